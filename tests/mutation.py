"""Mutation testing: change modules in one place at a time, and list the mutants that no test detects.

Usage: ``python tests/mutation.py MODULE.py... --tests TEST... [--results FILE]``. The tests are collected once and
run once to record which of them reaches which line. Every mutant then gets a forked child, in which the code of
the functions is exchanged and the tests that reach the line run, the fastest case of each first, until one fails.
Results are JSON lines: a killed mutant is not tried again; a surviving one is, and so is an undecided one, for which
not all tests fitted into the time, unless ``mutation_equivalents.toml`` explains it with a reason: by module, line
and mutation, or by a rule for all lines and mutations that match its patterns. A rule names the tests of what it
excepts. Without tests the results so far are reported. A test that fails without a mutation ends the run.

Not mutated: annotations, strings, messages of errors, imports, and ``strict`` of ``zip``, which guards no input.
"""

import argparse
import ast
import copy
import fnmatch
import functools
import gc
import importlib
import inspect
import json
import os
import pickle
import random
import re
import resource
import signal
import sys
import tempfile
import time
import tomllib
import types
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import settings

ROOT = Path(__file__).parent.parent
EQUIVALENTS = Path(__file__).with_name("mutation_equivalents.toml")
CALLS = 25  # of one function in one test that are followed line by line
LONGEST = 4  # seconds that a test may take when lines are followed; longer ones are omitted
MEMORY = 6 * 2**30  # bytes of address space that a mutant may fill

COMPARISONS = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
PAIRS = (ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.BitOr, ast.BitAnd), (ast.LShift, ast.RShift)
OPERATORS = {a: b for pair in PAIRS for a, b in (pair, pair[::-1])} | {ast.FloorDiv: ast.Mult, ast.Pow: ast.Mult}
OPERATORS |= {ast.Mod: ast.FloorDiv}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any"}


def changed(node: ast.AST, **fields: object) -> ast.AST:
    """Return a shallow copy with other fields."""
    result = copy.copy(node)
    for name, value in fields.items():
        setattr(result, name, value)
    return result


def replaced(entries: list, index: int, *new: object) -> list:
    """Return a list with one entry replaced or omitted."""
    return [*entries[:index], *new, *entries[index + 1 :]]


def numbers_near(value: object) -> Iterator[object]:
    """Yield the mutations of a constant."""
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield from dict.fromkeys([value + 1, *([value - 1] if value else []), *([2 * value] if value > 2 else [])])
    elif isinstance(value, float):
        yield from (2 * value, value / 2) if value else (1.0,)


def variants(node: ast.AST, returns_bool: bool) -> Iterator[ast.AST]:
    """Yield the mutations of a node."""
    match node:
        case ast.Compare():
            for i, operator in enumerate(node.ops):
                for other in COMPARISONS[type(operator)]:
                    yield changed(node, ops=replaced(node.ops, i, other()))
        case ast.BoolOp():
            yield changed(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())
            for i in range(len(node.values)):
                rest = replaced(node.values, i)
                yield changed(node, values=rest) if len(rest) > 1 else rest[0]
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            yield node.operand
        case ast.BinOp() | ast.AugAssign() if type(node.op) in OPERATORS:
            yield changed(node, op=OPERATORS[type(node.op)]())
        case ast.Constant():
            yield from (changed(node, value=value) for value in numbers_near(node.value))
        case ast.Name(id=name) if name in NAMES:
            yield changed(node, id=NAMES[name])
        case ast.Slice():
            yield from (changed(node, **{end: None}) for end in ("lower", "upper", "step") if getattr(node, end))
        case ast.comprehension():
            yield from (changed(node, ifs=replaced(node.ifs, i)) for i in range(len(node.ifs)))
        case ast.Expr(value=ast.Call() | ast.YieldFrom()) | ast.Raise() | ast.Continue() | ast.Break():
            yield ast.copy_location(ast.Pass(), node)
        case ast.Return(value=ast.expr()) if returns_bool and not isinstance(node.value, ast.Constant):
            yield from (changed(node, value=ast.copy_location(ast.Constant(flag), node)) for flag in (True, False))


