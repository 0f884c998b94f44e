"""What a fit returns: printed, serialised, without a graph."""

import pytest
import torch
from helpers.photographs import LIGHTS, clay, photographed, scene_and_photographs

from inverse import Scene, Sensor, fit, vase
from torchbrdf import OrenNayar


def test_result_prints_and_serialises():
    scene = Scene(vase(32, 32), LIGHTS, Sensor(exposure=3.0, read_noise=0.01))
    found = fit(scene, photographed(scene, clay(dtype=torch.float32)), OrenNayar())
    assert "deg" in str(found)
    assert "+-" in str(found)
    as_json = found.to_json()
    assert as_json["sigma_degrees"] == pytest.approx(40, abs=5 * as_json["sigma_degrees_standard_error"])
    assert as_json["status"] == "converged"


def test_result_carries_no_graph():
    scene, photographs = scene_and_photographs([0, 20])
    found = fit(scene, photographs.requires_grad_(), OrenNayar())
    tensors = [*found.parameters.values(), *found.standard_error.values(), found.correlation]
    assert not any(t.requires_grad for t in tensors)
