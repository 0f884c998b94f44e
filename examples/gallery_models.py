"""The materials of the model gallery (example 03): every model of the library once, some twice, by caption.

A caption is the model's name and, on its second line, its parameters.
"""

import math

import torch

import torchbrdf as tb

RHO = {"albedo": 0.7}
SIGMA = {"sigma": tb.sigma_from_degrees(30)}
SLOPE = {"slope": math.radians(35)}
GOLD = tb.Conductor(eta=torch.tensor([0.18, 0.42, 1.37]), k=torch.tensor([3.42, 2.35, 1.77]))
ALONG_X = torch.tensor([1.0, 0.02, 0.03])  # nearly: parallel to no normal of a pixel
COLOURS = torch.tensor([0.65, 0.55, 0.45])  # [um]
GLASS = tb.Dielectric(eta=1.5)


def brushed(brdf: tb.BRDF) -> tb.BRDF:
    return tb.Oriented(brdf, ALONG_X)


def aluminium(sigma0: float, tau: float) -> tb.HeTorrance:
    eta, k = tb.ALUMINIUM(COLOURS)
    return tb.HeTorrance(sigma0=sigma0, tau=tau, wavelength=COLOURS, eta=eta, k=k)


MODELS = {
    "Lambert\nrho 0.7, as everywhere but where stated": tb.Lambert(**RHO),
    "QualitativeOrenNayar\nsigma 30 deg": tb.QualitativeOrenNayar(**RHO, **SIGMA),
    "OrenNayar\nsigma 30 deg": tb.OrenNayar(**RHO, **SIGMA),
    "FastRoughSurface\nsigma 30 deg": tb.FastRoughSurface(**RHO, **SIGMA),
    "RoughSurface\nsigma 30 deg, all bounces": tb.RoughSurface(**RHO, **SIGMA, bounces="all"),
    "ClosedFormRoughSurface\nsigma 30 deg": tb.ClosedFormRoughSurface(**RHO, **SIGMA),
    "TabulatedRoughSurface\n12 slopes, equal shares": tb.TabulatedRoughSurface(
        **RHO, weights=torch.full((12,), 1 / 12)
    ),
    "AnisotropicRoughSurface\nsigma 45 deg along x, 10 deg along y": brushed(
        tb.AnisotropicRoughSurface(**RHO, sigma_x=math.radians(45), sigma_y=math.radians(10), nodes=8, azimuths=12)
    ),
    "FastGaussianHeightfield\nsigma 30 deg": tb.FastGaussianHeightfield(**RHO, **SIGMA),
    "GaussianHeightfield\nsigma 30 deg": tb.GaussianHeightfield(**RHO, **SIGMA),
    "AnisotropicGaussianHeightfield\nsigma 45 deg along x, 10 deg along y": brushed(
        tb.AnisotropicGaussianHeightfield(**RHO, sigma_x=math.radians(45), sigma_y=math.radians(10))
    ),
    "SingleSlopeVCavities\nslope 35 deg": tb.SingleSlopeVCavities(**RHO, **SLOPE),
    "ClosedFormVCavities\nslope 35 deg": tb.ClosedFormVCavities(**RHO, **SLOPE),
    "UnidirectionalVCavities\nslope 35 deg, upright grooves": brushed(tb.UnidirectionalVCavities(**RHO, **SLOPE)),
    "FujiiOrenNayar\nroughness 0.8": tb.FujiiOrenNayar(**RHO, roughness=0.8),
    "EON\nroughness 0.8": tb.EON(**RHO, roughness=0.8),
    "Burley\nroughness 0.8": tb.Burley(**RHO, roughness=0.8),
    "Burley, renormalised\nroughness 0.8": tb.Burley(**RHO, roughness=0.8, renormalised=True),
    "Minnaert\nk 1.4": tb.Minnaert(**RHO, k=1.4),
    "Minnaert\nk 0.7": tb.Minnaert(**RHO, k=0.7),
    "LommelSeeliger\nrho 0.9": tb.LommelSeeliger(albedo=0.9),
    "LambertSphere\nrho 0.9": tb.LambertSphere(albedo=0.9),
    "Hapke\nrho 0.9, asymmetry -0.3, surge 0.5, 0.05": tb.Hapke(albedo=0.9),
    "Coupled\nrho 0.7 under Fresnel 0.04": tb.Coupled(**RHO),
    "Dampened\nrho 0.7 under Fresnel 0.04": tb.Dampened(**RHO),
    "Mirror\ngold, in a tiled room": tb.Mirror(fresnel=GOLD),
    "Phong\nkd 0.5, ks 0.2, exponent 20": tb.Phong(diffuse=0.5, specular=0.2, exponent=20.0),
    "ModifiedPhong\nkd 0.5, ks 0.2, exponent 20": tb.ModifiedPhong(diffuse=0.5, specular=0.2, exponent=20.0),
    "MaxCosinePhong\nkd 0.5, ks 0.2, exponent 20": tb.MaxCosinePhong(diffuse=0.5, specular=0.2, exponent=20.0),
    "TorranceSparrow\nsigma 15 deg, gold": tb.TorranceSparrow(sigma=tb.sigma_from_degrees(15), fresnel=GOLD),
    "OrenNayar + TorranceSparrow\nsigma 30 deg, glass": tb.OrenNayar(**RHO, **SIGMA)
    + tb.TorranceSparrow(**SIGMA, fresnel=GLASS),
    "GGX\nalpha 0.3, gold": tb.GGX(alpha=0.3, fresnel=GOLD),
    "Beckmann\nalpha 0.3, gold": tb.Beckmann(alpha=0.3, fresnel=GOLD),
    "Lambert + GGX\nalpha 0.2, glass": tb.Lambert(**RHO) + tb.GGX(alpha=0.2, fresnel=GLASS),
    "AnisotropicGGX\nalpha 0.5 along x, 0.15 along y, gold": brushed(
        tb.AnisotropicGGX(alpha_x=0.5, alpha_y=0.15, fresnel=GOLD)
    ),
    "AnisotropicBeckmann\nalpha 0.15 along x, 0.5 along y, gold": brushed(
        tb.AnisotropicBeckmann(alpha_x=0.15, alpha_y=0.5, fresnel=GOLD)
    ),
    "AshikhminShirley\nRd 0.5, Rs 0.1, exponents 10, 200": brushed(
        tb.AshikhminShirley(diffuse=0.5, specular=0.1, exponent_x=10.0, exponent_y=200.0)
    ),
    "HeTorrance\nsigma0 0.28, tau 1.77 um, aluminium": aluminium(0.28, 1.77),
    "HeTorrance\nsigma0 0.5, tau 3 um, n 1.5, blue body": tb.HeTorrance(
        sigma0=0.5, tau=3.0, wavelength=COLOURS, eta=1.5, diffuse=torch.tensor([0.1, 0.2, 0.4])
    ),
    "TabulatedBRDF\na table of Lambert + GGX, 45 x 45 x 19": tb.TabulatedBRDF.of(
        tb.Lambert(**RHO) + tb.GGX(alpha=0.2, fresnel=GLASS), dtype=torch.float32
    ),
}
