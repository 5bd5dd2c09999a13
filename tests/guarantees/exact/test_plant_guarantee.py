"""Peaks of uncertain plants: independent runs inside, other discretisations of the norms, forged files refused."""

import json
import re
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from time import process_time
from typing import Any

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from thinned import few, some_or_all

import quakedesign as qd
from quakedesign.checking import check_files
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import UpperBound
from quakedesign.guarantees.exact.guarantee_files import guarantee_document, read_guarantee, save_guarantee
from quakedesign.guarantees.exact.plant_loop import MatrixLaw, response_bounds
from quakedesign.guarantees.exact.plant_proof import PlantClaims, PlantProof, named
from quakedesign.guarantees.search.plant_search import linear_part
from quakedesign.plant import uncertain_plant

CHECK = Path(__file__).parents[3] / "proofs" / "check.py"
REAL = qd.load_fault("real-fault")


def lqr(A, B, step, Q, R):
    plant = control.c2d(control.ss(A, B, np.eye(len(A)), 0), step)
    return control.dlqr(plant.A, plant.B, Q, R)[0]


def spring():
    """x″ + x′ + x + 2.5x³ = u, |x(0)| ≤ 1."""
    A, B = [[0, 1], [-1, -1]], [[0], [1]]
    sectors = {"spring": qd.Sector(entry=[0, -1], row=[1, 0], slopes=lambda y: (0, 2.5 * float(y) ** 2))}
    return qd.UncertainPlant(A=A, B=B, sectors=sectors, start=[1, 0], outputs={"x": [1, 0], "v": [0, 1]}), lqr(
        A, B, 0.1, np.diag([10, 1]), [[0.1]]
    )


def pendulum():
    """θ″ = 9.81·sin θ − 0.2θ′ + u + d about the upright position; the lag comes with the loop setup."""
    A, B = [[0, 1], [9.81, -0.2]], [[0], [1]]
    # sin θ less θ has slopes between sin(y)/y − 1 ≥ −y²/6 and 0 for |θ| ≤ y
    sine = qd.Sector(entry=[0, 9.81], row=[1, 0], slopes=lambda y: (-(float(y) ** 2) / 6, 0))
    slow = np.array([[0, 1, 0], [9.81, -0.2, 1], [0, 0, -50]])
    K = lqr(slow, [[0], [0], [50]], 0.02, np.diag([10, 1, 0.01]), [[0.1]])[:, :2]
    plant = qd.UncertainPlant(
        A=A,
        B=B,
        sectors={"sine": sine},
        disturbances={"push": ([0, 1], 0.1)},
        start=[0.1, 0],
        outputs={"x": [1, 0], "v": [0, 1]},
        noise={"y1": 1e-4},
    )
    return plant, K


def bearing():
    """Magnetic bearing: x″ = 2000·x + 10·i with 20 % of both unknown, and a shock."""
    A, B = [[0, 1], [2000, 0]], [[0], [10]]
    plant = qd.UncertainPlant(
        A=A,
        B=B,
        sectors={"stiffness": qd.Sector(entry=[0, 1], row=[1, 0], slopes=(-200, 200))},
        gains={"u1": (0.9, 1.1)},
        disturbances={"shock": ([0, 1], 5)},
        outputs={"x": [1, 0], "v": [0, 1]},
    )
    return plant, lqr(A, B, 0.001, np.diag([1e4, 1]), [[0.01]])


def converter():
    """Averaged buck converter about its operating point: L = 1 mH, C = 0.1 mF, load 5 to 20 Ω, source 12 V ± 10 %."""
    L, C, low, high = 1e-3, 1e-4, 1 / 20, 1 / 5
    A, B = [[0, -1 / L], [1 / C, -(low + high) / 2 / C]], [[12 / L], [0]]
    half = (high - low) / 2 / C
    plant = qd.UncertainPlant(
        A=A,
        B=B,
        sectors={"load": qd.Sector(entry=[0, 1], row=[0, 1], slopes=(-half, half))},
        gains={"u1": (0.9, 1.1)},
        disturbances={"current": ([0, 1 / C], 0.05)},
        outputs={"x": [1, 0], "v": [0, 1]},
    )
    return plant, lqr(A, B, 2e-5, np.diag([1, 1]), [[100.0]])


PLANTS = {
    "spring": (spring, {"step": "0.1"}),
    "pendulum": (pendulum, {"step": "0.02", "lag": "0.02"}),
    "bearing": (bearing, {"step": "0.001", "delay": "0.0003"}),
    "converter": (converter, {"step": "2e-5"}),
}


@pytest.fixture(scope="module", params=PLANTS)
def proved(request):
    make, setup = PLANTS[request.param]
    plant, K = make()
    found = qd.guarantee(plant, gains=K, **setup).proof
    assert found.available, found
    return request.param, plant, K, found


