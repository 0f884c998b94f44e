"""Material parameters: domains, storage, converters."""

import math

import pytest
import torch
from torch import nn
from torch.nn.functional import normalize
from torch.testing import assert_close

from torchbrdf import (
    GGX,
    Conductor,
    HeTorrance,
    Interval,
    Lambert,
    OrenNayar,
    QualitativeOrenNayar,
    TorranceSparrow,
    fixed,
    sigma_from_beckmann_alpha,
    sigma_from_degrees,
    sigma_from_mean_slope,
    trainable,
)

UNIT, HALF_LINE = Interval(0.0, 1.0), Interval(0.5, math.inf)
DOMAINS = {"albedo": (0.0, 1.0), "sigma": (0.0, math.pi / 2)}
RULES = {
    "albedo": r"OrenNayar.albedo must lie in [\[(]0, 1[\])]",
    "sigma": r"OrenNayar.sigma must lie in [\[(]0, 1.571[\])] rad",
}


@pytest.mark.parametrize("name", DOMAINS)
class TestDomain:
    @pytest.mark.parametrize("wrap", [fixed, lambda value: value], ids=["fixed", "trained"])
    @pytest.mark.parametrize("value", [-0.1, 1.6, math.nan, math.inf, -math.inf])
    def test_outside_is_refused(self, name, value, wrap):
        with pytest.raises(ValueError, match=rf"{RULES[name]}; 1 of 1 entries do not"):
            OrenNayar(**{name: wrap(value)})

    def test_refused_by_assignment_and_the_old_value_stays(self, name):
        brdf = OrenNayar(**{name: 0.4})
        with pytest.raises(ValueError, match=RULES[name]):
            setattr(brdf, name, 7.0)
        assert_close(getattr(brdf, name), torch.tensor(0.4))

    @pytest.mark.parametrize("end", [0, 1])
    def test_bound_is_for_fixed_only(self, name, end):
        bound = DOMAINS[name][end]
        with pytest.raises(ValueError, match=r"must lie in \(.*\).*hold it there with fixed\(...\)"):
            OrenNayar(**{name: bound})
        with pytest.raises(ValueError, match=r"hold it there with fixed"):
            OrenNayar(**{name: torch.tensor(bound, dtype=torch.float64)})
        held = OrenNayar(**{name: fixed(bound)})
        assert_close(getattr(held, name), torch.tensor(bound), rtol=0, atol=0)

    def test_bad_entries_are_counted_not_dumped(self, name):
        values = torch.full((1000,), 0.5)
        values[3], values[7], values[9] = -1.0, 2.0, math.nan
        with pytest.raises(ValueError, match=r"3 of 1000 entries do not \(min -1, max 2\)") as caught:
            OrenNayar(**{name: values})
        assert len(str(caught.value)) < 200

    def test_raw_is_stored_and_read_constrained(self, name):
        brdf = OrenNayar(**{name: torch.tensor(0.4, dtype=torch.float64)})
        low, high = DOMAINS[name]
        raw = dict(brdf.named_parameters())[f"raw_{name}"]
        assert_close(raw.item(), math.log(0.4 / (high - 0.4)), rtol=1e-14, atol=0)
        for value in (-800.0, -5.0, 3.0, 800.0):
            with torch.no_grad():
                raw.fill_(value)
            assert low <= getattr(brdf, name).item() <= high

    def test_gradient_reaches_the_raw_parameter(self, name):
        brdf = OrenNayar(**{name: torch.tensor(0.4, dtype=torch.float64)})
        (slope,) = torch.autograd.grad(getattr(brdf, name), dict(brdf.named_parameters())[f"raw_{name}"])
        high = DOMAINS[name][1]
        assert_close(slope.item(), 0.4 * (1 - 0.4 / high), rtol=1e-14, atol=0)

    def test_assignment_keeps_what_the_optimizer_holds(self, name):
        brdf = OrenNayar(**{name: 0.4})
        before = dict(brdf.named_parameters())[f"raw_{name}"]
        setattr(brdf, name, torch.tensor(0.6))
        assert dict(brdf.named_parameters())[f"raw_{name}"] is before
        assert_close(getattr(brdf, name), torch.tensor(0.6))
        setattr(brdf, name, torch.tensor([0.2, 0.3]))  # another shape needs another parameter
        assert_close(getattr(brdf, name), torch.tensor([0.2, 0.3]))

    def test_fixing_and_freeing(self, name):
        brdf = OrenNayar(**{name: 0.4})
        setattr(brdf, name, fixed(0.0))
        assert f"raw_{name}" not in dict(brdf.named_parameters())
        assert list(brdf.state_dict()).count(f"fixed_{name}") == 1
        setattr(brdf, name, fixed(0.3))
        assert_close(getattr(brdf, name), torch.tensor(0.3))
        setattr(brdf, name, 0.5)
        assert f"fixed_{name}" not in brdf.state_dict()
        assert_close(getattr(brdf, name), torch.tensor(0.5))

    def test_a_parameter_given_is_a_value(self, name):
        given = nn.Parameter(torch.tensor(0.4))
        brdf = OrenNayar(**{name: given})
        assert set(dict(brdf.named_parameters())) == {"raw_albedo", "raw_sigma"}
        assert_close(getattr(brdf, name), torch.tensor(0.4))

    def test_fixed_does_not_alias_its_tensor(self, name):
        given = torch.tensor([0.2, 0.4])
        brdf = OrenNayar(**{name: fixed(given)})
        given.fill_(0.9)
        assert_close(getattr(brdf, name), torch.tensor([0.2, 0.4]))


