"""Sets, plants and laws at the limits of their sizes, as the package reads them; nothing here is a whole proof."""

import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path
from types import SimpleNamespace

import pytest

from quakedesign.errors import CertificateError, ParameterError, UnsupportedError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.guarantees.exact import invariant_set, plant_proof
from quakedesign.guarantees.exact.file_entries import power_entries, powers
from quakedesign.guarantees.exact.guarantee_files import guarantee_document, read_guarantee
from quakedesign.guarantees.exact.invariant_set import InvariantPolytope, reached_bounds, require_fit
from quakedesign.guarantees.exact.limit_theorems import farthest_well, nearest_proved_well
from quakedesign.guarantees.exact.plant_proof import PlantEntries, peaks
from quakedesign.guarantees.exact.sampled_loop import Channel
from quakedesign.guarantees.exact.stick_slip_set import SampledStickSlip, StickSlipPolytope
from quakedesign.laws import Power
from quakedesign.laws.stick_slip_law import StickSlipLaw
from quakedesign.lyapunov.exact.certificate_files import read_as
from quakedesign.plant.plant_values import ExactSector

CERTIFICATES = Path(__file__).parents[3] / "proofs" / "certificates"


# ---------------------------------------------------------------- sets for aperiodic sampling


def set_of(count, size=2, sampled=1, held=1, **given):
    """A set with so many facets, and so many pieces at the samples and between them."""
    basis = tuple(range(size))
    rows = tuple(tuple(F(i % size == j) for j in range(size)) for i in range(count))
    parts = {
        "inputs": (F(1), F(0)),
        "facets": rows,
        "at_samples": ((basis,) * (sampled + 1),) * count,
        "between": ((basis,) * (held + 1),) * 3,
    }
    return InvariantPolytope(**parts | given)


@pytest.mark.parametrize(
    "given",
    [
        {"count": 2},
        {"count": 1, "size": 1},
        {"count": 400},
        {"count": 6, "size": 6},
        {"count": 2, "sampled": 32, "held": 32},
        {"count": 397, "sampled": 9, "held": 9},  # 397·10 + 3·10 bases
        {"count": 1, "size": 1, "facets": ((F(10**20 - 1, 10**20 - 3),),)},
        {"count": 1, "size": 1, "facets": ((F(-(10**20) + 1),),)},
        {"count": 2, "held": 2},
    ],
)
def test_a_set_may_have_its_largest_sizes(given):
    assert len(set_of(**given).facets) == given["count"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"count": 0}, "facets must be 1 to 400 rows, .* Received 0 rows of 0 entries"),
        ({"count": 1}, "at least as many as entries of a row in an invariant set. Received 1 rows of 2 entries"),
        ({"count": 401}, "facets must be 1 to 400 rows, .* Received 401 rows of 2 entries"),
        ({"count": 2, "size": 0}, "facets must be 1 to 400 rows, .* Received 2 rows of 0 entries"),
        ({"count": 7, "size": 7}, "facets must have at most 6 entries each in an invariant set. Received 7"),
        ({"count": 397, "sampled": 9, "held": 10}, "bases must be at most 4000 in all .* Received 4003"),
        ({"count": 2, "sampled": 0}, "rows of at_samples must .* 2 to 33, .* Received rows of 1 bases"),
        ({"count": 2, "held": 0}, "rows of between must .* 2 to 33, .* Received rows of 1 bases"),
        ({"count": 2, "sampled": 33}, "rows of at_samples must .* 2 to 33, .* Received rows of 34 bases"),
        ({"count": 2, "held": 33}, "rows of between must .* 2 to 33, .* Received rows of 34 bases"),
    ],
)
def test_a_set_beyond_a_size_is_rejected(given, said):
    with pytest.raises(ParameterError, match=said):
        set_of(**given)


