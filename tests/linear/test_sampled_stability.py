"""What the search for sampling periods does with its answers: which periods are tried, proved, refuted and reported."""

from fractions import Fraction as F
from itertools import pairwise

import pytest

import quakedesign as qd
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.linear import sampled_stability as module
from quakedesign.linear.linear_problem import LinearProblem, diagonal
from quakedesign.linear.sampled_stability import ClockProof, DelayProof, HeldPoles, LargestVaryingStep
from quakedesign.lyapunov.exact.claim import Verdict

PROBLEM = LinearProblem.of(qd.load_fault("real-fault", box="ten-percent"))
GAINS = (F(10**9), F(10**8), F(10**8), F(10**7))
PLUS, MINUS = diagonal((F(1),) * 5), diagonal((F(1), F(1), F(-1), F(1), F(1)))


def delay(longest):
    return DelayProof(longest=F(longest), P=PLUS, W=PLUS)


def clock(shortest, longest):
    return ClockProof(shortest=F(shortest), longest=F(longest), P=(PLUS,))


@pytest.mark.parametrize(
    ("proof", "forms", "expected"),
    [
        (clock(1, 2), {"P": PLUS, "v": PLUS}, True),
        (clock(2, 2), {"P": PLUS}, True),
        (clock(1, 2), {"P": PLUS, "v": MINUS}, False),
        (clock(1, 2), {"P": MINUS, "v": PLUS}, False),
        (clock(0, 2), {"P": PLUS}, False),
        (clock(-1, 2), {"P": PLUS}, False),
        (clock(2, 1), {"P": PLUS}, False),
        (delay(1), {"P": PLUS, "v": PLUS}, True),
        (delay(1), {"P": PLUS, "v": MINUS}, False),
    ],
)
def test_a_proof_holds_where_all_its_forms_are_positive_definite_and_its_periods_are_ordered(
    proof, forms, expected, monkeypatch
):
    monkeypatch.setattr(type(proof), "forms", lambda *_: forms)
    assert proof.holds(PROBLEM, GAINS) is expected


def bracket(limit, monkeypatch):
    tried = []

    def unstable(_, step):
        tried.append(step)
        return PROBLEM.vertices()[0] if limit is not None and step > limit else None

    monkeypatch.setattr(HeldPoles, "unstable", unstable)
    return HeldPoles(PROBLEM, GAINS).limit(), tried


@pytest.mark.parametrize("limit", [F(1, 3), F(1, 50), F(123)])
def test_the_limit_of_the_corners_is_bracketed_within_the_tolerance(limit, monkeypatch):
    (low, high), _ = bracket(limit, monkeypatch)
    assert low <= limit < high <= low * (1 + F(module._TOLERANCE))


def test_a_loop_that_no_period_destabilises_is_tried_up_to_a_last_period(monkeypatch):
    found, tried = bracket(None, monkeypatch)
    assert found == (tried[-1], None)
    assert all(b == 2 * a for a, b in pairwise(tried))
    assert len(tried) == module._DOUBLINGS


def test_no_limit_is_found_where_every_period_is_refuted(monkeypatch):
    found, tried = bracket(F(0), monkeypatch)
    assert found is None
    assert tried[1] / 2**13 <= tried[-1] <= tried[1] / 2**12  # about 4000 times shorter than the first period


def test_without_an_integral_every_period_is_refuted_at_once():
    assert HeldPoles(PROBLEM, (*GAINS[:3], F(0))).unstable(F(1)) == PROBLEM.vertices()[0]


@pytest.fixture
def searches(monkeypatch):
    """The searches for proofs, which answer with what is set and note what they are asked."""
    answers = {"unstable": None, "delay": None, "clock": {}}
    asked = []

    def clock_proof(problem, gains, steps, *, degree=module.DEGREE):
        asked.append((steps, degree))
        return answers["clock"].get((*steps, degree))

    def delay_proof(problem, gains, step):
        asked.append(step)
        return answers["delay"](step) if answers["delay"] else None

    monkeypatch.setattr(HeldPoles, "unstable", lambda _, step: answers["unstable"] and answers["unstable"](step))
    monkeypatch.setattr(module, "clock_proof", clock_proof)
    monkeypatch.setattr(module, "delay_proof", delay_proof)
    return answers, asked


def test_a_period_is_refuted_by_a_corner_before_a_proof_is_searched(searches):
    answers, asked = searches
    answers["unstable"] = lambda step: ("corner", step)
    found = module.varying_verdict(PROBLEM, GAINS, "0.5")
    assert (found.verdict, found.step, found.witness, found.proof) == (
        Verdict.REFUTED,
        F(1, 2),
        ("corner", F(1, 2)),
        None,
    )
    assert asked == []


def test_one_v_is_tried_first_and_then_v_that_depend_on_the_clock(searches):
    answers, asked = searches
    assert module.varying_verdict(PROBLEM, GAINS, F(1)).verdict is Verdict.UNDECIDED
    assert asked == [F(1), ((F(1), F(1)), 8), ((F(1), F(1)), 16)]
    answers["clock"] = {(F(1), F(1), 8): clock(1, 1), (F(1), F(1), 16): "unused"}
    asked.clear()
    found = module.varying_verdict(PROBLEM, GAINS, F(1))
    assert (found.verdict, found.proof) == (Verdict.PROVED, clock(1, 1))
    assert len(asked) == 2
    answers["clock"] = {(F(1), F(1), 16): clock(1, 1)}
    assert module.varying_verdict(PROBLEM, GAINS, F(1)).proof == clock(1, 1)
    answers["delay"] = delay
    asked.clear()
    assert module.varying_verdict(PROBLEM, GAINS, F(1)).proof == delay(1)
    assert asked == [F(1)]


