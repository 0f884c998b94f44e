"""Every model against the golden values of tests/data/other_models.json (its README says where they come from)."""

import math

import pytest
import torch
from helpers.probes import held
from helpers.recorded import recorded
from torch.testing import assert_close

from torchbrdf import (
    EON,
    GGX,
    AnisotropicBeckmann,
    AnisotropicGGX,
    AshikhminShirley,
    Beckmann,
    Burley,
    Cosines,
    Coupled,
    Dampened,
    Dielectric,
    FujiiOrenNayar,
    Hapke,
    Lambert,
    LambertSphere,
    LommelSeeliger,
    MaxCosinePhong,
    Minnaert,
    ModifiedPhong,
    OrenNayar,
    Perfect,
    Phong,
    QualitativeOrenNayar,
    Schlick,
    TorranceSparrow,
    conductor,
    dielectric,
    dielectric_average,
    eon_albedo_from_directional,
    eon_albedo_from_white_sky,
    lambert_sphere_fast,
    phong_radiance,
    schlick,
    smith_separable,
    v_cavities,
)

GOLDEN = recorded("other_models.json")
NORMAL = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
TANGENT = torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64)
LIGHT, VIEW = (torch.tensor([d[key] for d in GOLDEN["dirs"]], dtype=torch.float64) for key in ("wi", "wo"))
# What the sheet itself says about digits: a cosine near 89.9 degrees is a dot product known to 2e-16/1.7e-3.
RTOL = 1e-11


def number(value):
    return torch.tensor(value, dtype=torch.float64)


def interface(p):
    if "eta" in p:
        return Dielectric(eta=held(p["eta"]))
    if "r0" in p:
        return Schlick(f0=held(p["r0"]))
    return Perfect()


def masking(p):
    choices = {"separable": smith_separable, "vcavity": v_cavities}
    return {"masking": choices[p["mask"]]} if "mask" in p else {}


def phong(build, n):
    return lambda p: build(diffuse=held(p["kd"]), specular=held(p["ks"]), exponent=held(float(p[n])))


def facets(isotropic, anisotropic):
    def make(p):
        shared = {"fresnel": interface(p), **masking(p)}
        if p["ax"] == p["ay"]:
            return isotropic(alpha=held(p["ax"]), **shared)
        return anisotropic(alpha_x=held(p["ax"]), alpha_y=held(p["ay"]), **shared)

    return make


def brushed(p):
    zero = {"Rd": 0.0, "Rs": 0.0, "nu": 0.0, "nv": 0.0}
    q = {key: held(float(value)) for key, value in (zero | p).items()}
    return AshikhminShirley(diffuse=q["Rd"], specular=q["Rs"], exponent_x=q["nu"], exponent_y=q["nv"])


MAKE = {
    "lambert": lambda p: Lambert(albedo=held(p["rho"])),
    "phong_brdf_classic": phong(Phong, "alpha"),
    "phong_modified": phong(ModifiedPhong, "n"),
    "phong_maxcos": phong(MaxCosinePhong, "n"),
    "minnaert": lambda p: Minnaert(albedo=held(p["rho"]), k=held(p["k"])),
    "torrance_sparrow_slope": lambda p: TorranceSparrow(
        sigma=held(p["sigma"]), fresnel=interface(p), normalised=p.get("normalised", True)
    ),
    "shirley_dampened_matte": lambda p: Dampened(albedo=held(p["Rd"]), fresnel=interface(p)),
    "shirley_coupled_matte": lambda p: Coupled(albedo=held(p["Rm"]), fresnel=interface(p)),
    "shirley_coupled_matte_exact": lambda p: Coupled(albedo=held(p["Rm"]), fresnel=interface(p)),
    "ashikhmin_shirley": brushed,
    "on_full": lambda p: OrenNayar(
        albedo=held(p["rho"]), sigma=held(p["sigma"]), interreflection=p.get("interreflection", True)
    ),
    "on_qual": lambda p: QualitativeOrenNayar(
        albedo=held(p["rho"]), sigma=held(p["sigma"]), a_constant=p.get("a_const", 0.33)
    ),
    "fon": lambda p: FujiiOrenNayar(albedo=held(p["rho"]), roughness=held(p["r"])),
    "eon": lambda p: EON(albedo=held(p["rho"]), roughness=held(p["r"]), exact=p.get("exact", True)),
    "microfacet_ggx": facets(GGX, AnisotropicGGX),
    "microfacet_beckmann": facets(Beckmann, AnisotropicBeckmann),
    "burley": lambda p: Burley(albedo=held(p["rho"]), roughness=held(p["roughness"])),
    "frostbite": lambda p: Burley(albedo=held(p["rho"]), roughness=held(p["roughness"]), renormalised=True),
    "lommel_seeliger": lambda p: LommelSeeliger(albedo=held(p["w"])),
    "lambert_sphere_single": lambda p: LambertSphere(albedo=held(p["c"])),
    "hapke": lambda p: Hapke(
        albedo=held(p["w"]),
        asymmetry=held(p.get("g", 0.0)),
        surge=held(p.get("B0", 0.0)),
        surge_width=held(p.get("hs", 0.05)),
    ),
}
PARTS = {"as_specular": "specular", "as_diffuse": "diffuse"}
ELSEWHERE = {"phong_radiance_eq40", "shirley_coupled_matte_printed_constant", "lambert_sphere_fast"}
ROWS = [(name, row) for name, rows in GOLDEN["brdf"].items() for row in rows]


def identify(value):
    return value if isinstance(value, str) else ",".join(f"{k}={v}" for k, v in value["params"].items())


