"""Conditions, inputs and statements of proofs, each at the number that decides and at one beside it."""

import copy
import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import Claims, SampledLoop, TrackingProof, load_guarantee, read_guarantee
from quakedesign.guarantees.exact.guarantee_files import guarantee_document, guarantee_text
from quakedesign.guarantees.exact.plant_loop import LinearPart, MatrixLaw, ResponseBounds
from quakedesign.guarantees.exact.plant_proof import PlantClaims, PlantProof, peaks
from quakedesign.guarantees.exact.sampled_loop import Channel, reference_channels, through_diffusion
from quakedesign.guarantees.exact.sliding_proof import _inside
from quakedesign.laws import ImplicitStep, Power, compensated, summed_integrals
from quakedesign.loop.loop_setup import Pump
from quakedesign.plant import uncertain_plant
from quakedesign.plant.plant_values import ExactSector

FOLDER = Path(__file__).parents[3] / "proofs" / "certificates"
TASK = uncertain_plant(load_fault("real-fault"))
LAW = summed_integrals((F(5), F(3), F(7), F(2)), F(1))
LOOP = SampledLoop(law=LAW, step=F(1))


# ---------------------------------------------------------------- the sampled loop


@pytest.mark.parametrize(
    ("delay", "jitter", "late", "longest"),
    [("0", "0", "0", "1"), ("0.3", "0.01", "0.02", "0.67"), ("1", "0.01", "0.02", "0.94"), ("2.9", "0", "0", "0.1")],
)
def test_a_ramp_ends_before_the_next_sample_and_the_next_change(delay, jitter, late, longest):
    """T less the part of the delay and the errors; T less both errors of two pressures."""
    loop = replace(LOOP, delay=F(delay), jitter=F(jitter), delay_jitter=F(late))
    assert loop.longest_ramp == F(longest)


def test_aperiodic_sampling_accepts_a_pump_without_a_rate_limit_and_no_other():
    limits = {"least": F(-1), "largest": F(1)}
    assert replace(LOOP, longest_step=F(2), pump=Pump(**limits)).slack == 1
    with pytest.raises(ParameterError, match="pump rate limit"):
        replace(LOOP, longest_step=F(2), pump=Pump(**limits, rate=F(1)), ramp=F(1, 10))


@pytest.mark.parametrize("missing", ["diffusion", "longest_step", "root"])
def test_a_law_of_the_reference_has_no_guarantee_with_a_diffusion_path_aperiodic_sampling_or_a_root(missing):
    plain = summed_integrals((F(5), F(3), F(7), F(0)), F(1))
    law = replace(plain, of_reference=((F(1), F(0)),) * (len(plain.states) + 1))
    assert replace(LOOP, law=law).law.of_reference
    sign = Power(factor=(F(1, 3), F(1, 3)), exponent=F(0), argument="slip")
    rooted = compensated(ImplicitStep(pull=(sign,), slopes=(F(0), F(0)), remainder=F(0)), F(1, 2), F(1))
    changed = {
        "diffusion": {"law": law, "diffusion": F(1)},
        "longest_step": {"law": law, "longest_step": F(2)},
        "root": {"law": replace(rooted, of_reference=((F(1), F(0)),) * (len(rooted.states) + 1))},
    }
    with pytest.raises(ParameterError, match="a law that uses slip, slip rate or reference directly"):
        replace(LOOP, **changed[missing])


def test_inputs_beside_the_disturbance_have_the_bounds_of_the_reference():
    rates, jerk = TASK.reference_rates, TASK.reference_jerk
    expected = {
        "reference": (rates[0], {}),
        "reference_rate": (rates[0], {}),
        "reference_acceleration": (rates[1], {}),
        "reference_jerk": (jerk, {}),
        "start": (F(1), {}),
        "late": (F(0), {"stepped": F(1)}),
    }
    found = {
        channel.name: (channel.constant, channel.coefficients) for channel in reference_channels(TASK, set(expected))
    }
    assert found == expected
    assert len({rates[0], rates[1], jerk, F(0)}) == 4
    for name in expected:
        assert [channel.name for channel in reference_channels(TASK, {name})] == [name]


