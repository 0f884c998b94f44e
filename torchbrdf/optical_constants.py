"""Complex refractive indices of a few materials over the wavelength, for `HeTorrance` and `Conductor`.

The published numbers were read from the refractiveindex.info database (public domain, CC0).
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from torchbrdf._numerics import holds


@dataclass(frozen=True)
class MeasuredIndex:
    """Index of a metal between measured wavelengths, linear in between.

    Attributes:
        name, source: of the material and of the measurement.
        wavelengths: in vacuum, ascending. [um]
        eta, k: real and imaginary part of the index there. [-]

    >>> eta, k = GOLD(torch.tensor([0.61, 0.55, 0.46]))
    """

    name: str
    source: str
    wavelengths: tuple[float, ...]
    eta: tuple[float, ...]
    k: tuple[float, ...]

    def __call__(self, wavelength: Tensor) -> tuple[Tensor, Tensor]:
        """eta and k (...) at wavelengths (...) [um]; raises ValueError outside the measured range."""
        _check_range(self.name, wavelength, self.wavelengths[0], self.wavelengths[-1])
        table = wavelength.new_tensor(self.wavelengths)
        right = torch.searchsorted(table, wavelength.detach().contiguous()).clamp(1, len(self.wavelengths) - 1)
        start, end = table[right - 1], table[right]
        share = (wavelength - start) / (end - start)
        eta, k = (wavelength.new_tensor(values) for values in (self.eta, self.k))
        return tuple(v[right - 1] + share * (v[right] - v[right - 1]) for v in (eta, k))  # pyright: ignore[reportReturnType]


@dataclass(frozen=True)
class SellmeierIndex:
    """Index of a transparent material, n^2 = offset + sum_j b_j l^2/(l^2 - c_j) - bend_2 l^2 - bend_4 l^4; k = 0.

    Attributes:
        name, source: of the material and of the fit.
        low, high: range of the fit. [um]
        terms: pairs (b_j [-], c_j [um^2]).
        offset, bend_2, bend_4: [-], [um^-2], [um^-4]
    """

    name: str
    source: str
    low: float
    high: float
    terms: tuple[tuple[float, float], ...]
    offset: float = 1.0
    bend_2: float = 0.0
    bend_4: float = 0.0

    def __call__(self, wavelength: Tensor) -> tuple[Tensor, Tensor]:
        """eta and k = 0 (...) at wavelengths (...) [um]; raises ValueError outside the range of the fit."""
        _check_range(self.name, wavelength, self.low, self.high)
        squared = wavelength * wavelength
        total = self.offset - self.bend_2 * squared - self.bend_4 * squared * squared
        for strength, pole in self.terms:
            total = total + strength * squared / (squared - pole)
        return total.sqrt(), torch.zeros_like(wavelength)


def _check_range(name: str, wavelength: Tensor, low: float, high: float) -> None:
    # a float32 copy of an end of the range still counts
    slack = high * torch.finfo(wavelength.dtype).eps
    inside = (wavelength >= low - slack) & (wavelength <= high + slack)
    if not holds(inside):
        raise ValueError(
            f"{name}: wavelength must lie in [{low:g}, {high:g}] um; {int((~inside).sum())} of {inside.numel()} do not "
            f"(min {wavelength.min():.6g}, max {wavelength.max():.6g})."
        )


ALUMINIUM = MeasuredIndex(
    name="ALUMINIUM",
    source="Rakic 1995, Appl. Opt. 34, 4755 (evaporated film)",
    wavelengths=(
        0.30996,
        0.32628,
        0.36466,
        0.41328,
        0.4428,
        0.47687,
        0.5166,
        0.56357,
        0.61993,
        0.65225,
        0.68881,
        0.72932,
        0.77491,
        0.79478,
        0.81569,
        0.83774,
        0.88561,
        0.91166,
        0.93928,
        0.96863,
        0.99988,
        1.0332,
        1.1271,
        1.2399,
        1.3776,
        1.5498,
        1.7712,
        2.0664,
    ),
    eta=(
        0.28003,
        0.31474,
        0.39877,
        0.52135,
        0.6079,
        0.7278,
        0.8734,
        1.0728,
        1.366,
        1.5724,
        1.8301,
        2.1606,
        2.6154,
        2.7675,
        2.7668,
        2.6945,
        2.2802,
        1.9739,
        1.6784,
        1.4867,
        1.4359,
        1.3998,
        1.3281,
        1.3157,
        1.3899,
        1.5782,
        1.9205,
        2.4738,
    ),
    k=(
        3.7081,
        3.9165,
        4.3957,
        5.0008,
        5.3676,
        5.7781,
        6.2418,
        6.7839,
        7.4052,
        7.7354,
        8.0601,
        8.3565,
        8.4914,
        8.3866,
        8.2573,
        8.1878,
        8.1134,
        8.3058,
        8.597,
        9.0655,
        9.4939,
        9.8914,
        10.969,
        12.245,
        13.784,
        15.656,
        17.991,
        20.982,
    ),
)

COPPER = MeasuredIndex(
    name="COPPER",
    source="Johnson & Christy 1972, Phys. Rev. B 6, 4370",
    wavelengths=(
        0.3542,
        0.3679,
        0.3815,
        0.3974,
        0.4133,
        0.4305,
        0.4509,
        0.4714,
        0.4959,
        0.5209,
        0.5486,
        0.5821,
        0.6168,
        0.6595,
        0.7045,
        0.756,
        0.8211,
        0.892,
        0.984,
        1.088,
        1.216,
        1.393,
        1.61,
        1.937,
    ),
    eta=(
        1.37,
        1.36,
        1.33,
        1.32,
        1.28,
        1.25,
        1.24,
        1.25,
        1.22,
        1.18,
        1.02,
        0.7,
        0.3,
        0.22,
        0.21,
        0.24,
        0.26,
        0.3,
        0.32,
        0.36,
        0.48,
        0.6,
        0.76,
        1.09,
    ),
    k=(
        1.916,
        1.975,
        2.045,
        2.116,
        2.207,
        2.305,
        2.397,
        2.483,
        2.564,
        2.608,
        2.577,
        2.704,
        3.205,
        3.747,
        4.205,
        4.665,
        5.18,
        5.768,
        6.421,
        7.217,
        8.245,
        9.439,
        11.12,
        13.43,
    ),
)

GOLD = MeasuredIndex(
    name="GOLD",
    source="Johnson & Christy 1972, Phys. Rev. B 6, 4370",
    wavelengths=(
        0.3542,
        0.3679,
        0.3815,
        0.3974,
        0.4133,
        0.4305,
        0.4509,
        0.4714,
        0.4959,
        0.5209,
        0.5486,
        0.5821,
        0.6168,
        0.6595,
        0.7045,
        0.756,
        0.8211,
        0.892,
        0.984,
        1.088,
        1.216,
        1.393,
        1.61,
        1.937,
    ),
    eta=(
        1.5,
        1.48,
        1.46,
        1.47,
        1.46,
        1.45,
        1.38,
        1.31,
        1.04,
        0.62,
        0.43,
        0.29,
        0.21,
        0.14,
        0.13,
        0.14,
        0.16,
        0.17,
        0.22,
        0.27,
        0.35,
        0.43,
        0.56,
        0.92,
    ),
    k=(
        1.866,
        1.895,
        1.933,
        1.952,
        1.958,
        1.948,
        1.914,
        1.849,
        1.833,
        2.081,
        2.455,
        2.863,
        3.272,
        3.697,
        4.103,
        4.542,
        5.083,
        5.663,
        6.35,
        7.15,
        8.145,
        9.519,
        11.21,
        13.78,
    ),
)

SILVER = MeasuredIndex(
    name="SILVER",
    source="Johnson & Christy 1972, Phys. Rev. B 6, 4370",
    wavelengths=(
        0.3542,
        0.3679,
        0.3815,
        0.3974,
        0.4133,
        0.4305,
        0.4509,
        0.4714,
        0.4959,
        0.5209,
        0.5486,
        0.5821,
        0.6168,
        0.6595,
        0.7045,
        0.756,
        0.8211,
        0.892,
        0.984,
        1.088,
        1.216,
        1.393,
        1.61,
        1.937,
    ),
    eta=(
        0.1,
        0.07,
        0.05,
        0.05,
        0.05,
        0.04,
        0.04,
        0.05,
        0.05,
        0.05,
        0.06,
        0.05,
        0.06,
        0.05,
        0.04,
        0.03,
        0.04,
        0.04,
        0.04,
        0.04,
        0.09,
        0.13,
        0.15,
        0.24,
    ),
    k=(
        1.419,
        1.657,
        1.864,
        2.07,
        2.275,
        2.462,
        2.657,
        2.869,
        3.093,
        3.324,
        3.586,
        3.858,
        4.152,
        4.483,
        4.838,
        5.242,
        5.727,
        6.312,
        6.992,
        7.795,
        8.828,
        10.1,
        11.85,
        14.08,
    ),
)

# Published as n^2 = 2.956362 + 0.0219577/(l^2 - 0.01428322) - ...: the same, with its constant split off.
MAGNESIUM_OXIDE = SellmeierIndex(
    name="MAGNESIUM_OXIDE",
    source="Stephens & Malitson 1952, J. Res. Natl. Bur. Stand. 49, 249 (whole range; 1e-4 in the visible)",
    low=0.36,
    high=5.4,
    terms=((0.0219577 / 0.01428322, 0.01428322),),
    offset=2.956362 - 0.0219577 / 0.01428322,
    bend_2=0.01062387,
    bend_4=0.0000204968,
)

FUSED_SILICA = SellmeierIndex(
    name="FUSED_SILICA",
    source="Malitson 1965, J. Opt. Soc. Am. 55, 1205",
    low=0.21,
    high=3.71,
    terms=((0.6961663, 0.0684043**2), (0.4079426, 0.1162414**2), (0.8974794, 9.896161**2)),
)

CROWN_GLASS = SellmeierIndex(
    name="CROWN_GLASS",
    source="Schott 2017, data sheet of N-BK7",
    low=0.3,
    high=2.5,
    terms=((1.03961212, 0.00600069867), (0.231792344, 0.0200179144), (1.01046945, 103.560653)),
)

ACRYLIC = SellmeierIndex(
    name="ACRYLIC",
    source="PMMA: Sultanova, Kasarova & Nikolov 2009, Acta Phys. Pol. A 116, 585 (one-term fit of M. Polyanskiy)",
    low=0.4368,
    high=1.052,
    terms=((1.1819, 0.011313),),
)
