"""A linear law whose pressure acts at once: the loop as an idealisation in continuous time, without samples."""

from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.loop.held import steady_states
from quakedesign.loop.laws import Matrix, Model, Row, require_sizes
from quakedesign.loop.periodic import PeriodicLoop


@dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousLaw:
    """p = Cz + Dy + R(r, r′) and z′ = Fz + Gy at every time, y = (e1, e2), z from 0, r the reference.

    Attributes
    ----------
    states : tuple of str
        Names of z; their units are the law's own.
    rates : tuple of rows
        F [1/s].
    measured : tuple of rows
        G, two columns: for e1 [m] and e2 [m/s].
    output : tuple of Fraction
        C, so that Cz is in Pa.
    feedback : (Fraction, Fraction)
        D [Pa/m, Pa·s/m].
    of_reference : (Fraction, Fraction)
        R [Pa/m, Pa·s/m], D for feedback of the state in place of the errors.

    Raises
    ------
    ParameterError
        When the sizes do not fit, or there are more than 12 states.
    """

    states: tuple[str, ...]
    rates: Matrix
    measured: Matrix
    output: Row
    feedback: Row
    of_reference: tuple[Fraction, Fraction] = (Fraction(0), Fraction(0))

    def __post_init__(self) -> None:
        require_sizes(self.states, self.rates, self.measured, self.output, self.feedback)


def exact_integrals(gains: tuple[Fraction, ...], *, of_state: bool = False) -> ContinuousLaw:
    """The e-LQR in continuous time: p = −k1e1 − k2e2 − k3ξ1 − k4ξ2, ξ1′ = e1, ξ2′ = ξ1, without unused integrals.

    Parameters
    ----------
    gains : tuple of Fraction
        k1 … k4 [Pa/m, Pa·s/m, Pa/(m s), Pa/(m s²)].
    of_state : bool
        k1 and k2 act on slip and slip rate, as printed, instead of their errors.

    Raises
    ------
    ParameterError
        When there are not four gains.
    """
    if len(gains) != 4:
        raise ParameterError(f"gains of exact_integrals must be four. Received {len(gains)}. Give k1 to k4.")
    k1, k2, k3, k4 = gains
    zero, one = Fraction(0), Fraction(1)
    used = 2 if k4 else 1 if k3 else 0
    return ContinuousLaw(
        states=("xi1", "xi2")[:used],
        rates=tuple(row[:used] for row in ((zero, zero), (one, zero))[:used]),
        measured=((one, zero), (zero, zero))[:used],
        output=(-k3, -k4)[:used],
        feedback=(-k1, -k2),
        of_reference=(-k1, -k2) if of_state else (zero, zero),
    )


def continuous_loop(law: ContinuousLaw, model: Model, authority: Fraction) -> PeriodicLoop:
    """The error loop about p*, with the inputs and outputs of `held_loop`; states e1, e2 and z − z*.

    z* = ζ(p* − R(r, r′)) − ηR(r, r′)′ with Fζ = 0, Cζ = 1, Fη = ζ and Cη = 0, so that Cz* + R(r, r′) = p*. Where R is
    not zero its entries give two inputs more, ``reference_acceleration`` r″ and ``reference_jerk`` r‴, through
    ηR(r, r′)″.

    Parameters
    ----------
    law : ContinuousLaw
    model : Model
        Middle of the ranges.
    authority : Fraction
        b [m²/kg].

    Raises
    ------
    ParameterError
        For a law that leaves an error under a constant p*, or that feeds the reference forward without two integrals.
    """
    zero, one, n = Fraction(0), Fraction(1), 2 + len(law.states)
    push = tuple(authority * v for v in (*law.feedback, *law.output))
    plant = (model.slip, -model.rate, *[zero] * len(law.states))
    pushed = tuple(v + model.gain / authority * p for v, p in zip(plant, push, strict=True))
    own = tuple((*fed, *kept) for fed, kept in zip(law.measured, law.rates, strict=True))
    still = (zero,) * len(law.states)
    steady = steady_states(law.rates, law.output, still, one)
    inputs = {
        "acceleration": tuple(Fraction(i == 1) for i in range(n)),
        "drift": (zero, zero, *(-v / authority for v in steady)),
    }
    for name, fed in zip(("reference_acceleration", "reference_jerk"), law.of_reference, strict=True):
        if fed:
            moving = steady_states(law.rates, law.output, steady, zero)
            inputs[name] = (zero, zero, *(fed * v for v in moving))
    return PeriodicLoop(
        states=("e1", "e2", *law.states),
        flow=((zero, one, *[zero] * len(law.states)), pushed, *own),
        segments=(),
        inputs=inputs,
        outputs={
            "slip_error": tuple(Fraction(i == 0) for i in range(n)),
            "slip_rate_error": tuple(Fraction(i == 1) for i in range(n)),
            "push": push,
        },
    )