WIDE, THIN = F(10**20), F(1, 10**20)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"facets": ((F(1), WIDE), (F(1), F(0)))}, r"below 1e20 in .* Received the entry 1e\+20, whose numerator or"),
        ({"facets": ((F(1), -WIDE), (F(1), F(0)))}, r"below 1e20 in .* Received the entry -1e\+20, whose numerator"),
        ({"facets": ((THIN, F(1)), (F(1), F(0)))}, "below 1e20 in .* Received the entry 1e-20, whose numerator or"),
        ({"facets": ((F(1), F(0)), (F(1),))}, "the same number of entries in .* Received rows of 1, 2 entries"),
        ({"at_samples": (((0, 1),) * 2,)}, "at_samples must have one row for each facet .* 1 rows for 2 facets"),
        ({"between": ()}, "rows of between must have the same .* Received rows of no bases"),
        ({"between": (((0, 1),) * 2, ((0, 1),) * 3)}, "rows of between must .* Received rows of 2, 3 bases"),
        ({"between": (((0, 1), (0, 1, 1)),)}, r"a basis must be 2 indices of facets, .* Received \(0, 1, 1\)"),
        ({"between": (((0, 1), (0,)),)}, r"a basis must be 2 indices .* Received \(0,\)"),
        ({"between": (((0, 1), (0, 2)),)}, r"each at least 0 and below 2 .* Received \(0, 2\)"),
        ({"between": (((0, 1), (-1, 1)),)}, r"each at least 0 and below 2 .* Received \(-1, 1\)"),
        (
            {"inputs": (F(1), F(-1, 9), F(-2))},
            "bounds of the inputs must be given, and each must be 0 or more, .* Received -0.111111",
        ),
        ({"inputs": ()}, "bounds of the inputs must be given, and each must be 0 or more, .* Received none"),
    ],
)
def test_a_set_with_wrong_entries_is_rejected(given, said):
    with pytest.raises(ParameterError, match=said):
        set_of(2, **given)


def loop_of(outputs=("slip_error", "slip_rate_error", "push"), inputs=1, sampled=1):
    """Names and one jump that passes two states on."""
    jump = ((F(1), F(0)), (F(0), F(1)))
    return SimpleNamespace(
        segments=(SimpleNamespace(jump=jump),),
        outputs=dict.fromkeys(outputs),
        inputs=dict.fromkeys(range(inputs)),
        sampled=dict.fromkeys(range(10, 10 + sampled)),
    )


def test_a_set_must_have_the_sizes_of_its_loop():
    require_fit(loop_of(), set_of(2))
    for other, said in (
        (set_of(3, size=3), "facets of 2 entries, 3 outputs and 2 inputs. Received 3 entries"),
        (set_of(2, inputs=(F(1),)), "and 2 inputs. Received 2 entries, 3 outputs and 1 inputs"),
    ):
        with pytest.raises(ParameterError, match=said):
            require_fit(loop_of(), other)
    with pytest.raises(ParameterError, match=r"2 outputs and 2 inputs. Received 2 entries, 3 outputs"):
        require_fit(loop_of(outputs="ab"), set_of(2))
    with pytest.raises(ParameterError, match=r"3 outputs and 3 inputs. Received 2 entries, 3 outputs and 2 inputs"):
        require_fit(loop_of(sampled=2), set_of(2))


@pytest.mark.parametrize(
    ("own", "bound", "small"), [("1", "7/2", "5/7"), ("1", "349/100", None), ("0", "5/2", "1"), ("0", "249/100", None)]
)
def test_inputs_must_stay_within_the_bounds_of_a_set(own, bound, small, monkeypatch):
    """|a| ≤ F + (1/2)·3 + 1·1 = F + 5/2, the second input has bound 0; the pressure is shifted by 1/3."""
    outputs = [F(3), F(1), F(4)]
    channels = (
        Channel(name="acceleration", constant=F(own), coefficients={"slip_error": F(1, 2), "slip_rate_error": F(1)}),
        Channel(name="drift", constant=F(0), coefficients={}),
    )
    monkeypatch.setattr(invariant_set, "channels_of", lambda *_: channels)
    monkeypatch.setattr(invariant_set, "shift_bound", lambda _: F(1, 3))
    mapped = SimpleNamespace(of=lambda *_: SimpleNamespace(outputs=lambda *_: outputs))
    monkeypatch.setattr(invariant_set, "_SampleMap", mapped)
    held = SimpleNamespace(loop=lambda _: loop_of(), step=F(1), longest_step=F(2), noise={})
    result = reached_bounds(None, held, set_of(2, inputs=(F(bound), F(0))))
    if small is None:
        assert result.reason == "the acceleration may exceed its bound in the invariant set"
    else:
        assert (result.slip_error, result.slip_rate_error, result.push) == (3, 1, 4 + F(1, 3))
        assert result.small_gain == F(small)


