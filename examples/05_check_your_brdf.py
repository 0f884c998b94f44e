"""Check a BRDF of your own against the laws of `torchbrdf.testing`: two that are broken, and one that is right.

`FromAngles` is Oren-Nayar as it is often typed in: acos of dot products, and sigma in degrees where the formula wants
radians. `Varnished` adds an unnormalised highlight over the cosine of the light. `Corrected` is what both should be.
"""

import math
from functools import partial

import torch

from torchbrdf import BRDF, Constrained, Interval, QualitativeOrenNayar
from torchbrdf import testing as laws


class FromAngles(BRDF):
    def __init__(self, albedo: float, sigma: float):
        super().__init__()
        self.albedo, self.sigma = torch.nn.Parameter(torch.tensor(albedo)), torch.nn.Parameter(torch.tensor(sigma))

    def evaluate_components(self, cosines):
        theta_i, theta_r = cosines.light.acos(), cosines.view.acos()
        alpha, beta = torch.maximum(theta_i, theta_r), torch.minimum(theta_i, theta_r)
        cos_dphi = (cosines.phase - theta_i.cos() * theta_r.cos()) / (theta_i.sin() * theta_r.sin())
        s2 = self.sigma**2
        a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
        f = self.albedo / math.pi * (a + b * cos_dphi.clamp(min=0) * alpha.sin() * beta.tan())
        return {"matte": f[..., None]}


class Varnished(BRDF):
    def __init__(self, albedo: float, gloss: float):
        super().__init__()
        self.albedo, self.gloss = torch.nn.Parameter(torch.tensor(albedo)), torch.nn.Parameter(torch.tensor(gloss))

    def evaluate_components(self, cosines):
        mirror = 2 * cosines.light * cosines.view - cosines.phase  # cosine to the mirror direction
        return {"all": (self.albedo / math.pi + self.gloss * mirror.relu() ** 20 / cosines.light)[..., None]}


class Corrected(BRDF):
    albedo, gloss = Constrained(Interval(0.0, 1.0)), Constrained(Interval(0.0, 1.0))
    sigma = Constrained(Interval(0.0, math.pi / 2, "rad", even=True))

    def __init__(self, albedo: float, gloss: float, sigma: float):
        super().__init__()
        self.albedo, self.gloss, self.sigma = albedo, gloss, sigma

    def evaluate_components(self, cosines):
        s2 = torch.atleast_1d(self.sigma) ** 2
        a, b = 1 - 0.5 * s2 / (s2 + 0.33), 0.45 * s2 / (s2 + 0.09)
        # cos(dphi) sin(alpha) tan(beta) is in_plane/beta, beta the larger cosine: no angle, nothing to divide by 0
        matte = self.albedo / math.pi * (a + b * cosines.in_plane.relu() / cosines.beta)
        gloss = self.gloss * 11 / math.pi * (2 * cosines.light * cosines.view - cosines.phase).relu() ** 20
        return {"matte": matte[..., None], "gloss": gloss[..., None]}


def complaints(brdf: BRDF) -> dict[str, str]:
    """By law what it says of a model; nothing where the model obeys."""
    generator = torch.Generator().manual_seed(0)
    many, few = (laws.random_directions(n, dtype=torch.float64, generator=generator) for n in (1000, 3))
    hard = laws.hard_directions(torch.float64).items()
    checks = (
        ("reciprocal", "", lambda: laws.assert_reciprocal(brdf, *many)),
        ("not negative", "", lambda: laws.assert_nonnegative(brdf, *many)),
        ("energy", "", lambda: laws.assert_energy(brdf, nodes=48)),
        ("dark below horizon", "", lambda: laws.assert_zero_below_horizon(brdf, *many)),
        *(("finite", f"{name}: ", partial(laws.assert_finite, brdf, *at)) for name, at in hard),
        ("gradients", "", lambda: laws.assert_gradients(brdf, *few)),
        ("float32", "", lambda: laws.assert_float32_matches_float64(brdf, *many, rtol=2e-5)),
        ("sample weights", "", lambda: laws.assert_weights(brdf, 1.0, generator=generator)),
    )
    said = dict.fromkeys((law for law, *_ in checks), "")
    for law, place, check in checks:
        try:
            check()
        except AssertionError as error:
            said[law] = said[law] or f"{place}{error}"
    return said


def main() -> None:
    models = FromAngles(0.7, 20.0), Varnished(0.7, 2.0), Corrected(0.7, 0.2, math.radians(20))
    judged = {type(model).__name__: complaints(model.double()) for model in models}
    print(f"{'law':<20}" + "".join(f"{name:<12}" for name in judged))
    for law in judged["Corrected"]:
        print(f"{law:<20}" + "".join(f"{'broken' if said[law] else 'ok':<12}" for said in judged.values()))
    for name, said in judged.items():
        print("".join(f"\n{name}, {law}:\n  {complaint}\n" for law, complaint in said.items() if complaint), end="")
    print("\nNo law knows the unit of sigma: 20 rad is a rough material like another. A known model does, at 20 deg:")
    directions = laws.random_directions(1000, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    known = QualitativeOrenNayar(albedo=0.7, sigma=math.radians(20)).double()(*directions)
    for model in (models[0], models[2]):
        off = (model.components(*directions)["matte"] / known - 1).abs().max().item()
        print(f"  {type(model).__name__:<12}matte part differs from QualitativeOrenNayar by up to {off:.1g}")


if __name__ == "__main__":
    main()
