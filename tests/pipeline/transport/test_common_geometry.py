"""What lights have in common, against cosines that know the three vectors of each point."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from inverse import Distant, Environment, Point, perspective, sphere
from inverse.scene import Footprints
from inverse.scene.cameras import pinhole
from inverse.shapes import Sphere
from inverse.transport.common_geometry import CommonGeometry
from torchbrdf import Cosines

D = torch.float64
NAMES = ("light", "view", "phase", "half_phase", "azimuth_sine", "above_horizon")
LAMP = Point(torch.tensor([1.0, 1.0, 2.0], dtype=D))
FAR, NEAR = (Footprints.of(k) for k in (sphere(12, 12, dtype=D), perspective(Sphere(0.9), pinhole(12, 12), dtype=D)))


@pytest.mark.parametrize("footprints", [FAR, NEAR])
@pytest.mark.parametrize("light", [Distant.from_angle(70), LAMP])
def test_cosines_are_those_of_the_vectors(footprints, light):
    geometry = CommonGeometry(footprints)
    arrival = next(geometry.arrivals(light))
    cosines = geometry.cosines(arrival.direction)
    expected = Cosines.of(footprints.normals, arrival.direction, footprints.view)
    for name in NAMES:
        assert_close(getattr(cosines, name), getattr(expected, name), rtol=0, atol=1e-15)


def test_batches_are_the_arrivals_stacked():
    geometry = CommonGeometry(NEAR)
    sky = Environment(torch.rand(8, 16, 3, dtype=D, generator=torch.Generator().manual_seed(0)))
    for light in (sky, LAMP):
        arrivals, batches = list(geometry.arrivals(light)), list(geometry.batches(light))
        assert len(batches) < len(arrivals) or len(arrivals) == 1
        irradiances = torch.cat([batch.irradiance for batch in batches])
        assert torch.equal(irradiances, torch.stack([arrival.irradiance for arrival in arrivals]))
        cosines = torch.cat([geometry.cosines(batch.direction).light for batch in batches])
        assert torch.equal(cosines, torch.stack([geometry.cosines(arrival.direction).light for arrival in arrivals]))


def test_vectors_of_other_lengths_are_scaled():
    longer = replace(FAR, normals=1.5 * FAR.normals, view=2 * FAR.view)
    arrival = next(CommonGeometry(FAR).arrivals(LAMP))
    expected = CommonGeometry(FAR).cosines(arrival.direction)
    cosines = CommonGeometry(longer).cosines(3 * arrival.direction)
    for name in NAMES:
        assert_close(getattr(cosines, name), getattr(expected, name), rtol=0, atol=1e-15)


def test_what_is_no_direction_is_named():
    with pytest.raises(ValueError, match="normal must hold finite vectors of non-zero length; 1 of"):
        CommonGeometry(replace(FAR, normals=FAR.normals.clone().index_fill_(0, torch.tensor([3]), torch.nan)))
    with pytest.raises(ValueError, match="view must hold finite vectors"):
        CommonGeometry(replace(FAR, view=0 * FAR.view))
    with pytest.raises(ValueError, match="light must hold finite vectors"):
        CommonGeometry(FAR).cosines(torch.full((3,), torch.nan, dtype=D))
    with pytest.raises(TypeError, match="share one dtype"):
        CommonGeometry(FAR).cosines(torch.tensor([0.0, 0.0, 1.0]))