@some_or_all
def test_both_checkers_decide_the_file_and_refuse_tighter_claims(proved, checker, tmp_path, most):
    path = tmp_path / "plant.json"
    save_guarantee(proved[3], path)
    assert check_files([path])[str(path)][0] == "proved"
    assert checker.check(path.read_text()).verdict == "proved"
    for name in ("output_1", "output_2", "control_1")[: most and 1]:
        document = json.loads(path.read_text())
        document["claims"][name] = str(Fraction(document["claims"][name]) * Fraction(98, 100))
        with pytest.raises(checker.Refused):
            checker.check(json.dumps(document))
        assert str(read_guarantee(document).check()) != "proved"


ACCELERATION = {
    "spring": lambda x, u, d, r: -x[0] - x[1] - 2.5 * x[0] ** 3 + u,
    "pendulum": lambda x, u, d, r: 9.81 * np.sin(x[0]) - 0.2 * x[1] + u + 0.1 * d,
    "bearing": lambda x, u, d, r: (2000 + 200 * r[0]) * x[0] + 10 * (1 + 0.1 * r[1]) * u + 5 * d,
}


def test_an_independent_run_with_adverse_disturbances_stays_inside(proved):
    """SciPy on the nonlinear equations, each disturbance and uncertain term at an end that resonates."""
    name, _, K, found = proved
    step, delay, lag = (float(Fraction(PLANTS[name][1].get(key, "0"))) for key in ("step", "delay", "lag"))
    random, largest = np.random.default_rng(5), np.zeros(2)
    for course in range(6):
        period, ends = step * random.uniform(3, 40), random.choice([-1, 1], 3)
        first = {"spring": [random.choice([-1, 1]), 0], "pendulum": [0.1 * random.choice([-1, 1]), 0]}
        x, before = np.array([*first.get(name, [0, 0]), 0.0], dtype=float), 0.0

        def rates(t, x, u, period=period, ends=ends):
            d = np.sign(np.sin(2 * np.pi * t / period)) or 1.0
            acts = x[2] if lag else u
            if name == "converter":
                load = 0.125 + 0.075 * ends[0]
                current = (12 * (1 + 0.1 * ends[1]) * acts - x[1]) / 1e-3
                voltage = (x[0] - load * x[1] + 0.05 * d) / 1e-4
                return [current, voltage, 0]
            return [x[1], ACCELERATION[name](x, acts, d, ends), (u - x[2]) / lag if lag else 0]

        for k in range(80 if course else 200):
            seen = x[:2] + ([1e-4 * random.choice([-1, 1]), 0] if name == "pendulum" else 0)
            u = -float(K[0] @ seen)
            for acts, start, end in ((before, 0, delay), (u, delay, step)):
                if end > start:
                    span = (k * step + start, k * step + end)
                    run = solve_ivp(rates, span, x, args=(acts,), max_step=step / 4, rtol=1e-8, atol=1e-12)
                    largest = np.maximum(largest, np.abs(run.y[:2]).max(axis=1))
                    x = run.y[:, -1]
            before = u
    claims = [float(v) for v in found.claims.outputs]
    assert largest[0] <= claims[0]
    assert largest[1] <= claims[1]
    assert largest[0] >= 0.2 * claims[0]  # the runs are no idle ones


@pytest.mark.slow
def test_norms_are_those_of_another_discretisation():
    """Sums of |impulse responses| by matrix exponentials in steps of a 64th of a period, from below."""
    _, _, _, found = (
        None,
        None,
        None,
        qd.guarantee(bearing()[0], gains=bearing()[1], step="0.001", delay="0.0003").proof,
    )
    loop = found.part.loop(found.law)
    bounds = response_bounds(loop, 16)
    flow = np.array(loop.flow, dtype=float)
    rows, fine = np.array(loop.rows, dtype=float), 1e-3 / 200
    jumps = [np.array(jump, dtype=float) for jump, _ in loop.segments]
    counts = [round(float(time) / fine) for _, time in loop.segments]
    step = expm(flow * fine)
    for i, entry in enumerate(np.array(loop.inputs, dtype=float)):
        # responses at the end of a period to impulses at all earlier times
        total, now = np.zeros(len(rows)), np.eye(len(flow))
        for _ in range(300):
            for jump, count in zip(reversed(jumps), reversed(counts), strict=True):
                for _ in range(count):
                    total += np.abs(rows @ now @ entry) * fine
                    now = now @ step
                now = now @ jump
        exact = np.array([float(v) for v in bounds.inputs[i]])
        assert (exact >= total * (1 - 1e-2)).all()
        assert (exact[:2] <= 1.6 * total[:2]).all()  # the largest of all phases, which a period's end need not be


def leaves(value, way=()):
    if isinstance(value, dict):
        for key, entry in value.items():
            yield from leaves(entry, (*way, key))
    elif isinstance(value, list):
        for place, entry in enumerate(value):
            yield from leaves(entry, (*way, place))
    elif way[0] not in ("format", "kind"):
        yield way