def test_a_known_proof_of_the_period_is_used(searches):
    _, asked = searches
    known = LargestVaryingStep(proved=LowerBound(F(2)), refuted=None, proofs=(delay(1), clock(1, 2)))
    assert [known.proof_at(step) for step in (F(1, 2), F(3, 2), F(3))] == [delay(1), clock(1, 2), None]
    assert module.varying_verdict(PROBLEM, GAINS, F(3, 2), longest=known).proof == clock(1, 2)
    assert asked == []
    assert module.varying_verdict(PROBLEM, GAINS, F(3), longest=known).verdict is Verdict.UNDECIDED
    assert [entry for entry in asked if isinstance(entry, F)] == []


def limit_of(value, monkeypatch):
    monkeypatch.setattr(HeldPoles, "limit", lambda _: value)


def test_ranges_of_periods_follow_each_other_up_to_the_limit(searches, monkeypatch):
    answers, _ = searches
    limit_of((F(1), F(101, 100)), monkeypatch)
    answers["delay"] = lambda step: delay(step) if step <= F(1, 2) else None
    answers["unstable"] = lambda step: "corner" if step > 1 else None
    first = module._longest_delay(PROBLEM, GAINS, F(1))
    assert F(49, 100) <= first.longest <= F(1, 2)
    one, two = (first.longest, F(88, 100)), (F(88, 100), F(99, 100))
    answers["clock"] = {(*one, 8): clock(*one), (*two, 8): clock(*two)}
    found = module.largest_varying_step(PROBLEM, GAINS)
    assert found.proofs == (first, clock(*one), clock(*two))
    assert (found.proved, found.refuted) == (LowerBound(F(99, 100)), UpperBound(F(101, 100)))


def test_no_range_is_reported_without_a_first_proof_or_a_limit(searches, monkeypatch):
    answers, asked = searches
    limit_of((F(1), None), monkeypatch)
    assert module.largest_varying_step(PROBLEM, GAINS) is None
    assert min(asked) < F(2, 1000)  # one V is searched down to a thousandth of the limit
    limit_of(None, monkeypatch)
    answers["delay"] = delay
    assert module.largest_varying_step(PROBLEM, GAINS) is None
    limit_of((F(1), None), monkeypatch)
    assert module.largest_varying_step(PROBLEM, GAINS).refuted is None


def test_a_refuted_period_is_rounded_up_only_if_the_rounded_one_is_refuted(searches):
    answers, _ = searches
    corners = HeldPoles(PROBLEM, GAINS)
    answers["unstable"] = lambda step: "corner"
    assert module._refuted(corners, F("0.123456")) == UpperBound(F("0.1235"))
    answers["unstable"] = lambda step: "corner" if step == F("0.123456") else None
    assert module._refuted(corners, F("0.123456")) == UpperBound(F("0.123456"))
    assert module._short(F("0.123456")) == F("0.1234")


def test_results_for_a_period_are_plain_values_and_none_where_nothing_is_known():
    witness = (F(1), F(1, 2), F(3))
    longest = LargestVaryingStep(proved=LowerBound(F(1, 2)), refuted=UpperBound(F(3, 4)), proofs=())
    verdict = module.VaryingVerdict(verdict=Verdict.REFUTED, step=F(1), witness=witness)
    known = module.SampledStability(verdict_at_step=verdict, longest=longest, radius=1.5)
    assert known.to_dict() == {
        "step": 1.0,
        "verdict": str(Verdict.REFUTED),
        "varying": str(Verdict.REFUTED),
        "radius": 1.5,
        "witness": [1.0, 0.5, 3.0],
        "largest_step": 0.5,
        "refuted_step": 0.75,
    }
    undecided = module.VaryingVerdict(verdict=Verdict.UNDECIDED, step=F(1))
    unknown = module.SampledStability(verdict_at_step=undecided, longest=None, radius=float("nan")).to_dict()
    assert [unknown[key] for key in ("radius", "witness", "largest_step", "refuted_step")] == [None] * 4


@pytest.mark.parametrize("valid", [True, False])
@pytest.mark.parametrize("search", ["delay", "clock"])
def test_what_a_solver_proposes_is_a_proof_only_if_it_holds_exactly(search, valid, monkeypatch):
    asked = []
    monkeypatch.setattr(module, "proposed", lambda *_: [PLUS[:4], PLUS[:3]] if search == "delay" else [PLUS, PLUS])
    monkeypatch.setattr(module, "rounded", lambda matrix, bits: tuple(row[: len(matrix)] for row in matrix))
    for kind in (DelayProof, ClockProof):
        monkeypatch.setattr(kind, "holds", lambda self, *_: asked.append(self) or valid)
    if search == "delay":
        found = module.delay_proof(PROBLEM, GAINS, F(1, 2))
        ends = [(proof.longest,) for proof in asked]
    else:
        found = module.clock_proof(PROBLEM, GAINS, (F(1, 3), F(1, 2)))
        ends = [(proof.shortest, proof.longest) for proof in asked]
    tried = 1 if valid else len(module.BITS)
    assert ends == [(F(1, 2),) if search == "delay" else (F(1, 3), F(1, 2))] * tried
    assert found == (asked[0] if valid else None)