@pytest.mark.parametrize("build", [Lambert, QualitativeOrenNayar])
def test_message_names_the_model(build):
    with pytest.raises(ValueError, match=f"^{build.__name__}.albedo must lie in"):
        build(albedo=2.0)


def test_material_reads_back_what_was_given():
    brdf = OrenNayar(albedo=torch.tensor([0.7, 0.2]), sigma=fixed(0.3))
    assert list(brdf.material()) == ["albedo", "sigma"]
    assert_close(brdf.material()["albedo"], torch.tensor([0.7, 0.2]))
    assert_close(brdf.material()["sigma"], torch.tensor(0.3))


@pytest.mark.parametrize(
    ("domain", "value", "raw"),
    [(UNIT, 0.5, 0.0), (UNIT, 0.9, math.log(9.0)), (HALF_LINE, 1.5, 0.0), (HALF_LINE, 0.5 + math.e, 1.0)],
)
def test_interval_coordinates(domain, value, raw):
    value, raw = (torch.tensor(x, dtype=torch.float64) for x in (value, raw))
    assert_close(domain.to_raw(value), raw)
    assert_close(domain.from_raw(raw), value)


def test_interval_messages():
    with pytest.raises(ValueError, match=r"^x must lie in \[0.5, inf\); 1 of 2 entries do not \(min 0.1, max 3\).$"):
        HALF_LINE.check("x", torch.tensor([0.1, 3.0]))
    with pytest.raises(ValueError, match=r"^x must lie in \[0.5, inf\); 1 of 1 entries do not \(none is finite\)"):
        HALF_LINE.check("x", torch.tensor(math.nan))
    UNIT.check("x", torch.tensor([0.0, 1.0]))
    with pytest.raises(ValueError, match=r"^x must lie in \(0, 1\); 2 of 2"):
        UNIT.check("x", torch.tensor([0.0, 1.0]), open_ends=True)


def test_trainable_lists_paths_and_domains():
    brdf = 0.7 * OrenNayar(sigma=fixed(0.2)) + 0.3 * QualitativeOrenNayar()
    found = trainable(brdf)
    assert {name: raw for name, (raw, _) in found.items()} == {
        "weights": "raw_weights",
        "parts.0.albedo": "parts.0.raw_albedo",
        "parts.1.albedo": "parts.1.raw_albedo",
        "parts.1.sigma": "parts.1.raw_sigma",
    }
    domain = found["parts.1.sigma"][1]
    assert (domain.low, domain.high, domain.unit) == (0.0, math.pi / 2, "rad")
    assert set(dict(brdf.named_parameters())) == {raw for raw, _ in found.values()}
    brdf.parts[1].requires_grad_(False)
    assert "parts.1.sigma" not in trainable(brdf)


def mean_slope(sigma):
    """Mean of theta under exp(-theta^2/2 sigma^2) sin(theta), by the trapezoidal rule."""
    theta = torch.linspace(0.0, math.pi / 2, 200_001, dtype=torch.float64)
    weight = (-(theta**2) / (2 * sigma**2)).exp() * theta.sin()
    return (theta * weight).sum().item() / weight.sum().item()


