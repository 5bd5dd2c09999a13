"""Loops of uncertain plants and bounds of their responses: the standalone checker's, and closed forms."""

from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction as F
from math import exp
from types import SimpleNamespace

import pytest
from flint import arb, arb_mat, ctx
from standalone_guarantee import CHECK

from quakedesign.errors import ParameterError
from quakedesign.exact import UpperBound
from quakedesign.guarantees.exact import plant_loop
from quakedesign.guarantees.exact.guarantee_files import guarantee_document
from quakedesign.guarantees.exact.plant_loop import LinearPart, MatrixLaw, PlantLoop, response_bounds, solved
from quakedesign.guarantees.exact.plant_proof import PlantClaims, PlantProof
from quakedesign.plant.plant_values import ExactSector, SlowLoad

checker = CHECK.beside("guarantee.plant")


def rows(*lines):
    return tuple(tuple(F(v) for v in line) for line in lines)


STEP = F(2)
PART = LinearPart(
    A=rows([-2, 1], ["-1/2", -3]),
    B=rows([1, 0], [0, 1]),
    C=rows([1, 0], [1, 1], [0, 1]),
    disturbances=((rows([1, 2])[0], F(1)), (rows([0, 1])[0], F(2)), (rows([1, 2])[0], F(3))),
    loads=(
        SlowLoad(control=rows([1, 0])[0], shift=rows([0, 0])[0], rate=F(1)),
        SlowLoad(control=rows([1, 2])[0], shift=rows([0, 0])[0], rate=F(2)),
    ),
    sectors=(
        ExactSector(entry=rows([1, 0])[0], row=rows([0, 1, "1/16", "1/8"])[0], slopes=(F(-1, 4), F(1, 2))),
        ExactSector(entry=rows([0, 1])[0], row=rows([1, 0, 0, 0])[0], slopes=(F(-1, 8), F(1, 8))),
    ),
    noise=(F(1), F(0), F(2)),
    start=(F(0), F(3)),
    outputs=rows([1, 0], [1, -1]),
)
LAW = MatrixLaw(
    step=STEP,
    delay=F(0),
    update=rows(["1/8", 0, 0], [0, 1, 0], ["1/16", 0, 1]),
    measured=rows(["1/4", 0, 0], ["1/8", 0, 0], [0, 0, "1/8"]),
    output=rows([0, "-1/8", 0], ["1/8", 0, "-1/8"]),
    feedback=rows([0, "-1/8", 0], [0, 0, "-1/8"]),
)
"""Integral action from the first and the third measurement, which balances every load."""

STATIC = replace(LAW, update=(), measured=(), output=((), ()))
UNLOADED = replace(PART, loads=())
DELAYS = [F(0), F(1, 2), F(2), F(7, 2)]


def both(part, law, pieces):
    """The loop of the package and, read from a file, of the checker."""
    sizes = len(part.outputs), len(part.B[0])
    claims = PlantClaims(**dict(zip(("outputs", "controls"), ((UpperBound(1),) * n for n in sizes), strict=True)))
    inputs = (F(1),) * len(part.sectors)
    file = guarantee_document(PlantProof(part=part, law=law, pieces=pieces, inputs=inputs, claims=claims))
    plant = checker.read_plant(file["plant"])
    return part.loop(law), checker.loop_of(plant, checker.read_law(file["law"], len(plant.C), len(plant.B[0])))


def listed(value):
    return [listed(v) for v in value] if isinstance(value, (list, tuple)) else value


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize(("part", "law"), [(PART, LAW), (UNLOADED, STATIC)], ids=["integral", "static"])
def test_both_checkers_form_the_same_loop(part, law, delay):
    package, standalone = both(part, replace(law, delay=delay), 1)
    for ours, theirs in (("flow", "flow"), ("inputs", "inputs"), ("sampled", "told"), ("start", "start")):
        assert listed(getattr(package, ours)) == listed(getattr(standalone, theirs)), ours
    assert listed(package.rows) == listed(standalone.rows)
    assert listed(package.segments) == listed(standalone.segments)


