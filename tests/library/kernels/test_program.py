"""Straight-line programs: nothing twice, nothing idle."""

import math

from torchbrdf.kernels.program import Program, Step


def two_inputs():
    program = Program()
    return program, program.append("input", 0), program.append("input", 1)


def test_a_step_is_written_once():
    program, x, y = two_inputs()
    assert program.multiply(x, y) == program.multiply(x, y)
    assert program.constant(0.5) == program.constant(0.5)
    assert len(program.steps) == 4


def test_constants_are_told_apart_by_what_they_are():
    program = Program()
    places = {program.constant(value) for value in (0.0, -0.0, 1.0, math.nan, math.inf)}
    assert len(places) == 5
    assert program.constant(math.nan) in places


def test_neutral_terms_and_factors_vanish():
    program, x, _ = two_inputs()
    zero, one = program.constant(0.0), program.constant(1.0)
    before = len(program.steps)
    assert program.add(x, zero) == program.add(zero, x) == program.subtract(x, zero) == x
    assert program.multiply(one, x) == program.multiply(x, one) == program.divide(x, one) == x
    assert program.select(zero, x, x) == x
    assert len(program.steps) == before


def test_what_is_divided_by_one_number_is_divided_once():
    program, x, y = two_inputs()
    program.divide(x, y), program.divide(program.divide(y, y), y)
    assert [step.operation for step in program.steps].count("reciprocal") == 1
    third = program.reciprocal(program.constant(3.0))
    assert program.steps[third] == Step("constant", (1 / 3,))


def test_zero_times_something_is_kept_for_the_sake_of_nan():
    program, x, _ = two_inputs()
    place = program.multiply(program.constant(0.0), x)
    assert program.steps[place].operation == "multiply"


def test_constants_are_computed():
    program = Program()
    five = program.add(program.constant(2.0), program.constant(3.0))
    assert program.steps[program.multiply(five, five)] == Step("constant", (25.0,))


def test_total_adds_from_the_left():
    program, x, y = two_inputs()
    assert program.total([x, y, x]) == program.add(program.add(x, y), x)


def test_needed_leaves_out_what_nothing_depends_on():
    program, x, y = two_inputs()
    idle = program.multiply(y, y)
    wanted = program.add(program.multiply(x, x), program.constant(2.0))
    needed = program.needed_for([wanted])
    assert idle not in needed
    assert y not in needed
    assert needed == sorted(needed)
    assert needed[-1] == wanted


def test_truths_are_known():
    program, x, y = two_inputs()
    assert program.is_truth(program.append("lt", x, y))
    assert not program.is_truth(x)
