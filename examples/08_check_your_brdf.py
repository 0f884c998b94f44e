"""Check a BRDF of your own against the laws of `torchbrdf.testing.laws`: two that are broken, and one that is right.

`FromAngles` is Oren-Nayar as it is often typed in: acos of dot products, and sigma in degrees where the formula wants
radians. `Varnished` adds an unnormalised highlight divided by the cosine of the light. `Corrected` is what they
should have been. The script ends with what no law can see.
"""

import math

import torch

from torchbrdf import BRDF, Constrained, Interval, QualitativeOrenNayar
from torchbrdf import testing as laws
from torchbrdf.testing import assert_weights


class FromAngles(BRDF):
    def __init__(self, albedo: float, sigma: float):
        super().__init__()
        self.albedo, self.sigma = (torch.nn.Parameter(torch.tensor(k)) for k in (albedo, sigma))

    def evaluate_components(self, cosines):
        theta_i, theta_r = cosines.light.acos(), cosines.view.acos()
        alpha, beta = torch.maximum(theta_i, theta_r), torch.minimum(theta_i, theta_r)
        cos_dphi = (cosines.phase - theta_i.cos() * theta_r.cos()) / (theta_i.sin() * theta_r.sin())
        s2 = self.sigma**2
        a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
        f = self.albedo / math.pi * (a + b * cos_dphi.clamp(min=0) * alpha.sin() * beta.tan())
        return {"direct": f[..., None]}


class Varnished(BRDF):
    def __init__(self, albedo: float, gloss: float):
        super().__init__()
        self.albedo, self.gloss = (torch.nn.Parameter(torch.tensor(k)) for k in (albedo, gloss))

    def evaluate_components(self, cosines):
        mirror = 2 * cosines.light * cosines.view - cosines.phase  # cosine to the mirror direction
        f = self.albedo / math.pi + self.gloss * mirror.relu() ** 20 / cosines.light
        return {"all": f[..., None]}


class Corrected(BRDF):
    albedo = Constrained(Interval(0.0, 1.0))
    gloss = Constrained(Interval(0.0, 1.0))
    sigma = Constrained(Interval(0.0, math.pi / 2, "rad", even=True))

    def __init__(self, albedo: float, gloss: float, sigma: float):
        super().__init__()
        self.albedo, self.gloss, self.sigma = albedo, gloss, sigma

    def evaluate_components(self, cosines):
        s2 = torch.atleast_1d(self.sigma) ** 2
        a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
        # cos(dphi) sin(alpha) tan(beta) is in_plane/beta, beta the larger cosine: no angle, nothing to divide by 0
        matte = self.albedo / math.pi * (a + b * cosines.in_plane.relu() / cosines.beta)
        mirror = 2 * cosines.light * cosines.view - cosines.phase
        lobe = 22 / (2 * math.pi) * mirror.relu() ** 20
        return {"matte": matte[..., None], "gloss": (self.gloss * lobe)[..., None]}


def verdicts(brdf: BRDF) -> dict[str, str]:
    """What each law says of a model: "ok", or its complaint."""
    generator = torch.Generator().manual_seed(0)
    many = laws.random_directions(1000, dtype=torch.float64, generator=generator)
    few = laws.random_directions(3, dtype=torch.float64, generator=generator)
    exact = brdf.double()

    def finite() -> None:
        for name, directions in laws.hard_directions(torch.float64).items():
            try:
                laws.assert_finite(exact, *directions)
            except AssertionError as error:
                raise AssertionError(f"{name}: {error}") from None

    checks = {
        "reciprocal": lambda: laws.assert_reciprocal(exact, *many),
        "not negative": lambda: laws.assert_nonnegative(exact, *many),
        "energy": lambda: laws.assert_energy(exact, nodes=48),
        "dark below horizon": lambda: laws.assert_zero_below_horizon(exact, *many),
        "finite": finite,
        "gradients": lambda: laws.assert_gradients(exact, *few),
        "float32": lambda: laws.assert_float32_matches_float64(exact, *many, rtol=2e-5),
        "sample weights": lambda: assert_weights(exact, 1.0, generator=generator),
    }
    found = {}
    for name, check in checks.items():
        try:
            check()
            found[name] = "ok"
        except AssertionError as error:
            found[name] = str(error)
    return found


def main() -> None:
    sigma = math.radians(20)
    brdfs = FromAngles(0.7, 20.0), Varnished(0.7, 2.0), Corrected(0.7, 0.2, sigma)
    models = {type(brdf).__name__: brdf for brdf in brdfs}
    found = {title: verdicts(brdf) for title, brdf in models.items()}
    print(f"{'law':<20}" + "".join(f"{title:<12}" for title in found))
    for law in found["Corrected"]:
        cells = ("ok" if found[title][law] == "ok" else "broken" for title in found)
        print(f"{law:<20}" + "".join(f"{cell:<12}" for cell in cells))
    for title, verdict in found.items():
        for law, complaint in verdict.items():
            if complaint != "ok":
                print(f"\n{title}, {law}:\n  {complaint}")
    directions = laws.random_directions(1000, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    known = QualitativeOrenNayar(albedo=0.7, sigma=sigma).double()(*directions)
    print(
        "\nNo law knows the unit of sigma: 20 rad is a rough material like another. A known model does, at 20 degrees:"
    )
    with torch.no_grad():
        for title, part in (("FromAngles", "direct"), ("Corrected", "matte")):
            off = (models[title].components(*directions)[part] / known - 1).abs().max()
            print(f"  {title:<12}{part} part differs from QualitativeOrenNayar by up to {off:.1g}")


if __name__ == "__main__":
    main()