# ---------------------------------------------------------------- sets of the stick-slip plant

AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0, 0, -1))
SPARE = (F(0), F(0), F(-1), F(1), F(1))


def stick_set(count=5, extra=0, **given):
    """A set with so many facets, and with so many bases more than one a slice and combination."""
    rows = tuple(tuple(map(F, row)) for row in AXES) + ((F(1), F(1), F(1)),) * (count - 5)
    parts = {
        "facets": rows[:count],
        "multipliers": (SPARE,) * count,
        "sliding": (((0, 1, 2),) * (extra + 1), ((0, 1, 2),), ((0, 1, 2),)),
        "resting": (((0, 1, 2, 3),),) * 7,
    }
    return StickSlipPolytope(**parts | given)


def facets_with(number, *row):
    rows = [tuple(map(F, axis)) for axis in AXES]
    rows[number] = tuple(map(F, row))
    return {"facets": tuple(rows)}


def multiplier(number, value):
    row = list(SPARE)
    row[number] = F(value)
    return {"multipliers": ((tuple(row),) + (SPARE,) * 4)}


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"count": 400},
        {"extra": 40_000 - 10},
        facets_with(1, 0, "1/9", 0),
        multiplier(0, "1/9"),
        multiplier(1, 1),
        multiplier(2, 5),
        multiplier(3, 0),
        multiplier(4, 0),
        multiplier(4, "1/2"),
    ],
)
def test_a_set_of_the_stick_slip_plant_may_have_its_largest_sizes(given):
    assert len(stick_set(**given).box) == 5


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"count": 4}, "have 5 to 400 facets"),
        ({"count": 401}, "have 5 to 400 facets"),
        (facets_with(0, 1, 0), "have facets of 3 entries"),
        (facets_with(0, 0, 0, 0), r"begin with facets along \+e1"),
        (facets_with(0, -1, 0, 0), r"begin with facets along \+e1"),
        (facets_with(4, 0, 0, 1), r"begin with facets along \+e1"),
        (facets_with(3, 1, 0, 0), r"begin with facets along \+e1"),
        (facets_with(1, 0, 1, 1), r"begin with facets along \+e1"),
        (facets_with(1, 1, 0, 0), r"begin with facets along \+e1"),
        (facets_with(2, 0, 1, 0), r"begin with facets along \+e1"),
        ({"multipliers": (SPARE,) * 4}, "have 5 multipliers for each facet"),
        ({"multipliers": (SPARE,) * 4 + (SPARE[1:],)}, "have 5 multipliers for each facet"),
        (multiplier(0, "-1/9"), "have a first multiplier of 0 or more"),
        (multiplier(1, "1/2"), "have a first multiplier of 0 or more"),
        (multiplier(1, 2), "have a first multiplier of 0 or more"),
        (multiplier(3, "1/2"), "have a first multiplier of 0 or more"),
        (multiplier(4, "-1/9"), "have a first multiplier of 0 or more"),
        (multiplier(4, "10/9"), "have a first multiplier of 0 or more"),
        ({"sliding": (((0, 1, 2),),) * 2}, "have bases for 3 slices and 7 combinations"),
        ({"resting": (((0, 1, 2, 3),),) * 6}, "have bases for 3 slices and 7 combinations"),
        ({"sliding": ((), ((0, 1, 2),), ((0, 1, 2),))}, "have bases for 3 slices and 7 combinations"),
        ({"sliding": (((0, 1),),) * 3}, "have bases of 3 constraints for slices and of 4"),
        ({"resting": (((0, 1, 2),),) * 7}, "have bases of 3 constraints for slices and of 4"),
        ({"sliding": (((0, 1, -1),),) * 3}, "have bases of 3 constraints for slices and of 4"),
        ({"extra": 40_000 - 9}, "have at most 40000 bases"),
    ],
)
def test_a_set_of_the_stick_slip_plant_beyond_a_size_is_rejected(given, said):
    with pytest.raises(ParameterError, match=f"a polytope of the stick-slip plant must {said}"):
        stick_set(**given)