def test_no_golden_model_is_forgotten():
    assert set(GOLDEN["brdf"]) == set(MAKE) | set(PARTS) | ELSEWHERE


def close(got, expected, **kwargs):
    assert_close(got, torch.as_tensor(expected, dtype=torch.float64), **({"rtol": RTOL, "atol": 0.0} | kwargs))


@pytest.mark.parametrize(("name", "row"), [r for r in ROWS if r[0] in MAKE], ids=identify)
def test_model(name, row):
    brdf = MAKE[name](row["params"])
    tangent = TANGENT if brdf.anisotropic else None
    # The numbers of the dampened model take F of the view; ours is that of the light (see `Dampened`).
    light, view = (VIEW, LIGHT) if name == "shirley_dampened_matte" else (LIGHT, VIEW)
    got = brdf(NORMAL, light, view, tangent=tangent, normalize=True)[:, 0]
    close(got, row["values"])


@pytest.mark.parametrize(("name", "row"), [r for r in ROWS if r[0] in PARTS], ids=identify)
def test_part_of_ashikhmin_shirley(name, row):
    got = brushed(row["params"]).components(NORMAL, LIGHT, VIEW, tangent=TANGENT, normalize=True)
    close(got[PARTS[name]][:, 0], row["values"])


@pytest.mark.parametrize("row", GOLDEN["brdf"]["lambert_sphere_fast"], ids=identify)
def test_lambert_sphere_fast(row):
    got = lambert_sphere_fast(Cosines.of(NORMAL, LIGHT, VIEW, normalize=True), albedo=number(row["params"]["kd"]))
    # |dphi| at 0 and 180 degrees is the root of a rounding error
    close(got[:, 0], row["values"], rtol=1e-8)


@pytest.mark.parametrize("row", GOLDEN["brdf"]["phong_radiance_eq40"], ids=identify)
def test_phong_radiance(row):
    p = row["params"]
    got = phong_radiance(
        Cosines.of(NORMAL, LIGHT, VIEW, normalize=True),
        diffuse=number(p["rd"]),
        ambient=number(p["ra"]),
        specular=number(p["rs"]),
        exponent=number(float(p["alpha"])),
        light=p.get("Id", 1.0),
        ambient_light=p.get("Ia", 1.0),
        highlight=p.get("Is", 1.0),
    )[:, 0]
    # The last two, light below and view at the horizon, are (40) as printed: its highlight shines through.
    close(got[:-2], row["values"][:-2])
    close(got[-2:], [p["ra"] * p.get("Ia", 1.0)] * 2)


def test_coupled_with_the_printed_constant_is_too_bright():
    (row,) = GOLDEN["brdf"]["shirley_coupled_matte_printed_constant"]
    p = row["params"]
    ours = Coupled(albedo=held(p["Rm"]), fresnel=interface(p))(NORMAL, LIGHT, VIEW, normalize=True)[:, 0]
    close(ours / (1 - p["r0"]) ** 2, row["values"])


@pytest.mark.parametrize("name", ["dielectric 1.5", "dielectric 1/1.5", "schlick .04", "conductor .2,3.5"])
def test_fresnel(name):
    cos = number(GOLDEN["fresnel"]["cos"])
    functions = {
        "dielectric 1.5": lambda: dielectric(cos, eta=number(1.5)),
        "dielectric 1/1.5": lambda: dielectric(cos, eta=number(1 / 1.5)),
        "schlick .04": lambda: schlick(cos, f0=number(0.04)),
        "conductor .2,3.5": lambda: conductor(cos, eta=number(0.2), k=number(3.5)),
    }
    close(functions[name](), GOLDEN["fresnel"][name], rtol=1e-14)


def test_constants():
    from torchbrdf.facets import slope_area_norm

    table = GOLDEN["constants"]
    for sigma, value in table["slope_area_norm"].items():
        close(slope_area_norm(number(float(sigma))), value, rtol=1e-14)
    for eta, value in table["fresnel_avg_walsh"].items():
        close(dielectric_average(eta=number(float(eta))), value, rtol=1e-12)
    for f0, value in table["coupled_k"].items():
        # 21 (1 - f0)/(20 pi), from the average of Schlick's form
        average = Schlick(f0=held(float(f0))).average()[0]
        close((1 - float(f0)) ** 2 / (math.pi * (1 - average)), value, rtol=1e-14)


def test_average_albedos():
    table = GOLDEN["albedo_avg"]

    def white_sky(brdf):
        x, w = (torch.from_numpy(a) for a in __import__("numpy").polynomial.legendre.leggauss(64))
        mu = (1 + x) / 2
        return (brdf.directional_albedo(mu)[:, 0] * mu * w).sum()

    close(white_sky(FujiiOrenNayar(albedo=held(1.0), roughness=held(0.5))), table["fon r=.5"], rtol=1e-6)
    close(white_sky(FujiiOrenNayar(albedo=held(1.0), roughness=held(1.0))), table["fon r=1"], rtol=1e-6)
    eon = EON(albedo=held(0.8), roughness=held(0.5))
    close(white_sky(eon), table["eon rho=.8 r=.5"], rtol=1e-6)
    close(eon.average_albedo()[0], table["eon rho=.8 r=.5"])
    r = number(0.7)
    close(eon_albedo_from_white_sky(number(0.6), roughness=r), table["eon_invert_avg target=.6 r=.7"])
    close(
        eon_albedo_from_directional(number(0.6), number(0.4), roughness=r), table["eon_invert_dir target=.6 mu=.4 r=.7"]
    )
    minnaert = Minnaert(albedo=held(1.0), k=held(0.5))
    close(white_sky(minnaert), table["minnaert white-sky 2/(k+1) k=.5"], rtol=1e-4)
