"""Complex refractive indices of a few materials over the wavelength, for `HeTorrance` and `Conductor`.

The published numbers were read from the refractiveindex.info database (public domain, CC0).
Sources:
    Rakic 1995, "Algorithm for the determination of intrinsic optical constants of metal films: application to
        aluminum", DOI 10.1364/AO.34.004755;
    Johnson & Christy 1972, "Optical constants of the noble metals", DOI 10.1103/PhysRevB.6.4370;
    Stephens & Malitson 1952, "Index of refraction of magnesium oxide", DOI 10.6028/jres.049.025;
    Malitson 1965, "Interspecimen comparison of the refractive index of fused silica", DOI 10.1364/JOSA.55.001205;
    Sultanova, Kasarova & Nikolov 2009, "Dispersion properties of optical polymers", DOI 10.12693/APhysPolA.116.585;
    Schott 2017, data sheet of the optical glass N-BK7.
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

    @classmethod
    def of(cls, name: str, source: str, table: str) -> "MeasuredIndex":
        """From rows of wavelength [um], eta and k."""
        columns = zip(*(map(float, row.split()) for row in table.strip().splitlines()), strict=True)
        return cls(name, source, *map(tuple, columns))

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


ALUMINIUM = MeasuredIndex.of(
    "ALUMINIUM",
    "Rakic 1995, Appl. Opt. 34, 4755 (evaporated film)",
    """
    0.30996 0.28003 3.7081
    0.32628 0.31474 3.9165
    0.36466 0.39877 4.3957
    0.41328 0.52135 5.0008
    0.4428 0.6079 5.3676
    0.47687 0.7278 5.7781
    0.5166 0.8734 6.2418
    0.56357 1.0728 6.7839
    0.61993 1.366 7.4052
    0.65225 1.5724 7.7354
    0.68881 1.8301 8.0601
    0.72932 2.1606 8.3565
    0.77491 2.6154 8.4914
    0.79478 2.7675 8.3866
    0.81569 2.7668 8.2573
    0.83774 2.6945 8.1878
    0.88561 2.2802 8.1134
    0.91166 1.9739 8.3058
    0.93928 1.6784 8.597
    0.96863 1.4867 9.0655
    0.99988 1.4359 9.4939
    1.0332 1.3998 9.8914
    1.1271 1.3281 10.969
    1.2399 1.3157 12.245
    1.3776 1.3899 13.784
    1.5498 1.5782 15.656
    1.7712 1.9205 17.991
    2.0664 2.4738 20.982
    """,
)

COPPER = MeasuredIndex.of(
    "COPPER",
    "Johnson & Christy 1972, Phys. Rev. B 6, 4370",
    """
    0.3542 1.37 1.916
    0.3679 1.36 1.975
    0.3815 1.33 2.045
    0.3974 1.32 2.116
    0.4133 1.28 2.207
    0.4305 1.25 2.305
    0.4509 1.24 2.397
    0.4714 1.25 2.483
    0.4959 1.22 2.564
    0.5209 1.18 2.608
    0.5486 1.02 2.577
    0.5821 0.7 2.704
    0.6168 0.3 3.205
    0.6595 0.22 3.747
    0.7045 0.21 4.205
    0.756 0.24 4.665
    0.8211 0.26 5.18
    0.892 0.3 5.768
    0.984 0.32 6.421
    1.088 0.36 7.217
    1.216 0.48 8.245
    1.393 0.6 9.439
    1.61 0.76 11.12
    1.937 1.09 13.43
    """,
)

GOLD = MeasuredIndex.of(
    "GOLD",
    "Johnson & Christy 1972, Phys. Rev. B 6, 4370",
    """
    0.3542 1.5 1.866
    0.3679 1.48 1.895
    0.3815 1.46 1.933
    0.3974 1.47 1.952
    0.4133 1.46 1.958
    0.4305 1.45 1.948
    0.4509 1.38 1.914
    0.4714 1.31 1.849
    0.4959 1.04 1.833
    0.5209 0.62 2.081
    0.5486 0.43 2.455
    0.5821 0.29 2.863
    0.6168 0.21 3.272
    0.6595 0.14 3.697
    0.7045 0.13 4.103
    0.756 0.14 4.542
    0.8211 0.16 5.083
    0.892 0.17 5.663
    0.984 0.22 6.35
    1.088 0.27 7.15
    1.216 0.35 8.145
    1.393 0.43 9.519
    1.61 0.56 11.21
    1.937 0.92 13.78
    """,
)

SILVER = MeasuredIndex.of(
    "SILVER",
    "Johnson & Christy 1972, Phys. Rev. B 6, 4370",
    """
    0.3542 0.1 1.419
    0.3679 0.07 1.657
    0.3815 0.05 1.864
    0.3974 0.05 2.07
    0.4133 0.05 2.275
    0.4305 0.04 2.462
    0.4509 0.04 2.657
    0.4714 0.05 2.869
    0.4959 0.05 3.093
    0.5209 0.05 3.324
    0.5486 0.06 3.586
    0.5821 0.05 3.858
    0.6168 0.06 4.152
    0.6595 0.05 4.483
    0.7045 0.04 4.838
    0.756 0.03 5.242
    0.8211 0.04 5.727
    0.892 0.04 6.312
    0.984 0.04 6.992
    1.088 0.04 7.795
    1.216 0.09 8.828
    1.393 0.13 10.1
    1.61 0.15 11.85
    1.937 0.24 14.08
    """,
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
