"""The figure, the table and the folder of a map keep screened and proved apart."""

import csv
import json
from fractions import Fraction as F

import numpy as np
import pytest
from matplotlib.collections import PathCollection, QuadMesh

from quakedesign.errors import OutputError
from quakedesign.lyapunov import Verdict, load_certificate
from quakedesign.lyapunov.maps.gain_map import GainMap, MapDefinition, gain_map
from quakedesign.lyapunov.search.certify import closed_loop
from quakedesign.report import gain_map_drawing as report


@pytest.fixture(scope="module")
def drawn():
    return gain_map(
        "super-twisting", ("1.5", "1.1"), ("k1", "k2"), ranges=(("0.4", "3"), ("0.8", "4")), points=6,
        levels=("0.5", "1"), degree=6, interior=3, workers=1,
    )  # fmt: skip


@pytest.fixture
def made_up():
    """A map of four points: not found, screened only, tried in vain, proved."""
    sheet = MapDefinition(
        subject="super-twisting",
        loop=closed_loop("super-twisting", ("1.5", "1.1"), lipschitz=1),
        over=("k1", "k2"),
        axes=((F(1), F(2)), (F(0), F(3))),
        levels=(F(1, 2),),
        degree=4,
    )
    screened = {(0, 0): 0, (0, 1): 1, (1, 0): 1, (1, 1): 1}
    return GainMap(
        sheet=sheet,
        limits=dict.fromkeys(screened, F(3)) | {(0, 0): None},
        screened=screened,
        proved={(1, 0): 0, (1, 1): 1},
        edges=frozenset({(1, 0)}),
        certificates={(1, 1): "{}"},
        solves=7,
    )


def test_every_kind_of_point_has_its_own_look(made_up):
    (axis,) = report.gain_map_figure(made_up).axes
    marks = {
        c.get_label(): np.asarray(c.get_offsets()).tolist() for c in axis.collections if isinstance(c, PathCollection)
    }
    assert marks == {"proved, inside (drawn at random)": [[2.0, 3.0]], "screened, not proved there": [[2.0, 0.0]]}
    (shades,) = (c for c in axis.collections if isinstance(c, QuadMesh))
    assert np.asarray(shades.get_array()).reshape(2, 2).tolist() == [[0, 1], [1, 1]]
    assert (axis.get_xscale(), axis.get_yscale()) == ("log", "linear")


def test_the_legend_names_levels_and_markers(drawn):
    figure = report.gain_map_figure(drawn)
    said = [text.get_text() for text in figure.legends[0].get_texts()]
    assert said[:2] == ["screened: L̄ = 0.5", "screened: L̄ = 1"]
    assert set(said[2:]) == {"proved, at the edge of a level", "proved, inside (drawn at random)"}
    assert "V of degree 6" in figure.axes[0].get_title()
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("k1 [m^(1/2)/s^(3/2)]", "k2 [m/s^3]")


def test_rows_have_columns_of_their_own_for_screened_and_proved(made_up):
    rows = {(row["k1"], row["k2"]): row for row in report.gain_map_rows(made_up)}
    assert len(rows) == 4
    told = {key: (r["limit"], r["screened_lipschitz"], r["proved_lipschitz"], r["tried"]) for key, r in rows.items()}
    assert told["1", "0"] == ("", "", "", "")
    assert told["1", "3"] == ("3", "1/2", "", "")
    assert told["2", "0"] == ("3", "1/2", "", "edge")
    assert told["2", "3"] == ("3", "1/2", "1/2", "interior")
    assert [r["certificate"] for r in rows.values() if r["certificate"]] == ["certificates/1-1.json"]


def test_facts_count_what_is_there(made_up, drawn):
    facts = report.gain_map_values(made_up)
    assert (facts["points"], facts["screened"], facts["proved"], facts["tried"]) == (4, 3, 1, 2)
    assert facts["levels"] == [{"lipschitz": "1/2", "screened": 3, "proved": 1, "edge": 2, "edge_proved": 0}]
    assert (facts["gains"], facts["units"]["k2"]) == ({}, "m/s^3")
    json.dumps(report.gain_map_values(drawn), allow_nan=False)
    assert "3 points screened (floating point), 1 proved exactly" in report.gain_map_lines(made_up)[1]


def test_the_folder_is_whole_and_its_certificates_hold(drawn, tmp_path):
    folder = tmp_path / "map"
    facts = report.write_gain_map(drawn, folder)
    assert json.loads((folder / "results.json").read_text()) == facts
    with open(folder / "map.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 36
    named = [row for row in rows if row["certificate"]]
    assert {row["certificate"] for row in named} == {
        f"certificates/{p.name}" for p in (folder / "certificates").iterdir()
    }
    for row in named[::5]:
        certificate = load_certificate(folder / row["certificate"])
        assert certificate.check() is Verdict.PROVED
        assert certificate.loop.gains == {"k1": F(row["k1"]), "k2": F(row["k2"])}
        assert certificate.loop.uncertain["d"][1] == F(row["proved_lipschitz"])
    assert (folder / "map.png").stat().st_size > 10_000
    assert [p.name for p in tmp_path.iterdir()] == ["map"]


def test_a_folder_that_cannot_be_written_is_refused(made_up, tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        report.write_gain_map(made_up, tmp_path / "no" / "such")
