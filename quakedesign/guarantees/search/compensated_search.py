"""Design of sliding modes in the schemes ``compensated`` and ``stick-slip`` with bounds.

The implicit step of a law is derived from the scheme as a sum of signed powers; then scale, weight and authority are
chosen by their estimated bounds.
"""

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import lru_cache, partial
from itertools import product
from math import inf
from typing import Any

import numpy as np
import sympy as sp

from quakedesign.arguments import checked_dataclass
from quakedesign.cache import search_once
from quakedesign.errors import UnsupportedError, require_known
from quakedesign.exact import LowerBound, UpperBound, fraction_of, to_sympy
from quakedesign.fault.model import require_ordinary
from quakedesign.files import Json
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import PLAIN, ExactSetup, SampledLoop
from quakedesign.guarantees.exact.small_gain import Bounds, sector_is_valid
from quakedesign.guarantees.exact.stick_slip_proof import FaultProof, StickSlipProof
from quakedesign.guarantees.exact.stick_slip_set import SampledStickSlip
from quakedesign.guarantees.exact.tracking_proof import TrackingProof, guarantee
from quakedesign.guarantees.search.float_bounds import BoundsEstimate, distance, estimated, spectral_radius
from quakedesign.guarantees.search.linear_design import (
    MOST_DELAY,
    OBJECTIVES,
    Closest,
    LawSearch,
    Longest,
    best_guarantee,
    search_near,
    unpredictable,
)
from quakedesign.guarantees.search.stick_slip_design import design_stick_slip
from quakedesign.laws import Controller, ImplicitStep, Power, Sampling, SlidingMode
from quakedesign.laws import compensated as compensated_law
from quakedesign.laws.cta import ContinuousTwisting
from quakedesign.laws.dia import DiscontinuousIntegral
from quakedesign.laws.stick_slip_law import StickSlipLaw
from quakedesign.loop import discrete_law
from quakedesign.loop.discrete_law import DiscreteLaw
from quakedesign.loop.schemes.compensated import Compensated
from quakedesign.loop.schemes.implicit import end_rate, end_slip
from quakedesign.plant.fault_plant import FaultPlant
from quakedesign.symbolic import SignedPower

# ----------------------------------------------------------------------
# The implicit step of a law as a sum of signed powers, derived from the expression that the scheme evaluates.

_NAMES = {end_slip: "slip", end_rate: "rate"}
_DIGITS = 60
_MOST_DENOMINATOR = 10**18  # of a gain that is recovered from a power of itself
_WIDTH = Fraction(1, 10**40)  # relative width of intervals around irrational numbers


def implicit_pull(controller: Controller, step: Fraction, authority: Fraction) -> tuple[Power, ...]:
    """Function q of the implicit equation w = e2 − q(e1 + T_s·w, w) of the scheme ``compensated``.

    Parameters
    ----------
    controller : Controller
    step, authority : Fraction
        T_s [s], B0 [m²/kg].

    Raises
    ------
    UnsupportedError
        For a law with a feed-forward, or whose pressure is not a non-increasing sum of signed powers of the errors.
    """
    pull, feed_forward, _ = _derived(DiscreteLaw.of(controller, 0.0))
    if feed_forward != 0:
        raise UnsupportedError("an implicit step has no guarantee with a feed-forward. Use feedforward none.")
    numbers = {discrete_law.step: to_sympy(step), discrete_law.authority: to_sympy(authority)}
    return _terms(-pull.xreplace(numbers))


@lru_cache(maxsize=256)
def _derived(law: DiscreteLaw) -> tuple[sp.Expr, ...]:
    """Implicit step of given gains, cached for all T_s and B0."""
    return Compensated.derive(law)


def _terms(expression: sp.Expr) -> tuple[Power, ...]:
    """Terms of a non-decreasing expression."""
    return tuple(_term(part) for part in sp.Add.make_args(sp.expand_mul(expression)))


def _term(expression: sp.Expr) -> Power:
    factor, core = expression.as_independent(end_slip, end_rate, as_Add=False)
    if factor.is_nonnegative and core in _NAMES:
        return Power(factor=_enclosed(factor), exponent=Fraction(1), argument=_NAMES[core])
    if factor.is_nonnegative and isinstance(core, SignedPower) and core.args[1].is_Rational:
        inner = _NAMES.get(core.args[0]) or _terms(core.args[0])
        return Power(factor=_enclosed(factor), exponent=fraction_of(core.args[1]), argument=inner)
    raise UnsupportedError(
        "a guarantee of an implicit step needs a pressure that is a sum of signed powers with negative factors. "
        f"Received the term {expression}. Use another law."
    )