@pytest.mark.parametrize("pieces", [1, 3])
@pytest.mark.parametrize("delay", DELAYS)
def test_both_checkers_have_the_same_bounds_of_the_responses(delay, pieces):
    """The loop decays by e⁻²⁴ within the first eight periods, so that what follows them has no part in the bounds."""
    package, standalone = both(UNLOADED, replace(STATIC, delay=delay), pieces)
    found, other = response_bounds(package, pieces), checker.responses(standalone, pieces)
    for ours, theirs in (("inputs", other.inputs), ("sampled", other.told)):
        for row, line in zip(zip(*getattr(found, ours), strict=True), theirs, strict=True):
            assert [float(v) for v in row] == pytest.approx([float(v) for v in line], rel=1e-7), ours
    assert [float(v) for v in found.start] == pytest.approx([float(v) for v in other.start], rel=1e-7)


LAG = LinearPart(
    A=rows([-1]),
    B=rows([1]),
    C=rows([1]),
    disturbances=((rows([1])[0], F(1)),),
    loads=(),
    sectors=(),
    noise=(F(0),),
    start=(F(3),),
    outputs=rows([1]),
)
NONE = MatrixLaw(step=F(1), delay=F(0), update=(), measured=(), output=((),), feedback=rows([0]))


@pytest.mark.parametrize("step", ["1", "0.955", "0.2"])
def test_what_follows_the_periods_that_are_summed_is_added(step):
    """The norm of 1/(s + 1) is 1. After eight periods of 0.955 s a share of e^−7.64 = 1/2081 is left."""
    found = response_bounds(LAG.loop(replace(NONE, step=F(step))), 64)
    assert 1 <= found.inputs[0][0] <= F(1002, 1000)
    assert 3 <= found.start[0] <= F(3003, 1000)


@pytest.mark.parametrize("pieces", [1, 2, 5])
def test_the_remainder_of_the_trapezoidal_rule_is_added(pieces):
    """The response t·e⁻ᵗ of 1/(s + 1)², whose norm is 1, is concave before t = 2."""
    double = replace(LAG, A=rows([-1, 1], [0, -1]), B=rows([0], [1]), C=rows([1, 0]), start=(F(0), F(0)),
                     disturbances=((rows([0, 1])[0], F(1)),), outputs=rows([1, 0]))  # fmt: skip
    found = response_bounds(double.loop(NONE), pieces)
    below = sum(k / pieces * exp(-k / pieces) for k in range(1, 100 * pieces)) / pieces
    assert below < 1 <= found.inputs[0][0]


@pytest.mark.parametrize("pole", [F(0), F(1, 10)])
def test_a_loop_that_does_not_decay_is_rejected(pole):
    with pytest.raises(ParameterError, match="must be stable and decay fast"):
        response_bounds(replace(LAG, A=((pole,),)).loop(NONE), 1)


@pytest.mark.parametrize(("step", "delay", "valid"), [(1, 8, True), (1, "8.5", False), (1, -1, False), (0, 0, False),
                                                      (-1, -1, False), (2, 16, True), ("1/2", 5, False)])  # fmt: skip
def test_a_law_has_a_positive_step_and_a_delay_of_at_most_eight(step, delay, valid):
    if valid:
        assert replace(NONE, step=F(step), delay=F(delay)).delay == F(delay)
    else:
        with pytest.raises(ParameterError, match="positive step and a delay of 0 to 8 steps"):
            replace(NONE, step=F(step), delay=F(delay))


def test_a_loop_has_at_most_96_states():
    """One of the plant, 48 of the law, one control that acts and those that wait."""
    many = replace(NONE, update=rows(*[[0] * 94] * 94), measured=rows(*[[0]] * 94), output=rows([0] * 94))
    assert len(LAG.loop(many).flow) == 96
    with pytest.raises(ParameterError, match="at most 96 states"):
        LAG.loop(replace(many, delay=F(1, 2)))