@pytest.mark.parametrize("fades", [True, False])
def test_the_truncation_error_of_a_layer_acts_where_the_pressure_does(fades):
    """As an input of its own where it fades after each step, otherwise within the acceleration."""
    push, slip = {"push": F(1, 3)}, {"slip_error": F(1, 5)}
    given = (("acceleration", F(7), push), ("aged", F(2), push), ("drift", F(1), slip))
    channels = [Channel(name=name, constant=own, coefficients=shares) for name, own, shares in given]
    gains = {("left_out", "left_out"): (F(1),)} if fades else {}
    found = {
        channel.name: (channel.constant, dict(channel.coefficients)) for channel in through_diffusion(channels, gains)
    }
    left = {"left_out": F(1, 3)}
    assert found["acceleration"] == (7, push if fades else push | left)
    assert found["aged"] == (2, push | left)
    assert found["drift"] == (1, slip)
    assert found.get("left_out") == ((0, left) if fades else None)
    assert found["awaited"] == found["awaited_told"] == (0, {"left_out": F(1)})


def test_a_loop_with_a_diffusion_path_has_the_response_of_the_omitted_modes_as_an_input():
    loop = load_guarantee(FOLDER / "guarantee_late_real-fault.json").sampled_loop
    layered = replace(LOOP, diffusion=F(1)).loop(TASK)
    assert "awaited" in {*layered.inputs, *layered.fading}
    assert "awaited_told" in layered.sampled
    assert "awaited" not in {*loop.loop(TASK).inputs}


# ---------------------------------------------------------------- what follows from the claims of tracking

CLAIMS = Claims(
    slip_error=UpperBound(F(1, 10**4)),
    slip_rate_error=UpperBound(F(1, 10**3)),
    peak_slip_rate=UpperBound(F(1, 500)),
    least_pressure=LowerBound(F(-20 * 10**6)),
    largest_pressure=UpperBound(F(15 * 10**6)),
)


@pytest.mark.parametrize(("least", "largest"), [(-20, 15), (-15, 20)])
def test_the_slip_acceleration_is_bounded_by_the_claims(least, largest):
    """|e1″| ≤ |s||e1| + |w||e2| + β1·b|p − p*| + H and what the reference needs."""
    claims = replace(
        CLAIMS, least_pressure=LowerBound(F(least * 10**6)), largest_pressure=UpperBound(F(largest * 10**6))
    )
    low, high = TASK.rest_pressure
    away = max(F(largest * 10**6) - high, low - F(least * 10**6))
    slopes = [max(abs(v) for v in chord) for chord in (TASK.slip_chord, TASK.rate_chord)]
    bound = slopes[0] * F(1, 10**4) + slopes[1] * F(1, 10**3) + TASK.beta[1] * TASK.authority * away
    found = TrackingProof(task=TASK, sampled_loop=LOOP, claims=claims).slip_acceleration
    assert found == bound + TASK.amplitude + TASK.reference_force


def test_the_limit_at_rest_follows_from_the_claims_at_the_valve():
    """Width: twice |p − p*| at the valve, and the motion of the reference during all delays."""
    proof = load_guarantee(FOLDER / "guarantee_no-clock_lab-fault.json")
    errors = {"delay": F(1, 5000), "jitter": F(1, 10**5), "delay_jitter": F(1, 2 * 10**5), "slip_noise": F(1, 10**6)}
    held = replace(proof.sampled_loop, longest_step=F(0), **errors)
    claims = replace(CLAIMS, largest_step=UpperBound(F(10**6)))
    found = TrackingProof(task=proof.task, sampled_loop=held, claims=claims).rest_limit
    rate, (low, high) = proof.task.reference_rates[0], proof.task.rest_pressure
    per_slip = max(abs(v) for v in proof.task.slip_chord) / proof.task.authority
    away = max(15 * 10**6 - high, low + 20 * 10**6)
    exact = {
        "width": 2 * away + per_slip * (held.delay + F(3, 2 * 10**5)) * rate,
        "per_slip": per_slip,
        "resolution": 2 * held.slip_noise + rate * held.step / 100,
        "fastest": 2 * held.slip_noise + F(1, 500) * (held.step + 2 * held.jitter),
    }
    for name, value in exact.items():
        assert value <= getattr(found, name) <= value * F(1002, 1000), name
    assert (found.least, found.largest) == (-20 * 10**6, 15 * 10**6)
    aperiodic = TrackingProof(task=proof.task, sampled_loop=proof.sampled_loop, claims=CLAIMS).rest_limit
    resolution = 2 * proof.sampled_loop.slip_noise + rate * proof.sampled_loop.step / 100
    assert resolution <= aperiodic.resolution <= resolution * F(1002, 1000)
    fastest = 2 * proof.sampled_loop.slip_noise + F(1, 500) * proof.sampled_loop.longest_step
    assert fastest <= aperiodic.fastest <= fastest * F(1002, 1000)