def test_a_box_has_the_reciprocals_of_the_first_facets():
    rows = tuple(tuple(F(v) * (i + 2) for v in axis) for i, axis in enumerate(AXES))
    assert stick_set(6, facets=(*rows, (F(1), F(1), F(1)))).box == (F(1, 2), F(1, 3), F(1, 4), F(1, 5), F(1, 6))


PULL = (Power(factor=(F(1), F(1)), exponent=F(0), argument="slip"),)
STICK = StickSlipLaw(
    rate_gain=F(3), target_gain=F(3), return_rate=F(2), level_gain=F(0), slip_gain=F(0), rest_slip=F(1)
)
SLIDES = replace(STICK, pull=PULL)


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"longest_step": F(3, 4)},
        {"slip_noise": F(1, 2)},
        {"law": SLIDES},
        {"law": replace(STICK, target_gain=F(4))},
        {"law": replace(STICK, return_rate=F(1))},
    ],
)
def test_a_loop_on_the_stick_slip_plant_may_be(given):
    held = SampledStickSlip(**{"law": STICK, "step": F(1, 2)} | given)
    assert held.noise == ({"slip_noise": F(1, 2)} if "slip_noise" in given else {})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"step": F(0)}, "T_s must be positive, got 0 s"),
        ({"longest_step": F(1, 2)}, "longest_step must be 0 or above T_s, 0.5 s, and 0 for a sliding mode, got 0.5 s"),
        ({"longest_step": F(1, 4)}, "longest_step must be 0 or above T_s"),
        ({"longest_step": F(1), "law": SLIDES}, "longest_step must be 0 or above T_s"),
        ({"slip_noise": F(-1, 9)}, "slip_noise must be from 0 to half of rest_slip, 0.5 m"),
        ({"slip_noise": F(5, 9)}, "slip_noise must be from 0 to half of rest_slip, 0.5 m"),
        ({"law": replace(SLIDES, target_gain=F(4))}, "a sliding mode must have target_gain = rate_gain"),
        ({"law": replace(SLIDES, return_rate=F(1))}, "a sliding mode must have target_gain = rate_gain"),
    ],
)
def test_a_loop_on_the_stick_slip_plant_may_not_be(given, said):
    with pytest.raises(ParameterError, match=said):
        SampledStickSlip(**{"law": STICK, "step": F(1, 2)} | given)


def test_a_file_of_a_sliding_mode_keeps_its_implicit_step_and_has_no_controller():
    raw = json.loads((CERTIFICATES / "stick_slip_cta_real-fault.json").read_text())
    proof = read_guarantee(raw)
    assert guarantee_document(proof) == raw
    assert proof.implicit_step.pull == proof.sampled_loop.law.pull != ()
    with pytest.raises(UnsupportedError, match="states its implicit step, not the gains"):
        _ = proof.controller


# ---------------------------------------------------------------- uncertain plants


def plant_of(n=1, m=1, **changes):
    """A plant as a file states it, of n states and m controls, with a sector on the first state."""
    sector = {"entry": ["0"] * n, "row": ["1"] + ["0"] * (n + m - 1), "slopes": ["0", "1"], "within": "1/2"}
    given = {
        "A": [["0"] * n] * n,
        "B": [["1"] * m] * n,
        "C": [["1"] + ["0"] * (n - 1)],
        "disturbances": [],
        "loads": [],
        "sectors": [sector],
        "noise": ["0"],
        "start": ["0"] * n,
        "outputs": [["1"] + ["0"] * (n - 1)],
    }
    return given | changes