def test_the_standalone_checker_balances_a_load_by_states_that_depend_on_each_other():
    """z1 = z1/2 + z2/4 and 3 = z2; a third state that nothing depends on may be anything, and is 0."""
    A = rows(["1/2", "1/4", 0], [0, 1, 0], [0, 0, 1])
    law = checker.Law(F(1), F(0), A, [], rows([0, 1, 0]), [])
    assert checker.balance(law, [F(3)]) == [F(3, 2), 3, 0]
    with pytest.raises(CHECK.Refused, match="must balance every load"):
        checker.balance(replace(law, A=rows(["1/2", "1/4", 0], [0, "1/2", 0], [0, 0, 1])), [F(3)])


@pytest.mark.parametrize(("work", "fades"), [(4, True), (5, False)])
def test_a_map_must_become_small_within_the_work_that_is_allowed(work, fades, monkeypatch):
    """The largest entry of its powers 1, 2, 4 and 8 is 4, 4, 2 and 1/4: four periods are the last that are large."""
    monkeypatch.setattr(checker, "MOST_WORK", 8)
    monkeypatch.setattr(checker, "BEYOND", 2)
    leap = checker.fixed(rows(["1/2", 4], [0, "1/2"]))
    with nullcontext() if fades else pytest.raises(CHECK.Refused, match="must be stable and decay fast"):
        checker.require_fading(leap, 1, work)


@pytest.mark.parametrize(("size", "fades"), [(2**80 - 1, True), (2**80, False), (2**81, False)])
def test_a_map_of_entries_above_two_to_the_eightieth_is_not_followed(size, fades):
    with nullcontext() if fades else pytest.raises(CHECK.Refused, match=r"must be stable$"):
        checker.require_fading(checker.fixed(rows([0, size], [0, 0])), 1, 1)


def test_a_load_that_the_law_cannot_balance_is_rejected():
    """A law without integral action, and one whose integrator does not act on the loaded control."""
    loaded = replace(UNLOADED, loads=PART.loads[1:])
    with pytest.raises(ParameterError, match="load"):
        loaded.loop(STATIC)
    with pytest.raises(ParameterError, match="load"):
        loaded.loop(replace(LAW, output=rows([0, "-1/8", 0], [0, 0, 0])))


# ---------------------------------------------------------------- balance of loads


@pytest.mark.parametrize(
    ("equations", "unknowns", "solution"),
    [
        ([[2, 1, 5], [1, -1, 1]], 2, (2, 1)),
        ([[1, 1, 3], [2, 2, 6]], 2, (3, 0)),
        ([[0, 0, 2, 8], [0, 3, 0, 6]], 3, (0, 2, 4)),
        ([[0, 0, 0]], 2, (0, 0)),
        ([], 2, (0, 0)),
        ([[0], [0]], 0, ()),
    ],
)
def test_a_solution_satisfies_every_equation_and_what_is_free_is_zero(equations, unknowns, solution):
    given = [[F(v) for v in row] for row in equations]
    assert solved(given, unknowns) == tuple(map(F, solution))
    assert all(sum(a * b for a, b in zip(row, solution, strict=False)) == row[-1] for row in given)


@pytest.mark.parametrize(
    ("equations", "unknowns"),
    [([[1, 1, 3], [2, 2, 7]], 2), ([[0, 0, 1]], 2), ([[0], [1]], 0), ([[1], [0]], 0), ([[0, 5, 1], [0, 0, 1]], 2)],
)
def test_equations_that_contradict_each_other_leave_a_load_without_balance(equations, unknowns):
    with pytest.raises(ParameterError, match="must balance every load at zero error"):
        solved([[F(v) for v in row] for row in equations], unknowns)


@pytest.mark.parametrize("delay", DELAYS)
def test_both_checkers_move_the_equilibrium_with_a_load_alike(delay):
    """Also by the shift of the states, which no measurement sees, and by the controls that are on their way."""
    wide = replace(
        PART,
        A=rows([-2, 1, 0], ["-1/2", -3, 0], [1, 0, -1]),
        B=rows([1, 0], [0, 1], [0, 0]),
        C=rows([1, 0, 0], [1, 1, 0], [0, 1, 0]),
        disturbances=((rows([1, 2, 3])[0], F(1)),),
        loads=(SlowLoad(control=rows([1, 2])[0], shift=rows([0, 0, 5])[0], rate=F(2)),),
        sectors=(),
        start=(F(0), F(3), F(0)),
        outputs=rows([1, 0, 0], [1, -1, 2]),
    )
    package, standalone = both(wide, replace(LAW, delay=delay), 1)
    assert listed(package.inputs) == listed(standalone.inputs)
    moved = next(column for column in package.inputs if F(-5) in column)
    assert {F(-1), F(-2)} <= set(moved) or delay == 0


