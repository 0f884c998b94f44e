"""A folder of two photographs of a ball, as somebody else might have written it."""

import numpy as np
import pytest
from helpers.png_files import png_bytes
from helpers.stack_folder import SIZE

LIGHTS = "2\n0 0 1\n0.6 0 0.8 2.5  # a comment\n"


@pytest.fixture
def folder(tmp_path):
    """Two images of a sphere of 8 pixels at column 12, row 9, in natural order image2, image10."""
    for number, level in ((10, 40000), (2, 20000)):
        (tmp_path / f"image{number}.png").write_bytes(png_bytes(np.full((*SIZE, 3), level)))
    (tmp_path / "lights.txt").write_text(LIGHTS)
    (tmp_path / "geometry.txt").write_text("# the ball\nsphere 12 9 8\n")
    return tmp_path
