"""The tool that mutates the deciding modules changes one place at a time, and neither texts nor messages."""

import ast
import gc
import importlib.util
import json
import re
import runpy
import sys
from collections import Counter
from fnmatch import fnmatch
from pathlib import Path
from types import SimpleNamespace

import pytest

PATH = Path(__file__).with_name("mutation.py")
SPECIFICATION = importlib.util.spec_from_file_location("mutation", PATH)
tool = importlib.util.module_from_spec(SPECIFICATION)
sys.modules["mutation"] = tool
SPECIFICATION.loader.exec_module(tool)

SOURCE = '''
"""Text is not changed: 1 < 2."""
LIMIT = 7


def inside(value: int = 3) -> bool:
    need(value < LIMIT, "a number", 5)
    if value and not value % 2:
        raise ValueError("not 4")
    return value in range(1, LIMIT)
'''

MUTATIONS = [
    "3 → 4",
    "3 → 2",
    "3 → 6",
    "need(value < LIMIT, 'a number', 5) → pass",
    "value < LIMIT → value <= LIMIT",
    "value < LIMIT → value >= LIMIT",
    "value and (not value % 2) → value or not value % 2",
    "value and (not value % 2) → not value % 2",
    "value and (not value % 2) → value",
    "value and (not value % 2) → True",
    "value and (not value % 2) → False",
    "not value % 2 → value % 2",
    "value % 2 → value // 2",
    "2 → 3",
    "2 → 1",
    "raise ValueError('not 4') → pass",
    "return value in range(1, LIMIT) → return True",
    "return value in range(1, LIMIT) → return False",
    "value in range(1, LIMIT) → value not in range(1, LIMIT)",
    "1 → 2",
    "1 → 0",
    "7 → 8",
    "7 → 6",
    "7 → 14",
]


def test_code_is_changed_in_one_place_at_a_time(tmp_path):
    module = tmp_path / "module.py"
    module.write_text(SOURCE)
    found = list(tool.mutants_of(module))
    assert [mutant.mutation for mutant in found] == MUTATIONS
    assert [mutant.text for mutant in found][-1] == "LIMIT = 7"
    assert len({mutant.code for mutant in found}) == len(MUTATIONS)
    assert ast.parse(module.read_text())


CLASS = """
from dataclasses import dataclass
from functools import cache
from typing import ClassVar


@dataclass
class Size:
    most: ClassVar[int] = 20
    value: int = 3

    def times(self, factor: int = 5) -> int:
        return self.value * factor

    @classmethod
    def of(cls, value: int = 11) -> "Size":
        return cls(value)


@cache
def half(value: int = 8) -> int:
    return value // 2
"""


def test_defaults_of_fields_and_methods_are_changed_in_place(tmp_path):
    path = tmp_path / "size.py"
    path.write_text(CLASS)
    specification = importlib.util.spec_from_file_location("size", path)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    size = module.Size
    found = {mutant.mutation: mutant for mutant in tool.mutants_of(path)}
    for mutation, product in (("3 → 4", 4 * 5), ("5 → 6", 3 * 6), ("5 → 10", 3 * 10)):
        tool.apply(found[mutation], [size.times], [module])
        assert size().times() == product
    assert size(2).times(7) == 14
    tool.apply(found["20 → 40"], [], [module])
    assert (size.most, size().most) == (40, 40)
    tool.apply(found["11 → 12"], [], [module])
    assert size.of().value == 12
    tool.apply(found["8 → 9"], [module.half.__wrapped__], [module])
    assert module.half() == 4
    tool.apply(found["8 → 16"], [module.half.__wrapped__], [module])
    (cache,) = tool.caches_in([module.half, module.half.__wrapped__, tool.fnmatch.translate, size], tmp_path)
    cache.cache_clear()
    assert module.half() == 8


def test_a_test_that_imports_a_module_anew_reaches_no_line_of_its_classes(tmp_path):
    path = tmp_path / "fresh.py"
    path.write_text("class One:\n    size = 1\n\n    def own(self):\n        return self.size\n\n\nTWO = 2\n")
    follow = tool.Reached({str(path)}, [])
    sys.settrace(follow)
    runpy.run_path(str(path))["One"]().own()
    sys.settrace(None)
    assert dict(follow.lines) == {str(path): {4, 5}}


def test_functions_are_found_after_they_were_frozen():
    """`conftest.py` freezes what lives when tests are collected: a tool that overlooks it changes nothing."""
    gc.freeze()
    found = tool.living()
    assert any(entry is tool.living for entry in found)
    gc.freeze()