def _enclosed(value: sp.Expr) -> tuple[Fraction, Fraction]:
    """Rational ends of an interval around a number; equal for a rational."""
    if value.is_Rational:
        return fraction_of(value), fraction_of(value)
    near = fraction_of(sp.Rational(str(value.evalf(_DIGITS))))
    return near * (1 - _WIDTH), near * (1 + _WIDTH)


# ----------------------------------------------------------------------
# A sliding mode in the scheme ``compensated``: scale, weight and authority chosen by estimated bounds.

GUARANTEED = "compensated"
STICK_SLIP = "stick-slip"  # the scheme for the stick–slip plant
_NAMED = ("weight", "slip_weight", "rest_slip", "authority")  # settings other than the limit at rest
WEIGHTS = tuple(Fraction(k, 20) for k in range(2, 11))
_RATIOS = tuple(Fraction(k, 20) for k in range(17, 22))  # ratios of B0 to the midpoint of the input gain
_LARGEST_RATIO = Fraction(5, 4)  # largest peak of `tracking` over the smallest
_SLOPES = tuple(Fraction(v) for v in ("1", "0.99", "0.97", "0.93", "0.88", "0.8", "0.7", "0.6"))
_REMAINDERS = tuple(Fraction(v) for v in ("0", "0.02", "0.1"))  # shares of a deadbeat slip-rate error
_NEARLY = 2  # leading entries of _SLOPES that count as nearly deadbeat in the choice of λ
_MARGIN = Fraction(21, 20)
_DEADBEAT = ImplicitStep(pull=(Power(factor=(Fraction(1), Fraction(1)), exponent=Fraction(0), argument="slip"),))
# initial (weight, B0 divided by the midpoint of the input gain); both starts are tried in turn
_STARTS = (0.2, 0.75), (0.35, 1.0)
_BESIDE = 0.2, 3.0  # range of B0 over the midpoint
_EVALUATIONS, _NEAR_ENOUGH, _WORST = 60, 0.9, 9.0
_ROOTS = tuple(Fraction(f"{10 ** (k / 24):.1e}") for k in range(-48, 73))  # ρ of λ = ρ⁶


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Compensation:
    """A sliding mode in a scheme with a disturbance estimate, with its guarantee.

    Attributes
    ----------
    controller : SlidingMode
        A sampled law, see its `sampling`.
    proof : FaultProof or NoProof
        In the scheme ``compensated``, or on the stick–slip plant in ``stick-slip``.
    """

    controller: SlidingMode
    proof: FaultProof | NoProof

    @property
    def without_stick(self) -> TrackingProof | NoProof:
        """Guarantee in the scheme ``compensated``."""
        assert isinstance(self.proof, TrackingProof | NoProof)
        return self.proof

    @property
    def weight(self) -> Fraction:
        """Number a of the scheme [-]."""
        return _settings(self.controller)["weight"]

    @property
    def authority(self) -> Fraction:
        """B0 of the scheme [m²/kg]."""
        return _settings(self.controller)["authority"]

    @property
    def limited(self) -> SlidingMode:
        """The controller with the anti-windup limit of its guarantee, if it has one."""
        limit, sampling = getattr(self.proof, "rest_limit", None), self.controller.sampling
        if limit is None or sampling is None:
            return self.controller
        settings = ((part.name, getattr(limit, part.name)) for part in fields(limit))
        more = tuple((f"rest_{name}", value) for name, value in settings if value is not None)
        return replace(self.controller, sampling=replace(sampling, settings=(*sampling.settings, *more)))

    def sentence(self) -> str:
        """Settings and solution of the implicit step, as text."""
        law = self.controller
        gains = ", ".join(f"{name} = {float(v):.6g}" for name, v in law.gains.items())
        numbers = _settings(law)
        settings = f"weight {float(self.weight):g} and B0 = {float(self.authority):.4g} m²/kg"
        if "slip_weight" in numbers:
            settings = f"slip weight {float(numbers['slip_weight']):g}, {settings}"
        return (
            f"{law.title} with {gains}, λ = {float(law.scale):.4g} and the divisor {float(law.divisor):.6g} m²/kg, in "
            f"the scheme {self._scheme} with {settings}{self._end()}"
        )

    @property
    def deadbeat(self) -> bool:
        """Whether the implicit step ends at e1 + T_s·w = 0 within the proved errors."""
        implicit_step = self.proof.implicit_step if self.proof.available else None
        return implicit_step is not None and set(implicit_step.slopes) == {1} and not implicit_step.remainder

    @property
    def _scheme(self) -> str:
        return self.controller.sampling.scheme if self.controller.sampling else GUARANTEED

    def _end(self) -> str:
        implicit_step = self.proof.implicit_step if self.proof.available else None
        if implicit_step is None:
            return ""
        low, high = (LowerBound(implicit_step.slopes[0]), UpperBound(implicit_step.slopes[1]))
        if self.deadbeat:
            deadbeat = "; within the proved errors its implicit step is deadbeat, e1 + T_s·w = 0"
            return f"{deadbeat}: its pressures are those of every law with a deadbeat step"
        return (
            f"; within the proved errors its implicit step ends within "
            f"{UpperBound(implicit_step.remainder):.2g} m/s of w = -γ·e1/T_s, with γ from {low:.3g} to {high:.3g}"
        )

    def to_dict(self) -> Json:
        """Exact numbers as strings."""
        law = self.controller
        return {
            "scheme": self._scheme,
            "gains": {name: str(v) for name, v in law.gains.items()},
            "scale": str(law.scale),
            "divisor": str(law.divisor),
            **{name: str(value) for name, value in _settings(law).items() if name in _NAMED},
        }