def sector_of(**changes):
    return {"sectors": [plant_of()["sectors"][0] | changes]}


def load_of(**changes):
    return {"loads": [{"control": ["1"], "shift": ["0", "1"], "rate": "0"} | changes]}


FORCE = {"entry": ["1"], "size": "1"}


@pytest.mark.parametrize(
    "given",
    [
        plant_of(),
        plant_of(n=40),
        plant_of(m=40),
        plant_of(C=[["0"]] * 40, noise=["0"] * 40),
        plant_of(outputs=[["0"]] * 40),
        plant_of(disturbances=[FORCE] * 40),
        plant_of(**sector_of(slopes=["1", "1"])),
        plant_of(**sector_of(within="1/9")),
        plant_of(n=2, **load_of()),
        plant_of(n=2, C=[["1", "0"]] * 2, noise=["0", "0"], **load_of()),
    ],
)
def test_a_plant_of_a_file_may_have_its_largest_sizes(given):
    found = read_as(PlantEntries, given).part()
    assert (len(found.A), len(found.B[0]), len(found.C)) == (len(given["A"]), len(given["B"][0]), len(given["C"]))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (plant_of(A=[], B=[]), "a plant must have 1 to 40 states, and 1 to 40 controls"),
        (plant_of(A=[], B=[["1"]]), "a plant must have 1 to 40 states, and 1 to 40 controls"),
        (plant_of(n=41), "a plant must have 1 to 40 states, and 1 to 40 controls"),
        (plant_of(B=[[]]), "a plant must have 1 to 40 states, and 1 to 40 controls"),
        (plant_of(m=41), "a plant must have 1 to 40 states, and 1 to 40 controls"),
        (plant_of(B=[]), "a plant must have 1 to 40 states, and 1 to 40 controls"),
        (plant_of(C=[["0"]] * 41, noise=["0"] * 41), "C must have at most 40 entries"),
        (plant_of(outputs=[["0"]] * 41), "outputs must have at most 40 entries"),
        (plant_of(disturbances=[FORCE] * 41), "disturbances must have at most 40 entries"),
        (plant_of(sectors=plant_of()["sectors"] * 41), "sectors must have at most 40 entries"),
        (plant_of(n=2, loads=load_of()["loads"] * 41), "loads must have at most 40 entries"),
        (plant_of(B=[["1"], ["1"]]), "rows and columns of a plant must fit"),
        (plant_of(noise=[]), "rows and columns of a plant must fit"),
        (plant_of(start=["0", "0"]), "rows and columns of a plant must fit"),
        (plant_of(**sector_of(row=["1"])), "rows and columns of a plant must fit"),
        (plant_of(**sector_of(entry=["0", "0"])), "rows and columns of a plant must fit"),
        (plant_of(**sector_of(entry=["0", "0"], row=["1", "0", "0"])), "rows and columns of a plant must fit"),
        (plant_of(n=2, **load_of(rate="-1/9")), "a load must have a rate of 0 or more and a shift that is not"),
        (plant_of(n=2, C=[["0", "1"]], **load_of()), "a load must have a rate of 0 or more and a shift that is not"),
        (
            plant_of(n=2, C=[["1", "0"], ["0", "1"]], noise=["0", "0"], **load_of()),
            "a load must have a rate of 0 or more and a shift that is not",
        ),
        (plant_of(**sector_of(slopes=["1", "0"])), "slopes must be in order"),
        (plant_of(**sector_of(within="0")), "a bound of a sector must be positive"),
        (plant_of(**sector_of(within="-1")), "a bound of a sector must be positive"),
        (plant_of(**sector_of(row=["1", "1"])), "a sector with a bound must depend on the states alone"),
        (plant_of(m=2, **sector_of(row=["1", "1", "0"])), "a sector with a bound must depend on the states alone"),
    ],
)
def test_a_plant_of_a_file_beyond_a_size_is_rejected(given, said):
    with pytest.raises(CertificateError, match=said):
        read_as(PlantEntries, given).part()


