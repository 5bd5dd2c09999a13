"""README.md says what is there: links, and Python that compiles; pages say every metric."""

import dataclasses
import re
from pathlib import Path

import pytest

import quakedesign
from quakedesign.cli import main
from quakedesign.cli.app import app
from quakedesign.report.summary import LEGEND
from quakedesign.simulation import Metrics
from quakedesign.simulation.recorder import ActuatorMetrics
from quakedesign.studies.fault_facts import box_sentence

ROOT = Path(__file__).parent.parent
DOCUMENTS = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "proofs/FORMAT.md")
README = (ROOT / "README.md").read_text(encoding="utf-8")
KEYS, POLYNOMIALS = (
    (ROOT / "docs" / page).read_text(encoding="utf-8") for page in ("reference/json.md", "howto/polynomials.md")
)


def test_every_metric_has_its_row():
    body = re.search(r"^\| metric \|.*\n\|[-|]+\|\n((?:\|.*\n)+)", KEYS, flags=re.MULTILINE)[1]
    told = [word for row in body.splitlines() for word in re.findall(r"`([^`]+)`", row.split(" | ")[0])]
    fields = (*dataclasses.fields(Metrics), *dataclasses.fields(ActuatorMetrics))
    assert set(told) == {f.name for f in fields}


def test_the_box_is_said_before_it_is_used():
    first, *others = re.findall(r".{60}\bbox\b", README.replace("*", " ").replace("\n", " "))
    assert "ranges" in first
    assert others


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_somewhere(document):
    links = re.findall(r"\]\((?!https?:)([^)#]+)\)", (ROOT / document).read_text(encoding="utf-8"))
    assert all(((ROOT / document).parent / link).exists() for link in links)


def test_python_in_it_compiles_and_uses_public_names():
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert blocks
    for block in blocks:
        compile(block, "README.md", "exec")
    assert set(re.findall(r"qd\.(\w+)", README)) <= set(quakedesign.__all__)


def test_the_checks_run_exactly_the_command_for_tests():
    pattern = re.search(r"grep -E '([^']+)'", (ROOT / ".ci" / "run").read_text(encoding="utf-8"))[1]
    (command,) = re.findall(pattern, README, flags=re.MULTILINE)
    assert command == "python3 -m venv .venv && .venv/bin/pip install -e '.[test]' && .venv/bin/python -m pytest"


@pytest.mark.parametrize("name", [name for name in app if not name.startswith("-")])
def test_every_command_explains_itself(name, capsys):
    with pytest.raises(SystemExit) as end:
        main([name, "--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert "--json" in out
    assert "--empty-" not in out


def test_every_verdict_on_a_polynomial_in_it_is_the_one_given():
    from quakedesign import sos

    block = next(b for b in re.findall(r"```python\n(.*?)```", POLYNOMIALS, flags=re.DOTALL) if "motzkin" in b)
    questions = re.findall(r"^(sos\.prove\(.*\))\.verdict  # ([a-z-]+)", block, flags=re.MULTILINE)
    setting = {"sos": sos}
    exec(re.search(r"^motzkin = .*$", block, flags=re.MULTILINE)[0], setting)
    found = [(str(eval(question, setting).verdict), verdict) for question, verdict in questions]
    assert len(found) == 3
    assert all(given == verdict for given, verdict in found)


MAIN_JOB = (ROOT / "docs" / "explanation" / "main_job.md").read_text(encoding="utf-8")
PRINTED = re.search(r"It prints\n\n```\n(.*?)```", MAIN_JOB, flags=re.DOTALL)[1]


def test_the_page_of_the_main_job_prints_the_box_and_what_its_columns_are():
    said = " ".join(PRINTED.split())
    assert all(line in PRINTED.splitlines() for line in LEGEND)
    assert box_sentence(quakedesign.load_fault("real-fault")) in said


@pytest.mark.slow  # the main job itself
def test_the_page_of_the_main_job_prints_what_the_command_prints(capsys, tmp_path):
    with pytest.raises(SystemExit) as end:
        main(["design", "real-fault", "--out", str(tmp_path / "out")])
    out, _ = capsys.readouterr()
    assert end.value.code == 0
    assert out.startswith(PRINTED.rstrip("\n") + "\n\nwritten: ")