def compensated(
    task: FaultPlant,
    controller: SlidingMode,
    weight: Fraction,
    authority: Fraction,
    step: Fraction,
    setup: ExactSetup = PLAIN,
) -> TrackingProof | NoProof:
    """Guarantee of given settings with the narrowest provable sector of the implicit step.

    Raises
    ------
    ParameterError
        For a weight outside (0, 1], an authority or T_s that is not positive, or another time that is negative.
    """
    try:
        pull = implicit_pull(controller, step, authority)
    except UnsupportedError as error:
        return NoProof(reason=str(error))
    sampled_loop = _sampled(ImplicitStep(pull=pull), weight, authority, step, setup)
    first = guarantee(task, sampled_loop)
    if first.available:
        return first
    deadbeat = estimated(task, sampled_loop)
    if deadbeat is None or not deadbeat.bounds.available:
        return best_guarantee(task, sampled_loop)
    size = deadbeat.bounds.slip_rate_error
    for share, slope in product(_REMAINDERS, _SLOPES):
        implicit_step = ImplicitStep(pull=pull, slopes=(slope, Fraction(1)), remainder=share * size)
        wider = replace(sampled_loop, law=replace(sampled_loop.law, implicit_step=implicit_step))
        near = estimated(task, wider)
        if near is None or not near.bounds.available:
            continue
        errors = near.bounds.slip_error + sampled_loop.slip_noise, near.bounds.slip_rate_error + sampled_loop.rate_noise
        within = sector_is_valid(implicit_step, step, *errors)
        proof = guarantee(task, wider) if within else None
        if proof is not None and proof.available:
            return proof
    return best_guarantee(task, sampled_loop)


def design_compensated(
    task: FaultPlant,
    controller: SlidingMode,
    step: Fraction,
    *,
    objective: str = "tracking",
    weights: tuple[Fraction, ...] = WEIGHTS,
    setup: ExactSetup = PLAIN,
) -> Compensation:
    """Weight, authority and scale of a sliding mode, chosen by estimated bounds.

    Where the set-valued sign of the slip error contains the solution, the step is deadbeat, e1 + T_s·w = 0, for any
    gains. So weight and authority are chosen for the deadbeat step, on a grid of `weights`. ``peak``: the smallest
    estimated slip-rate error. ``tracking``: the smallest slip error under a drifting disturbance, among laws whose
    estimated slip-rate error is at most 1.25 times the smallest. λ = ρ⁶ is then the smallest tried scale for which the
    step is nearly deadbeat for errors up to 1.05 times the estimated ones.
    """
    require_ordinary(step=step)
    return _made(task, controller, step, _deadbeat(task, step, objective, weights, setup=setup), setup)


