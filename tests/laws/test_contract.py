"""What every law must keep, those of the future included, and what one that acts on a fault must keep besides."""

import pickle
from copy import deepcopy
from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pint
import pytest
import sympy as sp
from thinned import few

from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.laws import Law, Signals, SlidingMode, control_law, control_laws, laws, model_of
from quakedesign.laws import law as law_named
from quakedesign.symbolic.casadi_printer import to_numpy

UNITS = pint.UnitRegistry()
SIGNALS = sp.symbols("x1 x2 e1 e2 xi1 xi2", real=True)
AT = (0.3, -0.2, 0.11, -0.07, 0.05, -0.4)
SIGNAL_UNITS = ("m", "m/s", "m", "m/s")


OWN = ("own_parts:PID", "own_parts:OwnTwisting")  # a user's


@pytest.fixture(params=[*sorted(laws()), *OWN])
def law(request):
    return law_named(request.param)


@pytest.fixture(params=[*sorted(control_laws()), *OWN])
def acting(request):
    """A law that acts on a fault."""
    return control_law(request.param)


def some_gains(law, number=0):
    return tuple(F(7 + 3 * i + number, 5 + i) for i in range(len(law.gain_units)))


def signals(law):
    return Signals(
        slip=SIGNALS[0],
        slip_rate=SIGNALS[1],
        slip_error=SIGNALS[2],
        slip_rate_error=SIGNALS[3],
        integrals=SIGNALS[4 : 4 + len(law.integral_units)],
    )


def outputs(controller, at):
    """Pressure and rates of the law's own states at numbers."""
    given = signals(type(controller))
    expressions = [controller.pressure(given), *controller.integral_rates(given)]
    return np.array([float(v) for v in to_numpy(expressions, dict(zip(SIGNALS, at, strict=True)))])


def test_the_laws_of_the_paper_are_found():
    assert {"cta", "dia", "elqr"} <= set(control_laws())
    assert all(control_law(name).name == name for name in control_laws())
    with pytest.raises(UnknownNameError, match=r"controller must be one of .*cta.*Received 'pid'"):
        control_law("pid")


def test_laws_for_other_plants_are_found_for_proofs_and_kept_from_faults():
    only_proved = set(laws()) - set(control_laws())
    assert {"super-twisting", "cta3"} <= only_proved
    assert set(control_laws()) < set(laws())
    assert all(law_named(name).name == name for name in laws())
    for name in only_proved:
        with pytest.raises(UnknownNameError, match=f"controller must be one of .*Received '{name}'"):
            control_law(name)
    with pytest.raises(UnknownNameError, match=r"controller must be one of .*super-twisting.*Received 'pid'"):
        law_named("pid")


@pytest.mark.parametrize("given", [*laws(), *OWN])
def test_a_claim_can_be_about_a_name_a_class_or_a_bare_loop(given):
    named, model = model_of(given)
    assert (named, model) == model_of(law_named(given))
    assert named == law_named(given).name
    assert model_of(model) == ("custom", model)


def test_it_is_documented(law):
    assert law.title
    assert law.source
    units = (*law.gain_units.values(), *getattr(law, "integral_units", ()))
    assert all(UNITS.Quantity(1, unit).magnitude == 1 for unit in units)


def test_gains_are_exact_and_in_order(law):
    written = tuple(f"{i + 1}.1" for i in range(len(law.gain_units)))
    controller = law.from_values(written)
    assert tuple(controller.gains) == tuple(law.gain_units)
    assert tuple(controller.gains.values()) == tuple(F(10 * i + 11, 10) for i in range(len(written)))
    assert controller == law(gains=dict(reversed(list(zip(law.gain_units, written, strict=True)))))


def test_gains_without_names_are_refused(law):
    for given in (None, 3, ["1"], "1"):
        with pytest.raises(ParameterError, match=rf"gains of {law.name} must be a mapping.*Use from_values"):
            law(gains=given)


def test_it_cannot_be_changed(law):
    controller = law.from_values(some_gains(law))
    with pytest.raises(TypeError):
        controller.gains[next(iter(law.gain_units))] = F(1)
    with pytest.raises(AttributeError):
        controller.gains = {}


def test_it_can_be_sent_to_another_process(law):
    controller = law.from_values(some_gains(law))
    for twin in (pickle.loads(pickle.dumps(controller)), deepcopy(controller), replace(controller)):
        assert twin == controller
        assert type(twin) is law


