"""A linear law of samples around slow sliding of a fault with rate-and-state friction, without inertia."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

from quakedesign.loop.held import held_loop
from quakedesign.loop.laws import LinearLaw, Model, unit_row
from quakedesign.loop.periodic import PeriodicLoop

StateLaw = Literal["ageing", "slip"]
_ONE = Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingModel:
    """Middle of what may be about sliding at V, with v = Ve^y, θ = (D/V)e^z, slip error x, pressure error q = p − p*.

    strength·y + weakening·z = −stiffness·x + coefficient·q + e, x′ = V·c·y, z′ = −ρ(c_y·y + c_z·z), ρ = V/D. With all
    slopes 1 this is the linearisation about sliding at V, the same for both laws of the state.

    Attributes
    ----------
    rate : Fraction
        V [m/s].
    state_rate : Fraction
        ρ [1/s].
    slope : Fraction
        c [-], in place of e^y − 1 over y.
    state_slope : Fraction
        c_z [-]: of ageing in place of 1 − e^{−z} over z; of the slip law in place of e^y.
    strength : Fraction
        What a change of y takes, N·a and damping [Pa].
    weakening : Fraction
        N·b [Pa].
    direct, evolution : Fraction
        a and b [-].
    stiffness : Fraction
        [Pa/m].
    coefficient : Fraction
        Friction coefficient [-] of sliding at V.
    state_law : str
        ``"ageing"`` (Dieterich), z′ = −ρ(e^y − e^{−z}), or ``"slip"`` (Ruina), z′ = −ρe^y(y + z).
    """

    rate: Fraction
    state_rate: Fraction
    slope: Fraction
    state_slope: Fraction
    strength: Fraction
    weakening: Fraction
    direct: Fraction
    evolution: Fraction
    stiffness: Fraction
    coefficient: Fraction
    state_law: StateLaw = "ageing"

    @property
    def evolution_slope(self) -> Fraction:
        """c_y [-], which is c of ageing and c_z of the slip law, by which y + z evolves as a whole."""
        return self.slope if self.state_law == "ageing" else self.state_slope


def sliding_loop(
    law: LinearLaw,
    model: SlidingModel,
    step: Fraction,
    *,
    delay: Fraction = Fraction(0),
    lag: Fraction = Fraction(0),
    diffusion: Fraction = Fraction(0),
    noisy: Collection[str] = (),
) -> PeriodicLoop:
    """The error loop about sliding at V, with the order of events and the path of the pressure of `held_loop`.

    States: the slip error x [m] and z [-] in place of e1 and e2; pressures in Pa. Inputs: ``stress`` e [Pa], ``rate`` f
    [-] in x′ = V(cy + f) and, of ageing, in z′ = −ρ(cy + c_z·z + f), ``state`` h [-] in z′ = … − ρh, the ``drift``
    dp*/dt [Pa/s], and ``reference``, by how much of V the reference is faster [-], in x′ = … − V·it.
    Outputs: ``slip_error`` x [m], ``log_rate`` y, ``log_state`` z, ``ageing`` c_y·y + c_z·z, ``strength`` a·y + b·z,
    ``push`` q [Pa], ``asked`` [Pa], what arrived at the valve less what p* needs, and with a layer ``left_out`` [Pa].
    Those of y and q come without what e and what the layer leaves out add to them at once (`at_once`).

    Raises
    ------
    ParameterError
        As `held_loop`.
    """
    plain = Model(slip=Fraction(0), rate=Fraction(0), gain=_ONE)
    loop = held_loop(law, plain, _ONE, step, delay=delay, lag=lag, diffusion=diffusion, noisy=noisy)
    size = len(loop.states)
    push = loop.outputs["push"]
    y = [model.coefficient * v / model.strength for v in push]
    y[0] -= model.stiffness / model.strength
    y[1] -= model.weakening / model.strength
    z = unit_row(size, {1: _ONE})
    ageing = tuple(model.evolution_slope * a + model.state_slope * b for a, b in zip(y, z, strict=True))
    moving = model.rate * model.slope
    flow = (tuple(moving * v for v in y), tuple(-model.state_rate * v for v in ageing), *loop.flow[2:])
    aged = model.state_rate * model.evolution_slope
    by_stress = unit_row(size, {0: moving / model.strength, 1: -aged / model.strength})
    by_rate = {0: model.rate} | ({1: -model.state_rate} if model.state_law == "ageing" else {})
    by_pressure = tuple(model.coefficient * v for v in by_stress)
    left_out = {"left_out": row} if (row := loop.outputs.get("left_out")) else {}
    return replace(
        loop,
        flow=flow,
        inputs={
            "stress": by_stress,
            "rate": unit_row(size, by_rate),
            "state": unit_row(size, {1: -model.state_rate}),
            "drift": loop.inputs["drift"],
            "reference": unit_row(size, {0: -model.rate}),
        },
        outputs={
            "slip_error": unit_row(size, {0: _ONE}),
            "log_rate": tuple(y),
            "log_state": z,
            "ageing": ageing,
            "strength": tuple(model.direct * a + model.evolution * b for a, b in zip(y, z, strict=True)),
            "push": push,
            "asked": loop.outputs.get("asked", push),
            **left_out,
        },
        fading={name: replace(fading, entry=by_pressure) for name, fading in loop.fading.items()},
    )


def at_once(model: SlidingModel) -> dict[tuple[str, str], Fraction]:
    """What an input of size 1 adds to an output at the same instant, by (output, input)."""
    heard = {"log_rate": _ONE, "ageing": model.evolution_slope, "strength": model.direct}
    sizes = {"stress": 1 / model.strength, "left_out": model.coefficient / model.strength}
    return {(output, name): share * size for output, share in heard.items() for name, size in sizes.items()}