def _made(
    task: FaultPlant,
    controller: SlidingMode,
    step: Fraction,
    chosen: tuple[Fraction, Fraction, tuple[Fraction, Fraction] | None],
    setup: ExactSetup,
) -> Compensation:
    """Controller with a weight, B0 and the smallest λ for given errors, and its guarantee."""
    weight, authority, errors = chosen
    settings = ("weight", weight), ("authority", authority)
    sampling = Sampling(step=step, scheme=GUARANTEED, settings=settings, **setup.path)
    law = replace(controller, gains=dict(controller.gains), sampling=sampling)
    try:
        if errors is not None:
            law = law.scaled(_scale(law, authority, step, errors))
    except UnsupportedError as error:
        return Compensation(controller=law, proof=NoProof(reason=str(error)))
    return Compensation(controller=law, proof=compensated(task, law, weight, authority, step, setup=setup))


@dataclass(frozen=True, slots=True)
class Deadbeat(LawSearch):
    """Sliding modes in the scheme ``compensated``; numbers: weight, B0 over the midpoint."""

    controller: SlidingMode

    def closest(
        self, task: FaultPlant, step: Fraction, near: np.ndarray | None, setup: ExactSetup = PLAIN
    ) -> Closest | NoProof:
        """Weight and B0 with which a deadbeat step comes closest to a guarantee; they do not depend on the gains."""
        if (none := unpredictable(task, step)) is not None:
            return none
        if setup.delay > MOST_DELAY * step:
            return NoProof(reason=f"the delay is longer than {MOST_DELAY} periods")

        def cost(x: np.ndarray) -> float:
            if not (0 < x[0] <= 1 and _BESIDE[0] <= x[1] <= _BESIDE[1]):
                return 2 * _WORST
            sampled_loop = self.sampled_loop(task, x, step, setup=setup)
            value = distance(task, sampled_loop)[0]
            return value if value < _WORST else _WORST + min(spectral_radius(sampled_loop.loop(task)), 1.0)

        problem = "nearly deadbeat", task, step, setup
        least, x = inf, np.array(_STARTS[0])
        for start in _STARTS if near is None else (near,):
            minimum = search_near(problem, cost, start, enough=_NEAR_ENOUGH, evaluations=_EVALUATIONS)
            least, x = min((least, x), minimum, key=lambda reached: reached[0])
            if least < _NEAR_ENOUGH:
                break
        return Closest(least, x, self.sampled_loop(task, x, step, setup=setup))

    def sampled_loop(
        self, task: FaultPlant, numbers: np.ndarray, step: Fraction, setup: ExactSetup = PLAIN
    ) -> SampledLoop:
        """Loop with a deadbeat step, for any gains."""
        return _sampled(_DEADBEAT, *_settled(task, numbers), step, setup)

    def proved(self, task: FaultPlant, candidate: Closest) -> TrackingProof | NoProof:
        """Proof for the smallest tried λ for which the step is nearly deadbeat."""
        return self.made(
            task, candidate.sampled_loop.step, candidate.numbers, setup=candidate.sampled_loop.setup
        ).without_stick

    def made(self, task: FaultPlant, step: Fraction, numbers: np.ndarray, setup: ExactSetup = PLAIN) -> Compensation:
        """Controller with these numbers, and its guarantee."""
        (weight, authority), sampled_loop = _settled(task, numbers), self.sampled_loop(task, numbers, step, setup=setup)
        bounds = distance(task, sampled_loop)[1]
        noise = setup.slip_noise, setup.rate_noise
        errors = None if bounds is None else (bounds.slip_error + noise[0], bounds.slip_rate_error + noise[1])
        return _made(task, self.controller, step, (weight, authority, errors), setup)

    def low_pressure_loop(self, task: FaultPlant, step: Fraction, setup: ExactSetup = PLAIN) -> SampledLoop | None:
        """Loop with the smallest estimated slip-rate error; None if no deadbeat step has estimated bounds."""
        weight, authority, errors = _deadbeat(task, step, "peak", WEIGHTS, setup=setup)
        law = _made(task, self.controller, step, (weight, authority, errors), setup).controller
        implicit_step = ImplicitStep(pull=implicit_pull(law, step, authority))
        return None if errors is None else _sampled(implicit_step, weight, authority, step, setup)

    def design_near_longer_step(
        self, task: FaultPlant, step: Fraction, longest: Longest | None, setup: ExactSetup = PLAIN
    ) -> Compensation | None:
        """Design at T_s [s] near the law for the longest T_s; None for a longer T_s or without a proof."""
        if longest is None or longest.guarantee.sampled_loop.step < step:
            return None
        near = self.closest(task, step, longest.numbers, setup=setup)
        made = None if isinstance(near, NoProof) else self.made(task, step, near.numbers, setup=setup)
        return made if made is not None and made.proof.available else None

    def at(self, task: FaultPlant, longest: Longest, objective: str = "peak") -> Compensation:
        """Design at the longest T_s with a guarantee; if it has no proof, the law found by the search for this T_s."""
        sampled_loop = longest.guarantee.sampled_loop
        made = design_compensated(
            task, self.controller, sampled_loop.step, objective=objective, setup=sampled_loop.setup
        )
        if made.proof.available:
            return made
        return self.made(task, sampled_loop.step, longest.numbers, setup=sampled_loop.setup)


