"""The laws of sampling, as functions to run on your own model; the companion of `torchbrdf.testing.laws`.

All in float64, about a tilted normal, with the view at a polar angle [rad] and an azimuth of 0.3 rad.

>>> import torch
>>> from torchbrdf import EON
>>> brdf = EON(albedo=torch.tensor([0.7, 0.5, 0.3]), roughness=0.8)
>>> assert_density_integrates(brdf, 1.2, generator=torch.Generator().manual_seed(0))
>>> assert_samples_follow_pdf(brdf, 1.2, generator=torch.Generator().manual_seed(0))
"""

import copy
import math
from dataclasses import dataclass

import torch
from torch import Tensor

from torchbrdf.brdf import BRDF
from torchbrdf.quadrature import gauss_legendre
from torchbrdf.sampling import Sample

# Azimuth of every view, from the tangent. [rad]
AZIMUTH = 0.3
_FEWEST = 10.0


@dataclass(frozen=True)
class SamplingSetup:
    """A float64 copy of a model, the axes (tangent, bitangent, normal) of a tilted surface, and a view of it."""

    brdf: BRDF
    axes: Tensor
    view: Tensor

    @classmethod
    def of(cls, brdf: BRDF, view_angle: float) -> "SamplingSetup":
        normal = torch.nn.functional.normalize(torch.tensor([0.3, -0.5, 0.8], dtype=torch.float64), dim=0)
        grain = getattr(brdf, "direction", torch.tensor([1.0, 0.0, 0.2])).double()
        tangent = torch.nn.functional.normalize(grain - (grain @ normal) * normal, dim=0)
        axes = torch.stack((tangent, torch.linalg.cross(normal, tangent), normal))
        s, c = math.sin(view_angle), math.cos(view_angle)
        local = torch.tensor([s * math.cos(AZIMUTH), s * math.sin(AZIMUTH), c], dtype=torch.float64)
        view = torch.nn.functional.normalize(local @ axes, dim=0)
        return cls(copy.deepcopy(brdf).double(), axes, view)

    def draw(self, n: int, generator: torch.Generator) -> Sample:
        """Light directions (n, 3) of one view, as `BRDF.sample` draws them."""
        u = torch.rand(n, 2, dtype=torch.float64, generator=generator)
        normal, view = self.axes[2].expand(n, 3), self.view.expand(n, 3)
        return self.brdf.sample(normal, view, u)

    def pdf(self, light: Tensor) -> Tensor:
        """`BRDF.pdf` of directions (..., 3) for the view. [1/sr]"""
        return self.brdf.pdf(self.axes[2].expand_as(light), light, self.view.expand_as(light))

    def probabilities(self, rings: int, sectors: int, nodes: int) -> Tensor:
        """What the density says of each bin (ring of equal cosine, sector of azimuth from the tangent)."""
        x, w = gauss_legendre(nodes, self.view)
        # the square root of the cosine spreads the bins towards the horizon, where densities peak
        edge = torch.linspace(0, 1, rings + 1, dtype=torch.float64)
        r = (edge[:-1, None] + x / rings).flatten()
        phi = ((torch.arange(sectors, dtype=torch.float64)[:, None] + x) * 2 * math.pi / sectors).flatten()
        cos = (r * r)[:, None]
        sin = ((1 - cos) * (1 + cos)).sqrt()
        local = torch.stack(torch.broadcast_tensors(sin * phi.cos(), sin * phi.sin(), cos), -1)
        light = torch.nn.functional.normalize(local @ self.axes, dim=-1)
        weight = (2 * r * w.repeat(rings) / rings)[:, None] * (w.repeat(sectors) * 2 * math.pi / sectors)
        p = self.pdf(light.reshape(-1, 3)).reshape(weight.shape) * weight
        return p.reshape(rings, nodes, sectors, nodes).sum((1, 3))