@pytest.mark.parametrize("path", ["lag", "diffusion"])
def test_there_is_no_limit_at_rest_without_a_claim_at_the_valve(path):
    proof = load_guarantee(FOLDER / "guarantee_no-clock_lab-fault.json")
    behind = TrackingProof(
        task=proof.task, sampled_loop=replace(proof.sampled_loop, longest_step=F(0), **{path: F(1)}), claims=CLAIMS
    )
    assert behind.rest_limit is None
    asked = {"least_asked": LowerBound(F(-21 * 10**6)), "largest_asked": UpperBound(F(16 * 10**6))}
    found = replace(behind, claims=replace(CLAIMS, **asked)).rest_limit
    assert (found.least, found.largest) == (-21 * 10**6, 16 * 10**6)
    for name in asked:
        assert len(replace(CLAIMS, **{name: asked[name]}).pressures) == 1


# ---------------------------------------------------------------- the small gain of uncertain plants


def part(*sectors):
    row = (F(1),)
    sectors = tuple(ExactSector(entry=row, row=(F(1), F(0)), **one) for one in sectors)
    none = {"disturbances": (), "loads": (), "noise": (F(0),), "start": (F(0),)}
    return LinearPart(A=(row,), B=(row,), C=(row,), outputs=(row,), sectors=sectors, **none)


def responses(count):
    """Rows: one output, the arguments of the sectors, one control. Each argument is 1 + W/2 of its own input."""
    rows = [F(100), *[F(1)] * count, F(50)]
    gains = tuple((F(0), *(F(i == j, 2) for j in range(count)), F(0)) for i in range(count))
    return ResponseBounds(inputs=gains, sampled=(), start=tuple(rows))


WHOLE, NARROW = {"slopes": (F(-1), F(1))}, {"slopes": (F(1), F(1))}


@pytest.mark.parametrize(
    ("sectors", "inputs", "proved"),
    [
        ([WHOLE], ["2"], False),  # 1 + W/2 = W
        ([WHOLE], ["2.1"], True),
        ([WHOLE | {"within": F("2.05")}], ["2.1"], False),
        ([WHOLE | {"within": F("2.06")}], ["2.1"], True),
        ([NARROW], ["0"], True),
        ([NARROW | {"within": F(1)}], ["0"], False),
        ([WHOLE, NARROW], ["2.1", "0"], True),
        ([WHOLE, WHOLE], ["2.1", "2"], False),
        ([WHOLE, WHOLE], ["2.1", "-1"], False),
        ([{"slopes": (F(0), F(1, 2))}], ["1/2"], True),  # 1/4·(1 + W/2) < W
        ([], [], True),
    ],
)
def test_every_argument_stays_strictly_below_what_is_assumed_of_it(sectors, inputs, proved):
    found = peaks(part(*sectors), responses(len(sectors)), tuple(map(F, inputs)))
    assert found == ((100, 50) if proved else None)


def test_an_input_of_a_sector_without_width_has_no_effect():
    assert peaks(part(NARROW), replace(responses(1), start=(F(100), F(1), F(50)),
                 inputs=((F(7), F(1), F(7)),)), (F(5),)) == (100, 50)  # fmt: skip


def test_a_negative_input_of_a_sector_proves_nothing():
    """With a gain of 2 an argument of 1 − 200 would be below an input of −100."""
    wide = replace(responses(2), inputs=((F(0), F(2), F(0), F(0)), (F(0), F(0), F(1, 2), F(0))))
    assert peaks(part(WHOLE, WHOLE), wide, (F(-100), F(5))) is None


def test_a_claim_may_be_as_large_as_its_bound():
    proof = read_guarantee(PENDULUM)
    bounds = (*proof.claims.outputs, *proof.claims.controls)
    assert proof.follows_from(bounds)
    for i, bound in enumerate(bounds):
        assert not proof.follows_from((*bounds[:i], bound + F(1, 10**9), *bounds[i + 1 :]))