def _settled(task: FaultPlant, numbers: np.ndarray) -> tuple[Fraction, Fraction]:
    """Weight and B0 in few digits."""
    return Fraction(f"{numbers[0]:.3g}"), _short(Fraction(float(numbers[1])) * task.model.gain)


def recovered(proof: TrackingProof | StickSlipProof) -> Compensation:
    """Recover the sliding mode (2-CTA or 2-DIA) from the implicit step in a certificate.

    The law with these gains must be exactly that of the guarantee.

    Raises
    ------
    UnsupportedError
        When the step belongs to another law, or the gains for λ = 1 are not rational.
    """
    if isinstance(proof, StickSlipProof):
        again = _sticking(proof)
        if again is not None:
            return again
        raise UnsupportedError(_NOT_RECOVERED)
    sampled_loop, law, implicit_step = proof.sampled_loop, proof.sampled_loop.law, proof.sampled_loop.law.implicit_step
    if implicit_step is not None and len(law.measured) == 3 and law.feedback[2] > 0 and 0 < law.measured[2][1] <= 1:
        gain, weight = 1 / law.feedback[2], law.measured[2][1]
        authority = gain / sampled_loop.step
        settings = ("weight", weight), ("authority", authority)
        sampling = Sampling(step=sampled_loop.step, scheme=GUARANTEED, settings=settings, **sampled_loop.path)
        for base in _with_gains(implicit_step.pull, sampled_loop.step, authority):
            controller = replace(base, gains=dict(base.gains), sampling=sampling)
            matches = sorted_terms(implicit_pull(controller, sampled_loop.step, authority)) == sorted_terms(
                implicit_step.pull
            )
            if matches and compensated_law(implicit_step, weight, gain) == law:
                return Compensation(controller=controller, proof=proof)
    raise UnsupportedError(_NOT_RECOVERED)


_NOT_RECOVERED = (
    "gains can be recovered only for a 2-CTA or 2-DIA in the scheme compensated or stick-slip. Received a "
    "certificate of another law. Use the controller of its design, or its gains, scale and settings in that scheme."
)


def _sticking(proof: StickSlipProof) -> Compensation | None:
    """Sliding mode recovered from a certificate on the stick–slip plant; None if it is not a 2-CTA or 2-DIA."""
    sampled_loop, law = proof.sampled_loop, proof.sampled_loop.law
    authority = 1 / (sampled_loop.step * law.target_gain)
    for base in _with_gains(law.pull, sampled_loop.step, authority) if law.pull else ():
        controller = sticking_controller(base, sampled_loop)
        if sorted_terms(implicit_pull(controller, sampled_loop.step, authority)) == sorted_terms(law.pull):
            return Compensation(controller=controller, proof=proof)
    return None


def sticking_controller(controller: SlidingMode, sampled_loop: SampledStickSlip) -> SlidingMode:
    """Sliding mode in the scheme ``stick-slip`` with the disturbance estimator of a law."""
    law, step = sampled_loop.law, sampled_loop.step
    settings = {
        "authority": 1 / (step * law.target_gain),
        "weight": law.level_gain / law.target_gain,
        "slip_weight": law.slip_gain * step / law.target_gain,
        "rest_slip": law.rest_slip,
    }
    sampling = Sampling(step=step, scheme=STICK_SLIP, settings=tuple(settings.items()))
    return replace(controller, gains=dict(controller.gains), sampling=sampling)