@pytest.mark.slow
def test_every_number_of_a_file_is_bound_by_what_is_printed(checker):
    plant, K = bearing()
    document = guarantee_document(qd.guarantee(plant, gains=K, step="0.001").proof)
    stated = checker.check(json.dumps(document)).statement
    ways = list(leaves(document))
    assert len(ways) > 40
    for way in ways:
        changed = json.loads(json.dumps(document))
        inner = changed
        for key in way[:-1]:
            inner = inner[key]
        value = inner[way[-1]]
        moved = value + 1 if isinstance(value, int) else str(Fraction(value) * Fraction(1001, 1000) + Fraction(1, 997))
        inner[way[-1]] = moved
        try:
            assert checker.check(json.dumps(changed)).statement != stated, way
        except checker.Refused:
            pass


def test_a_sector_that_holds_up_to_a_bound_needs_it_in_both_checkers(checker):
    plant, K = spring()
    document = guarantee_document(qd.guarantee(plant, gains=K, step="0.1").proof)
    document["plant"]["sectors"][0]["within"] = "11/10"
    with pytest.raises(checker.Refused, match="stay within the bound of its sector"):
        checker.check(json.dumps(document))
    assert str(read_guarantee(document).check()) == "undecided"
    document["plant"]["sectors"][0]["within"] = "2"
    document["inputs"] = ["1"]
    with pytest.raises(checker.Refused, match="small-gain condition"):
        checker.check(json.dumps(document))
    assert str(read_guarantee(document).check()) == "undecided"


def test_a_loop_that_is_too_large_is_refused_before_its_powers_are_formed(checker, monkeypatch):
    plant, K = spring()
    text = json.dumps(guarantee_document(qd.guarantee(plant, gains=K, step="0.1").proof))
    checker.check(text)
    for module in [module for name, module in sys.modules.items() if name.endswith("guarantee.plant")]:
        monkeypatch.setattr(module, "MOST_WORK", 1000)
        monkeypatch.setattr(module, "shrinks", None)
    with pytest.raises(checker.Refused, match="the loop must be smaller"):
        checker.check(text)


def decaying():
    """x' = -x + u + w + d with |w| <= |x|/2 and |d| <= 1."""
    sector = qd.Sector(entry=[1], row=[1], slopes=(-0.5, 0.5))
    return qd.UncertainPlant(A=[[-1]], B=[[1]], sectors={"s": sector}, disturbances={"d": ([1], 1)})


@pytest.mark.parametrize(("size", "verdict"), [(Fraction(6, 5), "proved"), (Fraction(49, 50), "undecided")])
def test_numbers_for_a_sector_must_exceed_half_its_width_times_the_peak(size, verdict, checker):
    """x' = -x + w + d with |w| <= |x|/2 and |d| <= 1: the peak is 1 + W, so W must exceed (1 + W)/2, or 1."""
    proof = qd.guarantee(decaying(), gains=[[0]], step="0.1").proof
    wide = replace(proof.claims, outputs=(UpperBound(Fraction(9)),), controls=(UpperBound(Fraction(9)),))
    given = replace(proof, inputs=(size,), claims=wide)
    assert str(given.check()) == verdict
    assert (checker_verdict(checker, given) == "proved") is (verdict == "proved")


@pytest.mark.parametrize("delay", ["0.05", "0.25", "0.3"])
def test_a_delay_of_several_periods_is_that_of_the_other_checker(delay, checker):
    """x' = -x - 3x(t - delay) + d: the peak grows with the delay, so that claims for a shorter one are refused."""
    plant = qd.UncertainPlant(A=[[-1]], B=[[1]], disturbances={"d": ([1], 1)})
    proof = qd.guarantee(plant, gains=[[3]], step="0.1", delay=delay).proof
    assert checker_verdict(checker, proof) == "proved"
    later = replace(proof, law=replace(proof.law, delay=proof.law.delay + Fraction(1, 10)))
    assert str(later.check()) == checker_verdict(checker, later) == "undecided"


def checker_verdict(checker, proof):
    try:
        return checker.check(json.dumps(guarantee_document(proof))).verdict
    except checker.Refused:
        return "undecided"


def test_negative_numbers_close_no_small_gain(checker):
    """x′ = −x + φ + d is unstable at φ = 9x, but −10 is above 9·(1 − 10), and −9 is below every claim."""
    found = qd.guarantee(decaying(), gains=[[0]], step="0.1").proof
    document = guarantee_document(found)
    document["plant"]["sectors"][0]["slopes"], document["inputs"] = ["-9", "9"], ["-10"]
    with pytest.raises(checker.Refused, match="must be >= 0"):
        checker.check(json.dumps(document))
    with pytest.raises(CertificateError, match="inputs must be 0 or more"):
        read_guarantee(document)
    sectors = (replace(found.part.sectors[0], slopes=(Fraction(-9), Fraction(9))),)
    unread = replace(found, part=replace(found.part, sectors=sectors), inputs=(Fraction(-10),))
    assert str(unread.check()) == "undecided"


def broken(document, way, value):
    for key in way[:-1]:
        document = document[key]
    document[way[-1]] = value