def forced(parent: ast.AST, name: str, node: ast.AST) -> Iterator[ast.AST]:
    """Yield the two fixed outcomes of a condition."""
    if name == "test":
        outcomes = (False,) if isinstance(parent, ast.While) else (True, False)
        yield from (ast.copy_location(ast.Constant(flag), node) for flag in outcomes)


def is_text(parent: ast.AST, name: str, index: int | None) -> bool:
    """Whether a field holds annotations, messages or other code that is not mutated."""
    match parent:
        case ast.Raise() | ast.keyword(arg="strict") | ast.arg():
            return True
        case ast.Call(func=ast.Name(id="need" | "require")):
            return name == "args" and index != 0
        case ast.Call(func=ast.Name(id="refuse" | "_refuse" | "reject" | "_reject" | "_unsupported")):
            return name == "args"
    return name in ("annotation", "returns", "decorator_list", "format_spec", "ctx")


def places(parent: ast.AST, returns_bool: bool) -> Iterator[tuple[ast.AST, str, int | None, ast.AST, bool]]:
    """Yield every descendant of a node with its place and whether its function returns a truth value."""
    for name, value in ast.iter_fields(parent):
        for index, node in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if not isinstance(node, ast.AST) or is_text(parent, name, index):
                continue
            flag = returns_bool
            if isinstance(node, ast.FunctionDef):
                flag = isinstance(node.returns, ast.Name) and node.returns.id == "bool"
            yield parent, name, index, node, flag
            yield from places(node, flag)


@dataclass
class Mutant:
    """A changed statement of a module, compiled."""

    path: str
    lines: range
    within: range  # lines of its function or class
    text: str
    mutation: str
    code: types.CodeType | None
    names: list[str] = field(default_factory=list)  # that the statement assigns
    function: str = ""

    def key(self) -> tuple[str, str, str]:
        """Identify the mutant for as long as its line stays as it is."""
        return str(Path(self.path).relative_to(ROOT)), self.text, self.mutation


def mutants_of(path: Path, *, compiled: bool = True) -> Iterator[Mutant]:
    """Change a module in one place at a time."""
    source = path.read_text(encoding="utf-8")
    rows = source.splitlines()
    kinds = (ast.FunctionDef | ast.ClassDef, ast.Assign | ast.AnnAssign)  # constants last: any test may notice
    for top in (top for kind in kinds for top in ast.parse(source).body if isinstance(top, kind)):
        targets = top.targets if isinstance(top, ast.Assign) else [getattr(top, "target", None)]
        names = [node.id for target in targets if target for node in ast.walk(target) if isinstance(node, ast.Name)]
        names += [top.name] if isinstance(top, ast.FunctionDef | ast.ClassDef) else []
        tree = ast.Module([top], [])
        for parent, name, index, node, flag in list(places(tree, False)):
            for new in (*variants(node, flag), *forced(parent, name, node)):
                at = node if hasattr(node, "lineno") else parent if hasattr(parent, "lineno") else node.target
                mutation = f"{ast.unparse(node)} → {ast.unparse(new)}"
                place = getattr(parent, name) if index is not None else parent
                put, where = (place.__setitem__, index) if index is not None else (place.__setattr__, name)
                put(where, new)
                try:
                    code = compile(ast.fix_missing_locations(tree), str(path), "exec") if compiled else None
                finally:
                    put(where, node)
                lines = range(at.lineno, at.end_lineno + 1)
                function = getattr(top, "name", "")
                within = range(top.lineno, top.end_lineno + 1)
                yield Mutant(str(path), lines, within, rows[at.lineno - 1].strip(), mutation, code, names, function)


# ---------------------------------------------------------------- exchanging code