def beckmann_mean_square_slope(alpha):
    """Mean of tan(theta)^2 under Beckmann's exp(-tan^2/alpha^2)/cos^4, weighted by projected area cos."""
    theta = torch.linspace(0.0, math.pi / 2, 200_001, dtype=torch.float64)[:-1]
    tan2 = theta.tan() ** 2
    weight = (-tan2 / alpha**2).exp() / theta.cos() ** 3 * theta.sin()
    return (tan2 * weight).sum().item() / weight.sum().item()


def test_converters():
    assert_close(sigma_from_degrees(40.0), torch.tensor(math.radians(40)))
    assert_close(sigma_from_degrees(torch.tensor([0.0, 90.0])), torch.tensor([0.0, math.pi / 2]))
    # the Gaussian has mean square angle 2 sigma^2 for small sigma; each converter matches its moment to first order
    alpha = 0.02
    assert_close(2 * sigma_from_beckmann_alpha(alpha).item() ** 2, beckmann_mean_square_slope(alpha), rtol=1e-3, atol=0)
    for sigma in (0.01, 0.05):
        assert_close(sigma_from_mean_slope(mean_slope(sigma)).item(), sigma, rtol=1e-3, atol=0)


@pytest.mark.parametrize("convert", [sigma_from_degrees, sigma_from_beckmann_alpha, sigma_from_mean_slope])
def test_converters_keep_dtype(convert, dtype):
    assert convert(torch.tensor(0.3, dtype=dtype)).dtype == dtype
    assert convert(0.3).dtype == convert(1).dtype == torch.float32


def test_half_precision_parameters_are_refused():
    with pytest.raises(TypeError, match=r"OrenNayar.albedo must be float32 or float64; found torch.float16"):
        OrenNayar(albedo=torch.tensor(0.5, dtype=torch.float16))


def test_a_domain_may_end_before_its_coordinate_does():
    """What a formula cannot compute is refused; trained values keep the coordinate they had."""
    domain = Interval(0.0, 2.0, "rad", least=0.1)
    domain.check("x", torch.tensor(0.1), open_ends=True)
    with pytest.raises(ValueError, match=r"x must lie in \[0\.1, 2\] rad; 1 of 1"):
        domain.check("x", torch.tensor(0.0999))
    assert torch.equal(domain.to_raw(torch.tensor(0.5)), Interval(0.0, 2.0).to_raw(torch.tensor(0.5)))


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize(
    ("make", "ends", "beyond"),
    [
        (lambda x: TorranceSparrow(sigma=fixed(x)), [1e-3, math.pi / 2], [0.0, 1e-4]),
        (lambda x: GGX(alpha=0.3, fresnel=Conductor(eta=fixed(x), k=fixed(0.0))), [0.0, 1e-4, 1e3], [-1e-3]),
        (lambda x: GGX(alpha=0.3, fresnel=Conductor(eta=fixed(x), k=fixed(3.0))), [0.0, 1e3], [math.nan]),
        (lambda x: HeTorrance(sigma0=0.1, tau=1.0, wavelength=0.5, eta=fixed(x)), [0.0, 1e3], [-1e-3]),
        (lambda x: HeTorrance(sigma0=0.1, tau=fixed(1.0), wavelength=fixed(x)), [1.0000001e-9, 1e3], [1e-12, 1e-15]),
    ],
    ids=["facets", "transparent", "metal", "waves: index", "waves: length"],
)
@pytest.mark.filterwarnings("ignore:HeTorrance")
def test_the_ends_of_domains_are_computed_and_what_is_beyond_refused(make, ends, beyond, dtype):
    generator = torch.Generator().manual_seed(4)
    up = torch.tensor([0.0, 0.0, 1.0], dtype=dtype)
    light, view = (normalize(torch.randn(500, 3, generator=generator, dtype=dtype), dim=-1) for _ in range(2))
    light[0] = view[0] = up
    view[1] = light[1] * torch.tensor([-1.0, -1.0, 1.0], dtype=dtype)  # the mirror
    for value in ends:
        model = make(torch.tensor(value, dtype=dtype)).to(dtype)
        assert model(up.expand(500, 3), light, view).isfinite().all(), value
    for value in beyond:
        with pytest.raises(ValueError, match=r"must (lie in|be at most)"):
            make(torch.tensor(value, dtype=dtype))
