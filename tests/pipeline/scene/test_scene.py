"""What a scene takes, and what it gives those who shade it."""

import pytest

from inverse.scene.scene import Scene
from inverse.scene.surface import sphere


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scene(sphere(8, 8), []), r"Scene\.lights must hold .*found none"),
    ],
)
def test_a_scene_has_an_image(make, message):
    with pytest.raises(ValueError, match=message):
        make()