def test_a_statement_about_a_plant_names_nothing_that_is_absent():
    bare = part()
    law = MatrixLaw(step=F(1), delay=F(0), update=(), measured=(), output=((),), feedback=((F(-1),),))
    claims = PlantClaims(outputs=(UpperBound(2),), controls=(UpperBound(0),))
    proof = PlantProof(part=bare, law=law, pieces=1, inputs=(), claims=claims)
    assert proof.sentence() == (
        "on the uncertain plant of the certificate (1 state, 1 control), from rest, with zero-order hold over 1 s, "
        "exact measurements, for all t >= 0: |row 1| <= 2, |row 2| <= 0"
    )
    pushed = replace(bare, disturbances=(((F(1),), F(3)),))
    assert "disturbances of at most 3, exact measurements, for all t" in replace(proof, part=pushed).sentence()


PENDULUM = json.loads((FOLDER / "uncertain_plant_pendulum.json").read_text())


def edited(place, change):
    document = copy.deepcopy(PENDULUM)
    inner = document
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = change(inner[place[-1]])
    return document


@pytest.mark.parametrize(
    ("place", "change", "message"),
    [
        (("claims",), lambda v: v | {"output_3": "1"}, "claims must be"),
        (("inputs",), lambda v: [*v, "1"], "inputs must have an entry for each sector"),
        (("inputs", 0), lambda v: "-1", "must be 0 or more"),
        (("plant", "sectors", 1), lambda v: v | {"entry": ["0"], "row": ["0", "0", "1", "0"]}, "must fit"),
        (("plant", "sectors", 1), lambda v: v | {"entry": ["0", "1", "0"], "row": ["0", "1"]}, "must fit"),
        (("plant", "loads", 0), lambda v: v | {"control": ["1", "0"], "shift": ["0"]}, "must fit"),
        (("plant", "sectors", 0), lambda v: v | {"row": ["1", "0", "1"]}, "must depend on the states alone"),
        (("plant", "loads", 0), lambda v: v | {"rate": "-1/50"}, "a rate of 0 or more"),
    ],
)
def test_a_file_about_a_plant_fits_together(place, change, message):
    with pytest.raises(CertificateError, match=message):
        read_guarantee(edited(place, change))


@pytest.mark.parametrize(
    ("place", "change"),
    [
        (("plant", "loads", 0), lambda v: v | {"rate": "0"}),
        (("plant", "sectors", 1), lambda v: v | {"slopes": ["1/100", "1/100"]}),
    ],
)
def test_a_file_about_a_plant_may_have_a_load_without_rate_and_a_sector_without_width(place, change):
    assert read_guarantee(edited(place, change)).part


# ---------------------------------------------------------------- statements


def test_a_statement_about_the_stick_slip_plant_names_what_it_covers():
    exact = load_guarantee(FOLDER / "stick_slip_real-fault.json")
    noisy = load_guarantee(FOLDER / "stick_slip_noise_real-fault.json")
    free = load_guarantee(FOLDER / "stick_slip_aperiodic_real-fault.json")
    mode = load_guarantee(FOLDER / "stick_slip_cta_real-fault.json")
    assert "zero-order hold over 0.184 s and exact measurements of slip and slip rate" in exact.sentence()
    assert "slip measured within 1 µm and slip rate measured exactly" in noisy.sentence()
    assert "over sampling intervals from 0.092 s to 0.184 s in any order" in free.sentence()
    assert "friction at rest" not in exact.sentence()
    assert "friction at rest up to 2e-05 above friction in slip" in replace(exact, healing=F(2, 10**5)).sentence()
    assert "longest_step" not in exact.to_dict()
    assert free.to_dict()["longest_step"] == "23/125"
    assert (exact.implicit_step, mode.implicit_step.pull) == (None, mode.sampled_loop.law.pull)
    for proof in (exact, noisy):
        assert proof.bounds["slip_error"] == max(proof.claims.slip_behind, proof.claims.slip_ahead)
        assert proof.bounds["slip_rate_error"] == max(proof.claims.peak_slip_rate, proof.task.reference_rates[0])
        assert proof.valve_pressures == (proof.claims.least_pressure, proof.claims.largest_pressure)
    wide = replace(exact, task=replace(exact.task, spreads=(F(0), F(0), F(1, 4))))
    assert "(3.2 kPa of shear)" in wide.sentence()  # 4 kPa / 1.25, for the largest area per mass
    slow = replace(exact, claims=replace(exact.claims, peak_slip_rate=UpperBound(F(1, 10**7))))
    assert slow.bounds["slip_rate_error"] == exact.task.reference_rates[0] > F(1, 10**7)


