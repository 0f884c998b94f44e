"""The rows of the random heightfields."""

from helpers.coarse_tables import COARSE_HEIGHTFIELD
from helpers.materials import Model, brushed, colour, number
from torchbrdf import (
    AnisotropicGaussianHeightfield,
    FastGaussianHeightfield,
    GaussianHeightfield,
    InterpolatedGaussianHeightfield,
    fixed,
)

# The masking of two rays has a kink where they coincide, which no panel's end follows off the plane of the view.
CONE = 5e-5
# The nodes of the slopes move with the directions: a value is a sum of some hundred that were rounded apart.
ROUNDED = 1e-5

HEIGHTFIELD = [
    Model(
        "gaussian heightfield, direct",
        lambda dtype: GaussianHeightfield(albedo=colour(dtype), sigma=number(0.5, dtype), nodes=160, bounces=1),
        integral=CONE,
        float32=ROUNDED,
    ),
    Model(
        "gaussian heightfield",
        lambda dtype: GaussianHeightfield(
            albedo=colour(dtype),
            sigma=number(0.5, dtype),
            occlusion=number(0.8, dtype),
            nodes=160,
            polar_nodes=5,
            table_orders=3,
        ),
        captured=False,
        integral=CONE,
        float32=ROUNDED,
    ),
    Model(
        "gaussian heightfield, white",
        lambda dtype: GaussianHeightfield(
            albedo=fixed(number(1.0, dtype)), sigma=fixed(number(0.9, dtype)), nodes=160, bounces="all"
        ),
        energy_limit=1.001,
        reason="balanced at the nodes of the table: up to 1.0005 between them",
        captured=False,
        integral=CONE,
        float32=ROUNDED,
    ),
    Model(
        "gaussian heightfield, fixed sigma = 0",
        lambda dtype: GaussianHeightfield(
            albedo=colour(dtype), sigma=fixed(number(0.0, dtype)), nodes=160, polar_nodes=4, table_orders=2
        ),
        captured=False,
    ),
    Model(
        "fast gaussian heightfield",
        lambda dtype: FastGaussianHeightfield(albedo=colour(dtype), sigma=number(0.5, dtype)),
        float32=ROUNDED,
    ),
    Model(
        "fast gaussian heightfield, white",
        lambda dtype: FastGaussianHeightfield(albedo=fixed(number(1.0, dtype)), sigma=number(0.9, dtype)),
        energy_limit=1.002,
        reason="a fit of a surface that returns all its light at rho = 1",
        captured=False,
        float32=ROUNDED,
    ),
    Model(
        "fast gaussian heightfield, fixed sigma = 0",
        lambda dtype: FastGaussianHeightfield(albedo=colour(dtype), sigma=fixed(number(0.0, dtype))),
        captured=False,
    ),
    Model(
        "interpolated gaussian heightfield",
        lambda dtype: InterpolatedGaussianHeightfield(
            albedo=colour(dtype), sigma=number(0.5, dtype), nodes=160, grid=COARSE_HEIGHTFIELD
        ),
        captured=False,
        float32=ROUNDED,
    ),
    Model(
        "anisotropic gaussian heightfield",
        lambda dtype: brushed(
            AnisotropicGaussianHeightfield(
                albedo=colour(dtype), sigma_x=number(0.3, dtype), sigma_y=number(0.7, dtype), nodes=160
            ),
            dtype,
        ),
        integral=CONE,
        float32=ROUNDED,
    ),
]