@few(
    ("way", "value"),
    [
        (("pieces",), 0),
        (("pieces",), 65),
        (("pieces",), "16"),
        (("plant", "A"), [["0"]]),
        (("plant", "noise"), ["-1", "0"]),
        (("plant", "start"), ["-1", "0"]),
        (("plant", "disturbances", 0, "size"), "-1"),
        (("plant", "sectors", 0, "slopes"), ["1", "0"]),
        (("plant", "sectors", 0, "row"), ["1", "0"]),
        (("plant", "sectors", 1, "within"), "1"),
        (("law", "step"), "0"),
        (("law", "delay"), "1"),
        (("law", "D"), [["1"]]),
        (("inputs",), ["1"]),
        (("claims", "output_3"), "1"),
        (("more",), "1"),
    ],
    every=3,
)
def test_a_file_that_breaks_a_rule_is_refused_by_both(way, value, checker):
    plant, K = bearing()
    document = guarantee_document(qd.guarantee(plant, gains=K, step="0.001").proof)
    broken(document, way, value)
    with pytest.raises(checker.Refused):
        checker.check(json.dumps(document))
    with pytest.raises(CertificateError):
        read_guarantee(document)


def test_none_says_why():
    plant, K = bearing()
    assert "a mode is unstable" in qd.guarantee(plant, gains=0 * K, step="0.001").reason
    wide = qd.UncertainPlant(
        A=[[0, 1], [-1, -1]],
        B=[[0], [1]],
        sectors={"s": qd.Sector(entry=[0, 1], row=[1, 0], slopes=(-9, 0.5))},
        disturbances={"d": ([0, 1], 1)},
    )
    none = qd.guarantee(wide, gains=[[1, 1]], step="0.1").proof
    assert "s contributes" in none.reason
    assert none.small_gain > 1
    far = qd.UncertainPlant(
        A=[[-1]],
        B=[[1]],
        sectors={"s": qd.Sector(entry=[1], row=[1], slopes=(0, 0.5), within=0.5)},
        disturbances={"d": ([1], 2)},
    )
    assert "is valid up to 0.5" in qd.guarantee(far, gains=[[0]], step="0.1").reason


USER_LAW = control.ss(1, [[1, 1]], 1, [[0, 0]], 0.1)
FOLLOWING = qd.SampledLaw.from_gains([1, 1], step="0.1", inputs=("slip", "slip_rate"))
STARTED = qd.SampledLaw.from_gains([1, 1, 1], step="0.1")
STARTED = replace(STARTED, law=replace(STARTED.law, first=((Fraction(1), Fraction(0)),)))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: qd.guarantee(bearing()[0]), "needs a law, or gains"),
        (lambda: qd.guarantee(bearing()[0], gains=[[1, 1]]), "need a step"),
        (lambda: qd.guarantee(bearing()[0], gains=[[1, 1]], step="1", jitter="1 ms"), "takes step, delay and lag"),
        (lambda: qd.guarantee(bearing()[0], gains=[[1]], step="1"), "must be 1 x 2"),
        (lambda: qd.guarantee(bearing()[0], law=control.ss(1, [[1, 1]], 1, [[0, 0]])), "dt of a law must be positive"),
        (lambda: qd.guarantee(bearing()[0], law=USER_LAW, step="0.2"), "here 0.2 s. Received dt = 0.1"),
        (lambda: qd.guarantee(bearing()[0], law=FOLLOWING), "Received one with r or r' as an input"),
        (lambda: qd.guarantee(bearing()[0], law=STARTED), "Received one with nonzero initial states"),
        (lambda: qd.guarantee(bearing()[0], "cta", gains=[[1, 1]], step="1"), "do not apply to an uncertain plant"),
        (lambda: qd.UncertainPlant(A=[[1, 2]], B=[[1]]), "matrix A of a plant must be 1 x 1"),
        (lambda: qd.UncertainPlant(A=[[1]], B=[[1]], gains={"v": (1, 2)}), "gains of a plant must be given for u1"),
        (lambda: qd.UncertainPlant(A=[[1]], B=[[1]], gains={"u1": (2, 1)}), r"\(least, largest\)"),
        (lambda: qd.UncertainPlant(A=[[1]], B=[[1]], noise={"y1": -1}), "noise and start must be 0 or more"),
        (lambda: qd.UncertainPlant(A=[[1]], B=[[1]], disturbances={"d": ([1], -1)}), "must be 0 or more"),
        (lambda: qd.UncertainPlant(A=[[1]], B=[[1]], loads={"l": ([1], [1], 1)}), "a shift that is not measured"),
        (lambda: qd.UncertainPlant.from_statespace(control.ss(1, 1, 1, 1)), "with D = 0. Received D not 0"),
        (lambda: qd.UncertainPlant.from_statespace(None), "Received NoneType"),
        (lambda: qd.UncertainPlant.from_statespace(control.ss(1, 1, 1, 0, 0.1)), "Received dt = 0.1"),
        (lambda: qd.UncertainPlant.from_blocks(REAL, 1), "blocks must be a whole number from 2 to 20"),
        (lambda: qd.UncertainPlant.from_blocks(REAL, 3, coupling=0), "coupling of blocks must be positive"),
        (lambda: qd.UncertainPlant.from_blocks(REAL.with_box("ten-percent"), 3, wells="one"), "box paper"),
    ],
)
def test_what_does_not_fit_is_refused(call, said):
    with pytest.raises(ParameterError, match=said):
        call()


