"""The structure that CONTRIBUTING.md describes: imports, start-up, docstrings."""

import ast
import dataclasses
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import quakedesign

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "quakedesign"
EVERYWHERE = {f"quakedesign.{name}" for name in ("arguments", "errors", "exact", "files", "cache", "text", "discovery")}
LAYERS = (
    *("fault", "sos.exact", "sos.solve", "sos", "symbolic", "laws", "loop", "plant", "identification", "simulation"),
    *("lyapunov.exact", "lyapunov.search", "lyapunov.maps", "lyapunov.gains", "lyapunov"),
    *("guarantees.exact", "guarantees.search", "guarantees", "linear", "synthesis", "studies", "report", "cli"),
)
"""Packages in the order of CONTRIBUTING.md: each imports only packages before it, and less where `LESS` says so."""
DECIDING = (
    "fault",
    "symbolic",
    "sos",
    "sos.exact",
    "laws",
    "loop",
    "plant",
    "lyapunov.exact",
    "lyapunov",
    "guarantees.exact",
)
DECISIONS = ("sos.exact", "lyapunov.exact", "guarantees.exact", "rocq", "checking")
LESS = {
    "fault": (),
    "symbolic": ("fault",),
    "sos.exact": (),
    "sos.solve": ("sos.exact",),
    "sos": ("sos.exact",),  # the package itself hands on the deciding part only
    "laws": ("fault", "symbolic"),
    "loop": ("fault", "symbolic", "laws"),
    "plant": ("fault", "symbolic", "laws", "loop"),
    "identification": ("fault", "symbolic"),
    "simulation": ("fault", "symbolic", "laws", "loop", "plant"),
    "lyapunov.exact": DECIDING[:7],
    "guarantees.exact": DECIDING,
    "report": tuple(p for p in LAYERS[:-2] if not p.startswith("sos")),
}
WITHIN = {"lyapunov.search": ("lyapunov.maps",)}  # a search asks the map of gains, which stands beside it
MAY_IMPORT = {name: (*LESS.get(name, LAYERS[:place]), *WITHIN.get(name, ())) for place, name in enumerate(LAYERS)} | {
    "rocq": DECIDING,
    "checking": (*DECIDING, "guarantees"),
    "__main__": ("cli", "parallel", "streams"),
    "streams": (),
    "parallel": (),
    "cache": (),
    "__init__": (),
    "errors": (),
    "text": (),
    "discovery": (),
    "arguments": (),
    "files": (),
    "exact": (),
}
for _name in ("simulation", "lyapunov.search", "lyapunov.maps", "lyapunov.gains", "synthesis", "studies", "cli"):
    MAY_IMPORT[_name] += ("parallel",)
MAY_IMPORT["cli"] += ("checking", "rocq", "streams")
MAY_IMPORT["sos.solve"] += ("parallel",)
PROVING = (
    *("laws", "loop", "lyapunov.exact", "lyapunov.search"),
    *("guarantees.exact", "guarantees.search", "linear", "synthesis"),
)
SOLVERS = {"cvxpy", "clarabel", "scs", "osqp", "ecos", "mosek", "scipy", "control", "casadi"}
HEAVY = {
    *("sympy", "numpy", "scipy", "cvxpy", "clarabel", "casadi", "control", "matplotlib", "pint"),
    *("pandas", "xarray", "h5netcdf", "flint", "jinja2", "mpmath", "dask"),
}
SOURCES = sorted(PACKAGE.rglob("*.py"))


def module_name(path):
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 2 else parts)


MODULES = {module_name(path).removesuffix(".__init__") for path in SOURCES}


def room(module):
    """Room of a module or of an imported name: the longest name in the table of rooms."""
    parts = module.split(".")[1:]
    for length in (2, 1):
        if ".".join(parts[:length]) in MAY_IMPORT:
            return ".".join(parts[:length])
    raise AssertionError(f"{module} is in no package of CONTRIBUTING.md")


def test_one_place_builds_syntax_trees():
    """`arguments.parsed`, one thread at a time: CPython 3.11 counts the recursion of all threads together."""
    calls = [
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        for node in nodes(path)
        if isinstance(node, ast.Attribute) and node.attr in ("parse", "literal_eval")
        if isinstance(node.value, ast.Name) and node.value.id == "ast"
    ]
    assert calls == ["arguments.py"]


