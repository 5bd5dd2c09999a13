"""What the command line says about an export."""

import json

import pytest

from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.report.terminal import export_lines
from quakedesign.studies.exporting import export_result

LAB = load_fault("lab-fault")
LAW = published("lab-fault")["cta"]


@pytest.mark.slow
def test_files_facts_and_the_premise_of_the_differentiator_are_told(tmp_path):
    answer = export_result(LAB, LAW, tmp_path / "c", scheme="implicit", differentiator_bound=1e4)
    assert answer["measurement"] == {"slip": "m"}
    assert all((tmp_path / "c" / name).is_file() for name in ("controller.h", "controller.c"))
    (premise,) = answer["premises"]
    assert (premise["name"], premise["certified"]) == ("differentiator", 1e4)
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer
    said = "\n".join(export_lines(answer))
    assert "premise differentiator" in said
    assert "scheme: implicit" in said


def test_without_a_differentiator_there_is_no_premise(tmp_path):
    answer = export_result(LAB, LAW, tmp_path / "c")
    assert answer["premises"] == []
    assert list(answer["measurement"]) == ["slip", "slip_rate"]