def key_of(code: types.CodeType) -> tuple[str, int]:
    """Identify a function in its module."""
    return code.co_qualname, code.co_firstlineno


def codes_in(code: types.CodeType) -> Iterator[types.CodeType]:
    """Yield a code object and those within."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from codes_in(constant)


def apply(mutant: Mutant, functions: list[types.FunctionType], modules: list[types.ModuleType]) -> None:
    """Exchange the code and defaults of functions, or the values of names wherever they were imported."""
    codes = {key_of(code): code for code in codes_in(mutant.code)}
    for function in functions:
        if key_of(function.__code__) in codes:
            function.__code__ = codes[key_of(function.__code__)]
    for home in [module for module in modules if getattr(module, "__file__", None) == mutant.path]:
        scope = dict(vars(home))
        exec(mutant.code, scope)
        for name in mutant.names:
            old, new = vars(home)[name], scope[name]
            if name == mutant.function:
                exchange_defaults({name: old}, {name: new})
                exchange_defaults(vars(old), vars(new))
                exchange_numbers(old, new)
            else:
                for module in modules:
                    if vars(module).get(name) is old:
                        setattr(module, name, new)


def living() -> list[object]:
    """All objects of the garbage collector, including those that `conftest.py` has frozen."""
    gc.unfreeze()
    return gc.get_objects()


def caches_in(objects: list[object], folder: Path) -> list[functools._lru_cache_wrapper]:
    """Caches of functions of a folder: their entries from the collection of tests are without mutation."""
    caches = [entry for entry in objects if isinstance(entry, functools._lru_cache_wrapper)]
    codes = [getattr(inspect.unwrap(entry), "__code__", None) for entry in caches]
    pairs = zip(caches, codes, strict=True)
    return [entry for entry, code in pairs if code and Path(code.co_filename).is_relative_to(folder)]


def exchange_defaults(old: Mapping[str, object], new: Mapping[str, object]) -> None:
    """Give functions, unwrapped from decorators, the defaults of others of the same name."""
    for name, function in old.items():
        wrapped = callable(function) or isinstance(function, classmethod | staticmethod)
        inner, other = (inspect.unwrap(one) if wrapped else one for one in (function, new.get(name)))
        if isinstance(inner, types.FunctionType) and isinstance(other, types.FunctionType):
            inner.__defaults__, inner.__kwdefaults__ = other.__defaults__, other.__kwdefaults__


def exchange_numbers(old: object, new: object) -> None:
    """Give a class the numbers of another one that are the same for all of its objects."""
    for name, value in vars(new).items():
        if isinstance(old, type) and type(value) in (bool, int, float) and vars(old).get(name) != value:
            setattr(old, name, value)


# ---------------------------------------------------------------- running tests


def in_child(work, seconds: float) -> tuple[str, bytes]:
    """Run work in a forked child; return its end, ``done`` or ``timeout``, and its result."""
    with tempfile.TemporaryFile() as answer:
        child = os.fork()
        if child == 0:
            os.setpgid(0, 0)
            quiet = os.open(os.devnull, os.O_RDWR)
            for stream in (1, 2) if seconds else ():
                os.dup2(quiet, stream)
            if seconds:
                resource.setrlimit(resource.RLIMIT_CPU, (int(seconds) + 1, int(seconds) + 1))
                resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
                signal.alarm(10 * int(seconds) + 10)
            try:
                answer.write(work())
                answer.flush()
            finally:
                os._exit(0)
        _, status = os.waitpid(child, 0)
        try:
            os.killpg(child, signal.SIGKILL)  # processes that the tests have started
        except (ProcessLookupError, PermissionError):
            pass
        answer.seek(0)
        return "timeout" if os.WIFSIGNALED(status) else "done", answer.read()


class TooLong(BaseException):
    """A test takes longer than it may."""


class Reached:
    """Lines of some files that every test reaches, its seconds, and whether it passed: None if it was stopped."""

    def __init__(self, paths: set[str], caches: list[functools._lru_cache_wrapper]) -> None:
        self.paths, self.calls, self.lines, self.stopped = paths, Counter(), defaultdict(set), False
        self.caches = [cache for cache in caches if inspect.unwrap(cache).__code__.co_filename in paths]

    def __call__(self, frame, event, _):
        """Follow the first calls of every function, as the interpreter's trace function."""
        code = frame.f_code
        if code.co_filename not in self.paths or not code.co_flags & inspect.CO_OPTIMIZED:
            return None  # bodies of modules and classes: a test that imports anew would seem to be the only one
        self.calls[code] += 1
        if self.calls[code] > CALLS:
            return None
        lines = self.lines[code.co_filename]
        lines.add(frame.f_lineno)

        def line(frame, event, _):
            lines.add(frame.f_lineno)
            return line

        return line

    def stop(self, *_: object) -> None:
        """Stop a test, as a signal handler."""
        self.stopped = True
        raise TooLong

    def run(self, items) -> bytes:
        """Run tests, each with its own fixtures, up to one that is stopped: its fixtures may be left half built."""
        result = {}
        signal.signal(signal.SIGVTALRM, self.stop)
        for item in items:
            for cache in self.caches:  # else only the first test would reach the lines of cached results
                cache.cache_clear()
            self.stopped = False
            signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST)
            self.calls, self.lines, start = Counter(), defaultdict(set), time.process_time()
            sys.settrace(self)
            passed = passes(item)
            sys.settrace(None)
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            verdict = None if self.stopped else passed  # the clock of the timer may run a little ahead of the other
            result[item.nodeid] = time.process_time() - start, verdict, dict(self.lines)
            if verdict is None:
                break
        return pickle.dumps(result)