@pytest.mark.parametrize("healing", [F(-1, 10**9), F(1)])
def test_a_claim_with_more_healing_than_disturbance_is_undecided(healing):
    """The stated disturbance, less the healing, would be negative; or the healing itself is."""
    proof = load_guarantee(FOLDER / "stick_slip_real-fault.json")
    assert proof.follows_from(proof.claims)
    assert not replace(proof, healing=healing).follows_from(proof.claims)
    assert not proof.follows_from(replace(proof.claims, slip_ahead=UpperBound(proof.claims.slip_ahead + F(1, 10**9))))


def test_a_statement_about_slow_sliding_names_what_it_covers():
    proof = load_guarantee(FOLDER / "sliding_crustal-patch.json")
    task, text = proof.task, proof.sentence()
    assert ("exact measurements" in text) is not bool(proof.sampled_loop.slip_noise)
    assert (
        "m in the measured slip"
        in replace(proof, sampled_loop=replace(proof.sampled_loop, slip_noise=F(1, 10**6))).sentence()
    )
    assert (
        "exact measurements of slip"
        in replace(proof, sampled_loop=replace(proof.sampled_loop, slip_noise=F(0))).sentence()
    )
    assert ("every reference whose rate" in text) is bool(task.swing)
    size, planned = proof.claims.push, task.pressure_per_slip * task.distance
    assert proof.pressures == (-size, planned + size)
    assert proof.bounds["least_pressure"] == -size
    assert {"log_rate", "peak_slip_rate", "largest_pressure"} <= proof.bounds.keys()


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (F(1, 3), F(2, 3), "0.333334 to 0.666666"),
        (F("0.3333333"), F("0.3333337"), "0.3333333 to 0.3333337"),
        (F("1.00000000000001"), F("1.00000000000002"), "1.00000000000001 to 1.00000000000002"),
        (F(1), F(10**15 + 1, 10**15), "1 to 1000000000000001/1000000000000000"),
    ],
)
def test_ends_of_a_range_are_printed_inward_with_the_digits_that_they_need(low, high, text):
    assert _inside(low, high) == text


# ---------------------------------------------------------------- files


LOOPS = {
    "jitter alone": {"jitter": F(1, 100)},
    "a late pressure alone": {"delay_jitter": F(1, 100)},
    "averaging alone": {"averaging": F(1, 50)},
    "an initial slip alone": {"initial_slip": F(1, 10**5)},
    "an initial slip rate alone": {"initial_slip_rate": F(1, 10**5)},
    "noise of the slip rate alone": {"rate_noise": F(1, 10**6)},
    "limits of a pump": {"pump": Pump(least=F(-(10**6)), largest=F(10**6))},
    "a pump without limits": {"pump": Pump()},
    "a pump with a rate": {"pump": Pump(rate=F(10**7)), "ramp": F(1, 10), "largest_step": True},
}


@pytest.mark.parametrize("setup", LOOPS.values(), ids=LOOPS)
def test_a_file_says_each_part_of_a_loop_whatever_else_there_is(setup):
    """Read again, it is the same loop; a pump without limits is none."""
    counted = {"largest_step": UpperBound(5)} if setup.get("largest_step") else {}
    loop = replace(LOOP, **{name: value for name, value in setup.items() if name != "largest_step"})
    claim = TrackingProof(task=TASK, sampled_loop=loop, claims=replace(CLAIMS, **counted))
    again = read_guarantee(json.loads(guarantee_text(claim)))
    assert again.sampled_loop == (replace(loop, pump=None) if loop.pump == Pump() else loop)
    assert again.claims == claim.claims


@pytest.mark.parametrize(("rows", "stands"), [("00", False), ("10", True), ("01", True)])
def test_a_law_of_the_reference_has_a_row_that_is_not_zero(rows, stands):
    law = replace(LAW, of_reference=((F(0), F(0)),) * len(LAW.states) + ((F(rows[0]), F(rows[1])),))
    raw = guarantee_document(TrackingProof(task=TASK, sampled_loop=replace(LOOP, law=law), claims=CLAIMS))
    if stands:
        assert read_guarantee(raw).sampled_loop.law == law
    else:
        with pytest.raises(CertificateError, match="of_reference must not be zero"):
            read_guarantee(raw | {"loop": raw["loop"] | {"of_reference": [["0", "0"]] * (len(LAW.states) + 1)}})


def test_only_a_guarantee_is_written():
    with pytest.raises(ParameterError, match="a claim must be a guarantee"):
        guarantee_text(LOOP)
