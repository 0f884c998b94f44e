"""A matte body under a smooth interface, and the bare mirror: models with a delta lobe."""

import math
from typing import final

import torch
from torch import Tensor

from torchbrdf._numerics import safe_divide
from torchbrdf.brdf import BRDF
from torchbrdf.directions import Cosines
from torchbrdf.fresnel import Fresnel, Perfect, Schlick
from torchbrdf.parameters import ALBEDO, Constrained, ParameterValue
from torchbrdf.sampling import choose, cosine_hemisphere


class _Polished(BRDF):
    """A mirror lobe of reflectance F over whatever `evaluate_components` says. `forward` leaves the lobe out."""

    fresnel: Fresnel

    def mirror_share(self, cos_view: Tensor) -> Tensor:
        """Probability (...) of drawing the mirror direction, for a view at this cosine (...)."""
        reflected = self.fresnel(cos_view).mean(-1)
        body = torch.atleast_1d(self.body_albedo()).mean(-1) * (1 - reflected)
        return safe_divide(reflected, reflected + body, where=reflected + body > 0).detach()

    def body_albedo(self) -> Tensor:
        raise NotImplementedError

    def propose(self, view: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
        share = self.mirror_share(view[..., 2])
        mirror, u1 = choose(u[..., 0].expand_as(share + u[..., 0]), share)
        image = view * view.new_tensor([-1.0, -1.0, 1.0])
        matte = cosine_hemisphere(torch.stack((u1, u[..., 1].expand_as(u1)), -1))
        return torch.where(mirror[..., None], image, matte), mirror

    def density(self, cosines: Cosines) -> Tensor:
        return (1 - self.mirror_share(cosines.view)) * cosines.light / math.pi

    def delta_reflectance(self, cosines: Cosines) -> Tensor | None:
        return cosines.zero_below_horizon(self.fresnel(cosines.view))

    def delta_probability(self, cosines: Cosines) -> Tensor:
        return self.mirror_share(cosines.view)


@final
class Mirror(_Polished):
    r"""A smooth mirror: sampled, never evaluated.

    .. math:: f_r = F(\cos\theta_r)\,\delta(\omega_i - M \omega_r) / \cos\theta_i

    The delta is per solid angle and has no value at a point: `forward` is 0 everywhere, `sample` returns the mirror
    direction with weight F and pdf inf, `delta_reflectance` gives F, `directional_albedo` includes it.

    Args:
        fresnel: reflectance; Perfect (F = 1) if not given.
    Components: specular (0).
    Source: Fleet & Hertzmann 2006, "Computer Graphics Lecture Notes", University of Toronto, eqs. (37), (38).
    """

    def __init__(self, *, fresnel: Fresnel | None = None):
        super().__init__()
        self.fresnel = Perfect() if fresnel is None else fresnel

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        return {"specular": 0 * self.fresnel(cosines.view)}

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        """F at the view; `nodes` is not used."""
        return self.fresnel(cos_view)

    def mirror_share(self, cos_view: Tensor) -> Tensor:
        return torch.ones_like(cos_view)


@final
class Coupled(_Polished):
    r"""A matte body that gets what a smooth interface lets through, on the way in and out.

    .. math:: f_r = F\text{-mirror} + \frac{\rho\,(1 - F_i)(1 - F_r)}{\pi\,(1 - \bar F)}, \quad
        \bar F = 2 \int_0^1 F c\,dc

    Args:
        albedo: rho of the body, scalar, (channel,) or (..., channel). [-] in [0, 1]; 1 reflects everything.
        fresnel: Schlick (0.04) if not given; Dielectric is exact.
    Components: matte. The mirror lobe is sampled, not evaluated: see `Mirror`.
    Deviations: the matte part has the fitted shape of Shirley et al. 1997. With Schlick's F the constant is
        21 (1 - f0)/(20 pi): the published 21/(20 pi (1 - f0)) goes with (1 - F), not with 1 - (1 - c)^5, and as
        printed reflects 1.10 of the light at f0 = 0.05. That also means that photographs show rho (1 - f0) alone: to
        fit, hold one of the two fixed.
    Source: Shirley, Smits, Hu & Lafortune 1997, "A practitioners' assessment of light reflection models", Pacific
        Graphics; Shirley & Marschner 2009, Fundamentals of Computer Graphics, 3rd edition, eqs. (25.1)-(25.3),
        corrected.
    """

    albedo: Constrained = Constrained(ALBEDO)

    def __init__(self, *, albedo: ParameterValue = 0.5, fresnel: Fresnel | None = None):
        super().__init__()
        self.albedo = albedo
        self.fresnel = Schlick(f0=self.albedo.new_tensor(0.04)) if fresnel is None else fresnel

    def body_albedo(self) -> Tensor:
        return self.albedo

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        through = (1 - self.fresnel(cosines.light)) * (1 - self.fresnel(cosines.view))
        open_ = 1 - self.fresnel.average()
        coupled = safe_divide(through, open_, where=(open_ > 0).expand(through.shape[:-1] + open_.shape[-1:]))
        return {"matte": torch.atleast_1d(self.albedo) / math.pi * coupled}

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        """F + rho (1 - F), in closed form; `nodes` is not used."""
        mirror = self.fresnel(cos_view)
        return mirror + torch.atleast_1d(self.albedo) * (1 - mirror)


@final
class Dampened(_Polished):
    r"""A matte body that gets what a smooth interface does not reflect; nothing is lost on the way out.

    .. math:: f_r = F\text{-mirror} + \frac{\rho}{\pi} (1 - F_i)

    F_i is that of the light: "for each incident theta" the mirror and the matte part together return F + rho (1 - F)
    of what arrives, at most all of it. With F of the view, the other reading, they would return more than arrives at
    grazing light.

    Args:
        albedo: rho of the body, scalar, (channel,) or (..., channel). [-] in [0, 1]
        fresnel: Schlick (0.04) if not given.
    Components: matte. The mirror lobe is sampled, not evaluated: see `Mirror`.
    Deviations: not reciprocal, since F is that of the light alone. `Coupled` is the model to use. With Schlick's F
        photographs show rho (1 - f0) alone.
    Source: Shirley & Marschner 2009, Fundamentals of Computer Graphics, 3rd edition, ch. 25, smooth-layered model;
        eq. (25.1) for what theta is.
    """

    albedo: Constrained = Constrained(ALBEDO)

    def __init__(self, *, albedo: ParameterValue = 0.5, fresnel: Fresnel | None = None):
        super().__init__()
        self.albedo = albedo
        self.fresnel = Schlick(f0=self.albedo.new_tensor(0.04)) if fresnel is None else fresnel

    def body_albedo(self) -> Tensor:
        return self.albedo

    def evaluate_components(self, cosines: Cosines) -> dict[str, Tensor]:
        return {"matte": torch.atleast_1d(self.albedo) / math.pi * (1 - self.fresnel(cosines.light))}

    def directional_albedo(self, cos_view: Tensor, *, nodes: int = 32) -> Tensor:
        """F + rho (1 - mean F), in closed form: what a view sees under uniform light, which may be more than that light
        (not reciprocal); `nodes` is not used."""
        return self.fresnel(cos_view) + torch.atleast_1d(self.albedo) * (1 - self.fresnel.average())
