"""Limits of a pump that are never reached, in the package; the other checker's are beside its reading."""

import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.guarantees import NoProof, guarantee
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.lqg import family_of
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov.exact.claim import Verdict

STORED = Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_real-fault.json"


def stored(**changes):
    known = parse_guarantee(STORED.read_text())
    return replace(known, sampled_loop=replace(known.sampled_loop, **changes))


@pytest.mark.parametrize(("least", "largest"), [("1", "2"), ("-2", "-1"), ("0", "0"), ("1/1000000000", "5")])
def test_nothing_is_between_the_limits_of_a_pump(least, largest):
    with pytest.raises(ParameterError, match=r"least pressure of a pump must be 0 or less, .* and they must differ"):
        Pump(least=F(least), largest=F(largest))


def test_a_pump_has_both_limits_or_none():
    assert Pump().limits is None
    for name in ("least", "largest"):
        with pytest.raises(ParameterError, match=f"Received the {name} pressure alone"):
            Pump(**{name: F(0)})


@pytest.mark.parametrize(("name", "off"), [("least", 1), ("largest", -1)])
def test_a_claim_may_touch_a_limit_and_not_pass_it(name, off):
    low, high = stored().claims.pressures[0]
    tight = Pump(least=F(low), largest=F(high))
    proved = stored(pump=tight)
    assert proved.check() is Verdict.PROVED
    assert "whose limits are never reached, for every" in proved.sentence()
    narrow = replace(tight, **{name: getattr(tight, name) + F(off, 10**9)})
    assert stored(pump=narrow).check() is Verdict.UNDECIDED
    found = guarantee(proved.task, replace(proved.sampled_loop, pump=narrow))
    assert isinstance(found, NoProof)
    assert found.reason.startswith("pressures from -14.3 MPa to 14.2 MPa may be commanded, but the pump supplies")


def test_behind_a_lag_the_pressure_at_the_valve_counts():
    """Claims of the fault's pressure within the limits, of the valve's beyond them."""
    limits = Pump(least=F(-5), largest=F(5))
    assert not limits.exceeded(LowerBound(F(-5)), UpperBound(F(5)))
    task, around = stored().task, {"lag": F("0.2")}
    law = family_of(task, F("0.184"), "slip-and-rate", ExactSetup(**around)).law([-2.4, -6.0, 0.3])
    lagging = replace(stored(law=law, **around), varying_gain=None)
    found = guarantee(task, lagging.sampled_loop)
    (_, fault), (_, valve) = found.claims.pressures
    assert fault < valve
    for most, verdict in ((valve, Verdict.PROVED), ((valve + fault) / 2, Verdict.UNDECIDED)):
        pumped = replace(found.sampled_loop, pump=Pump(least=-10 * valve, largest=F(most)))
        assert replace(found, sampled_loop=pumped).check() is verdict
    pumped = replace(found, sampled_loop=replace(found.sampled_loop, pump=Pump(least=-10 * valve, largest=10 * valve)))
    raw = json.loads(guarantee_text(pumped))
    assert parse_guarantee(json.dumps(raw)) == pumped
    for name in ("least_asked", "largest_asked"):
        del raw["claims"][name]
    with pytest.raises(CertificateError, match="a pump before a lag or diffusion path needs claims on its pressure"):
        parse_guarantee(json.dumps(raw))


@pytest.mark.parametrize(("rate", "slow"), [("2e5", True), ("1e9", False)])
def test_a_pump_is_blamed_for_what_it_does_not_do_within_a_whole_period(rate, slow):
    """From one sample to the next the loop asks for some MPa; 0.2 MPa/s for T_s = 184 ms makes 37 kPa of them."""
    known = stored()
    found = guarantee(known.task, replace(known.sampled_loop, pump=Pump(rate=F(rate))))
    assert isinstance(found, NoProof) is slow
    if slow:
        step, said = known.sampled_loop.step, found.reason
        assert said.endswith(f"which a pump of 200 kPa/s cannot complete in {LowerBound(step).quantity('s')}")
