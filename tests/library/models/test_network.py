"""Networks against matrix products by hand, and the pieces in which pixels are worked on."""

import numpy as np
import pytest
import torch
from torch.testing import assert_close

from torchbrdf.models.network import BYTES_AT_A_TIME, Network, bounded, pixel_by_pixel

RNG = np.random.default_rng(1)
STORED = {
    name: RNG.normal(size=shape).tolist()
    for name, shape in zip(Network._fields, ((5, 3), (5, 1), (4, 5), (4, 1), (2, 4), (2, 1)), strict=True)
}
NETWORK = Network.of(STORED)
FEATURES = torch.from_numpy(RNG.normal(size=(3, 40)))


def by_hand(x: np.ndarray) -> np.ndarray:
    """One column of features: u/sqrt(1 + u^2) is the sine of the angle of tangent u."""
    layers = [np.array(rows) for rows in STORED.values()]
    for matrix, bias in (layers[0:2], layers[2:4]):
        x = np.sin(np.arctan(matrix @ x + bias[:, 0])) - np.sin(np.arctan(bias[:, 0]))
    return layers[4] @ x + layers[5][:, 0]


def test_outputs_are_two_layers_and_a_matrix():
    expected = np.stack([by_hand(column) for column in FEATURES.numpy().T], 1)
    np.testing.assert_allclose(NETWORK.outputs(FEATURES), expected, rtol=1e-12)


def test_nothing_in_leaves_the_last_bias_to_the_last_digit(dtype):
    outputs = NETWORK.outputs(torch.zeros(3, 1, dtype=dtype))
    assert_close(outputs, NETWORK.last_bias.to(dtype), rtol=0, atol=0)


def test_bounded():
    u = torch.tensor([-1e9, -2.0, 0.0, 0.5, 1e9], dtype=torch.float64)
    assert_close(bounded(u), torch.sin(torch.atan(u)))


@pytest.mark.parametrize("setting", ["autocast", "high", "medium"])
def test_settings_that_shorten_matrix_products_take_no_digits(setting):
    features = FEATURES.float().requires_grad_()
    exact = NETWORK.outputs(FEATURES)
    before = torch.get_float32_matmul_precision()
    try:
        if setting != "autocast":
            torch.set_float32_matmul_precision(setting)
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=setting == "autocast"):
            outputs = NETWORK.outputs(features)
        (slope,) = torch.autograd.grad(outputs.sum(), features)
    finally:
        torch.set_float32_matmul_precision(before)
    assert outputs.dtype == torch.float32
    assert_close(outputs.double(), exact, rtol=1e-5, atol=1e-5)
    double = FEATURES.clone().requires_grad_()
    assert_close(slope.double(), torch.autograd.grad(NETWORK.outputs(double).sum(), double)[0], rtol=1e-5, atol=1e-5)


def test_pieces_change_nothing():
    # more pixels than are worked on at a time, one number for all of them, and a gradient
    count = BYTES_AT_A_TIME // 8 + 100
    pixels, sizes = torch.rand(2, count, dtype=torch.float64), []
    one = torch.tensor(0.3, dtype=torch.float64, requires_grad=True)

    def compute(a, b):
        sizes.append(len(a))
        return a * b, a + b * b

    product, total = pixel_by_pixel(compute, pixels, one)
    assert len(sizes) == 3
    assert sum(sizes) == 2 * count
    assert_close(product, pixels * one)
    assert_close(total, pixels + one * one)
    (slope,) = torch.autograd.grad(product.sum(), one)
    assert_close(slope, pixels.sum())


def test_a_single_pixel_has_no_axis():
    one = torch.tensor(2.0)
    (square,) = pixel_by_pixel(lambda a, b: (a * b,), one, one)
    assert square.shape == ()
    assert square == 4