def document_of(q=0, **changes):
    """A whole file about a plant of one state and a law of q integrals."""
    unit = [[str(int(i == j)) for j in range(q)] for i in range(q)]
    law = {"step": "1/2", "delay": "0", "A": unit, "B": [["1"]] * q, "C": [["0"] * q], "D": [["0"]]}
    return {
        "format": 1,
        "kind": "uncertain_plant",
        "plant": plant_of(disturbances=[FORCE]),
        "law": law,
        "pieces": 1,
        "inputs": ["1"],
        "claims": {"output_1": "1", "control_1": "1"},
    } | changes


def test_a_file_about_a_plant_is_read_up_to_its_limits():
    assert len(read_guarantee(document_of(48)).law.update) == 48
    assert read_guarantee(document_of(inputs=["0"])).inputs == (0,)
    minus = "-1/9"
    for given, said in (
        (document_of(49), "a law must have at most 48 states"),
        (document_of(inputs=[minus]), "noise, start, sizes of disturbances and inputs must be 0 or more"),
        (document_of(plant=plant_of(noise=[minus])), "noise, start, sizes of disturbances and inputs must be 0 or"),
        (document_of(plant=plant_of(start=[minus])), "noise, start, sizes of disturbances and inputs must be 0 or"),
        (
            document_of(plant=plant_of(disturbances=[FORCE | {"size": minus}])),
            "noise, start, sizes of disturbances and inputs must be 0 or more",
        ),
        (document_of(inputs=[]), "inputs must have an entry for each sector"),
        (document_of(claims={"output_1": "1"}), "claims must be output_1, control_1"),
    ):
        with pytest.raises(CertificateError, match=said):
            read_guarantee(given)


@pytest.mark.parametrize(
    ("inputs", "within", "slopes", "proved"),
    [
        ("2", "4", (0, 1), True),  # half of |y| <= 3 is below 2
        ("3/2", "4", (0, 1), False),  # half of 3 is 3/2 itself
        ("2", "3", (0, 1), False),  # |y| may reach the bound of the sector
        ("-1/9", "4", (1, 1), False),
        ("0", "4", (1, 1), True),  # a sector of one slope does not deviate
        ("1/9", "4", (0, 1), False),
    ],
)
def test_conditions_on_a_sector_are_decided(inputs, within, slopes, proved, monkeypatch):
    monkeypatch.setattr(plant_proof, "row_bounds", lambda *_: (F(5), F(7), F(3), F(11)))
    sector = ExactSector(entry=(F(1),), row=(F(1), F(0)), slopes=tuple(map(F, slopes)), within=F(within))
    part = SimpleNamespace(outputs=((F(1),),) * 2, sectors=(sector,))
    assert peaks(part, None, (F(inputs),)) == ((5, 7, 11) if proved else None)


# ---------------------------------------------------------------- powers and wells


def test_powers_of_powers_are_written_and_read():
    inner = Power(factor=(F(1), F(2)), exponent=F(1, 2), argument="slip")
    terms = (Power(factor=(F(3), F(3)), exponent=F(2, 3), argument=(inner,)), inner)
    entries = power_entries(terms)
    assert (entries[1].of, entries[0].of[0].of, entries[0].of[0].factor) == ("slip", "slip", (1, 2))
    assert powers(entries) == terms


def test_a_well_is_as_far_as_the_root_of_time_and_diffusivity():
    assert float(farthest_well(UpperBound(F(36)), F(1, 4))) == pytest.approx(3)
    assert float(nearest_proved_well(LowerBound(F(36)), F(1, 4))) == pytest.approx(3)
    assert nearest_proved_well(LowerBound(F(2)), F(1)) ** 2 <= 2 <= farthest_well(UpperBound(F(2)), F(1)) ** 2
    for value in (F(0), F(-1)):
        with pytest.raises(ParameterError, match="a diffusivity above 0"):
            farthest_well(UpperBound(F(1)), value)
        with pytest.raises(ParameterError, match="a diffusivity above 0"):
            nearest_proved_well(LowerBound(F(1)), value)