# ---------------------------------------------------------------- the standalone checker's verdict and statement

NUMBERS = ["5", "7", "2"]
BOUNDS = [F(3), F(4), F(10), F(6), F(9), F(8)]
"""Of two outputs, of the arguments of three sectors, of a control."""


def decided(monkeypatch, bounds=BOUNDS, start=("0", "3"), disturbances=((["1", "0"], "2/3"),), **changes):
    """What the checker says of a file whose rows have certain bounds; two sectors and one of a single slope."""
    sector = {"entry": ["1", "0"], "row": ["0", "1", "0"]}
    document = {
        "format": 1, "kind": "uncertain_plant", "pieces": 2, "inputs": NUMBERS,
        "claims": {"output_1": "3", "output_2": "4", "control_1": "8"},
        "plant": {
            "A": [["-1", "0"], ["0", "-1"]], "B": [["1"], ["0"]], "C": [["1", "0"]],
            "disturbances": [{"entry": entry, "size": size} for entry, size in disturbances], "loads": [],
            "sectors": [sector | {"slopes": ["1/10", "1"], "within": "21/2"}, sector | {"slopes": ["-1", "1"]},
                        sector | {"slopes": ["2", "2"]}],
            "noise": ["0"], "start": list(start), "outputs": [["1", "0"], ["0", "1"]],
        },
        "law": {"step": "1/2", "delay": "1/8", "A": [], "B": [], "C": [[]], "D": [["-1"]]},
    }  # fmt: skip
    monkeypatch.setattr(checker, "responses", lambda *_: None)
    monkeypatch.setattr(checker, "rows_of", lambda *_: list(bounds))
    return checker.verify(document | changes)


def test_bounds_that_meet_every_condition_are_proved_and_said(monkeypatch):
    said = decided(monkeypatch)
    assert said[0] == "plant with 2 states, 1 controls, 3 sectors, 0 loads; law with 0 states, every 1/2 s, 1/8 s late"
    assert said[1] == "disturbances of at most 0.6666; from |x_i| <= start_i, for all t >= 0"
    assert said[2] == "|output_1| <= 3, |output_2| <= 4, |control_1| <= 8"
    still = decided(monkeypatch, start=("0", "0"), disturbances=())
    assert still[1] == "disturbances of at most none; from rest, for all t >= 0"


@pytest.mark.parametrize(
    ("place", "most", "reason"),
    [
        (2, "10999/1000", "argument must stay within the bound"),  # beyond 21/2, while (9/20)·y is below 5
        (2, "21/2", "argument must stay within the bound"),
        (3, "7", "small-gain condition"),  # 1·y = 7
        (0, "3001/1000", "claims must follow"),
        (1, "4001/1000", "claims must follow"),
        (5, "8001/1000", "claims must follow"),
    ],
)
def test_every_condition_on_the_bounds_is_asked_for(place, most, reason, monkeypatch):
    bounds = [*BOUNDS[:place], F(most), *BOUNDS[place + 1 :]]
    with pytest.raises(CHECK.Refused, match=reason):
        decided(monkeypatch, bounds)


def test_half_the_width_of_a_sector_counts_in_the_small_gain(monkeypatch):
    """(1 − 1/10)/2 = 9/20 of the argument, below 10·9/20 = 9/2; a sector of one slope has no part."""
    assert decided(monkeypatch, inputs=["4501/1000", "7", "0"])
    for inputs in (["9/2", "7", "0"], ["4499/1000", "7", "0"], ["5", "6", "0"]):
        with pytest.raises(CHECK.Refused, match="small-gain condition"):
            decided(monkeypatch, inputs=inputs)


