"""Machine code: packed instructions, which a new compiler must not undo silently."""

import itertools
import platform
import re

import pytest
import torch
from helpers.kernels import kernel_of, made, with_compiler

from torchbrdf.kernels.lowering import Stream, lower
from torchbrdf.kernels.machine import assembly_of

pytestmark = with_compiler
# name of the instructions on several numbers, and on one
PACKED = {"x86_64": (r"\bv?(?:mul|div|sqrt|fmadd\d+)p[sd]\b", r"\bv?divs[sd]\b")}


on_known_processors = pytest.mark.skipif(
    platform.machine() not in PACKED, reason="the names of another processor's instructions"
)


def text_and_divisions(dtype, wanted):
    """The loop of a model over six to twelve arrays, and the divisions of one pixel."""
    kernel, _ = kernel_of(made("functional", 5), dtype)
    pixel = kernel.pixel
    outputs = {"value": [pixel.value], "material": pixel.slopes[3:], "everything": pixel.slopes}[wanted]
    arrays = [Stream(3)] * 4 + [Stream(1)] + ([] if wanted == "value" else [Stream(3)])
    truth = pixel.unit if wanted == "value" else None
    needed = pixel.program.needed_for(itertools.chain(*outputs))
    divisions = sum(pixel.program.steps[k].operation == "reciprocal" for k in needed)
    return lower(pixel.program, arrays, outputs, dtype, truth=truth), divisions


def counted(text):
    """Instructions on several numbers, and divisions of single ones."""
    assembly = assembly_of(text)
    return tuple(len(re.findall(pattern, assembly)) for pattern in PACKED[platform.machine()])


@on_known_processors
@pytest.mark.parametrize("wanted", ["value", "material", "everything"])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_instructions_work_on_several_pixels(dtype, wanted):
    text, divisions = text_and_divisions(dtype, wanted)
    packed, single = counted(text)
    assert packed > 2 * divisions
    # the pixels left over are computed one by one: as many single instructions as the formula has, and no more
    assert single <= divisions


@on_known_processors
def test_a_loop_that_is_not_vectorised_is_told_from_one_that_is():
    text, divisions = text_and_divisions(torch.float32, "value")
    packed, _ = counted(text.replace('vectorize.enable", i1 true', 'vectorize.enable", i1 false'))
    assert packed < 2 * divisions
