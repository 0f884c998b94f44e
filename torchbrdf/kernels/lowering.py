"""Programs of one pixel as loops over pixels, in the text of LLVM's intermediate representation.

Of the liberties a compiler may take with floating point it has one, `contract`: product and sum may be rounded once.
Arrays are declared not to overlap (`noalias`); without that a loop over ten of them stays scalar.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch

from torchbrdf.kernels.elementary import ELEMENTARY, REALS, Real, literal
from torchbrdf.kernels.program import COMPARISONS, TRUTHS, Program

_BINARY = {"add": "fadd", "subtract": "fsub", "multiply": "fmul"}
_INTRINSIC = {"abs": "fabs", "sqrt": "sqrt"}
_CONDITION = {"lt": "olt", "le": "ole", "gt": "ogt", "ge": "oge", "eq": "oeq", "ne": "une"}
ARITHMETIC = frozenset((*_BINARY, *_INTRINSIC, *TRUTHS, *ELEMENTARY, "negate", "reciprocal", "select"))


class Stream(NamedTuple):
    """An array of the loop: `width` numbers a pixel, or the same ones for all pixels."""

    width: int
    repeated: bool = False


def lower(
    program: Program,
    inputs: Sequence[Stream],
    outputs: Sequence[Sequence[int]],
    dtype: torch.dtype,
    *,
    truth: int | None = None,
) -> str:
    """A function `evaluate(inputs..., outputs..., pixels)`; it returns at how many pixels `truth` did not hold."""
    real = REALS[dtype]
    results = [place for output in outputs for place in output]
    needed = program.needed_for(results if truth is None else [*results, truth])
    numbers = {program.steps[k].arguments[0]: k for k in needed if program.steps[k].operation == "input"}
    once, each = [], []
    first = 0
    for array, stream in enumerate(inputs):
        for k in range(stream.width):
            if first + k in numbers:
                place = numbers[first + k]
                index = str(k) if stream.repeated else f"%in{place}"
                lines = _load(real, f"%v{place}", f"%a{array}", index)
                if not stream.repeated:
                    lines = [*_index(index, stream.width, k), *lines]
                (once if stream.repeated else each).extend(lines)
        first += stream.width
    for place in needed:
        each += _step(program, place, real)
    for array, output in enumerate(outputs, len(inputs)):
        for k, place in enumerate(output):
            each += _index(f"%out{array}_{k}", len(output), k)
            each += _store(real, _operand(program, place, real), f"%a{array}", f"%out{array}_{k}")
    count = "%off"
    if truth is not None:
        each += [f"%lapse = select i1 {_operand(program, truth, real)}, i32 0, i32 1", "%more = add i32 %off, %lapse"]
        count = "%more"
    arguments = [f"ptr noalias nocapture %a{k}" for k in range(len(inputs) + len(outputs))]
    return "\n".join(
        [
            *(f"declare {real.name} @llvm.{name}.f{real.bits}({real.name})" for name in _INTRINSIC.values()),
            f"define i32 @evaluate({', '.join(arguments)}, i64 %pixels) {{",
            "start:",
            *once,
            "%empty = icmp sle i64 %pixels, 0",
            "br i1 %empty, label %end, label %loop",
            "loop:",
            "%pixel = phi i64 [ 0, %start ], [ %next, %loop ]",
            f"%off = phi i32 [ 0, %start ], [ {count}, %loop ]",
            *each,
            "%next = add nuw nsw i64 %pixel, 1",
            "%last = icmp eq i64 %next, %pixels",
            "br i1 %last, label %end, label %loop, !llvm.loop !0",
            "end:",
            f"%total = phi i32 [ 0, %start ], [ {count}, %loop ]",
            "ret i32 %total",
            "}",
            # not unrolled further: it would be no faster and takes longer to compile
            '!0 = distinct !{!0, !{!"llvm.loop.vectorize.enable", i1 true}, !{!"llvm.loop.interleave.count", i32 1}}',
        ]
    )


def _index(name: str, width: int, number: int) -> list[str]:
    return [f"{name}_row = mul nuw nsw i64 %pixel, {width}", f"{name} = add nuw nsw i64 {name}_row, {number}"]


def _load(real: Real, name: str, array: str, index: str) -> list[str]:
    return [f"{name}_at = getelementptr inbounds {real.name}, ptr {array}, i64 {index}",
            f"{name} = load {real.name}, ptr {name}_at, align {real.bits // 8}"]  # fmt: skip


def _store(real: Real, value: str, array: str, index: str) -> list[str]:
    return [f"{index}_at = getelementptr inbounds {real.name}, ptr {array}, i64 {index}",
            f"store {real.name} {value}, ptr {index}_at, align {real.bits // 8}"]  # fmt: skip


def _operand(program: Program, place: int, real: Real) -> str:
    step = program.steps[place]
    return literal(step.arguments[0], real) if step.operation == "constant" else f"%v{place}"


def _step(program: Program, place: int, real: Real) -> Iterator[str]:
    operation, arguments = program.steps[place]
    if operation in {"constant", "input"}:
        return
    result, kind = f"%v{place}", real.name
    given = [_operand(program, int(k), real) for k in arguments]
    if operation in _BINARY:
        yield f"{result} = {_BINARY[operation]} contract {kind} {given[0]}, {given[1]}"
    elif operation in _INTRINSIC:
        yield f"{result} = call {kind} @llvm.{_INTRINSIC[operation]}.f{real.bits}({kind} {given[0]})"
    elif operation in COMPARISONS:
        yield f"{result} = fcmp {_CONDITION[operation]} {kind} {given[0]}, {given[1]}"
    elif operation == "negate":
        yield f"{result} = fneg {kind} {given[0]}"
    elif operation == "reciprocal":
        yield f"{result} = fdiv {kind} {literal(1.0, real)}, {given[0]}"
    elif operation in ELEMENTARY:
        yield from ELEMENTARY[operation](result, given[0], real)
    else:
        truths = [_truth(program, int(k), real) for k in arguments]
        if operation == "select":
            yield f"{result} = select i1 {truths[0]}, {kind} {given[1]}, {kind} {given[2]}"
        elif operation == "not":
            yield f"{result} = xor i1 {truths[0]}, true"
        else:
            yield f"{result} = {operation} i1 {truths[0]}, {truths[1]}"


def _truth(program: Program, place: int, real: Real) -> str:
    step = program.steps[place]
    if step.operation == "constant":
        return "true" if step.arguments[0] else "false"
    return _operand(program, place, real)