def passes(item) -> bool:
    """Run one test with fixtures of its own."""
    return not any(report.failed for report in runtestprotocol(item, log=False, nextitem=None))


def refuse_failures(reached: dict) -> None:
    """Raise for a test that fails without a mutation: it would hide what it detects; name tests that are too long."""
    for name, (_, passed, _) in reached.items():
        if passed is False:
            raise pytest.UsageError(f"{name} fails without a mutation")
        if passed is None:
            print(f"takes too long without a mutation, left out: {name}")


def first_failure(items) -> bytes:
    """Run tests until one fails, and return its name."""
    return next((item.nodeid for item in items if not passes(item)), "").encode()


class Mutation:
    """Replaces pytest's loop over the tests."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.paths = [path.resolve() for path in options.modules]
        self.controlled: dict[tuple, bool] = {}
        self.caches: list[functools._lru_cache_wrapper] = []
        self.seconds: dict[str, float] = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        """Remove the deadline of random tests: a busy machine kills no mutant."""
        settings.register_profile("patient", settings.get_profile("reproducible"), deadline=None)
        settings.load_profile("patient")

    def pytest_runtestloop(self, session) -> bool:
        """Try every mutant that was not killed before."""
        for path in self.paths:
            if path.is_relative_to(ROOT / "quakedesign"):
                importlib.import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
        objects = living()
        by_path = defaultdict(list)
        for entry in objects:
            if isinstance(entry, types.FunctionType):
                by_path[entry.__code__.co_filename].append(entry)
        modules = [entry for entry in objects if isinstance(entry, types.ModuleType)]
        self.caches = caches_in(objects, ROOT)
        del objects
        gc.collect()
        gc.freeze()  # not searched in children
        items = {item.nodeid: item for item in session.items}
        reached = self.reached(session.items)
        self.seconds = {name: seconds for name, (seconds, _, _) in reached.items()}
        refuse_failures(reached)
        past, known = read_results(self.options.results), Explanations()
        kills: Counter[tuple[str, str, str]] = Counter()
        with open(self.options.results, "a", encoding="utf-8") as stream:
            for path in self.paths:
                seen: Counter[tuple[str, str, str]] = Counter()
                mutants = list(mutants_of(path))
                drawn = set(
                    random.Random(self.options.seed).sample(range(len(mutants)), len(mutants))[: self.options.sample]
                )
                for index, mutant in enumerate(mutants):
                    key, count = mutant.key(), seen[mutant.key()]
                    seen[key] += 1
                    skipped = self.options.skip and re.search(self.options.skip, mutant.text)
                    if (
                        index not in drawn
                        or skipped
                        or known.of(key)
                        or past.get((*key, count), "survived") not in ("survived", "undecided")
                    ):
                        continue
                    names, all_of_them = self.choose(mutant, reached, kills)
                    status, killer = self.try_out(mutant, by_path[mutant.path], modules, [items[n] for n in names])
                    status = "undecided" if status == "survived" and not all_of_them else status
                    kills[mutant.path, mutant.function, killer] += 1
                    row = [*key, count, mutant.lines[0], status, killer, len(names)]
                    stream.write(json.dumps(row, ensure_ascii=False) + "\n")
                    stream.flush()
        return True

    def reached(self, items) -> dict:
        """Return seconds, success and lines of every test, from a file beside the results where tests are the same."""
        stored = self.options.results.with_suffix(".reached")
        if stored.exists():
            result = pickle.loads(stored.read_bytes())
            if result.keys() == {item.nodeid for item in items}:
                return result
        result = {}
        while left := items[len(result) :]:
            reached = Reached(set(map(str, self.paths)), self.caches)
            result |= pickle.loads(in_child(lambda reached=reached, left=left: reached.run(left), 0)[1])
        stored.write_bytes(pickle.dumps(result))
        return result

    def try_out(self, mutant: Mutant, functions, modules, items) -> tuple[str, str]:
        """Run tests on a mutant; a failure counts where the same tests succeed without it."""
        limit = 2 + 2 * sum(self.seconds[item.nodeid] for item in items)

        def work() -> bytes:
            try:
                apply(mutant, functions, modules)
                for cache in self.caches:
                    cache.cache_clear()
            except Exception as error:
                return f"on import: {error!r}".encode()
            return first_failure(items)

        ending, answer = in_child(work, limit) if items else ("done", b"")
        killer = answer.decode()
        if ending == "done" and not killer:
            return "survived", ""
        suspects = tuple(item for item in items if ending == "timeout" or item.nodeid == killer)
        if suspects not in self.controlled:
            self.controlled[suspects] = in_child(lambda: first_failure(suspects), limit) == ("done", b"")
        if not self.controlled[suspects]:
            return "survived", "tests fail or are slow by themselves"
        return ("timeout" if ending == "timeout" else "killed"), killer

    def choose(self, mutant: Mutant, reached: dict, kills: Counter) -> tuple[list[str], bool]:
        """Return the tests that reach a mutant, within the time for it, best ones first, and whether they are all."""
        known = {name: paths.get(mutant.path, set()) for name, (_, passed, paths) in reached.items() if passed}
        names = [name for name, lines in known.items() if lines.intersection(mutant.lines)]
        if not mutant.function:  # a constant: any test may read it
            names = list(known)
        elif not names:  # a default, or a line that is not traced
            names = [name for name, lines in known.items() if lines.intersection(mutant.within)] or list(known)
        reaching = {name: reached[name][0] / (1 + kills[mutant.path, mutant.function, name]) for name in names}
        ranks, seen = {}, Counter()  # the fastest of every test function before the second of any
        for name in sorted(reaching, key=reaching.__getitem__):
            ranks[name] = seen[name.partition("[")[0]]
            seen[name.partition("[")[0]] += 1
        chosen, left = [], self.options.seconds
        for name in sorted(reaching, key=lambda name: (ranks[name], reaching[name])):
            left -= reached[name][0]
            if left >= 0:
                chosen.append(name)
        return chosen, len(chosen) == len(names)


# ---------------------------------------------------------------- results


def read_results(path: Path) -> dict[tuple[str, str, str, int], str]:
    """Return the last result of every mutant."""
    rows = [json.loads(row) for row in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []
    return {tuple(row[:4]): row[5] for row in rows}


@dataclass(frozen=True)
class Rule:
    """Mutants of one kind, for one reason.

    Attributes
    ----------
    module : str
        Pattern of paths, as of a shell.
    line, mutation : str
        Regular expressions.
    reason : str
    held : list of str
        Tests that fail without the lines.
    """

    module: str
    line: str
    mutation: str
    reason: str
    held: list[str] = field(default_factory=list)

    def explains(self, key: tuple[str, str, str]) -> bool:
        """Whether the rule applies to a mutant."""
        module, line, mutation = key
        return bool(
            fnmatch.fnmatch(module, self.module) and re.search(self.line, line) and re.search(self.mutation, mutation)
        )


class Explanations:
    """Mutants that are equivalent to the original, with the reason."""

    def __init__(self) -> None:
        entries = tomllib.loads(EQUIVALENTS.read_text(encoding="utf-8"))
        self.single = {(row["module"], row["line"], row["mutation"]): row["reason"] for row in entries["equivalent"]}
        self.rules = [Rule(**row) for row in entries["rule"]]

    def of(self, key: tuple[str, str, str]) -> str:
        """``equivalent``, ``by rule``, or an empty text for an unexplained mutant."""
        if key in self.single:
            return "equivalent"
        return "by rule" if any(rule.explains(key) for rule in self.rules) else ""


def report(options: argparse.Namespace) -> int:
    """Print survivors without explanation, and the number of mutants by module and result."""
    known, results, totals = Explanations(), read_results(options.results), defaultdict(Counter)
    for path in options.modules:
        seen: Counter[tuple[str, str, str]] = Counter()
        for mutant in mutants_of(path.resolve(), compiled=False):
            key = mutant.key()
            status = results.get((*key, seen[key]), "not tried")
            seen[key] += 1
            if status in ("survived", "undecided", "not tried"):
                status = known.of(key) or status
            if status == "survived":
                print(f"{key[0]}:{mutant.lines[0]}: {mutant.text}\n    {mutant.mutation}")
            totals[key[0]][status] += 1
        for key in sorted(key for key in known.single.keys() - seen.keys() if ROOT / key[0] == path.resolve()):
            print(f"explained, but no mutant any more: {key}")
    for name, counts in totals.items():
        print(f"{name}: {sum(counts.values())} mutants; {', '.join(f'{n} {s}' for s, n in sorted(counts.items()))}")
    return int(any(counts[open_] for counts in totals.values() for open_ in ("survived", "undecided", "not tried")))


def main() -> int:
    """Run the tests, if any are given, on the mutants, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="+", type=Path)
    parser.add_argument("--tests", nargs="*", default=[], help="without them the results so far are reported")
    parser.add_argument("--results", type=Path, default=Path(tempfile.gettempdir()) / "mutation.jsonl")
    parser.add_argument("--select", default="", help="expression on the names of tests, as pytest -k")
    parser.add_argument("--slow", action="store_true", help="with the slow tests, which try all cases")
    parser.add_argument("--skip", help="regular expression for lines that are left for another run")
    parser.add_argument("--sample", type=int, help="mutants of each module, drawn at random; all by default")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--seconds", type=float, default=10, help="of tests for one mutant")
    options = parser.parse_args()
    if options.tests:
        flags = [
            "-o",
            "addopts=--import-mode=importlib",
            "-m",
            "" if options.slow else "not slow",
            "-q",
            "-s",
            "-p",
            "no:cacheprovider",
        ]
        flags += ["--assert=plain", "--tb=native"]
        done = pytest.main([*flags, "-k", options.select, *options.tests], plugins=[Mutation(options)])
        if done != 0:
            return int(done)
    return report(options)


if __name__ == "__main__":
    sys.exit(main())