@pytest.mark.parametrize(
    ("pieces", "valid"), [(1, True), (64, True), (0, False), (65, False), ("2", False), (True, False)]
)
def test_a_flow_is_cut_into_one_to_sixty_four_pieces(pieces, valid, monkeypatch):
    with nullcontext() if valid else pytest.raises(CHECK.Refused, match="pieces must be 1 to 64"):
        decided(monkeypatch, pieces=pieces)


@pytest.mark.parametrize("value", [5, None, {"a": 1}, "ab", [0] * 41])
def test_a_list_of_a_file_has_at_most_forty_entries(value):
    assert checker.listed([0] * 40, "loads") == [0] * 40
    with pytest.raises(CHECK.Refused, match="loads must be a list of at most 40"):
        checker.listed(value, "loads")


def plant_of(n=1, m=1, **changes):
    """A plant as a file states it, of n states and m controls, with a sector on the first state."""
    sector = {"entry": ["0"] * n, "row": ["1"] + ["0"] * (n + m - 1), "slopes": ["0", "1"], "within": "1/2"}
    given = {
        "A": [["0"] * n] * n, "B": [["1"] * m] * n, "C": [["1"] + ["0"] * (n - 1)], "disturbances": [], "loads": [],
        "sectors": [sector], "noise": ["0"], "start": ["0"] * n, "outputs": [["1"] + ["0"] * (n - 1)],
    }  # fmt: skip
    return given | changes


def sector_of(**changes):
    return {"sectors": [plant_of()["sectors"][0] | changes]}


@pytest.mark.parametrize(
    "given",
    [
        plant_of(), plant_of(n=40), plant_of(m=40), plant_of(C=[["0"]] * 40, noise=["0"] * 40),
        plant_of(outputs=[["0"]] * 40), plant_of(**sector_of(slopes=["1", "1"])), plant_of(**sector_of(within="1/9")),
        plant_of(sectors=[{k: v for k, v in plant_of()["sectors"][0].items() if k != "within"}]),
    ],
)  # fmt: skip
def test_plants_are_read_up_to_their_limits(given):
    found = checker.read_plant(given)
    assert (len(found.A), len(found.B[0]), len(found.C)) == (len(given["A"]), len(given["B"][0]), len(given["C"]))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (plant_of(A=5), "A must have 1 to 40 rows"), (plant_of(A=[]), "A must have 1 to 40 rows"),
        (plant_of(n=41), "A must have 1 to 40 rows"), (plant_of(A="ab"), "A must have 1 to 40 rows"),
        (plant_of(B=5), "B must have one row per state"), (plant_of(B=[["1"], ["1"]]), "B must have one row per state"),
        (plant_of(B=[5]), "B must have one row per state"), (plant_of(B=["1"]), "B must have one row per state"),
        (plant_of(B=[]), "B must have one row per state"), (plant_of(B=[[]]), "B must have 1 to 40 columns"),
        (plant_of(m=41), "B must have 1 to 40 columns"), (plant_of(C=5), "C must have at most 40 rows"),
        (plant_of(C=[["0"]] * 41, noise=["0"] * 41), "C must have at most 40 rows"),
        (plant_of(outputs={"0": 1}), "outputs must have at most 40 rows"),
        (plant_of(sectors=[5]), "a sector"), (plant_of(sectors=["within"]), "a sector"),
        (plant_of(**sector_of(slopes=["1", "0"])), "slopes must be in order"),
        (plant_of(**sector_of(within="0")), "within must be > 0"),
        (plant_of(**sector_of(within="-1")), "within must be > 0"),
        (plant_of(**sector_of(row=["1", "1"])), "of a row of the states alone"),
        (plant_of(noise=["-1"]), "sizes must be >= 0"), (plant_of(start=["-1"]), "sizes must be >= 0"),
        (plant_of(disturbances=[{"entry": ["1"], "size": "-1"}]), "sizes must be >= 0"),
    ],
)  # fmt: skip
def test_plants_beyond_a_limit_are_refused_by_the_standalone_checker(given, said):
    with pytest.raises(CHECK.Refused, match=said):
        checker.read_plant(given)


