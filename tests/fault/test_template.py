"""The file to start from can be read as it is, and the schema of editors accepts what the program accepts."""

import tomllib
from fractions import Fraction
from importlib.resources import files

import jsonschema
import pytest

from quakedesign.fault import Fault, fault_toml, friction_laws, load_fault, parse_fault, presets
from quakedesign.fault.block_chain import BLOCK, DIFFUSION, WELL
from quakedesign.fault.entries import entries_of
from quakedesign.fault.fault_schema import fault_schema, template
from quakedesign.fault.fault_toml import DISTURBANCE, PLANT, TASK, TEXTS, WIDTHS
from quakedesign.fault.units import si_value

VALIDATOR = jsonschema.Draft202012Validator(fault_schema())


def uncommented(text):
    """The file with every key that it offers."""
    lines = []
    for line in text.splitlines():
        bare = line.removeprefix("# ")
        offered = bare.startswith("[") or (" = " in bare.split("  #")[0] and not bare.startswith("uncertainty ="))
        lines.append(bare if offered else line)
    return "\n".join(lines)


@pytest.mark.parametrize("law", sorted(friction_laws()))
def test_every_law_has_a_file_to_start_from(law):
    text = template(law, schema=True)
    fault = parse_fault(text, "my-fault.toml")
    assert isinstance(fault, Fault)
    assert fault.friction.name == law
    whole = parse_fault(uncommented(text), "my-fault.toml")
    assert not any("no disturbance" in said or "damping" in said for said in whole.assumed)
    assert float(whole.box.stiffness) == 0.1
    assert whole.width == 1500
    assert all(VALIDATOR.is_valid(tomllib.loads(each)) for each in (text, uncommented(text)))


@pytest.mark.parametrize("name", presets())
def test_a_fault_is_written_and_read_again(name):
    fault = load_fault(name)
    assert parse_fault(fault_toml(fault), name) == fault
    assert parse_fault(fault_toml(load_fault(name, box="ten-percent")), name).box.name == "ten-percent"


def test_texts_and_boxes_of_ones_own_are_written_as_toml_has_them():
    text = (
        fault_toml(load_fault("real-fault")).replace('uncertainty = "paper"\n', "")
        + "\n[uncertainty]\nstiffness = 0.3\n"
    )
    awkward = 'a "b" \\ \u007f \u00e9 \n'
    fault = parse_fault(text, "own.toml")
    fault = type(fault)(**{**vars(fault), "source": awkward})
    read = parse_fault(fault_toml(fault), "own.toml")
    assert read == fault
    assert read.source == awkward


def test_an_option_of_a_law_is_written_too():
    text = template("regularised-rate-and-state").replace(
        '"regularised-rate-and-state"', '"regularised-rate-and-state"\nevolution = "slip"', 1
    )
    fault = parse_fault(text, "own.toml")
    assert fault.friction.evolution == "slip"
    assert parse_fault(fault_toml(fault), "own.toml") == fault


@pytest.mark.parametrize("name", presets())
def test_the_schema_accepts_presets(name):
    text = (files("quakedesign.fault") / "presets" / f"{name}.toml").read_text(encoding="utf-8")
    assert list(VALIDATOR.iter_errors(tomllib.loads(text))) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('length = "5 km"', 'lenght = "5 km"'),
        ('length = "5 km"', "length = 5"),
        ('length = "5 km"', ""),
        ("drop = 0.1", ""),
        ("drop = 0.1", "drop = 0.1\nfall = 2"),
        ("exponential-slip-weakening", "magic"),
        ('uncertainty = "paper"', 'uncertainty = "wide"'),
        ("[task]", "[tusk]"),
    ],
)
def test_the_schema_refuses_what_the_program_refuses(old, new):
    text = (files("quakedesign.fault") / "presets" / "real-fault.toml").read_text(encoding="utf-8")
    assert old in text
    assert not VALIDATOR.is_valid(tomllib.loads(text.replace(old, new)))


