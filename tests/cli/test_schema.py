"""JSON Schemas of outputs: valid themselves, one for each command, and outputs of quick commands are valid by them."""

import json
from pathlib import Path

import jsonschema
import pytest

from quakedesign.cli import main
from quakedesign.cli.app import app

SCHEMAS = json.loads((Path(main.__code__.co_filename).parent / "output_schemas.json").read_text(encoding="utf-8"))


def test_every_command_has_one():
    assert set(SCHEMAS) == {name for name in app if not name.startswith("-")} - {"schema"}


@pytest.mark.parametrize("name", SCHEMAS)
def test_it_is_a_schema_and_is_printed(name, capsys):
    jsonschema.Draft202012Validator.check_schema(SCHEMAS[name])
    with pytest.raises(SystemExit) as end:
        main(["schema", name])
    assert end.value.code == 0
    assert json.loads(capsys.readouterr().out) == SCHEMAS[name]


def test_an_unknown_command_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        main(["schema", "desing"])
    assert end.value.code == 2
    assert "Did you mean design?" in capsys.readouterr().err


PROOF = Path(__file__).parents[2] / "proofs" / "certificates" / "guarantee_lab-fault.json"
DATA = Path(__file__).parents[1] / "data"
BLOCKS, SLIDING = DATA / "three_blocks.toml", DATA / "three_sliding_blocks.toml"
QUICK = [
    "fault real-fault",
    "fault creeping-patch",
    "derive lab-fault",
    "scale lab-fault real-fault",
    "sos x^2-2*x+1",
    "sos x^4*y^2+x^2*y^4+1-3*x^2*y^2",
    "certify cta --gains 7 5 2.3 1.1 --lipschitz 1",
    "simulate lab-fault --controller elqr --duration 0.05s",
    f"check {PROOF}",
    "completion bash",
    "errata 3",
    f"fault {BLOCKS}",
    f"limits {BLOCKS}",
    f"limits {SLIDING}",
    f"limits {SLIDING} --stress 1kPa",
    f"simulate {SLIDING} --duration 1hour",
    *(
        pytest.param(line, marks=pytest.mark.slow)
        for line in (
            "limits lab-fault",
            "guarantee lab-fault",
            "guarantee real-fault --step 2s",
            "compare lab-fault",
            f"guarantee {BLOCKS} --step 20s",
            f"simulate {BLOCKS} --duration 1min",
            f"export {BLOCKS} --force",
            f"simulate {SLIDING} --certificate {SLIDING.with_suffix('.json')} --duration 1hour",
            f"export {SLIDING} --certificate {SLIDING.with_suffix('.json')} --force",
            f"compare {SLIDING} --lag 800s --stress 10kPa",
            f"design {SLIDING} --lag 800s --stress 10kPa --force",
        )
    ),
]


@pytest.mark.parametrize("line", QUICK)
def test_an_output_is_valid(line, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command, *more = line.split()
    with pytest.raises(SystemExit):
        main([command, *more, "--json"])
    jsonschema.Draft202012Validator(SCHEMAS[command]).validate(json.loads(capsys.readouterr().out))


@pytest.mark.parametrize("broken", [{"magnitude": "large"}, {"name": 3}])
def test_an_output_of_another_type_is_not_valid(broken, capsys):
    with pytest.raises(SystemExit):
        main(["fault", "lab-fault", "--json"])
    answer = json.loads(capsys.readouterr().out)
    checked = jsonschema.Draft202012Validator(SCHEMAS["fault"])
    checked.validate(answer)
    (name,) = broken
    assert name in SCHEMAS["fault"]["else"]["properties"]
    with pytest.raises(jsonschema.ValidationError):
        checked.validate(answer | broken)
    with pytest.raises(jsonschema.ValidationError, match="required"):
        checked.validate({key: value for key, value in answer.items() if key != name})


@pytest.mark.parametrize(
    ("line", "name"), [(f"fault {BLOCKS}", "shares"), (f"simulate {SLIDING} --duration 1hour", "run")]
)
def test_an_output_about_blocks_without_a_key_or_of_another_type_is_not_valid(line, name, capsys):
    command, *more = line.split()
    with pytest.raises(SystemExit):
        main([command, *more, "--json"])
    answer, checked = json.loads(capsys.readouterr().out), jsonschema.Draft202012Validator(SCHEMAS[command])
    checked.validate(answer)
    for broken in (answer | {name: "text"}, {key: value for key, value in answer.items() if key != name}):
        with pytest.raises(jsonschema.ValidationError):
            checked.validate(broken)