def sticking_loop(controller: SlidingMode, slip_noise: Fraction = Fraction(0)) -> SampledStickSlip:
    """Sampled law of a sliding mode in the scheme ``stick-slip``; slip_noise [m].

    Raises
    ------
    ParameterError
        For noise of more than half of rest_slip.
    UnsupportedError
        As `implicit_pull`.
    """
    assert controller.sampling is not None
    step, settings = controller.sampling.step, _settings(controller)
    per_rate = 1 / (step * settings["authority"])
    law = StickSlipLaw(
        rate_gain=per_rate,
        target_gain=per_rate,
        return_rate=1 / step,
        level_gain=settings["weight"] * per_rate,
        slip_gain=settings["slip_weight"] * per_rate / step,
        rest_slip=settings["rest_slip"],
        pull=implicit_pull(controller, step, settings["authority"]),
    )
    return SampledStickSlip(law=law, step=step, slip_noise=slip_noise)


def design_sticking(
    task: FaultPlant, controller: SlidingMode, step: Fraction, **options: Any
) -> Compensation | NoProof:
    """Sliding mode with given base gains and a guarantee on the stick–slip plant.

    The disturbance estimator and B0 are those for which a deadbeat step has a guarantee; λ = ρ⁶ is the smallest tried
    scale for which the step is deadbeat in the whole invariant polytope.

    Parameters
    ----------
    task : FaultPlant
    controller : SlidingMode
        Gives the base gains.
    step : Fraction
        T_s [s].
    **options
        As in `design_stick_slip`.
    """
    proof = design_stick_slip(task, step, implicit=True, **options)
    if not isinstance(proof, StickSlipProof):
        return proof
    sampled_loop, claims = proof.sampled_loop, proof.claims
    errors = sampled_loop.errors(task, claims.slip_error, claims.peak_slip_rate)
    authority = 1 / (step * sampled_loop.law.target_gain)
    try:
        scale = _smallest_scale(controller, authority, step, errors, _SLOPES[:1])
    except UnsupportedError as error:
        return NoProof(reason=str(error))
    if scale is None:
        return NoProof(reason="the implicit step is not deadbeat for any tried scale λ")
    law = sticking_controller(controller.scaled(scale), sampled_loop)
    return Compensation(controller=law, proof=replace(proof, sampled_loop=sticking_loop(law, sampled_loop.slip_noise)))


def sorted_terms(terms: tuple[Power, ...]) -> tuple[Power, ...]:
    """Terms of a sum in an order that does not depend on their factors."""
    return tuple(sorted(terms, key=lambda term: (term.exponent, str(term.argument))))


def _with_gains(pull: tuple[Power, ...], step: Fraction, authority: Fraction) -> Iterator[SlidingMode]:
    """Candidate laws with a given implicit step, for λ = 1 and the divisor B0."""
    terms: dict[Any, Power] = {term.exponent: term for term in pull}
    root, jump = terms.get(Fraction(1, 3)), terms.get(Fraction(0))
    if root is not None and jump is not None and len(terms) == len(pull) and not isinstance(root.argument, str):
        inner = {term.argument: term.factor for term in root.argument}
        late = () if isinstance(jump.argument, str) else jump.argument
        fourth = next((term.factor[0] for term in late if term.argument == "rate"), Fraction(0))
        third = _of_few_digits(sum(inner.get("slip", ()), Fraction(0)) / 2, Fraction(2, 3))
        values = third, root.factor[0] / step, jump.factor[0] / step**2, fourth
        yield DiscontinuousIntegral.from_values(tuple(map(str, values)), divisor=authority)
    one = ContinuousTwisting.from_values(("1",) * 4, divisor=authority)
    pull, units = sorted_terms(pull), sorted_terms(implicit_pull(one, step, authority))
    if [(t.exponent, t.argument) for t in units] == [(t.exponent, t.argument) for t in pull]:
        sizes = [t.factor[0] / unit.factor[0] for t, unit in zip(pull, units, strict=True)]
        doubled = {name: replace(one, gains={**one.gains, name: Fraction(2)}) for name in one.gains}
        pulls = {name: sorted_terms(implicit_pull(other, step, authority)) for name, other in doubled.items()}
        gains = {name: sizes[next(i for i, t in enumerate(pulls[name]) if t != units[i])] for name in one.gains}
        yield replace(one, gains=gains)