def test_a_rule_explains_what_tests_hold_and_leaves_no_check_out():
    explanations = tool.Explanations()
    files = [path for room in ("proofs", "quakedesign", "tests") for path in (tool.ROOT / room).rglob("*.py")]
    texts = {str(path.relative_to(tool.ROOT)): path.read_text(encoding="utf-8") for path in files}
    for rule in explanations.rules:
        rows = [row.strip() for path, text in texts.items() if fnmatch(path, rule.module) for row in text.splitlines()]
        assert any(re.search(rule.line, row) for row in rows), rule.line
        for left_out in ("need(a <= B, 'c', d) → pass", "raise Refused → pass", "a <= B → True", "a <= B → False",
                         "spend(1) → pass", "budget.spend(1, 2) → pass"):  # fmt: skip
            assert not re.search(rule.mutation, left_out), left_out
        for held in rule.held:
            path, _, name = held.partition("::")
            assert f"def {name}(" in texts[path], held


def test_single_mutants_and_kinds_are_explained():
    explanations = tool.Explanations()
    limit = ("proofs/checker/lyapunov/loop.py", "MAX_ROOTS, MAX_LIFTS = 4, 4", "4 → 5")
    assert explanations.of(limit) == "by rule"
    assert explanations.of(("quakedesign/lyapunov/exact/claim.py", *limit[1:])) == ""
    assert (
        explanations.of(
            ("proofs/checker/lyapunov/loop.py", "need(x <= MAX_ROOTS, where)", "need(x <= MAX_ROOTS, where) → pass")
        )
        == ""
    )
    assert {explanations.of(key) for key in explanations.single} == {"equivalent"}


@pytest.mark.slow
def test_every_single_mutant_that_is_explained_can_be_made():
    single = set(tool.Explanations().single)
    made = {m.key() for path in {key[0] for key in single} for m in tool.mutants_of(tool.ROOT / path, compiled=False)}
    assert not single - made


def test_the_first_case_of_every_test_comes_before_a_second_and_it_says_whether_all_fit():
    lines = {"file.py": {3, 4}}
    seconds = {"a[1]": 1.0, "a[2]": 2.0, "a[3]": 3.0, "b": 4.0, "c[x]": 0.5, "elsewhere": 0.1, "failing": 0.1}
    reached = {name: (s, name != "failing", {} if name == "elsewhere" else lines) for name, s in seconds.items()}
    mutant = SimpleNamespace(path="file.py", lines=range(4, 5), within=range(1, 9), function="f")
    for limit, chosen in ((100, ["c[x]", "a[1]", "b", "a[2]", "a[3]"]), (6, ["c[x]", "a[1]", "b"])):
        tried = tool.Mutation(SimpleNamespace(modules=[], seconds=limit))
        assert tried.choose(mutant, reached, Counter()) == (chosen, limit == 100)
    many = Counter({("file.py", "f", "b"): 9})
    tried = tool.Mutation(SimpleNamespace(modules=[], seconds=100))
    assert tried.choose(mutant, reached, many)[0][0] == "b"


def test_a_test_that_fails_without_a_mutation_ends_the_run_and_a_long_one_is_named(capsys):
    tool.refuse_failures({"quick": (0.1, True, {}), "long": (tool.LONGEST / 2, None, {})})
    assert capsys.readouterr().out == "takes too long without a mutation, left out: long\n"
    with pytest.raises(pytest.UsageError, match="broken fails without a mutation"):
        tool.refuse_failures({"quick": (0.1, True, {}), "broken": (2 * tool.LONGEST, False, {})})


@pytest.mark.parametrize(("status", "code"), [("killed", 0), ("timeout", 0), ("survived", 1), ("undecided", 1)])
def test_a_report_is_clean_where_all_mutants_are_detected(status, code, tmp_path, capsys):
    module = PATH.parent / "data" / "thinned.py"
    results, seen = tmp_path / "results.jsonl", Counter()
    with results.open("w", encoding="utf-8") as stream:
        for number, mutant in enumerate(tool.mutants_of(module, compiled=False)):
            key = mutant.key()
            stream.write(json.dumps([*key, seen[key], 1, status if number == 3 else "killed", "", 1]) + "\n")
            seen[key] += 1
    assert tool.report(SimpleNamespace(modules=[module], results=results)) == code
    said = capsys.readouterr().out
    assert (f"1 {status}" in said) or status == "killed"
    assert ("→" in said) is (status == "survived")
