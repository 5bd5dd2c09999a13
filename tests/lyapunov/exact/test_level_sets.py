"""Level sets of a V whose powers and roots are known: V = 2|e1|^(5/3) + 3|e2|^(5/2) + |e3|^5."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.laws import LoopField
from quakedesign.lyapunov import Certificate, Loop
from quakedesign.lyapunov.exact.robustness import LevelSets
from quakedesign.symbolic.terms import Term

LEVEL = F(64)
SCALE = F(2)


def power(coefficient, name, exponent, kind="a", parameters=()):
    return Term(F(coefficient), parameters, ((name, F(exponent), kind),))


def certificate(units_of=()):
    """V >= gamma_i u_i^5 with gamma = 2, 2, 2: |e1| <= 8, |e2| <= 4, |e3| <= 2 where V <= 64.

    e2' = -beta k sqrt|e2| + beta r e3 with k = 3, beta in [1, 5], r in [7/5, 3/2]: at most 5*3*2 + 5*3/2*2 = 45.
    """
    loop = Loop(
        law="own",
        gains={"k": F(3)},
        constants={"c": F(2)},
        states={"e1": 3, "e2": 2, "e3": 1},
        domain="cells",
        uncertain={"beta": (F(1), F(5))},
        field={
            "e1": (power(1, "e2", 1, "s"),),
            "e2": (power(-1, "e2", "1/2", "s", ("beta", "k")), power(1, "e3", 1, "s", ("beta", "r"))),
            "e3": (power(-1, "e3", 1, "s"),),
        },
        roots={"r": ("c", (F(7, 5), F(3, 2)))},
    )
    lyapunov = (power(2, "e1", "5/3"), power(3, "e2", "5/2"), power(1, "e3", 5))
    return Certificate(loop=loop, lyapunov=lyapunov, claims={f"bound_e{i}": F(2) for i in (1, 2, 3)})


def model():
    """Loop in which a unit of e1 is 4k/3 = 4 m, and one of e2 is r m/s."""
    e1, e2, e3, k, r, c = sp.symbols("e1 e2 e3 k r c", real=True)
    return LoopField(
        states={e1: 1, e2: 1, e3: 1},
        field={e1: e2, e2: -k * e2, e3: -e3},
        gains=(k,),
        constants=(c,),
        uncertain=(),
        domain="reals",
        roots={r: c},
        units={e1: 4 * k / 3, e2: r},
    )


def about(bound, exact, *, below=False):
    """On the safe side of a number, and close to it."""
    return exact * (1 - F(1, 10**6)) <= bound <= exact if below else exact <= bound <= exact * (1 + F(1, 10**6))


def test_the_degree_is_that_of_every_term():
    assert LevelSets(certificate(), SCALE).degree == 5


def test_a_matched_perturbation_alone_gives_its_own_term():
    assert about(LevelSets(certificate(), SCALE).level(F(6)), F(3) ** 5)  # 6/2 to the fifth


def test_a_joint_start_adds_up():
    # |e1| <= 16 and |e2| <= 8, |e3| <= 6, all over 2: 2*8^(5/3) + 3*4^(5/2) + 3^5
    assert about(LevelSets(certificate(), SCALE).level_of(slip=F(16), rate=F(8), matched=F(6)), 64 + 96 + F(243))


def test_errors_are_the_bounds_of_the_states_times_the_scale():
    found = LevelSets(certificate(), SCALE).errors(LEVEL)
    assert about(found.slip, F(16))
    assert about(found.rate, F(8))
    assert about(found.acceleration, F(90))


def test_every_bound_has_its_own_claim():
    one = certificate()
    one.claims.update(bound_e1=F(64), bound_e2=F(64), bound_e3=F(64 * 32))
    found = LevelSets(one, F(1)).errors(LEVEL)
    assert about(found.slip, F(1))
    assert about(found.rate, F(1))
    assert about(found.acceleration, F(15) + F(15, 4))  # 5*3*1 + 5*3/2*1/2


def test_units_enlarge_errors_at_their_upper_end_and_starts_at_their_lower():
    sets = LevelSets(certificate(), SCALE, model())
    found = sets.errors(LEVEL)
    assert about(found.slip, F(64))
    assert about(found.rate, F(12))
    assert about(found.acceleration, F(135))
    assert about(sets.level_of(slip=F(64), rate=F(8) * F(7, 5), matched=F(6)), 64 + 96 + F(243))
    first, second, third = sets.starts(LEVEL)
    assert about(first, 8 * 4 * F(2), below=True)  # 2*8^(5/3) = 64
    assert float(second) == pytest.approx(2 * 1.4 * (64 / 3) ** 0.4, rel=1e-6)
    assert float(third) == pytest.approx(2 * 64**0.2, rel=1e-6)


def test_starts_lie_inside_for_both_signs():
    """2|e1|^(5/3) = 64, 3|e2|^(5/2) = 64, |e3|^5 = 64: 8, (64/3)^(2/5), 64^(1/5), times the scale."""
    first, second, third = LevelSets(certificate(), SCALE).starts(LEVEL)
    assert about(first, F(16), below=True)
    assert float(second) == pytest.approx(2 * (64 / 3) ** 0.4, rel=1e-6)
    assert float(third) == pytest.approx(2 * 64**0.2, rel=1e-6)
    assert third**5 <= 32 * 64
    assert second**5 <= 32 * F(64, 3) ** 2


def test_the_start_of_a_level_zero_is_zero():
    sets = LevelSets(certificate(), SCALE, model())
    assert sets.starts(F(0)) == (0, 0, 0)
    found = sets.errors(F(0))
    assert (found.slip, found.rate, found.acceleration) == (0, 0, 0)


def signed(*terms, states=("e1", "e2", "e3")):
    """Certificate with V of degree 2 in states of weight one, and bounds of one."""
    base = certificate().loop
    field = {name: (power(1, states[1], 1, "s"),) for name in states}
    loop = replace(base, states=dict.fromkeys(states, 1), field=field)
    return Certificate(loop=loop, lyapunov=terms, claims={f"bound_{name}": F(1) for name in states})


def product(coefficient, first, second):
    return Term(F(coefficient), (), ((first, F(1), "s"), (second, F(1), "s")))


def test_signs_of_a_joint_start_are_taken_at_their_worst():
    """e1^2 + e2^2 + e3^2 - 2 e1 e3 + 2 e2 e3, for |e1| <= 1, |e2| <= 2, |e3| <= 3: 1 + 4 + 9 + 6 + 12."""
    squares = tuple(power(1, name, 2) for name in ("e1", "e2", "e3"))
    sets = LevelSets(signed(*squares, product(-2, "e1", "e3"), product(2, "e2", "e3")), F(1))
    assert about(sets.level_of(slip=F(1), rate=F(2), matched=F(3)), F(32))
    assert about(sets.level(F(3)), F(9))
    assert about(sets.level_of(slip=F(1), matched=F(3)), F(16))
    assert about(sets.level_of(rate=F(2), matched=F(3)), F(25))


def test_the_state_that_holds_the_perturbation_is_the_last():
    names = ("e1", "e2", "e3", "e4")
    sets = LevelSets(signed(*(power(i + 1, name, 2) for i, name in enumerate(names)), states=names), F(1))
    assert about(sets.level_of(slip=F(1), rate=F(10), matched=F(100)), F(1 + 200 + 40000))
    assert len(sets.starts(F(1))) == 4


def test_the_start_is_that_of_the_worse_sign():
    """2 |e1|^2 - ⌈e1⌋^2 is 3 e1^2 for e1 < 0, and 2 |e2|^2 + ⌈e2⌋^2 is for e2 > 0."""
    terms = power(2, "e1", 2), power(-1, "e1", 2, "s"), power(2, "e2", 2), power(1, "e2", 2, "s"), power(1, "e3", 2)
    first, second, third = LevelSets(signed(*terms), F(1)).starts(F(12))
    assert about(first, F(2), below=True)
    assert about(second, F(2), below=True)
    assert float(third) == pytest.approx(12**0.5, rel=1e-6)


def test_the_unit_of_the_slip_is_uncertain_too():
    e1, e2, e3, k, r, c = sp.symbols("e1 e2 e3 k r c", real=True)
    other = LoopField(
        states={e1: 1, e2: 1, e3: 1}, field={e1: e2, e2: -k * e2, e3: -e3}, gains=(k,), constants=(c,),
        uncertain=(), domain="reals", roots={r: c}, units={e1: r},
    )  # fmt: skip
    sets = LevelSets(certificate(), SCALE, other)
    assert about(sets.errors(LEVEL).slip, F(24))
    assert about(sets.starts(LEVEL)[0], 16 * F(7, 5), below=True)
    assert about(sets.level_of(slip=16 * F(7, 5), matched=F(0)), F(64))


def test_the_level_zero_is_the_origin_alone():
    sets = LevelSets(certificate(), SCALE)
    found = sets.errors(F(0))
    assert (found.slip, found.rate, found.acceleration) == (0, 0, 0)
    assert sets.starts(F(0)) == (0, 0, 0)


def test_a_start_is_at_rest_unless_told():
    sets = LevelSets(certificate(), SCALE)
    assert sets.level_of(matched=F(6)) == sets.level_of(slip=F(0), rate=F(0), matched=F(6)) == sets.level(F(6))
