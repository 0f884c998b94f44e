"""Every model once, with the laws it is known to break and why. Add a row for each new model."""

import torch

from helpers.catalog_heightfield import HEIGHTFIELD
from helpers.catalog_oren_nayar import OREN_NAYAR
from helpers.materials import Model, brushed, colour, number
from torchbrdf import (
    BRDF,
    EON,
    GGX,
    AnisotropicBeckmann,
    AnisotropicGGX,
    AshikhminShirley,
    Beckmann,
    Burley,
    Conductor,
    Coupled,
    Dampened,
    Dielectric,
    FujiiOrenNayar,
    Hapke,
    HeTorrance,
    LambertSphere,
    LommelSeeliger,
    MaxCosinePhong,
    Minnaert,
    Mirror,
    ModifiedPhong,
    Oriented,
    Phong,
    TabulatedBRDF,
    TorranceSparrow,
    fixed,
    v_cavities,
)


def gold(dtype: torch.dtype) -> Conductor:
    return Conductor(eta=torch.tensor([0.18, 0.42, 1.37], dtype=dtype), k=torch.tensor([3.42, 2.35, 1.77], dtype=dtype))


def every_other(dtype: torch.dtype) -> BRDF:
    """The other models in one sum, for one compiled graph."""
    x = {m.name: m for m in OTHERS}
    names = [
        "torrance_sparrow, glass",
        "ggx, brushed",
        "beckmann",
        "eon",
        "hapke",
        "minnaert",
        "coupled, glass",
        "he_torrance, plastic",
    ]
    parts = [x[name].make(dtype) for name in names]
    inner = [part.brdf if isinstance(part, Oriented) else part for part in parts]
    total = 0.2 * inner[0]
    for part in inner[1:]:
        total = total + 0.2 * part
    return brushed(total, dtype)