def test_a_dynamic_law_with_a_load_holds_it():
    """An integrator holds a load at the input: the peak under a ramp is below that of an independent run's claim."""
    A, B = [[-1]], [[2]]
    plant = qd.UncertainPlant(A=A, B=B, loads={"weight": ([1], None, 0.5)}, outputs={"x": [1]})
    law = control.ss([[1]], [[0.1]], [[-2]], [[-1.5]], 0.1)
    found = qd.guarantee(plant, law=law).proof
    assert found.available
    x, z, reached = 0.0, 0.0, 0.0
    for k in range(400):
        u = -2 * z - 1.5 * x
        z += 0.1 * x
        run = solve_ivp(
            lambda t, x, u=u: -x + 2 * (u - 0.5 * t), (0.1 * k, 0.1 * k + 0.1), [x], rtol=1e-9, max_step=0.02
        )
        reached, x = max(reached, np.abs(run.y).max()), run.y[0, -1]
    assert 0.5 * float(found.bounds["x"]) < reached <= found.bounds["x"]
    with pytest.raises(ParameterError, match="integral action"):
        qd.guarantee(plant, gains=[[1.5]], step="0.1")
    moved = qd.guarantee(plant, law=control.ss([[1 - 1e-9]], [[0.1]], [[-2]], [[-1.5]], 0.1)).proof
    assert moved.law.update == ((1,),)
    assert "is taken for an integrator" in moved.statement()[-1]
    assert moved.to_dict()["notes"] == list(moved.notes) != []


def test_a_sentence_names_every_size_that_it_covers_rounded_inward():
    half = Fraction(1, 10**6)
    plant = qd.UncertainPlant(
        A=[[0, 1], [-1, -1]],
        B=[[0], [1]],
        sectors={"s": qd.Sector(entry=[0, 1], row=[1, 0], slopes=(-0.1, 0.1), within=Fraction(7, 3))},
        disturbances={"d": ([0, 1], Fraction(2, 30))},
        loads={"l": ([1], None, Fraction(1, 60))},
        noise={"y1": Fraction(2, 3000)},
        start=[Fraction(2, 3), 0],
    )
    law = control.ss([[1]], [[0.1, 0]], [[-0.5]], [[-2, -1.5]], 0.1)
    found = qd.guarantee(plant, law=law, delay="0.05").proof
    assert found.sentence().startswith(
        "on the uncertain plant of the certificate (2 states, 1 control), from |x_i(0)| <= 0.6666, 0, with zero-"
        "order hold over 0.1 s, with a delay of 0.05 s, for all uncertain terms in 1 sector, 1 of which hold for "
        "|y| <= 2.333, "
        "disturbances of at most 0.06666, loads that change by at most 0.01666, measurement noise of at most "
        "0.0006666, 0, for all t >= 0: |y1| <= "
    )
    for name, bound in zip(
        ("y1", "y2", "u1 minus its equilibrium value"), (*found.claims.outputs, *found.claims.controls), strict=True
    ):
        (shown,) = re.findall(rf"\|{name}\| <= ([0-9.e-]+)", found.sentence())
        assert bound <= Fraction(shown) < bound * (1 + 2000 * half)
    told = named(found, replace(plant, units={"y1": "m", "u1": "MPa", "d": "m/s²"})).sentence()
    assert "disturbances of at most 66.66 mm/s², loads that change by at most 16.66 kPa/s, measurement" in told
    prefixes = {"m": Fraction(1, 1000), "": Fraction(1), "k": Fraction(1000), "M": Fraction(10**6)}
    for name, unit, bound in (
        ("y1", "m", found.bounds["y1"]),
        ("u1 minus its equilibrium value", "Pa", found.bounds["u1"] * 10**6),
    ):
        ((shown, prefix),) = re.findall(rf"\|{name}\| <= ([0-9.]+) ([mkM]?){unit}\b", told)
        assert bound <= Fraction(shown) * prefixes[prefix] < bound * Fraction(1002, 1000)
    assert "|y2| <= 0" in told
    assert "/s, measurement" not in named(found, replace(plant, units={"y1": "m"})).sentence()


def test_a_statement_about_blocks_says_first_of_which_plant_and_how_much_of_a_force_is_the_faults():
    """r″ is at most 10/√3 of d/T², r′ at most 15/8 of d/T; real-fault has no friction of the rate."""
    plant, task = qd.UncertainPlant.from_blocks(REAL.with_box("ten-percent"), 2), REAL.reference
    law = MatrixLaw(step=Fraction(1, 10), delay=Fraction(0), update=(), measured=(), output=((), ()), feedback=((), ()))
    claims = PlantClaims(outputs=(UpperBound(1),) * 4, controls=(UpperBound(1),) * 2)
    bare = PlantProof(part=linear_part(plant, {}), law=law, pieces=1, inputs=(), claims=claims)
    found = named(bare, plant)
    before, after = found.sentence().split(" for all t >= 0: ")
    assert "without stick (friction continues to negative slip rates)" in before
    assert "of box ten-percent, the stiffness of the springs between blocks known exactly" in before
    assert "stick" not in after
    total, own, moved = (Fraction(v) / 10**6 for v in re.findall(r"([0-9.]+) µm/s²", before))
    mean = task.target_slip / task.operation_time
    needed = 10 / 3**0.5 * mean / task.operation_time + 1.1 * REAL.specific_damping * 15 / 8 * mean
    sizes = {float(size) for _, size in found.part.disturbances}
    assert own == REAL.disturbance_bounds[0] == Fraction("3.2e-4")
    assert needed <= moved < 1.01 * needed
    assert min(sizes) == max(sizes) == pytest.approx(float(own) + needed, rel=1e-4)
    assert total <= min(sizes) < total * 1.001
    assert "without stick" not in bare.sentence()  # a file is about its plant alone