def assert_density_integrates(
    brdf: BRDF, view_angle: float, *, draws: int = 10_000, nodes: int = 12, generator: torch.Generator
) -> None:
    """The density over the hemisphere, the draws rejected and those of a delta lobe add up to one.

    False-alarm rate below 1e-6: five standard deviations of the counted share. 1e-4 allows for the quadrature.
    """
    setting = SamplingSetup.of(brdf, view_angle)
    total = float(setting.probabilities(24, 24, nodes).sum())
    pdf = setting.draw(draws, generator).pdf
    missed = float(((pdf == 0) | pdf.isinf()).double().mean())
    allowed = 5 * math.sqrt(missed * (1 - missed) / draws) + 1e-4
    if abs(total + missed - 1) > allowed:
        raise AssertionError(f"pdf integrates to {total:.6g} and misses {missed:.6g}; allowed {allowed:.2g} from 1")


def assert_samples_follow_pdf(
    brdf: BRDF,
    view_angle: float,
    *,
    draws: int = 20_000,
    nodes: int = 8,
    false_alarm: float = 1e-6,
    generator: torch.Generator,
) -> None:
    """Chi-square test of drawn lights against the density, in 16 x 24 bins; rejected draws are left to the sum.

    `false_alarm` is the probability that a correct sampler fails one such test: divide what you accept by the
    number of tests (Bonferroni). Bins with fewer than 10 expected draws are put together.
    """
    setting = SamplingSetup.of(brdf, view_angle)
    rings, sectors = 16, 24
    expected = draws * setting.probabilities(rings, sectors, nodes).flatten()
    sample = setting.draw(draws, generator)
    local = sample.light[(sample.pdf > 0) & sample.pdf.isfinite()] @ setting.axes.T
    ring = (local[:, 2].clamp(0, 1).sqrt() * rings).long().clamp(max=rings - 1)
    turn = torch.atan2(local[:, 1], local[:, 0]) / (2 * math.pi)
    sector = ((turn - turn.floor()) * sectors).long().clamp(max=sectors - 1)
    counted = torch.bincount(ring * sectors + sector, minlength=rings * sectors).double()
    few = expected < _FEWEST
    expected, counted = (torch.cat((x[~few], x[few].sum()[None])) for x in (expected, counted))
    outside = draws - expected.sum()
    expected = torch.cat((expected, outside.clamp(min=0)[None]))
    counted = torch.cat((counted, (draws - counted.sum())[None]))
    kept = expected > _FEWEST / 2
    statistic = ((counted - expected) ** 2 / expected)[kept].sum()
    freedom = max(int(kept.sum()) - 1, 1)
    p = float(torch.special.gammaincc(torch.tensor(freedom / 2, dtype=torch.float64), statistic / 2))
    stray = float(counted[~kept].sum())
    if p < false_alarm or stray > 5 * _FEWEST:
        raise AssertionError(
            f"chi-square {statistic:.4g} at {freedom} degrees of freedom: p = {p:.2g} < {false_alarm:.2g}"
            f" ({stray:.0f} draws where the density is next to nothing)"
        )


def assert_weights(brdf: BRDF, view_angle: float, *, draws: int = 1000, generator: torch.Generator) -> Sample:
    """Weight = f_r cos(light)/pdf and pdf = `pdf(...)` for each draw, 0 for the rejected; returns the draws."""
    setting = SamplingSetup.of(brdf, view_angle)
    sample = setting.draw(draws, generator)
    normal, view = setting.axes[2].expand(draws, 3), setting.view.expand(draws, 3)
    smooth = sample.pdf.isfinite()
    kept = smooth & (sample.pdf > 0)
    if bool((sample.weight[smooth & ~kept] != 0).any()):
        raise AssertionError("a rejected draw has a weight")
    lengths = sample.light.norm(dim=-1)
    if not torch.allclose(lengths, torch.ones_like(lengths), rtol=0, atol=1e-12):
        raise AssertionError("lights are not unit vectors")
    light = sample.light[kept]
    f = setting.brdf(normal[kept], light, view[kept], normalize=True)
    cos = (normal[kept] * light).sum(-1)
    torch.testing.assert_close(setting.pdf(light), sample.pdf[kept], rtol=1e-6, atol=0)
    expected = f * (cos / sample.pdf[kept])[:, None]
    torch.testing.assert_close(sample.weight[kept], expected, rtol=1e-6, atol=1e-9)
    return sample
