"""Maps of super-twisting gains against its exactly known region."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from multiprocessing import active_children
from pathlib import Path

import pytest

from quakedesign.errors import ParameterError
from quakedesign.laws.dia import DiscontinuousIntegral
from quakedesign.lyapunov import Verdict, parse_certificate
from quakedesign.lyapunov.maps import gain_map as maps
from quakedesign.lyapunov.maps.gain_map import SHARES, Screener, Screeners, axis, gain_map
from quakedesign.lyapunov.search.certify import closed_loop
from quakedesign.lyapunov.search.lyapunov_search import find_certificate
from quakedesign.parallel import Processes

SPECIFICATION = importlib.util.spec_from_file_location(
    "map_region", Path(__file__).parents[1] / "search" / "super_twisting_region.py"
)
region = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(region)

RANGES = (("0.3", "3"), ("0.8", "5"))
ASKED = {"ranges": RANGES, "points": 7, "levels": ("1", "0.5"), "degree": 6, "interior": 6, "workers": 1}


@pytest.fixture(scope="module")
def drawn():
    return gain_map("super-twisting", ("1.5", "1.1"), ("k1", "k2"), **ASKED)


def gains_at(drawn, place):
    return tuple(values[i] for values, i in zip(drawn.sheet.axes, place, strict=True))


def test_every_point_is_screened_with_the_level_it_reaches(drawn):
    assert set(drawn.screened) == {(i, j) for i in range(7) for j in range(7)}
    assert set(drawn.screened.values()) == {0, 1, 2}
    for place, level in drawn.screened.items():
        k1, k2 = gains_at(drawn, place)
        assert drawn.limits[place] == k2
        if level:
            assert region.stable(float(k1), float(k2), float(drawn.sheet.levels[level - 1]))
    stable = [p for p in drawn.screened if region.stable(*map(float, gains_at(drawn, p)), 0.5)]
    assert sum(drawn.screened[p] > 0 for p in stable) >= 0.7 * len(stable)


def test_all_edges_and_the_points_drawn_inside_are_proved(drawn):
    inside = {k: {p for p, level in drawn.screened.items() if level >= k} for k in (1, 2)}
    for k, places in inside.items():
        edge = {
            (i, j)
            for i, j in places
            if any(
                (i + a, j + b) not in places and 0 <= i + a < 7 and 0 <= j + b < 7
                for a, b in ((0, 1), (1, 0), (0, -1), (-1, 0))
            )
        }
        assert edge
        assert all(drawn.proved[p] >= k for p in edge)
        assert edge <= drawn.edges
        counts = drawn.counts(k)
        assert (counts["screened"], counts["edge"], counts["edge_proved"]) == (len(places), len(edge), len(edge))
    assert sum(drawn.role(p) == "interior" for p in drawn.proved) == 6
    assert {drawn.role(p) for p in drawn.screened} == {"edge", "interior", ""}


def test_certificates_are_about_their_points(drawn):
    assert set(drawn.certificates) == {p for p, level in drawn.proved.items() if level}
    for place, text in list(drawn.certificates.items())[::4]:
        certificate = parse_certificate(text)
        bound = drawn.sheet.levels[drawn.proved[place] - 1]
        assert tuple(certificate.loop.gains.values()) == gains_at(drawn, place)
        assert certificate.loop.uncertain["d"] == (-bound, bound)
        assert certificate.check() is Verdict.PROVED


@pytest.mark.slow
def test_a_point_without_a_proof_is_told_from_a_proved_one_and_its_neighbours_are_tried(drawn, monkeypatch):
    lost = min(p for p in drawn.edges if drawn.screened[p] == 1)
    honest = Screener.proof

    def failing(self, place, level):
        return (place, level, None, 1) if place == lost else honest(self, place, level)

    monkeypatch.setattr(Screener, "proof", failing)
    again = gain_map("super-twisting", ("1.5", "1.1"), ("k1", "k2"), **ASKED)
    assert again.screened == drawn.screened
    assert again.proved[lost] == 0
    assert lost not in again.certificates
    assert again.counts(1)["edge_proved"] == again.counts(1)["edge"] - 1
    around = {(lost[0] + a, lost[1] + b) for a, b in ((0, 1), (1, 0), (0, -1), (-1, 0))}
    assert all(again.proved[p] for p in around if again.screened.get(p))


@pytest.mark.slow
def test_levels_and_degree_follow_from_the_gains_unless_given():
    asked = {"ranges": RANGES, "points": 3, "interior": 0, "workers": 1}
    chosen = gain_map("super-twisting", ("1.5", "1.1"), ("k1", "k2"), **asked)
    assert chosen.sheet.levels == tuple(s * F("1.1") for s in SHARES)
    assert chosen.sheet.degree == 3
    high = gain_map("super-twisting", ("1.5", "1.1"), ("k1", "k2"), levels=("1",), **asked)
    assert high.sheet.degree == 6
    loop = closed_loop("super-twisting", ("1.5", "1.1"), lipschitz=1)
    assert [bool(find_certificate(loop, degree)) for degree in (3, 4, 6)] == [False, False, True]
    quarter = gain_map("super-twisting", ("1.5", "1.1"), ("k2", "k1"), points=3, levels=("1",), interior=0, workers=1)
    assert quarter.sheet.axes[0] == (F("0.275"), F("1.1"), F("4.4"))


def test_an_interrupted_map_leaves_no_process_waiting(monkeypatch):
    def stop(what, done):
        if done > 0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gain_map("super-twisting", ("1.5", "1.1"), ("k1", "k2"), progress=stop, **ASKED)
    assert not active_children()


@pytest.mark.slow
def test_processes_give_the_same_answers_even_if_they_are_killed():
    sheet = maps._sheet("super-twisting", ("1.5", "1.1"), ("k1", "k2"), RANGES, 3, ("1",), (1, 1), 4)
    alone = Screener(sheet)
    with Processes(2) as processes:
        crew = Screeners(sheet, processes)
        first = [found for found, _ in crew.results("row", [(row,) for row in sheet.rows])]
        for process in active_children():
            process.kill()
        second = list(crew.results("proof", [((2, 2), 1)]))
    assert sorted(first) == sorted(alone.row(row)[0] for row in sheet.rows)
    assert second == [alone.proof((2, 2), 1)]
    assert second[0][2] is not None


def test_axes_are_exact_and_divided_in_equal_ratios_where_positive():
    values = axis("0.5", 8, 5)
    assert values == (F(1, 2), 1, 2, 4, 8)
    assert axis(-1, 1, 3) == (-1, 0, 1)
    assert axis(0, "1/3", 2) == (0, F(1, 3))
    many = axis(1, 2, 200)
    assert len(set(many)) == 200


@pytest.mark.slow
def test_points_that_cannot_be_expressed_are_not_found():
    # with e1 for a state the root of kI1 stands under a cube root, so that it must be rational
    dia = DiscontinuousIntegral.loop_field()
    ((root, gain),) = dia.roots.items()
    f1, e2, _ = dia.states
    field = {state: rate.subs(f1, f1 * gain * root) for state, rate in dia.field.items()} | {f1: e2}
    subject = replace(dia, field=field, units={})
    sheet = maps._sheet(
        subject, ("4", "20", "1", "0.1"), ("kI1", "kI4"), (("4", "5"), (0, "0.1")), 2, ("0.3",), (1, 1), 5
    )
    screener = Screener(replace(sheet, degree=5))
    assert [screener._solvable(place, 1) for place in ((0, 1), (1, 0), (1, 1))] == [True, False, False]
    assert sheet.rows == [[(0, 0), (0, 1)], [(1, 0), (1, 1)]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"over": ("k1", "k9")}, "two different gains among k1, k2"),
        ({"over": ("k1", "k1")}, "two different gains"),
        ({"points": 1}, "at least two points"),
        ({"ranges": (("3", "1"), ("1", "2"))}, "the lower end of the range of k1 must be below"),
        ({"ranges": (("1", "1.00001"), ("1", "2")), "points": 60}, "too narrow for 60 points"),
        ({"levels": ("-1",)}, "must not be negative"),
        ({"levels": ()}, "must not be negative"),
        ({"gains": ("1",)}, "needs 2 gains"),
    ],
)
def test_bad_input_gets_one_clear_message(change, message):
    asked = {"gains": ("1.5", "1.1"), "over": ("k1", "k2"), **ASKED, **change}
    with pytest.raises(ParameterError, match=message):
        gain_map("super-twisting", **asked)


@pytest.mark.slow
def test_ten_thousand_points_of_the_continuous_twisting_law():
    drawn = gain_map("cta", ("7", "5", "2.3", "1.1"), ("k1", "k2"), points=100, levels=("1",))
    counts = drawn.counts(1)
    assert len(drawn.screened) == 10_000
    assert counts["edge"] == counts["edge_proved"] > 100
    assert sum(drawn.role(p) == "interior" and level == 1 for p, level in drawn.proved.items()) == 200
    assert drawn.seconds["screening"] < 600
