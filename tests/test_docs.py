"""The documentation is built without a warning, and what is built needs no network."""

import inspect
import json
import math
import os
import re
import subprocess
import sys
from fractions import Fraction
from html.parser import HTMLParser
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from urllib.parse import unquote, urlsplit

import matplotlib.pyplot as plt
import pytest

import quakedesign
from quakedesign.guarantees.exact.guarantee_files import read_guarantee

ROOT = Path(__file__).parents[1]
SPECIFICATION = spec_from_file_location("generated_pages", ROOT / "docs" / "_extensions" / "generated.py")
generated = module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(generated)
DRAWN = spec_from_file_location("gallery", ROOT / "docs" / "figures" / "gallery.py")
gallery = module_from_spec(DRAWN)
DRAWN.loader.exec_module(gallery)
PAGES = ("index.html", "reference/commands.html", "reference/fault_file.html", "explanation/glossary.html")


KERNEL = re.compile(r"^\[IPKernelApp\] WARNING \| Kernel is running over TCP|INFO traitlets .* -- Executing notebook")
"""What Jupyter says of itself when it executes a page."""


def built(target, execute="off"):
    """Folder of pages; what Sphinx said if it had something to say."""
    done = subprocess.run(
        [
            *(sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", "-E"),
            *("-d", target / "trees", ROOT / "docs", target / "html"),
        ],
        env=os.environ | {"QUAKEDESIGN_DOCS_EXECUTE": execute, "PYTHONWARNINGS": "ignore"},
        capture_output=True,
        text=True,
        check=False,
    )
    told = [line for line in done.stderr.splitlines() if line.strip() and not KERNEL.search(line)]
    return target / "html", "\n".join([*told, *([] if done.returncode == 0 else [f"exit {done.returncode}"])])


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    folder, said = built(tmp_path_factory.mktemp("docs"))
    assert said == ""
    return folder


class Addresses(HTMLParser):
    """What a page links to, what it loads, and the anchors that it has."""

    def __init__(self, page):
        super().__init__()
        self.links, self.loaded, self.anchors = [], [], set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.anchors.add(given.get("id"))
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag in ("script", "img", "iframe", "source") and given.get("src"):
            self.loaded.append(given["src"])
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loaded.append(given["href"])


@pytest.mark.slow
def test_every_link_inside_resolves_and_nothing_is_loaded_from_elsewhere(pages):
    found = {page: Addresses(page) for page in pages.rglob("*.html")}
    assert {pages / name for name in PAGES} <= set(found)
    broken = []
    for page, addresses in found.items():
        for address in [*addresses.links, *addresses.loaded]:
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                if address in addresses.loaded:
                    broken.append((page.name, address))
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            known = found.get(target)
            if not target.exists() or (parts.fragment and known and unquote(parts.fragment) not in known.anchors):
                broken.append((page.name, address))
    assert broken == []


@pytest.mark.slow
def test_every_public_name_and_command_is_told(pages):
    from quakedesign.cli.app import app

    names = (pages / "reference" / "api.html").read_text(encoding="utf-8")
    assert [name for name in quakedesign.__all__ if f"quakedesign.{name}" not in names] == []
    commands = (pages / "reference" / "commands.html").read_text(encoding="utf-8")
    told = [name for name in app if not name.startswith("-")]
    assert len(told) > 15
    assert [name for name in told if f"quakedesign {name}" not in commands] == []


def test_tables_in_pages_are_what_the_program_says_today():
    """They stand in the pages, which are read where nothing is built; generated.py writes them again."""
    for page, (head, _) in generated.TABLES.items():
        text = (ROOT / "docs" / page).read_text(encoding="utf-8")
        assert text == generated.regenerated(page)
        assert text.count(f"\n| {' | '.join(head)} |\n") == 1
        assert len(re.findall(r"^\|", text, re.MULTILINE)) > 20


def test_every_link_of_a_page_to_a_page_leads_to_one():
    """Of what is built, links into pages are tested with -m slow, which `.ci/run` does."""
    pages = [page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts]
    links = {page: re.findall(r"\]\((?![a-z]+:)([^)#\s]+)", page.read_text(encoding="utf-8")) for page in pages}
    assert sum(map(len, links.values())) > 50
    exists = lambda page, link: (  # noqa: E731
        (ROOT / "notebooks" / link.removeprefix("../tutorial/")).exists()  # made into pages when they are built
        if link.startswith("../tutorial/") and link.endswith(".ipynb")
        else (page.parent / link).exists()
    )
    broken = [(page.name, link) for page, found in links.items() for link in found if not exists(page, link)]
    assert broken == []


@pytest.mark.parametrize("folder", ["howto", "reference", "explanation"])
def test_every_page_is_linked_from_the_index_of_its_folder(folder):
    index = ROOT / "docs" / folder / "index.md"
    linked = re.findall(r"\]\((.*?)\)", index.read_text(encoding="utf-8"))
    there = {page.name for page in index.parent.glob("[a-z]*.md")} - {"index.md"}
    assert there <= set(linked)
    assert all((index.parent / page).exists() for page in linked)
    assert len(linked) == len(set(linked))


def test_what_is_proved_begins_with_the_guarantee_that_is_printed():
    """The sentence is that of the certificate in proofs, word by word."""
    told = (ROOT / "docs" / "explanation" / "what_is_proved.md").read_text(encoding="utf-8").split("\n## ")[0]
    quoted = " ".join(re.findall(r"^> (.*)$", told, re.MULTILINE)).replace("m/s²", "m/s^2").replace("≥", ">=")
    raw = json.loads((ROOT / "proofs" / "certificates" / "stick_slip_real-fault.json").read_text(encoding="utf-8"))
    assert quoted.lower() == f"{read_guarantee(raw).sentence()}.".lower()


@pytest.mark.slow
def test_equations_are_drawn_without_a_script(pages):
    model = (pages / "explanation" / "model.html").read_text(encoding="utf-8")
    assert model.count("<math") > 15


@pytest.mark.slow
def test_every_example_runs(tmp_path):
    folder, said = built(tmp_path, execute="force")
    assert said == ""
    assert "T_s = 0.184 s" in (folder / "howto" / "bode_and_margins.html").read_text(encoding="utf-8")


def test_the_gallery_shows_every_figure_with_the_lines_that_draw_it():
    page = (ROOT / "docs" / "tutorial" / "gallery.md").read_text(encoding="utf-8")
    for draw in gallery.FIGURES:
        assert f":pyobject: {draw.__name__}\n" in page
        assert f"## {draw.__doc__.rstrip('.')}\n" in page
        image = f"gallery-{draw.__name__.replace('_', '-')}.png"
        assert f"(../figures/{image})" in page
        assert (ROOT / "docs" / "figures" / image).is_file()
        assert len(inspect.getsource(draw).splitlines()) <= 15


@pytest.mark.slow
@pytest.mark.parametrize("draw", gallery.FIGURES, ids=lambda draw: draw.__name__)
def test_the_lines_of_the_gallery_draw_curves_with_labelled_axes(draw):
    axes = draw().axes
    assert all(each.lines and each.get_xlabel() + each.get_ylabel() for each in axes)
    plt.close("all")


def test_how_it_works_leads_to_the_bounds_of_the_stored_certificates():
    """One chain of numbers for each plant: the bounds are those of the files, rounded up."""
    page = (ROOT / "docs/explanation/how_it_works.md").read_text(encoding="utf-8")
    proofs = ROOT / "proofs" / "certificates"
    sticks, without = (
        json.loads((proofs / name).read_text(encoding="utf-8"))["claims"]
        for name in ("stick_slip_real-fault.json", "guarantee_real-fault.json")
    )
    shown = [(sticks["peak_slip_rate"], 0), (sticks["slip_behind"], 1), (sticks["slip_ahead"], 1)]
    for value, places in [*shown, (without["peak_slip_rate"], 0)]:
        scale = 10**places
        micro = f"{math.ceil(Fraction(value) * 10**6 * scale) / scale:.{places}f} µm"
        assert micro.removesuffix(" µm") in page, micro


def test_files_of_the_source_that_pages_name_exist():
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    named = {
        (page.name, name)
        for page in pages
        for name in re.findall(
            r"\b(?:quakedesign|benchmarks|proofs|tests)/[\w/.-]*\.(?:py|toml|json|v|md)\b", page.read_text()
        )
        if "quakedesign-" not in name
    }
    assert named
    assert not sorted((page, name) for page, name in named if not (ROOT / name).exists())