# An exponent of some tens multiplies the rounding of what it is taken of: 4e-5 in the worst of 20,000 directions.
STEEP_LOBE = 2e-4
# A power of 8 or 20 of a length: 7e-7, and 4e-6 where nothing diffuse covers the tail.
POWER = 1e-5
# Two or three roundings more than a diffuse model: 1.5e-6.
FACETS = 4e-6
OTHERS = [
    Model(
        "phong, classic",
        lambda dtype: Phong(diffuse=number(0.2, dtype), specular=number(0.3, dtype), exponent=number(20.0, dtype)),
        reciprocal=False,
        reason="the radiance over the irradiance: divided by the cosine of the light alone",
        nodes=32,
        albedo_error=2e-3,
        float32=POWER,
    ),
    Model(
        "phong, modified",
        lambda dtype: ModifiedPhong(diffuse=colour(dtype), specular=number(0.3, dtype), exponent=number(20.0, dtype)),
        nodes=32,
        albedo_error=2e-3,
        float32=POWER,
    ),
    Model(
        "phong, maximum of cosines",
        lambda dtype: MaxCosinePhong(
            diffuse=number(0.0001, dtype), specular=number(0.99, dtype), exponent=number(8.0, dtype)
        ),
        nodes=32,
        albedo_error=4e-3,
        float32=POWER,
    ),
    Model("minnaert", lambda dtype: Minnaert(albedo=colour(dtype), k=number(1.4, dtype)), nodes=96),
    Model(
        "minnaert, k < 1",
        lambda dtype: Minnaert(albedo=number(0.5, dtype), k=number(0.5, dtype)),
        energy_limit=3.47,
        reason="the directional albedo is rho cos^(k-1): 3.465 at 1.55 rad",
        nodes=96,
        albedo_error=1e-2,
    ),
    Model(
        "torrance_sparrow",
        lambda dtype: TorranceSparrow(sigma=number(0.5, dtype)),
        nodes=160,  # the kinks of G are no panel's end
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model(
        "torrance_sparrow, glass",
        lambda dtype: TorranceSparrow(sigma=number(0.5, dtype), fresnel=Dielectric(eta=number(1.5, dtype))),
        nodes=160,
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model("coupled", lambda dtype: Coupled(albedo=colour(dtype))),
    Model(
        "coupled, glass",
        lambda dtype: Coupled(albedo=number(0.9, dtype), fresnel=Dielectric(eta=number(1.5, dtype))),
        nodes=48,
        albedo_error=1e-3,
        float32=2e-6,
    ),
    Model(
        "dampened",
        lambda dtype: Dampened(albedo=colour(dtype)),
        reciprocal=False,
        reason="dims the light that enters and not the light that leaves",
    ),
    Model("mirror", lambda dtype: Mirror(fresnel=gold(dtype))),
    Model(
        "ashikhmin_shirley",
        lambda dtype: brushed(
            AshikhminShirley(
                diffuse=colour(dtype),
                specular=number(0.1, dtype),
                exponent_x=number(4.0, dtype),
                exponent_y=number(15.0, dtype),
            ),
            dtype,
        ),
        nodes=32,
        albedo_error=1e-2,
        float32=FACETS,
    ),
    Model("fujii", lambda dtype: FujiiOrenNayar(albedo=colour(dtype), roughness=number(0.6, dtype)), float32=2e-6),
    Model("eon", lambda dtype: EON(albedo=colour(dtype), roughness=number(0.6, dtype))),
    Model(
        "eon, white",
        lambda dtype: EON(albedo=fixed(number(1.0, dtype)), roughness=number(0.9, dtype)),
        float32=2e-6,
    ),
    Model(
        "eon, fitted",
        lambda dtype: EON(albedo=colour(dtype), roughness=number(0.6, dtype), exact=False),
        albedo_error=1e-3,
    ),
    Model(
        "ggx",
        lambda dtype: GGX(alpha=number(0.5, dtype)),
        nodes=64,
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model(
        "ggx, gold",
        lambda dtype: GGX(alpha=number(0.5, dtype), fresnel=gold(dtype)),
        nodes=64,
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model(
        "ggx, brushed",
        lambda dtype: brushed(AnisotropicGGX(alpha_x=number(0.4, dtype), alpha_y=number(0.7, dtype)), dtype),
        nodes=64,
        albedo_error=2e-2,
        float32=FACETS,
    ),
    Model(
        "beckmann",
        lambda dtype: Beckmann(alpha=number(0.5, dtype)),
        nodes=64,
        albedo_error=2e-2,
        float32=STEEP_LOBE,
    ),
    Model(
        "beckmann, V-cavities",
        lambda dtype: Beckmann(alpha=number(0.5, dtype), masking=v_cavities),
        nodes=96,
        albedo_error=2e-2,
        float32=STEEP_LOBE,
    ),
    Model(
        "beckmann, brushed",
        lambda dtype: brushed(AnisotropicBeckmann(alpha_x=number(0.4, dtype), alpha_y=number(0.7, dtype)), dtype),
        nodes=64,
        albedo_error=2e-2,
        float32=STEEP_LOBE,
    ),
    Model(
        "burley",
        lambda dtype: Burley(albedo=fixed(number(1.0, dtype)), roughness=number(0.9, dtype)),
        energy_limit=1.5,
        reason="fitted by eye to measurements, not to conserve energy",
    ),
    Model("frostbite", lambda dtype: Burley(albedo=colour(dtype), roughness=number(0.7, dtype), renormalised=True)),
    Model("lommel_seeliger", lambda dtype: LommelSeeliger(albedo=colour(dtype))),
    Model("lambert_sphere", lambda dtype: LambertSphere(albedo=colour(dtype)), float32=5e-6),
    Model(
        "hapke",
        lambda dtype: Hapke(
            albedo=number(0.6, dtype),
            asymmetry=number(-0.3, dtype),
            surge=number(0.8, dtype),
            surge_width=number(0.1, dtype),
        ),
        nodes=64,
        albedo_error=5e-3,
        float32=2e-6,
    ),
    Model(
        "he_torrance, aluminium",  # Figure 8; the specular part matters at grazing alone
        lambda dtype: HeTorrance(
            sigma0=number(0.28, dtype),
            tau=number(1.77, dtype),
            wavelength=fixed(torch.tensor([0.65, 0.5], dtype=dtype)),
            eta=fixed(torch.tensor([1.49, 0.77], dtype=dtype)),  # (1 + k^2)/eta reflects as much at normal incidence
            k=torch.tensor([7.82, 6.08], dtype=dtype),
            diffuse=number(0.02, dtype),  # covers the far tail of the other part, which float32 cannot hold
        ),
        nodes=96,
        float32=FACETS,
    ),
    Model(
        "he_torrance, plastic",
        lambda dtype: HeTorrance(
            sigma0=number(0.2, dtype),
            tau=number(2.0, dtype),
            wavelength=fixed(number(0.55, dtype)),
            eta=number(1.5, dtype),
            diffuse=torch.tensor([0.28, 0.2, 0.15], dtype=dtype),
        ),
        nodes=96,
        float32=FACETS,
    ),
    Model(
        "he_torrance, averaged specular part",
        lambda dtype: HeTorrance(
            sigma0=number(0.05, dtype),
            tau=fixed(number(0.7, dtype)),  # the specular part hardly knows it
            wavelength=fixed(number(0.55, dtype)),
            eta=number(1.5, dtype),
            solid_angle=1.0,
            directional_diffuse=False,
            uniform_diffuse=False,
        ),
        nodes=96,
        integral=1e-3,  # the kinks at apex and rim of the specular part are no panel's end
        albedo_error=2e-2,
        float32=2e-3,  # at the rim it is what two roots leave: relative to its apex all digits are right
    ),
    Model(
        "he_torrance, facets",
        lambda dtype: HeTorrance(
            sigma0=number(0.3, dtype),
            tau=fixed(number(2.0, dtype)),  # one width of the two
            wavelength=fixed(number(0.55, dtype)),
            eta=number(1.5, dtype),
            diffuse=torch.tensor([0.28, 0.2, 0.15], dtype=dtype),
            wave_optics=False,
        ),
        nodes=96,
        float32=FACETS,
        captured=False,
    ),
    Model(
        "tabulated",
        lambda dtype: TabulatedBRDF.of(
            EON(albedo=colour(dtype), roughness=number(0.3, dtype)).to(dtype),
            nodes=(7, 7, 4),
            half_power=1.0,
            dtype=dtype,
        ),
        nodes=96,
        albedo_error=5e-3,
        float32=5e-6,
    ),
]

MODELS = [*OREN_NAYAR, *HEIGHTFIELD, *OTHERS]