def test_units_of_unknown_names_are_refused():
    with pytest.raises(ParameterError, match="Received y3"):
        qd.UncertainPlant(A=[[-1]], B=[[1]], units={"y3": "m"})


def test_slopes_that_are_steep_only_far_from_the_start_let_no_mode_escape():
    """x′ = −x + y³·50 with |y| ≤ 0.1 has slopes up to 0.5 there; at |y| = 1 they would be 50."""
    cubic = qd.Sector(entry=[1], row=[1], slopes=lambda y: (0, 50 * y**2))
    plant = qd.UncertainPlant(A=[[-1]], B=[[1]], sectors={"cubic": cubic}, start=["0.01"])
    assert qd.guarantee(plant, gains=[[0]], step="0.1").proved


def test_a_plant_of_python_control_has_its_names():
    system = control.ss([[0, 1], [-4, -1]], [[0], [1]], [[1, 0]], 0, inputs=["force"], outputs=["place"], name="arm")
    plant = qd.UncertainPlant.from_statespace(system, gains={"force": (0.9, 1.1)}, disturbances={"d": ([0, 1], 1)})
    found = qd.guarantee(plant, gains=[[1.0]], step="0.05").proof
    assert found.bounds["place"] > 0
    assert "|place|" in found.sentence()
    assert found.to_dict()["peaks"]["place"] == found.bounds["place"].exact


def friction_run(found, law, blocks, seed):
    """Largest errors of blocks whose slopes, gains and disturbances switch between their ends, by exponentials."""
    part, random = found.part, np.random.default_rng(seed)
    A, B, C = (np.array(m, dtype=float) for m in (part.A, part.B, part.C))
    F, G, H, D = (np.array(m, dtype=float) for m in (law.update, law.measured, law.output, law.feedback))
    force, *moved = [float(size) for _, size in part.disturbances[blocks - 1 :]]
    n, each = len(A), slice(blocks, 2 * blocks)
    x, z, largest, pieces = np.zeros(n), np.zeros(len(F)), np.zeros(n), 4
    period = random.uniform(1, 8)
    low, high = (np.array([float(one.slopes[end]) for one in part.sectors[:blocks]]) for end in (0, 1))
    gain = np.array([float(one.slopes[1]) for one in part.sectors[blocks:]])
    drift = np.array(moved or np.zeros(blocks)) * random.choice([-1, 1], blocks)
    shifts = [np.array(load.shift[2 * blocks :], dtype=float) * float(load.rate) for load in part.loads]
    lagging = random.choice([-1, 1], len(shifts)) @ np.array(shifts)  # of pressures that diffuse
    for k in range(300):
        y = C @ x
        u = H @ z + D @ y
        z = F @ z + G @ y
        for j in range(pieces):
            sign = np.sign(
                np.sin(2 * np.pi * (k + j / pieces) / period + np.arange(blocks) * random.choice([0, np.pi]))
            )
            now = A.copy()
            now[each, :blocks] += np.diag(np.where(x[:blocks] * sign > 0, high, low))
            larger = 1 + gain * random.choice([0, 1], blocks)
            now[each, 2 * blocks :] *= larger[:, None]
            pushed = B[each] @ u * larger + force * sign
            flowing = B[2 * blocks :] @ u + lagging
            whole = expm(np.block([[now, np.r_[drift, pushed, flowing][:, None]], [np.zeros((1, n + 1))]]) * 0.046)
            x = (whole @ [*x, 1])[:n]
            largest = np.maximum(largest, np.abs(x))
    return largest[: 2 * blocks]


@pytest.mark.slow
@pytest.mark.parametrize("wells", ["each", "one"])
def test_several_blocks_stay_inside_and_both_checkers_decide(wells, checker):
    plant = qd.UncertainPlant.from_blocks(REAL, 2, wells=wells)
    found = qd.guarantee(plant, step="0.184").proof
    assert found.available
    document = guarantee_document(found)
    assert checker.check(json.dumps(document)).verdict == "proved"
    document["claims"]["output_3"] = str(Fraction(document["claims"]["output_3"]) * Fraction(98, 100))
    with pytest.raises(checker.Refused):
        checker.check(json.dumps(document))
    claims = np.array([float(v) for v in found.claims.outputs])
    for seed in range(4):
        assert (friction_run(found, found.law, 2, seed) < claims).all()
    assert max(claims[2:]) < (2.4e-4 if wells == "each" else 9e-4)