def test_a_plant_of_one_state_is_decided(monkeypatch):
    monkeypatch.setattr(checker, "responses", lambda *_: None)
    monkeypatch.setattr(checker, "rows_of", lambda *_: [F(1), F(1, 3), F(1)])
    law = {"step": "1", "delay": "0", "A": [], "B": [], "C": [[]], "D": [["0"]]}
    document = {"format": 1, "kind": "uncertain_plant", "plant": plant_of(), "law": law, "pieces": 1, "inputs": ["1"]}
    said = checker.verify(document | {"claims": {"output_1": "1", "control_1": "1"}})
    assert said[0].startswith("plant with 1 states, 1 controls, 1 sectors, 0 loads; law with 0 states")


def law_of(q=0, **changes):
    """A law of q integrals as a file states it, with one measurement and one control."""
    unit = [[str(int(i == j)) for j in range(q)] for i in range(q)]
    return {"step": "1/2", "delay": "0", "A": unit, "B": [["1"]] * q, "C": [["0"] * q], "D": [["0"]]} | changes


def test_laws_of_a_plant_are_read_up_to_their_limits():
    for given in (law_of(), law_of(48), law_of(delay="4"), law_of(step="1/9")):
        assert len(checker.read_law(given, 1, 1).A) == len(given["A"])
    for given, said in (
        (law_of(49), "at most 48 states"), (law_of(A=5), "at most 48 states"),
        (law_of(delay="401/100"), "delay 0 to 8"), (law_of(delay="-1/9"), "delay 0 to 8"),
        (law_of(step="0"), "step must be > 0"), (law_of(step="-1"), "step must be > 0"),
        (law_of(D=[["0", "0"]]), "D of the law"), (law_of(C=[]), "C of the law"), (law_of(1, B=[[]]), "B of the law"),
    ):  # fmt: skip
        with pytest.raises(CHECK.Refused, match=said):
            checker.read_law(given, 1, 1)


def test_bounds_of_rows_count_every_input_with_its_size():
    """Disturbance, load, sectors of two slopes and of one, noise that is not 0: 1 + 2·2 + 3·5 + 4·7 + 5·0 + 6/3."""
    load = {"control": ["1"], "shift": ["0", "1"], "rate": "5"}
    sector = {"entry": ["0", "0"], "row": ["1", "0", "0"], "slopes": ["0", "1"]}
    plant = checker.read_plant(
        plant_of(
            n=2, C=[["1", "0"], ["1", "0"]], noise=["0", "1/3"], loads=[load],
            disturbances=[{"entry": ["1", "0"], "size": "2"}],
            sectors=[sector, sector | {"slopes": ["2", "2"]}],
        )
    )  # fmt: skip
    found = SimpleNamespace(start=[F(1), F(0)], inputs=[[F(2), F(3), F(4), F(5)], [F(0)] * 4], told=[[F(6)], [F(9)]])
    assert checker.rows_of(plant, found, [F(7), F(11)]) == [1 + 4 + 15 + 28 + 2, 3]
    assert checker.rows_of(plant, found, [F(0), F(0)]) == [1 + 4 + 15 + 2, 3]
    for numbers in ([F(-1), F(0)], [F(7), F(-1, 9)]):
        with pytest.raises(CHECK.Refused, match="inputs of the sectors must be >= 0"):
            checker.rows_of(plant, found, numbers)


def test_a_law_of_other_dimensions_is_rejected():
    for law in (replace(NONE, feedback=rows([0, 0])), replace(NONE, feedback=()), replace(NONE, output=((F(0),),))):
        with pytest.raises(
            ParameterError, match=r"of a law for this plant must be 1 x [01], as 1 signals are measured"
        ):
            LAG.loop(law)


def test_a_sampled_input_passes_the_second_jump_of_the_period():
    """x′ = −x, reset by each sample and multiplied by 10 after 1 s: the largest response is 10/e, just after that."""
    loop = PlantLoop(
        flow=rows([-1]), segments=((rows([0]), F(1)), (rows([10]), F(2))), inputs=(), sampled=rows([1]), start=(),
        rows=rows([1]),
    )  # fmt: skip
    assert 10 * exp(-1) <= response_bounds(loop, 8).sampled[0][0] <= 10 * exp(-1) * (1 + (2 / 8) ** 2 / 8 + 1e-9)


