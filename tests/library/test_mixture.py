"""Weighted sums of models: values, weights, mirrors, stand-ins, what is refused."""

import math

import pytest
import torch
from helpers.probes import held, seeded
from helpers.two_channels import D, material, number
from torch.testing import assert_close

from torchbrdf import EON, GGX, Dielectric, Lambert, Mirror, OrenNayar, WeightedSum, fixed, simulated
from torchbrdf import testing as laws
from torchbrdf.testing import TOLERANCE, random_directions


class TestWeightedSum:
    @pytest.fixture
    def directions(self):
        return random_directions(50, dtype=torch.float64, generator=torch.Generator().manual_seed(0))

    @pytest.fixture
    def parts(self):
        return OrenNayar(albedo=0.7, sigma=0.5).double(), Lambert(albedo=0.4).double()

    def test_is_the_sum_of_its_parts(self, parts, directions):
        a, b = parts
        tight = {"rtol": TOLERANCE[torch.float64].rounding, "atol": 0.0}
        expected = 0.7 * a(*directions) + 0.3 * b(*directions)
        assert_close((0.7 * a + 0.3 * b)(*directions), expected, **tight)
        assert_close((a * 0.7 + b * 0.3)(*directions), expected, **tight)
        assert_close((a + b)(*directions), a(*directions) + b(*directions), **tight)
        assert_close((2 * (0.7 * a + 0.3 * b) + a)(*directions), 2 * expected + a(*directions), **tight)
        assert_close(WeightedSum(parts, [0.7, 0.3])(*directions), expected, **tight)

    def test_weights_are_trainable(self, parts, directions):
        brdf = 0.7 * parts[0] + 0.3 * parts[1]
        raw = dict(brdf.named_parameters())["raw_weights"]
        (slope,) = torch.autograd.grad(brdf(*directions).sum(), raw)
        assert_close(slope, torch.stack([w * p(*directions).sum() for w, p in zip((0.7, 0.3), parts, strict=True)]))

    def test_components_are_named_by_model(self, parts, directions):
        brdf = 0.7 * parts[0] + 0.3 * parts[1] + 0.1 * parts[1]
        got = brdf.components(*directions)
        assert list(got) == ["OrenNayar.direct", "OrenNayar.interreflection", "Lambert.direct", "Lambert.direct#2"]
        assert_close(got["Lambert.direct#2"], 0.1 * parts[1](*directions))

    @pytest.mark.parametrize("weight", [0.0, -0.5, math.nan, math.inf])
    def test_weight_that_is_not_positive_is_refused(self, parts, weight):
        with pytest.raises(ValueError, match=r"WeightedSum.weights must lie in \(0, inf\)"):
            weight * parts[0]
        with pytest.raises(ValueError, match=r"WeightedSum.weights must lie in \(0, inf\); 1 of 2"):
            WeightedSum(parts, [weight, 1.0])

    def test_weights_follow_the_dtype_of_the_parts(self, parts):
        assert (0.7 * parts[0]).weights.dtype == torch.float64
        assert (0.7 * Lambert()).weights.dtype == torch.float32


def test_sums_refuse_what_does_not_add_up():
    with pytest.raises(ValueError, match="found 1 parts and 2 weights"):
        WeightedSum([Lambert()], [1.0, 2.0])
    with pytest.raises(ValueError, match="at least one part"):
        WeightedSum([], [])
    with pytest.raises(TypeError, match="adds BRDFs; found int"):
        Lambert() + 3  # pyright: ignore
    assert len(sum([Lambert(), Lambert()]).parts) == 2  # pyright: ignore


def test_delta_lobes_survive_in_sums():
    brdf = 0.5 * Mirror() + 0.5 * Lambert(albedo=held(0.6))
    brdf = brdf.double()
    _, pdf, weight = laws.SamplingSetup.of(brdf, 1.0).draw(20_000, seeded())
    delta = pdf.isinf()
    assert abs(float(delta.double().mean()) - 0.5) < 5 * math.sqrt(0.25 / 20_000)
    assert abs(float(weight.detach().mean()) - 0.8) < 0.01


def test_parts_of_a_sum():
    model = WeightedSum([material(OrenNayar), GGX(alpha=number(0.3), fresnel=Dielectric(eta=number(1.5)))], [0.9, 0.2])
    groups = model.stand_ins()
    assert list(groups) == ["rung of part 1", "Fresnel variation of part 2", "part 1", "part 2"]
    directions = random_directions(20, dtype=D, generator=torch.Generator().manual_seed(1))
    alone = groups["part 2"][0].model
    assert [type(part) for part in alone.parts] == [OrenNayar]
    torch.testing.assert_close(alone(*directions), 0.9 * material(OrenNayar)(*directions))
    assert set(alone.stand_ins()) == {"rung of part 1"}  # the last part stays
    model = WeightedSum(list(model.parts), fixed(number([0.9, 0.2])))
    assert not [name for name, _ in model.stand_ins()["part 2"][0].model.named_parameters() if "weights" in name]
    assert simulated(model, by_part=False)[-3:] == ("Fresnel variation", "part 1", "part 2")


def test_parts_that_stay_keep_their_names():
    model = WeightedSum([GGX(alpha=number(0.3)), material(OrenNayar), EON(albedo=number([0.3]))], [0.1, 0.9, 0.3])
    (dropped,) = model.stand_ins()["part 1"]
    assert [type(part) for part in dropped.model.parts] == [OrenNayar, EON]
    groups = dropped.model.stand_ins()
    assert list(groups) == ["rung of part 2", "rung of part 3", "part 2", "part 3"]
    assert groups["part 2"][0].skips[:2] == ("part 2", "roughness of part 2")
    assert dropped.renamed == {
        "parts.0.albedo": "parts.1.albedo",
        "parts.0.sigma": "parts.1.sigma",
        "parts.1.albedo": "parts.2.albedo",
        "parts.1.roughness": "parts.2.roughness",
    }
    for stand_in, given in dropped.renamed.items():
        assert torch.equal(value(dropped.model, stand_in), value(model, given))
    inner = WeightedSum([Lambert(albedo=number(0.2)), model], [1.0, 1.0])
    (dropped,) = inner.stand_ins()["part 1 of part 2"]
    assert dropped.skips[0] == "part 1 of part 2"
    assert dropped.renamed["parts.1.parts.0.sigma"] == "parts.1.parts.1.sigma"
    assert "roughness" in simulated(inner, by_part=False)


def value(model, path):
    *modules, last = path.split(".")
    return getattr(model.get_submodule(".".join(modules)), last)