@pytest.mark.slow
@pytest.mark.parametrize("wells", [(1000.0, 4000.0), (2500.0,)], ids=["two wells", "one well"])
@pytest.mark.parametrize("controller", ["centralised", "decentralised"])
def test_three_blocks_that_differ_under_fewer_wells_stay_inside(wells, controller, checker):
    chain = qd.load_chain(Path(__file__).parents[2] / "data" / "three_blocks.toml")
    found = qd.guarantee(replace(chain, wells=wells), controller).proof
    claims = np.array([float(v) for v in found.claims.outputs])
    for seed in range(4):
        assert (friction_run(found, found.law, 3, seed) < claims).all()
    assert checker.check(json.dumps(guarantee_document(found))).verdict == "proved"


@pytest.mark.parametrize(
    ("wells", "controller"),
    [
        ((1200.0, 3800.0), "centralised"),
        pytest.param((1200.0, 3800.0), "decentralised", marks=pytest.mark.slow),
        pytest.param((1250.0,), "centralised", marks=pytest.mark.slow),
    ],
)
def test_blocks_stay_inside_where_the_pressure_diffuses_along_the_fault(wells, controller, checker):
    chain = qd.load_chain(Path(__file__).parents[2] / "data" / "three_blocks.toml")
    blocks = tuple(replace(chain.blocks[0], length=2500.0) for _ in range(2))
    chain = replace(chain, blocks=blocks, wells=wells, diffusivity=1e6 if len(wells) == 2 else 1e7)
    found = qd.guarantee(chain, controller).proof
    assert len(found.part.A) == 4 + (2 if len(wells) == 2 else 1)
    claims = np.array([float(v) for v in found.claims.outputs])
    assert max(claims[2:]) < (3e-4 if len(wells) == 2 else 2e-3)
    for seed in range(4):
        assert (friction_run(found, found.law, 2, seed) < claims).all()
    assert checker.check(json.dumps(guarantee_document(found))).verdict == "proved"


def test_a_mode_that_escapes_wells_at_a_distance_is_named_by_the_slips_of_its_blocks(monkeypatch):
    chain = qd.load_chain(Path(__file__).parents[2] / "data" / "three_blocks.toml")
    blocks = tuple(replace(chain.blocks[0], length=2500.0) for _ in range(2))
    far = replace(chain, blocks=blocks, wells=(1200.0, 3800.0), diffusivity=1.0)
    zero, kept = Fraction(0), ((Fraction(1), Fraction(0)), (Fraction(0), Fraction(1)))
    idle: Any = {
        "update": kept,
        "measured": tuple((*row, zero, zero) for row in kept),
    }  # an integral of 1 Pa/m a sample
    idle |= {"output": tuple(tuple(-v for v in row) for row in kept), "feedback": ((zero,) * 4,) * 2}
    still = MatrixLaw(step=Fraction("0.184"), delay=zero, **idle)
    monkeypatch.setattr("quakedesign.synthesis.plant_guarantees.block_law", lambda *_, **__: still)
    none = qd.guarantee(far).proof
    # alike blocks, pole p of x'' + wx' = sx: e^(pT)
    assert none.reason.startswith(
        "a mode is unstable: with every uncertain term at its upper slope the states (1, 1) grow by a factor of "
    )
    task = uncertain_plant(far.faults[0])
    s, w = float(task.slip_chord[1]), float(task.rate_chord[0])
    grown = np.exp((np.sqrt(w**2 + 4 * s) - w) / 2 * 0.184)
    assert none.reason.endswith(f"grow by a factor of {grown:.4g} per sample")


@pytest.mark.slow
def test_the_pressure_of_a_well_depends_on_its_own_measurements_in_a_decentralised_law():
    plant = qd.UncertainPlant.from_blocks(REAL, 3)
    found = qd.guarantee(plant, "decentralised", step="0.184").proof
    for part in (found.law.update, found.law.measured, found.law.output, found.law.feedback):
        assert all(not v or i % 3 == j % 3 for i, row in enumerate(part) for j, v in enumerate(row))
    claims = np.array([float(v) for v in found.claims.outputs])
    assert (friction_run(found, found.law, 3, 1) < claims).all()
    whole = qd.guarantee(plant, "centralised", step="0.184").proof
    assert max(whole.claims.outputs[3:]) < max(found.claims.outputs[3:])


@pytest.mark.parametrize("given", [{"gains": [[1.0]]}, {}], ids=["gains", "no blocks"])
def test_a_law_that_is_not_designed_is_not_decentralised(given):
    with pytest.raises(ParameterError, match="Received controller"):
        qd.guarantee(qd.UncertainPlant(A=[[-1]], B=[[1]]), "decentralised", step="0.1", **given)


def test_blocks_that_one_well_does_not_hold_name_the_mode_that_escapes():
    plant = qd.UncertainPlant.from_blocks(REAL, 2, wells="one", coupling=0.5)
    none = qd.guarantee(plant, step="0.184").proof
    assert "a mode that is not measured is unstable" in none.reason
    assert "(1, -1)" in none.reason or "(-1, 1)" in none.reason