def test_wrong_gains_are_one_clear_message(law):
    first, *_ = law.gain_units
    right = dict(zip(law.gain_units, some_gains(law), strict=True))
    with pytest.raises(ParameterError, match=rf"{law.name} needs {len(right)} gains \({first}, .*Received 1\."):
        law.from_values((1,))
    with pytest.raises(ParameterError, match=f"{law.name} needs the gains {first}, .*Received .*extra"):
        law(gains=right | {"extra": F(1)})
    with pytest.raises(ParameterError, match="Received none"):
        law(gains={})
    for value in ("nan", float("inf"), "1/0", "five", None):
        with pytest.raises(ParameterError, match=f"gain {first} must be a finite number"):
            law(gains=right | {first: value})


def test_the_law_is_exact(acting):
    controller = acting.from_values(some_gains(acting))
    given = signals(acting)
    expressions = [controller.pressure(given), *controller.integral_rates(given)]
    assert len(expressions) == 1 + len(acting.integral_units)
    assert not any(e.has(sp.Float) for e in expressions)
    assert all(e.free_symbols <= set(SIGNALS) for e in expressions)


def test_at_rest_on_the_reference_it_asks_for_nothing(acting):
    at_rest = dict.fromkeys(SIGNALS, 0)
    given = signals(acting)
    controller = acting.from_values(some_gains(acting))
    assert all(e.subs(at_rest) == 0 for e in (controller.pressure(given), *controller.integral_rates(given)))


def test_it_pushes_back_alike_in_both_directions(acting):
    controller = acting.from_values(some_gains(acting))
    assert outputs(controller, np.negative(AT)) == pytest.approx(-outputs(controller, AT), rel=1e-14)


@few(("metre", "second", "kilogram"), [(100, 1, 1), (1, 60, 1), (1, 1, 1000), (39.37, 1e-3, 2.2)], every=4)
def test_the_units_of_gains_and_states_fit_together(acting, metre, second, kilogram):
    # In other units (1 m is `metre` of them, and so on) the same law gives the same pressure.
    own = pint.UnitRegistry()
    own.define(f"little = meter / {metre}")
    own.define(f"tick = second / {second}")
    own.define(f"pebble = kilogram / {kilogram}")

    def factor(unit):
        size = own.Quantity(1.0, unit).to_base_units()
        powers = {name.strip("[]"): float(n) for name, n in size.dimensionality.items()}
        return metre ** powers.get("length", 0) * second ** powers.get("time", 0) * kilogram ** powers.get("mass", 0)

    gains = [float(g) * factor(u) for g, u in zip(some_gains(acting), acting.gain_units.values(), strict=True)]
    divisor = {"divisor": factor("m^2/kg")} if issubclass(acting, SlidingMode) else {}
    before, after = acting.from_values(some_gains(acting)), acting.from_values(tuple(gains), **divisor)
    units = [*SIGNAL_UNITS, *acting.integral_units, "1"][: len(AT)]
    at = [v * factor(u) for v, u in zip(AT, units, strict=True)]
    expected = [factor("Pa"), *(factor(f"({u})/s") for u in acting.integral_units)]
    assert outputs(after, at) == pytest.approx(outputs(before, AT) * expected, rel=1e-9)


def test_the_loop_has_a_rate_for_every_state(law):
    loop = law.loop_field()
    known = {*loop.states, *loop.gains, *loop.constants, *loop.uncertain, *loop.roots}
    assert set(loop.roots.values()) <= {*loop.gains, *loop.constants}
    assert set(loop.units) <= set(loop.states)
    assert set(loop.field) == set(loop.states)
    assert [str(g) for g in loop.gains] == list(law.gain_units)
    assert set().union(*(rate.free_symbols for rate in loop.field.values())) <= known
    assert loop.domain in ("cells", "reals")
    # x1·x2 of the two heaviest states is a candidate of this degree
    assert loop.degree == sum(sorted(loop.states.values())[-2:])


def test_the_loop_is_odd(law):
    loop = law.loop_field()
    # without perturbation, and the rest states cannot move by themselves
    calm = {u: 0 for u in loop.uncertain if str(u) == "d"}
    mirror = {s: -s for s in loop.states}
    for rate in loop.field.values():
        assert sp.expand(rate.subs(calm).subs(mirror, simultaneous=True) + rate.subs(calm)) == 0


def test_a_suggested_counterexample_names_what_it_must(law):
    loop = law.loop_field()
    uncertain = {str(u): (F(1), F(2)) for u in loop.uncertain}
    found = law.counterexample(dict(zip(law.gain_units, some_gains(law), strict=True)), uncertain)
    assert found is None or set(found) == {"parameters", "point", "weights"}
    assert issubclass(law, Law)


def test_its_text_is_short_and_holds_its_gains(law):
    given = dict(zip(law.gain_units, [*some_gains(law)[1:], F(10) ** 400], strict=True))
    text = repr(law(gains=given))
    assert text.startswith(f"{law.__name__}({next(iter(given))} ≈ ")
    assert "≈ 1.00000e+400" in text
    assert len(text) < 60 + 25 * len(given)
