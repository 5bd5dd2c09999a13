"""Rest or steady sliding: chosen once, by whether a friction law has a state."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import friction_law, friction_laws, load_fault
from quakedesign.fault.equilibrium import AT_REST, STEADY_SLIDING, by_equilibrium
from quakedesign.fault.friction.rate_and_state import RateAndStateAging
from quakedesign.fault.friction.weakening import Weakening

REAL, PATCH = load_fault("real-fault"), load_fault("crustal-patch")
which = by_equilibrium(rest=lambda subject, more="": f"rest{more}", sliding=lambda subject, more="": f"sliding{more}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ageing(RateAndStateAging):
    """A user's law that derives from one with a state."""

    name: ClassVar[str] = "ageing"


def test_rate_and_state_friction_slides_and_weakening_rests():
    laws = friction_laws().values()
    assert {law.equilibrium for law in laws if issubclass(law, Weakening)} == {AT_REST}
    assert {law.name for law in laws if law.equilibrium is STEADY_SLIDING} == {
        "rate-and-state-aging",
        "rate-and-state-slip",
        "regularised-rate-and-state",
    }
    assert Ageing.equilibrium is STEADY_SLIDING


def test_a_function_has_one_implementation_for_each_equilibrium_of_a_fault_or_a_law():
    assert [which(one) for one in (REAL, REAL.friction, type(REAL.friction))] == ["rest"] * 3
    assert [which(one, more="!") for one in (PATCH, PATCH.friction, Ageing)] == ["sliding!"] * 3
    assert which(SimpleNamespace(friction=PATCH.friction), "?") == "sliding?"


def test_what_does_not_apply_is_rejected_with_the_law_and_nothing_else_is():
    REAL.friction.require(ramp=None, plant="printed", purpose="a tide")
    PATCH.friction.require(ramp=0.1, plant=None)
    with pytest.raises(ParameterError, match=r"Received the ramp 0.1 with exponential-slip-weakening, whose"):
        REAL.friction.require(ramp=0.1)
    with pytest.raises(ParameterError, match=r"a tide needs .* Received rate-and-state-aging, with the state theta"):
        PATCH.require_memoryless("a tide")
    with pytest.raises(ParameterError, match=r"which never rests. Received 'printed' with rate-and-state-aging"):
        PATCH.friction.require(plant="printed")


def test_every_message_of_the_tables_can_be_written():
    for law in (friction_law("exponential-slip-weakening"), Ageing):
        for message in law.equilibrium.messages.values():
            assert "{" not in message.format(value=1, law=law.name, states="theta")


def test_of_several_that_do_not_apply_the_first_of_the_table_is_named():
    for given in ({"plant": "printed", "disturbance": 1.0}, {"disturbance": 1.0, "plant": "printed"}):
        with pytest.raises(ParameterError, match="needs the bound of a shear stress, not a disturbance"):
            PATCH.friction.require(**given)