def test_the_schema_knows_symbols():
    text = template("rate-and-state-aging").replace("direct_effect", "a").replace("critical_slip", "Dc")
    assert "\na = 0.01" in text
    assert VALIDATOR.is_valid(tomllib.loads(text))
    assert parse_fault(text, "x").friction.direct_effect == 0.01


@pytest.mark.parametrize("width", ["0.3", '"0.3"'])
def test_a_half_width_is_a_number_or_a_text_for_the_schema_and_the_program(width):
    text = fault_toml(load_fault("real-fault")).replace('uncertainty = "paper"\n', "")
    text += f"\n[uncertainty]\nstiffness = {width}\n"
    assert VALIDATOR.is_valid(tomllib.loads(text))
    assert parse_fault(text, "own.toml").box.stiffness == Fraction(3, 10)


def test_a_law_without_descriptions_has_a_file_to_start_from():
    text = template("tests.data.own_parts:Hyperbolic")
    drop = next(line for line in text.splitlines() if line.startswith("drop = "))
    assert "#" not in drop
    assert parse_fault(text, "own.toml", allow_code=True).friction.drop == float(drop.split()[-1])


TABLES = {"top": TEXTS | PLANT, "task": TASK, "disturbance": DISTURBANCE, "uncertainty": WIDTHS, "block": BLOCK}
TABLES |= {"well": WELL, "diffusion": DIFFUSION} | {name: entries_of(law) for name, law in friction_laws().items()}


@pytest.mark.parametrize("table", TABLES)
def test_every_entry_has_a_description_and_an_example_in_its_unit(table):
    for name, entry in TABLES[table].items():
        assert (entry.name, bool(entry.description)) == (name, True)
        if entry.unit is not None:
            assert si_value(entry.example, entry.unit, name) >= 0


def test_an_entry_is_declared_once_for_reading_writing_template_and_schema():
    """A declared default and example appear in the template and the schema; the unit in the written file."""
    entry = PLANT["damping"]
    assert (entry.unit, entry.required) == ("kg/s", False)
    assert f'# damping = "{entry.example}"  # η [kg/s], not negative; default: {entry.default_text}' in template()
    assert fault_schema()["properties"]["damping"]["examples"] == [entry.example]
    assert '\ndamping = "500000000000000.0 kg/s"\n' in fault_toml(load_fault("real-fault"))


def test_a_block_has_the_descriptions_of_a_block():
    block = fault_schema()["properties"]["block"]["items"]["properties"]
    assert block["length"]["description"].startswith("Length of the block")
    assert "default in a file: that of the fault" in block["effective_normal_stress"]["description"]


def test_the_examples_of_a_law_decide_whether_the_template_needs_a_target_slip(tmp_path, monkeypatch):
    """Weakening over 20 m instead of 2 cm leaves no next rest slip."""
    header = "from dataclasses import dataclass, field\nfrom quakedesign.fault.friction.weakening import *\n"
    body = "@dataclass(frozen=True, slots=True, kw_only=True)\nclass {0}(LinearSlipWeakening):\n"
    body += '    name = "{0}"\n    critical_slip: float = field(metadata={{"unit": "m", "example": "{1}"}})\n'
    other = "@dataclass(frozen=True, slots=True, kw_only=True)\nclass Other(Weakening):\n    name = 'Other'\n"
    other += "    domain, source = 'slip >= 0', 'none'\n    slip_slope = property(lambda self: 50 * self.drop)\n"
    other += "    extended = lambda self, slip, rate, *state: self.coefficient(slip, rate)\n"
    other += "    def coefficient(self, slip, rate, *state):\n"
    other += "        import sympy as sp\n        return self.residual + self.drop * sp.exp(-50 * slip)\n"
    text = header + body.format("Short", "2 cm") + body.format("Long", "20 m") + other
    (tmp_path / "written_laws.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    for law, needed in (("Short", False), ("Long", True), ("Other", False)):
        text = template(f"written_laws:{law}")
        assert ("\n[task]" in text) is needed
        assert ("\ntarget_slip = " in text) is needed
        assert parse_fault(text, "own.toml", allow_code=True).friction.name == law
