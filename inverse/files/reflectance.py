"""Measured reflectance and optical constants on disk: MERL tables, gonioreflectometer text, refractiveindex.info."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from inverse.files.regular import read_text, size_of
from torchbrdf import Cosines, TabulatedBRDF

# Relative sensitivity of red, green and blue, over the range of the stored numbers.
_MERL_SCALE = (1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0)
_MERL_HEADER = 12
_MICRO_PER_NANO = 1e-3


@dataclass(frozen=True)
class Measurements:
    """Reflectance in single pairs of directions, in the frame whose z axis is the normal.

    Attributes:
        light, view: unit vectors (sample, 3).
        values: f_r (sample, wavelength). [1/sr]
        wavelengths: (wavelength,). [nm]
    """

    light: Tensor
    view: Tensor
    values: Tensor
    wavelengths: Tensor

    def cosines(self) -> Cosines:
        """Cosines (sample,) of the pairs; the x axis is the tangent."""
        tangent, _, normal = torch.eye(3, dtype=self.light.dtype, device=self.light.device)
        return Cosines.of(normal, self.light, self.view, tangent=tangent, normalize=True)


def read_gonioreflectometer(path: str | Path) -> Measurements:
    """Text of a gonioreflectometer: theta_i phi_i theta_r phi_r [rad] and one value a wavelength in each row.

    A header gives the number of wavelengths and then the wavelengths [nm]; lines from `#` on are comments.
    Raises: ValueError, with the file and what is wrong, for text that is not a number, a header that does not
    fit, rows that are not whole, angles out of [0, pi/2], values that are not finite, wavelengths not above 0.
    """
    words = [word for line in read_text(path).splitlines() for word in line.split("#")[0].split()]
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError as error:
        raise ValueError(f"{path}: not gonioreflectometer text ({error}).") from None
    count = int(numbers[0]) if len(numbers) and np.isfinite(numbers[0]) else 0
    rows = numbers[1 + count :]
    if count < 1 or count != numbers[0] or len(rows) == 0 or len(rows) % (4 + count):
        raise ValueError(
            f"{path}: the header announces {count} wavelengths, so that rows have {4 + count} numbers; "
            f"found {len(rows)} numbers after it."
        )
    table = torch.from_numpy(rows.reshape(-1, 4 + count))
    polar = table[:, [0, 2]]
    if not bool(table.isfinite().all()) or not bool(((polar >= 0) & (polar <= math.pi / 2)).all()):
        raise ValueError(f"{path}: polar angles must lie in [0, 1.571] rad and all numbers be finite.")
    wavelengths = torch.from_numpy(numbers[1 : 1 + count])
    if not bool((wavelengths.isfinite() & (wavelengths > 0)).all()):
        raise ValueError(f"{path}: wavelengths must be finite and positive [nm]; found {wavelengths.tolist()[:8]}.")
    light, view = (_direction(table[:, k], table[:, k + 1]) for k in (0, 2))
    return Measurements(light, view, table[:, 4:], wavelengths)


def read_merl(path: str | Path) -> TabulatedBRDF:
    """A MERL `.binary` file as a BRDF in float32, channels red, green, blue. [1/sr]

    The samples (theta_h, theta_d, phi_d) are taken at the lower ends of their bins, the last one again at pi/2;
    phi_d and pi - phi_d, which reciprocity and symmetry make one, are averaged. Negative entries mark directions
    that were not measured; they become 0.
    Raises: ValueError for a file of another size than its header says, or whose dimensions are not a table.
    Source: Matusik, Pfister, Brand & McMillan 2003, "A data-driven reflectance model", DOI 10.1145/882262.882343.
    """
    size = size_of(path)
    if size < _MERL_HEADER:
        raise ValueError(f"{path}: not a MERL file: {size} bytes, its header alone has {_MERL_HEADER}.")
    with Path(path).open("rb") as file:
        half, difference, azimuth = (int(n) for n in np.frombuffer(file.read(_MERL_HEADER), "<i4"))
    expected = _MERL_HEADER + 3 * 8 * half * difference * azimuth
    if min(half, difference, azimuth) < 1 or azimuth % 2 or size != expected:
        raise ValueError(
            f"{path}: not a MERL file: dimensions ({half}, {difference}, {azimuth}) ask for {expected} bytes, "
            f"with an even third; found {size}."
        )
    raw = np.fromfile(path, "<f8", offset=_MERL_HEADER).reshape(3, half, difference, azimuth)
    if not np.isfinite(raw).all():
        raise ValueError(f"{path}: {int((~np.isfinite(raw)).sum())} of {raw.size} values are not finite.")
    table = np.clip(raw, 0, None) * np.array(_MERL_SCALE)[:, None, None, None]
    table = np.concatenate((table, table[:, -1:]), 1)
    table = np.concatenate((table, table[:, :, -1:]), 2)
    there = np.arange(azimuth // 2 + 1)
    folded = (table[..., there] + table[..., -there % azimuth]) / 2
    return TabulatedBRDF(torch.from_numpy(np.moveaxis(folded, 0, -1)).float(), half_power=2.0)


def read_optical_constants(path: str | Path, wavelengths: Tensor) -> tuple[Tensor, Tensor]:
    """Index n and absorption k (wavelength,) at wavelengths [nm] from a refractiveindex.info file (yml).

    Understands `tabulated nk`, `tabulated n`, `tabulated k` (linear between entries) and formulas 1, 2 and 4
    (Sellmeier, Sellmeier-2, RefractiveIndex.INFO); k is 0 where the file has none.
    Raises: ValueError, with the file, for other kinds of data, none at all, text that is not a finite number,
    wavelengths in no order or outside the range of the data, and where n is not above 0 or k is below it, as
    beside the pole of a formula.
    """
    text = read_text(path)
    micro = wavelengths.detach().double().numpy() * _MICRO_PER_NANO
    index, absorption = None, np.zeros_like(micro)
    for kind, body in re.findall(r"^ *- type: *(\S+ \S+)\s*\n(.*?)(?=^ *- type:|^\S|\Z)", text, re.M | re.S):
        try:
            if kind in ("tabulated nk", "tabulated n", "tabulated k"):
                lines = body.split("data: |", 1)[-1].strip().splitlines()
                table = np.array([[float(x) for x in line.split()] for line in lines])
                if not np.isfinite(table).all() or not (np.diff(table[:, 0]) > 0).all():
                    raise ValueError("a table must be finite, its wavelengths increasing")
                _check_range(path, micro, table[0, 0], table[-1, 0])
                columns = [np.interp(micro, table[:, 0], column) for column in table.T[1:]]
                if kind != "tabulated k":
                    index = columns[0]
                if kind != "tabulated n":
                    absorption = columns[-1]
            elif kind in _FORMULAS:
                low, high = _numbers(body, "wavelength_range")
                _check_range(path, micro, low, high)
                with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # refused below
                    squared = _FORMULAS[kind](micro, _numbers(body, "coefficients"))
                index = np.sqrt(np.where(squared > 0, squared, np.nan))
            else:
                raise ValueError(f"data of type '{kind}' is not an index")
        except (ValueError, IndexError, AttributeError) as error:
            raise ValueError(f"{path}: {error}") from None
    if index is None:
        raise ValueError(f"{path}: no refractive index found: is this a refractiveindex.info file?")
    wrong = ~(np.isfinite(index) & (index > 0) & np.isfinite(absorption) & (absorption >= 0))
    if wrong.any():
        raise ValueError(
            f"{path}: n must be finite and above 0, k finite and not below it; not so at {micro[wrong][:8] * 1e3} nm."
        )
    return torch.from_numpy(index).to(wavelengths), torch.from_numpy(absorption).to(wavelengths)


def _direction(theta: Tensor, phi: Tensor) -> Tensor:
    return torch.stack((theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()), -1)


def _numbers(body: str, key: str) -> list[float]:
    entry = re.search(rf"^ *{key}: *(.*)$", body, re.M)
    if entry is None:
        raise ValueError(f"{key} is missing")
    return [float(x) for x in entry.group(1).split()]


def _check_range(path: str | Path, micro: np.ndarray, low: float, high: float) -> None:
    if not ((micro >= low) & (micro <= high)).all():
        raise ValueError(f"covers {low * 1e3:.4g} to {high * 1e3:.4g} nm; asked for {micro * 1e3} nm")


def _sellmeier(x: np.ndarray, c: list[float], *, squared: bool) -> np.ndarray:
    pairs = zip(c[1::2], c[2::2], strict=True)
    return 1 + c[0] + sum((b * x**2 / (x**2 - (r**2 if squared else r)) for b, r in pairs), np.zeros_like(x))


def _general(x: np.ndarray, c: list[float]) -> np.ndarray:
    total = c[0] + np.zeros_like(x)
    for a, p, b, q in zip(c[1:9:4], c[2:9:4], c[3:9:4], c[4:9:4], strict=True):
        total = total + a * x**p / (x**2 - b**q)
    return total + sum((a * x**p for a, p in zip(c[9::2], c[10::2], strict=True)), np.zeros_like(x))


_FORMULAS = {
    "formula 1": lambda x, c: _sellmeier(x, c, squared=True),
    "formula 2": lambda x, c: _sellmeier(x, c, squared=False),
    "formula 4": _general,
}