def test_a_loop_that_needs_more_products_than_allowed_has_no_bound(monkeypatch):
    """8·r·n·(c + n) products for eight periods of a lag, after which e⁻⁸ is left, less than 1/1024.

    n = 2 states with the pressure; r = 8 rows: two at two ends of the piece, and twice two unit rows; c = 5 columns:
    one disturbance at two ends, two units and one initial state.
    """
    needed = 8 * 8 * 2 * (5 + 2)
    for most, proved in ((needed, True), (needed - 1, False)):
        monkeypatch.setattr("quakedesign.guarantees.exact.plant_loop._MOST_WORK", most)
        with nullcontext() if proved else pytest.raises(ParameterError, match="stable and decay fast"):
            assert response_bounds(LAG.loop(NONE), 1).inputs[0][0] > 1


def test_a_loop_with_a_large_transient_is_bounded():
    """x′ = −x/10 + 100y, y′ = −y/10 + w: the response 100·te^{−t/10} has the integral 10⁴."""
    loop = PlantLoop(
        flow=rows(["-1/10", 100], [0, "-1/10"]), segments=((rows([1, 0], [0, 1]), F(1)),), inputs=rows([0, 1]),
        sampled=(), start=rows([0, 1]), rows=rows([1, 0]),
    )  # fmt: skip
    found = response_bounds(loop, 8)
    assert 10**4 <= found.inputs[0][0] <= 10**4 * (1 + 1e-2)
    assert 1000 * exp(-1) <= found.start[0] <= 1000 * exp(-1) * (1 + 1e-2)


def test_the_larger_precision_is_tried_as_soon_as_the_smaller_one_is_lost(monkeypatch):
    """A rotation by 5.6 degrees with a decay of 1 %: its balls of 20 bits grow by 1.3 in eight periods.

    They exceed 2⁸⁰ after about 2¹¹ periods, before the tenth check.
    """
    turn = rows(["197/200", "-97/1000"], ["97/1000", "197/200"])
    loop = PlantLoop(
        flow=rows([0, 0], [0, 0]), segments=((turn, F(1)),), inputs=(), sampled=(), start=rows([1, 0]),
        rows=rows([1, 0]),
    )  # fmt: skip
    checks, raised = [], plant_loop._raised
    monkeypatch.setattr(plant_loop, "_raised", lambda part: checks.append(ctx.prec) or raised(part))
    monkeypatch.setattr(plant_loop, "_BITS", (20, 128))
    monkeypatch.setattr(plant_loop, "_MOST_WORK", 10**7)  # so that the test ends without the early exit
    assert F(197, 200) <= response_bounds(loop, 1).start[0] < F(197, 200) + F(1, 10**6)
    assert checks.count(20) < 10
    assert checks.count(128) > 1


def test_raised_bounds_exceed_all_bounds_and_zero():
    with ctx.workprec(128):
        raised = plant_loop._raised(arb_mat([[3], [0]])).entries()
        assert raised[0] > 3
        assert 0 < raised[1] < arb(2) ** -55


def test_a_sentence_names_plant_and_forces_and_a_bound_of_zero_without_unit():
    claims = PlantClaims(outputs=(UpperBound(1), UpperBound(2)), controls=(UpperBound(0), UpperBound(3)))
    remarks = {"plant": "of a fault", "disturbances": "all forces"}
    units = ("m", "m", "Pa", "Pa", "m/s^2", "m/s^2", "m/s^2")
    proof = PlantProof(part=PART, law=LAW, pieces=1, inputs=(F(1),) * 2, claims=claims, units=units)
    text = replace(proof, remarks=remarks).sentence()
    assert "(2 states, 2 controls) of a fault, from" in text
    assert "3 m/s^2 (all forces), loads" in text
    assert "|row 3| <= 0, |row 4| <= 3 Pa" in text
    assert "(2 states, 2 controls), from" in proof.sentence()
