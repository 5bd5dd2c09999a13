"""How fast a fault can slip at most under a given e-LQR: rigorous inputs, exact bounds, superposition."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.bounds import Enclosure, UpperBound
from quakedesign.certificates import Verdict
from quakedesign.certificates.claim import require
from quakedesign.certificates.linear_premises import Sectors, rest_pressure, sectors
from quakedesign.certificates.tracking import needed_inputs, reference_rates
from quakedesign.controllers import Controller
from quakedesign.controllers.elqr import PressureLimits
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.peak import PeakBound
from quakedesign.synthesis.linear.peak_search import find_peak_bound
from quakedesign.synthesis.linear.plant.polytope import ErrorLoop, error_loop

CLASSES = ("amplitude", "rate")
PREMISES = (
    "start at rest: x = 0, integrals 0",
    "friction: any function of slip and slip rate within the bounds and chord slopes of the box, growing with slip "
    "only if the fault's own law does, held at its static value for slip < 0",
    "k, eta, N anywhere in the box but constant",
    "pressure acts at once; limits of the law, if any, lie outside the certified range of p",
    "friction opposes forward motion: the printed plant is continued to negative slip rates (ERRATA 14)",
)
_OUTPUTS = ("slip_error", "slip_rate_error", "pressure_offset")


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedPeaks:
    """Bounds that hold for ever for every fault of the box, every friction law and every disturbance of a class.

    The error loop is linear with time-varying coefficients, so the bounds of its inputs add.

    Attributes
    ----------
    disturbance_class : str
        ``"amplitude"``: every measurable |φ_e| ≤ a; ``"rate"``: also |φ_e′| ≤ ȧ.
    reference_rate : Fraction
        Largest r′ [m/s].
    rest_pressure : (Fraction, Fraction)
        Range of p*(r) [Pa] for every friction law and plant of the box.
    bounds : mapping of (str, str) to PeakBound
        By input and output; none where the input is zero.
    """

    disturbance_class: str
    reference_rate: Fraction
    rest_pressure: tuple[Fraction, Fraction]
    bounds: Mapping[tuple[str, str], PeakBound]

    def total(self, output: str) -> UpperBound:
        """Bound on |x1 − r| [m], |x2 − r′| [m/s] or |p − p*(r)| [Pa], all inputs together."""
        return UpperBound(sum((b.bound for (_, name), b in self.bounds.items() if name == output), Fraction(0)))

    @property
    def peak_slip_rate(self) -> UpperBound:
        """The fault never slips faster than this [m/s]."""
        return UpperBound(self.reference_rate + self.total("slip_rate_error"))

    @property
    def pressure(self) -> Enclosure | None:
        """Range that p never leaves [Pa]; None when the offset from p* was not bounded."""
        if not any(output == "pressure_offset" for _, output in self.bounds):
            return None
        offset = self.total("pressure_offset")
        return Enclosure.of(self.rest_pressure[0] - offset, self.rest_pressure[1] + offset)

    def within(self, limits: PressureLimits | None) -> bool:
        """Whether p provably stays strictly inside limits, so that the loop is the one without them."""
        if limits is None:
            return True
        return self.pressure is not None and limits.lowest < self.pressure.low <= self.pressure.high < limits.highest

    def check(self) -> Verdict:
        """Re-decide every bound in exact arithmetic.

        Raises
        ------
        CertificateError
            When one does not hold.
        """
        for bound in self.bounds.values():
            bound.check()
        return Verdict.PROVED

    def require_cover(self, fault: Fault, controller: Controller) -> None:
        """Refuse bounds that are not about this fault, this controller and every input of the class; all re-derived.

        Raises
        ------
        CertificateError
        """
        needed, loop = sectors(fault), loop_for(fault, controller)
        channels = _channels(fault, controller, needed, self.disturbance_class)
        for output in {output for _, output in self.bounds}:
            there = {name: b for (name, known), b in self.bounds.items() if known == output}
            require(set(there) == set(channels), f"{output} is not bounded for every input.")
            for name, bound in there.items():
                wider = all(bound.inputs.get(n, Fraction(0)) >= v for n, v in channels[name].items())
                same = bound.loop == loop and bound.output == output and set(bound.inputs) == set(channels[name])
                require(same and wider, f"the bound of {output} for {name} is about another loop or smaller inputs.")
        require(self.reference_rate >= reference_rates(fault).first, "the reference is faster.")
        low, high = rest_pressure(fault, (Fraction(0), rational(fault.reference.target_slip)))
        require(
            self.rest_pressure[0] <= low <= high <= self.rest_pressure[1], "the pressure at rest has another range."
        )
        require(self.within(_limits(controller)), "the pressure may reach a limit of the law.")

    def to_dict(self) -> dict[str, Any]:
        """Exact bounds as texts, SI; with the share of every input in the slip-rate error."""
        return {
            "disturbance_class": self.disturbance_class,
            "peak_slip_rate": self.peak_slip_rate.exact,
            **{name: self.total(name).exact for name in _OUTPUTS},
            "pressure": [self.pressure.low.exact, self.pressure.high.exact] if self.pressure else None,
            "parts": {f"{name} {output}": str(b.bound) for (name, output), b in self.bounds.items()},
            "premises": list(PREMISES),
        }


def certified_peaks(
    fault: Fault, controller: Controller, *, disturbance_class: str = "amplitude", outputs: tuple[str, ...] = _OUTPUTS
) -> CertifiedPeaks | None:
    """Certify how far the slip, the slip rate and the pressure can be from where the reference wants them.

    Parameters
    ----------
    fault : Fault
    controller : Controller
        e-LQR, with either feedback.
    disturbance_class : str
        ``"amplitude"`` or ``"rate"``; a and ȧ are those of the fault's disturbance.
    outputs : tuple of str
        Which outputs to bound; ``slip_rate_error`` must be among them for a peak slip rate.

    Returns
    -------
    CertifiedPeaks or None
        None when a bound was not found, or p may reach a limit of the law: undecided.

    Raises
    ------
    UnknownNameError
        For an unknown class.
    ParameterError
        For a law that starts with a pressure other than zero, or friction with a state.
    """
    if disturbance_class not in CLASSES:
        raise UnknownNameError(
            f"disturbance class must be one of {', '.join(CLASSES)}. Received {disturbance_class!r}."
        )
    fault.require_memoryless("a certified peak")
    needed = sectors(fault)
    loop = error_loop(tuple(controller.gains.values()), needed)
    bounds: dict[tuple[str, str], PeakBound] = {}
    for name, inputs in _channels(fault, controller, needed, disturbance_class).items():
        for output in outputs:
            bound = find_peak_bound(loop, inputs, output)
            if bound is None:
                return None
            bounds[name, output] = bound
    found = CertifiedPeaks(
        disturbance_class=disturbance_class,
        reference_rate=reference_rates(fault).first,
        rest_pressure=rest_pressure(fault, (Fraction(0), rational(fault.reference.target_slip))),
        bounds=bounds,
    )
    return found if found.within(_limits(controller)) else None


def _limits(controller: Controller) -> PressureLimits | None:
    return getattr(controller, "limits", None)


def _without_limits(controller: Controller) -> Controller:
    """Return the law as the error loop knows it: linear, starting from p = 0.

    Raises
    ------
    ParameterError
    """
    if getattr(controller, "offset", 0):
        raise ParameterError("a certified peak needs a law that starts with p = 0. Received one with an offset.")
    return replace(controller, limits=None) if _limits(controller) is not None else controller  # type: ignore[call-arg]


def _channels(fault: Fault, controller: Controller, needed: Sectors, kind: str) -> dict[str, dict[str, Fraction]]:
    """Inputs that are bounded apart: the disturbance, and everything that the reference causes."""
    found = needed_inputs(fault, _without_limits(controller), needed, kind == "rate")
    names = {name: "force" if name == "disturbance" else name.removeprefix("reference_") for name in found}
    return {name: dict(zip((names[name], "force_rate"), limits, strict=False)) for name, limits in found.items()}


def loop_for(fault: Fault, controller: Controller) -> ErrorLoop:
    """Error loop of a controller over the sectors of a fault."""
    return error_loop(tuple(controller.gains.values()), sectors(fault))