@pytest.mark.slow
@pytest.mark.parametrize(("wells", "most"), [("each", "3.5e-4"), ("one", "1.4e-3")])
def test_five_blocks_of_the_real_fault(wells, most, checker):
    found = qd.guarantee(qd.UncertainPlant.from_blocks(REAL, 5, wells=wells), step="0.184").proof
    assert max(found.claims.outputs[5:]) <= Fraction(most)
    claims = np.array([float(v) for v in found.claims.outputs])
    for seed in range(4):
        assert (friction_run(found, found.law, 5, seed) < claims).all()
    assert checker.check(json.dumps(guarantee_document(found))).verdict == "proved"


def exact_peaks(A, B, entry, K, step, delay, fine=20, periods=400):
    """Largest |x| and |v| that a disturbance of size 1 gives one linear plant: sums of |response| at all phases."""
    n, h = len(A), step / fine
    flow = np.zeros((n + 2, n + 2))  # states, control that acts, control on its way
    flow[:n, :n], flow[:n, n] = A, np.ravel(B)
    move, sample, arrive = expm(flow * h), np.eye(n + 2), np.eye(n + 2)
    sample[n + 1, :], arrive[n, :] = [*-np.ravel(K), 0, 0], np.eye(n + 2)[n + 1]
    late, entered = round(delay / h), np.array([*entry, 0, 0], dtype=float)
    maps = []
    for j in range(fine):
        before = np.eye(n + 2) if j else sample
        maps.append(move @ (arrive @ before if j == late else before))
    largest = np.zeros(2)
    for end in range(fine):
        now, total = np.eye(n + 2)[:2], np.zeros(2)
        for back in range(periods * fine):
            total += np.abs(now @ entered) * h
            now = now @ maps[(end - back) % fine]
        largest = np.maximum(largest, total)
    return largest


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bearing", "converter"])
def test_peaks_are_near_the_exact_ones_of_the_worst_constant_plant(name):
    """A lower bound that some course reaches: the L1 norm of the worst vertex, by exponentials."""
    (plant, K), setup = PLANTS[name][0](), PLANTS[name][1]
    step, delay = float(Fraction(setup["step"])), float(Fraction(setup.get("delay", "0")))
    if name == "bearing":
        vertices = [([[0, 1], [2000 + 200 * a, 0]], [[0], [10 + b]], [0, 5]) for a in (-1, 1) for b in (-1, 1)]
    else:
        loads, sources = (1 / 20, 1 / 5), (0.9, 1.1)
        vertices = [
            ([[0, -1e3], [1e4, -1e4 * load]], [[12e3 * share], [0]], [0, 500]) for load in loads for share in sources
        ]
    least = np.max([exact_peaks(*vertex, K, step, delay) for vertex in vertices], axis=0)
    claims = np.array([float(v) for v in qd.guarantee(plant, gains=K, **setup).proof.claims.outputs])
    assert (least <= claims * (1 + 1e-3)).all()
    assert (claims <= 1.6 * least).all(), claims / least


@pytest.mark.slow
def test_springs_of_three_let_a_mode_of_five_blocks_escape_one_well():
    none = qd.guarantee(qd.UncertainPlant.from_blocks(REAL, 5, wells="one", coupling=3), step="0.184").proof
    assert "a mode that is not measured is unstable" in none.reason
    slow = -np.cos(np.pi * (np.arange(5) + 0.5) / 5)  # the slowest mode of a chain that differs
    shape = [float(v) for v in re.search(r"states \((.*?)\)", none.reason)[1].split(",")]
    assert np.abs(shape / np.max(np.abs(shape))) == pytest.approx(np.abs(slow / slow[-1]), abs=0.01)


@pytest.mark.slow
def test_ten_blocks_are_designed_proved_and_checked_within_their_time(checker):
    began = process_time()
    found = qd.guarantee(qd.UncertainPlant.from_blocks(REAL, 10), step="0.184").proof
    assert process_time() - began <= 60
    text, began = json.dumps(guarantee_document(found)), process_time()
    assert checker.check(text).verdict == "proved"
    assert process_time() - began <= 30
    claims = np.array([float(v) for v in found.claims.outputs])
    for seed in range(2):
        assert (friction_run(found, found.law, 10, seed) < claims).all()


def test_a_plant_that_nothing_moves_is_refused_and_a_proof_is_saved(tmp_path):
    still = {"A": [[0, 1], [1, 0]], "B": [[0], [1]]}
    with pytest.raises(ParameterError, match="needs disturbances, loads, noise or start"):
        qd.guarantee(qd.UncertainPlant(**still), gains=[[3, 2]], step="0.1 s")
    found = qd.guarantee(qd.UncertainPlant(**still, start=[1, 0]), gains=[[3, 2]], step="0.1 s")
    found.save(tmp_path / "plant.json")
    assert qd.load_guarantee(tmp_path / "plant.json").claims == found.proof.claims