def _of_few_digits(value: Fraction, power: Fraction) -> Fraction:
    """Rational nearest to a power of a number, with a denominator up to 10¹⁸."""
    near = sp.Pow(to_sympy(value), to_sympy(power)).evalf(_DIGITS)
    return fraction_of(sp.Rational(str(near))).limit_denominator(_MOST_DENOMINATOR)


def _settings(law: SlidingMode) -> dict[str, Fraction]:
    return dict(law.sampling.settings) if law.sampling else {}


@lru_cache(maxsize=64)
def _deadbeat(
    task: FaultPlant, step: Fraction, objective: str, weights: tuple[Fraction, ...], setup: ExactSetup = PLAIN
) -> tuple[Fraction, Fraction, tuple[Fraction, Fraction] | None]:
    """Weight, B0 [m²/kg] and estimated bounds of the measured errors [m], [m/s] of a deadbeat step; None without."""
    require_known(objective, OBJECTIVES, "objective")
    key = "deadbeat", task, step, objective, weights, setup
    search = partial(_deadbeat_search, task, step, objective, weights, setup)
    weight, authority, *errors = map(Fraction, search_once(search, *key))
    return weight, authority, (errors[0], errors[1]) if errors else None


def _deadbeat_search(
    task: FaultPlant, step: Fraction, objective: str, weights: tuple[Fraction, ...], setup: ExactSetup
) -> list[str]:
    """Result of `_deadbeat` as strings."""
    seen = dict[tuple[Fraction, Fraction], BoundsEstimate]()
    for weight, ratio in product(weights, _RATIOS):
        choice = weight, _short(ratio * task.model.gain)
        estimate = estimated(task, _sampled(_DEADBEAT, *choice, step, setup))
        if estimate is not None and estimate.bounds.available:
            seen[choice] = estimate
    if not seen:
        return [str(weights[0]), str(_short(task.model.gain))]
    peaks = {choice: float(_bounds(estimate).slip_rate_error) for choice, estimate in seen.items()}
    least = min(peaks, key=lambda choice: peaks[choice])
    if objective == "tracking":
        allowed = [choice for choice in seen if peaks[choice] <= _LARGEST_RATIO * peaks[least]]
        least = min(allowed, key=lambda choice: seen[choice].drift_gain)
    bounds = _bounds(seen[least])
    slip_noise, rate_noise = setup.slip_noise, setup.rate_noise
    return [str(v) for v in (*least, bounds.slip_error + slip_noise, bounds.slip_rate_error + rate_noise)]


def _scale(controller: SlidingMode, authority: Fraction, step: Fraction, errors: tuple[Fraction, Fraction]) -> Fraction:
    """Smallest tried λ with a nearly deadbeat step for 1.05 times the errors; else the present λ."""
    scale = _smallest_scale(controller, authority, step, errors, _SLOPES[:_NEARLY])
    return controller.scale if scale is None else scale


def _smallest_scale(
    controller: SlidingMode,
    authority: Fraction,
    step: Fraction,
    errors: tuple[Fraction, Fraction],
    slopes: tuple[Fraction, ...],
) -> Fraction | None:
    """Smallest λ of `_ROOTS`⁶ with γ in [slope, 1] at 1.05 times the errors, for the first feasible slope, or None."""
    slip, rate = (_MARGIN * v for v in errors)

    def deadbeat(slope: Fraction, root: Fraction) -> bool:
        pull = implicit_pull(controller.scaled(root**6), step, authority)
        return sector_is_valid(ImplicitStep(pull=pull, slopes=(slope, Fraction(1))), step, slip, rate)

    for slope in slopes:
        index = bisect_left(_ROOTS, True, key=partial(deadbeat, slope))
        if index < len(_ROOTS):
            return _ROOTS[index] ** 6
    return None


def _sampled(
    implicit_step: ImplicitStep, weight: Fraction, authority: Fraction, step: Fraction, setup: ExactSetup
) -> SampledLoop:
    return setup.with_law(compensated_law(implicit_step, weight, step * authority), step)


def _bounds(estimate: BoundsEstimate) -> Bounds:
    assert estimate.bounds.available
    return estimate.bounds


def _short(value: Fraction) -> Fraction:
    return Fraction(f"{float(value):.3e}")