@cache
def nodes(path):
    """Everything in a file, in order."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


@cache
def imports(path):
    """Every absolute name that a file imports anywhere, functions and ``import_module`` with a text included."""
    return tuple(_imports(path))


def _imports(path):
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not (node.level and "checker" in path.parts):
            assert node.level == 0, f"{path.name}:{node.lineno} imports relatively"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in (
            "import_module",
            "__import__",
        ):
            yield from (a.value for a in node.args[:1] if isinstance(a, ast.Constant))


def imported_modules(path):
    """Modules of the package that a file imports anywhere, those for type hints alone included."""
    for name in imports(path):
        yield from [n for n in (name, name.rpartition(".")[0]) if n in MODULES][:1]


def circle(arrows):
    """Modules that import each other in a circle, and what leads there; none where all can be put in order."""
    rest = {name: set(others) - {name} for name, others in arrows.items()}
    while free := [name for name, others in rest.items() if not others & rest.keys()]:
        for name in free:
            del rest[name]
    return sorted(rest)


SLOW = {
    "fault": {"sympy", "pint", "mpmath", "docstring_parser"},
    "exact": {"sympy"},
    "loop": {"casadi", "numpy"},
    "laws": {"control"},
    "sos.exact": {"sympy"},
    "sos.solve": {"cvxpy", "scipy"},
    "simulation": {"control", "scipy", "pandas", "xarray", "matplotlib"},
    "parallel": {"distributed"},
    "lyapunov.maps": {"cvxpy"},
    "linear": {"cvxpy", "control"},
    "report": {"matplotlib", "jinja2"},
}
"""Libraries that a room loads inside functions: each takes longer than much that does without it."""


@cache
def late_imports(path):
    """Names that a file imports inside functions."""
    functions = (node for node in nodes(path) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda))
    inside = [inner for function in functions for inner in ast.walk(function)]
    names = {alias.name for node in inside if isinstance(node, ast.Import) for alias in node.names}
    return names | {node.module for node in inside if isinstance(node, ast.ImportFrom)}


def wrong(found, paths=SOURCES):
    """What `found` has to say against files, by module."""
    return {module_name(path): said for path in paths if (said := found(path))}


def test_imports_stand_at_the_top_but_those_of_slow_libraries():
    """Commands refuse what is wrong before they load anything, so that they import inside as well."""
    files = [path for path in SOURCES if room(module_name(path)) not in ("cli", "__main__")]
    roots = lambda path: {name.split(".")[0] for name in late_imports(path)}  # noqa: E731
    assert wrong(lambda path: roots(path) - SLOW.get(room(module_name(path)), set()), files) == {}


def test_no_slow_library_is_named_in_vain():
    rooms = {}
    for path in SOURCES:
        rooms.setdefault(room(module_name(path)), set()).update(name.split(".")[0] for name in late_imports(path))
    assert {name: rooms[name] for name in SLOW} == SLOW


def test_no_module_imports_in_a_circle():
    arrows = {module_name(p).removesuffix(".__init__"): imported_modules(p) for p in SOURCES}
    assert circle(arrows) == []


def test_a_circle_is_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": set()}) == ["a", "b", "c"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def third_party(path):
    roots = {name.split(".")[0] for name in imports(path)}
    return roots - sys.stdlib_module_names - {"quakedesign"}


def forbidden(path):
    """Rooms from which a file imports though it may not."""
    home = room(module_name(path))
    own = [name for name in imports(path) if name.split(".")[0] == "quakedesign"]
    names = [name for name in own if ".".join(name.split(".")[:2]) not in EVERYWHERE]
    return {room(name) for name in names} - {home, *MAY_IMPORT[home]}


def test_rooms_import_only_what_the_design_allows():
    assert wrong(forbidden) == {}


@pytest.mark.parametrize(
    ("source", "ok"),
    [
        ("fault/x.py: from quakedesign.symbolic import plant", False),
        ("lyapunov/exact/x.py: from quakedesign.sos.solve.joint import JointProgram", False),
        ("lyapunov/exact/x.py: from quakedesign.sos import solve", False),
        ("lyapunov/exact/x.py: from quakedesign.sos import Answer", True),
        ("sos/exact/x.py: from quakedesign.sos.solve import search", False),
        ("sos/solve/x.py: from quakedesign.sos.exact.proofs import Square", True),
        ("lyapunov/search/x.py: from quakedesign.sos.solve import search", True),
        ("synthesis/x.py: from quakedesign.report import compare", False),
        ("simulation/x.py: import quakedesign.lyapunov.exact.claim", False),
        ("guarantees/exact/x.py: from quakedesign.loop import sampled_error_loop", True),
        ("guarantees/exact/x.py: from quakedesign.guarantees.search import estimate", False),
        ("guarantees/exact/x.py: from quakedesign.simulation import simulate", False),
        ("loop/x.py: from quakedesign.simulation import simulate", False),
        ("studies/x.py: from quakedesign.synthesis import design", True),
        ("studies/x.py: from quakedesign.report import compare", False),
        ("identification/x.py: from quakedesign.simulation import simulate", False),
        ("report/x.py: from quakedesign.identification import identify", True),
        ("synthesis/x.py: from quakedesign.studies import limits", False),
    ],
)
def test_the_rule_itself_tells_good_from_bad(source, ok, tmp_path, monkeypatch):
    where, line = source.split(": ")
    monkeypatch.setitem(globals(), "PACKAGE", tmp_path / "quakedesign")
    path = tmp_path / "quakedesign" / where
    path.parent.mkdir(parents=True)
    path.write_text(f"def late():\n    {line}\n", encoding="utf-8")
    assert (forbidden(path) == set()) is ok


def test_what_decides_knows_no_solver_and_no_floating_point_library():
    files = [path for path in SOURCES if room(module_name(path)) in DECISIONS]
    found = wrong(
        lambda path: third_party(path) - {"sympy", "flint", "msgspec"}, files
    )  # msgspec reads entries by type
    # arrays of rationals and balls, whose multipliers floats propose: rational arithmetic decides
    assert found == {"quakedesign.guarantees.exact.stick_slip_set": {"numpy"}}


@pytest.mark.parametrize("path", sorted((PACKAGE / "report").glob("*.py")), ids=module_name)
def test_what_shows_results_computes_none(path):
    """Derivations, runs and searches are asked of `quakedesign.studies` and what stands below."""
    assert third_party(path) <= {"numpy", "matplotlib", "jinja2", "markupsafe", "latex2mathml", "rich"}
    assert not [n for n in imports(path) if re.match(r"quakedesign\.sos\b|.*\.(simulate|ClosedLoop)$", n)]


def test_only_the_search_knows_the_solvers():
    users = {room(module_name(p)) for p in SOURCES if third_party(p) & {"cvxpy", "clarabel"}}
    assert users <= {"sos.solve", "lyapunov.search", "lyapunov.maps", "lyapunov.gains", "linear"}


def test_cones_are_assembled_by_hand_for_single_polynomials_only():
    """All other programmes are stated in cvxpy."""
    assert {module_name(p) for p in SOURCES if "clarabel" in third_party(p)} == {"quakedesign.sos.solve.moment"}


PROOFS = sorted((*(ROOT / "proofs").glob("*.py"), *(ROOT / "proofs" / "checker").rglob("*.py")))


@pytest.mark.parametrize("path", PROOFS, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_proofs_never_import_a_solver(path):
    assert not third_party(path) & SOLVERS


def test_the_independent_checker_needs_the_standard_library_and_itself():
    front, folder = ROOT / "proofs" / "check.py", ROOT / "proofs" / "checker"
    arrows = {}
    for path in folder.rglob("*.py"):
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        own = [node for node in nodes if isinstance(node, ast.ImportFrom) and node.level]
        places = [path.parents[node.level - 1].joinpath(*node.module.split(".")) for node in own]
        arrows[path] = [place.with_suffix(".py") for place in places]
        assert set(arrows[path]) <= set(folder.rglob("*.py")), path
    assert circle(arrows) == []
    for path in (front, *arrows):
        assert {name.split(".")[0] for name in imports(path)} <= sys.stdlib_module_names, path


def loaded_by(*arguments):
    """Packages that a fresh interpreter loads, and what it prints."""
    call = [sys.executable, "-X", "importtime", *arguments]
    done = subprocess.run(call, capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL)
    found = re.findall(r"^import time:.*\|\s*([\w.]+)$", done.stderr, flags=re.MULTILINE)
    assert "re" in found
    return {name.split(".")[0] for name in found}, done.stdout


def test_help_and_import_load_no_heavy_library():
    loaded, printed = loaded_by("-m", "quakedesign", "--help")
    assert "design" in printed
    assert not loaded & HEAVY
    assert not loaded_by("-m", "quakedesign", "guarantee", "--help")[0] & HEAVY
    assert not loaded_by("-c", "import re, quakedesign")[0] & (HEAVY | {"cyclopts", "rich"})


@pytest.mark.parametrize("name", ["super-twisting_1.5_1.1", "guarantee_lab-fault"])
def test_checking_a_file_loads_neither_sympy_nor_a_solver(name):
    (path,) = (ROOT / "proofs" / "certificates").glob(f"{name}.json")
    loaded, printed = loaded_by("-m", "quakedesign", "check", str(path))
    assert ": proved" in printed
    assert not loaded & (HEAVY - {"flint"})


def test_loading_all_that_decides_loads_no_solver():
    modules = [module_name(p) for p in SOURCES if room(module_name(p)) in DECISIONS]
    loaded, _ = loaded_by("-c", "import re, " + ", ".join(m.removesuffix(".__init__") for m in modules))
    assert not loaded & SOLVERS


def exported():
    """Every function and class in an ``__all__``, once, by where it lives."""
    found = {}
    for info in pkgutil.walk_packages(quakedesign.__path__, "quakedesign."):
        if info.name.endswith("__main__"):
            continue
        module = importlib.import_module(info.name)
        for name in getattr(module, "__all__", ()):
            item = getattr(module, name)
            if inspect.isfunction(item) or inspect.isclass(item):
                found[f"{item.__module__}.{item.__qualname__}"] = item
    return found


def section(item, title):
    """Names in one numpydoc section, in order; ``a, b : type`` counts as two."""
    text = inspect.cleandoc(item.__doc__)
    match = re.search(rf"^{title}\n-+\n(.*?)(?=^\S[^\n]*\n---|\Z)", text, flags=re.MULTILINE | re.DOTALL)
    heads = re.findall(r"^([^\s:][^:\n]*?)(?: ?:.*)?$", match[1], flags=re.MULTILINE) if match else []
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


TOP = {name: getattr(quakedesign, name) for name in quakedesign.__all__}


def test_every_exported_function_and_class_has_a_docstring_of_its_own():
    silent = [name for name, item in exported().items() if not (item.__dict__.get("__doc__") or item.__doc__)]
    generated = [
        name
        for name, item in exported().items()
        if dataclasses.is_dataclass(item) and (item.__doc__ or "").startswith(f"{item.__name__}(")
    ]
    assert not silent + generated


@pytest.mark.parametrize("name", [n for n, item in TOP.items() if inspect.isfunction(item)])
def test_public_functions_document_exactly_their_parameters(name):
    assert section(TOP[name], "Parameters") == list(inspect.signature(TOP[name]).parameters)


@pytest.mark.parametrize("name", [n for n, item in TOP.items() if dataclasses.is_dataclass(item)])
def test_public_values_document_exactly_their_fields(name):
    assert section(TOP[name], "Attributes") == [f.name for f in dataclasses.fields(TOP[name])]


def test_the_public_names_are_all_there():
    assert set(quakedesign.__all__) <= set(dir(quakedesign))
    assert re.fullmatch(r"\d+\.\d+\.\d+", quakedesign.__version__)
    with pytest.raises(AttributeError, match="attribute nothing"):
        quakedesign.nothing  # noqa: B018


FAMILIES = {"SlidingMode", "ExtendedLQR", "SampledController", "ContinuousTwisting", "DiscontinuousIntegral"}


def families_asked_for(path):
    """Questions of which family a law is."""
    calls = [node for node in nodes(path) if isinstance(node, ast.Call)]
    asked = [c for c in calls if getattr(c.func, "id", "") in ("isinstance", "issubclass")]
    return [ast.unparse(c) for c in asked if FAMILIES & {n.id for n in ast.walk(c) if isinstance(n, ast.Name)}]


def test_no_law_is_asked_which_family_it_is_of():
    """What a law has is asked of itself, what is done with its family of `quakedesign.synthesis`."""
    assert wrong(families_asked_for) == {}


def declared_friction(tree):
    """Bounds and slopes that are read from the friction law of a fault itself."""
    pairs = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
            both = isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)
            pairs += zip(target.elts, value.elts, strict=False) if both else [(target, value)]
    laws = {ast.unparse(target) for target, value in pairs if is_law(value)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr in ("bounds", "slip_slope", "rate_slope"):
            if is_law(node.value) or ast.unparse(node.value) in laws:
                yield ast.unparse(node)


def is_law(node):
    return re.fullmatch(r".*fault\.friction(\.exact\(\))?", ast.unparse(node)) is not None


@pytest.mark.slow
def test_proofs_use_confirmed_bounds_of_friction_only():
    """What a law declares is checked against its expression by `friction_bounds`; no proof reads it elsewhere."""
    files = [path for path in SOURCES if room(module_name(path)) in PROVING]
    assert wrong(lambda path: list(declared_friction(ast.parse(path.read_text()))), files) == {}


def test_declared_friction_is_found():
    text = "law, x = fault.friction.exact(), 1\na = law.slip_slope\nb = self.fault.friction.bounds\nc = box.bounds"
    assert sorted(declared_friction(ast.parse(text))) == ["law.slip_slope", "self.fault.friction.bounds"]


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.pyi")), ids=lambda path: path.parent.name)
def test_what_tools_read_of_a_stub_is_what_its_package_loads(path):
    package = importlib.import_module(".".join(path.parent.relative_to(ROOT).parts))
    stub = [node for node in ast.parse(path.read_text(encoding="utf-8")).body if isinstance(node, ast.ImportFrom)]
    stated = {alias.asname: (f".{node.module}", alias.name) for node in stub for alias in node.names}
    assert sorted(stated) == sorted(package.__all__)
    for name, (module, there) in stated.items():
        assert name == there
        assert getattr(importlib.import_module(module, package.__name__), there) is getattr(package, name)


def names(pattern):
    """What a pattern finds in every module, with the modules."""
    found = {}
    for path in SOURCES:
        for name in re.findall(pattern, path.read_text(encoding="utf-8"), flags=re.MULTILINE):
            found.setdefault(name, []).append(module_name(path))
    return found


def test_the_name_of_a_class_and_of_a_file_occurs_once():
    assert {name: where for name, where in names(r"^class (\w+)").items() if len(where) > 1} == {}
    files = [path.name for path in SOURCES if path.name not in ("__init__.py", "base.py")]
    assert sorted({name for name in files if files.count(name) > 1}) == []


BUDGETS = {
    "fault": 3246,
    "symbolic": 3188,
    "sos": 6388,
    "laws": 3132,
    "loop": 4186,
    "plant": 1477,
    "guarantees": 13573,
    "lyapunov": 7064,
    "linear": 2417,
    "synthesis": 1982,
    "rocq": 849,
    "simulation": 9789,
    "identification": 4054,
    "studies": 4163,
    "report": 4163,
    "cli": 3596,
}
"""Lines that a package may have: a feature that needs more goes with what it makes unnecessary."""


@pytest.mark.parametrize("package", BUDGETS)
def test_a_package_keeps_to_its_budget_of_lines(package):
    lines = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in (PACKAGE / package).rglob("*.py"))
    assert lines <= BUDGETS[package]


def test_every_package_has_a_budget():
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} == set(BUDGETS)


ASKED = re.compile(
    r"\bif (not )?(?!len\()[\w.\[\]()]*\.state_names\b(?! ==)"
    r"|bool\([\w.\[\]()]*\.state_names\)"
    r"|\bis (not )?(STEADY_SLIDING|AT_REST)\b"
)


def test_few_places_ask_whether_friction_has_a_state():
    """The others have one implementation for each equilibrium, or an entry of it."""
    texts = (path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py"))
    assert sum(len(ASKED.findall(text)) for text in texts) < 10
