"""Nuisances of the photographs and parameters of the model are told apart, whatever their names."""

import pytest
import torch

from inverse import Distant, Scene, Sensor, bootstrap, fit, render, sphere
from torchbrdf import BRDF, Constrained, Cosines, Interval

DOUBLE = torch.float64
SHARE = Interval(0.0, 1.0)


class Foil(BRDF):
    """A user's own: two albedos, of which each bears the name of a nuisance."""

    exposure = Constrained(SHARE)
    ambient = Constrained(SHARE)

    def __init__(self, exposure, ambient):
        super().__init__()
        self.exposure, self.ambient = (torch.tensor(k, dtype=DOUBLE) for k in (exposure, ambient))

    def evaluate_components(self, cosines: Cosines):
        lit = cosines.above_horizon.to(cosines.light)[..., None]
        return {"all": lit * (self.exposure + self.ambient * cosines.view[..., None]) / torch.pi}


LIGHTS = [Distant.from_angle(angle) for angle in (-30, 10, 50)]
SCENE = Scene(sphere(20, 20, dtype=DOUBLE), LIGHTS, Sensor(exposure=1.5))
GAINS = torch.tensor([1.0, 1.2, 0.7], dtype=DOUBLE)
PHOTOGRAPHS = 1.5 * render(SCENE, Foil(0.4, 0.2)).detach() * GAINS[:, None, None, None] + 0.01


def test_names_of_nuisances_do_not_collide():
    """By name, exposure converged to 0.8 where the truth is 0.4."""
    result = fit(SCENE, PHOTOGRAPHS, Foil(0.5, 0.5), free_exposure=True, free_ambient=True)
    assert result.status == "converged"
    assert result.parameters["exposure"].item() == pytest.approx(0.4, abs=1e-6)
    assert result.parameters["ambient"].item() == pytest.approx(0.2, abs=1e-6)
    assert result.nuisances == ("image exposure", "image ambient")
    torch.testing.assert_close(result.parameters["image exposure"], GAINS[1:], rtol=1e-6, atol=0)
    torch.testing.assert_close(result.parameters["image ambient"], torch.full_like(GAINS, 0.01), rtol=0, atol=1e-7)
    assert result.names == [
        "exposure", "ambient", "image exposure[1]", "image exposure[2]",
        "image ambient[0]", "image ambient[1]", "image ambient[2]",
    ]  # fmt: skip
    assert result.model.exposure.item() == pytest.approx(0.4, abs=1e-6)


def test_a_bootstrap_keeps_the_models_own():
    photographs = 1.5 * render(SCENE, Foil(0.4, 0.2)).detach()
    spread = bootstrap(SCENE, photographs, Foil(0.5, 0.5), samples=3, free_exposure=True)
    assert spread.keys() == {"exposure", "ambient"}
    assert all(value.ndim <= 1 for value in spread.values())


def test_nuisances_keep_their_names_where_nothing_else_bears_them():
    class Plain(BRDF):
        albedo = Constrained(SHARE)

        def __init__(self):
            super().__init__()
            self.albedo = torch.tensor(0.5, dtype=DOUBLE)

        def evaluate_components(self, cosines):
            return {"all": cosines.above_horizon.to(cosines.light)[..., None] * self.albedo}

    result = fit(SCENE, PHOTOGRAPHS, Plain(), free_exposure=True, free_ambient=True)
    assert result.nuisances == ("exposure", "ambient")
    assert result.names[1:3] == ["exposure[1]", "exposure[2]"]
    assert fit(SCENE, PHOTOGRAPHS, Plain()).nuisances == ()
