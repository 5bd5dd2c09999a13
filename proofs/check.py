"""Verify certificate files of FORMAT.md in exact arithmetic, with the Python standard library alone.

Usage: ``python proofs/check.py FILE...``. Every file gets one block: ``proved`` or ``refuted`` with the
statement that was verified, or ``invalid`` with one reason. Exit code 0: all proved; 1: not all; 2: an
argument cannot be read, or the verdict not be written; 4: out of memory. The folder ``checker`` must
stand beside this file.

To trust a verdict, read this file, checker/numbers.py (reading and arithmetic) and the modules of the kind of file.
"""

import os
import sys
from dataclasses import dataclass
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

FOLDER = Path(__file__).resolve().with_name("checker")
PACKAGE = f"{__name__}_checker".replace(".", "_")  # a name that no other module has


class Source(SourceFileLoader):
    """Loads a module from its source: compiled files are neither read nor written."""

    def get_code(self, fullname: str) -> CodeType:
        """Compile the source."""
        return self.source_to_code(self.get_data(self.path), self.path)


class Finder(MetaPathFinder):
    """Finds the modules of the package, in the folder ``checker`` only; no other modules."""

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """Location of a module of the package; an OSError names a missing file."""
        package, *parts = fullname.split(".")
        if package != PACKAGE:
            return None
        place = FOLDER.joinpath(*parts)
        file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
        if not file.is_file():
            raise OSError(f"{file.relative_to(FOLDER.parent)} must stand beside check.py")
        within = [str(place)] if place.is_dir() else None
        loader = Source(fullname, str(file))
        return spec_from_file_location(fullname, file, loader=loader, submodule_search_locations=within)


sys.meta_path.insert(0, Finder())


def beside(name: str) -> ModuleType:
    """Load a module of the folder ``checker``, with its imports."""
    return import_module(f"{PACKAGE}.{name}")


try:
    numbers = beside("numbers")
except OSError as missing:
    print(f"{missing}. Copy the whole folder.", file=sys.stderr)
    sys.exit(2)
Refused, need = numbers.Refused, numbers.need


class Outdated(Exception):
    """The file is of a kind that is no longer supported."""


@dataclass(frozen=True)
class Result:
    """Verdict, ``proved`` or ``refuted``, and the verified statement, line by line in ASCII."""

    verdict: str
    statement: tuple[str, ...]


# ---------------------------------------------------------------- kinds of files


def check(text: str) -> Result:
    """Verify the text of a file; Refused if a rule is broken, whether or not the claim is true."""
    numbers.budget.renew()
    document = numbers.read_object(numbers.parse(text), "the file")
    version = document.get("format")
    need(type(version) is int and version == 1, "format", "the integer 1", version)
    if "polynomial" in document:
        return check_polynomial(document)
    if document.get("kind") == "attraction":
        verdict, lines = beside("attraction").decide(document)
        return Result(verdict, tuple(lines))
    if "kind" in document:
        return check_guarantee(document)
    if "inputs" in document and "outputs" in document:
        raise Outdated
    if "refutation" in document:
        return Result("refuted", tuple(beside("lyapunov.equilibrium").refute(document)))
    return Result("proved", tuple(beside("lyapunov.stability").prove(document)))


def check_polynomial(document: dict[str, Any]) -> Result:
    """Verify a file about a plain polynomial."""
    polynomials = beside("polynomials")
    given = [kind for kind in ("sos", "not-sos", "negative") if kind in document] or ["sos"]
    numbers.read_object(document, "the file", (*polynomials.STATEMENT_KEYS, given[0]))
    statement = polynomials.read_statement(document)
    if given[0] == "sos":
        lines = polynomials.prove_squares(document["sos"], statement)
    elif given[0] == "not-sos":
        lines = beside("functionals").refute_by_functional(document["not-sos"], statement)
    else:
        lines = polynomials.refute_by_point(document["negative"], statement)
    described = polynomials.describe_statement(statement)
    return Result("proved" if given == ["sos"] else "refuted", (*described, *lines))


def check_guarantee(document: dict[str, Any]) -> Result:
    """Verify the guarantee of a file."""
    kind = document["kind"]
    modules = {"guarantee": "tracking", "slow_sliding": "slow_sliding", "stick_slip": "stick_slip"}
    modules["uncertain_plant"] = "plant"
    need(kind in tuple(modules), "kind", "guarantee, slow_sliding, stick_slip or uncertain_plant", kind)
    return Result("proved", tuple(beside(f"guarantee.{modules[kind]}").verify(document)))


# ---------------------------------------------------------------- the command


def read_file(name: str) -> str:
    """Read a regular file of bounded size as UTF-8."""
    if Path(name).exists() and not Path(name).is_file():
        raise OSError("it is not a regular file")
    most = numbers.MAX_BYTES
    with open(name, "rb") as stream:
        content = stream.read(most + 1)
    need(len(content) <= most, "the file", f"at most {most} bytes long", "more")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise Refused(f"the file must be UTF-8. Received another byte at {error.start}") from None


def report(name: str) -> int:
    """Check one file, print its block and return its exit code."""
    try:
        result = check(read_file(name))
    except Refused as error:
        print(f"{ascii(name)[1:-1]}: invalid: {error}")
        return 1
    except MemoryError:  # no verdict on the file
        print(f"FILE must fit into memory. Received {name!a}. Raise the memory limit.", file=sys.stderr)
        return 4
    except Outdated:
        expected = "FILE must be a proof, a refutation or of the kind guarantee"
        remedy = "Make the new file with quakedesign certify elqr FAULT --gains K1 K2 K3 K4 --peaks CLASS --out FILE"
        print(f"{expected}. Received {name!a}, of an older kind: no longer supported. {remedy}.", file=sys.stderr)
        return 2
    except (OSError, ValueError) as error:
        reason = ascii(getattr(error, "strerror", None) or str(error))
        print(f"FILE must be readable. Received {name!a}: {reason}. Check the path.", file=sys.stderr)
        return 2
    print(f"{ascii(name)[1:-1]}: {result.verdict}", *result.statement, sep="\n    ")
    return 0 if result.verdict == "proved" else 1


def main(arguments: list[str]) -> int:
    """Check every file named on the command line."""
    options = [argument for argument in arguments if argument.startswith("-")]
    if options or not arguments:
        print(f"Arguments must be files. Received {options}. Use: python check.py FILE...", file=sys.stderr)
        return 2
    return max([report(name) for name in arguments])


if __name__ == "__main__":
    try:
        if sys.stdout is None:
            raise OSError("standard output is closed")
        code = main(sys.argv[1:])
        sys.stdout.flush()
    except BrokenPipeError:  # the output is closed: the verdict was not printed
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    except OSError as error:  # the verdict was not printed either
        print(f"The verdict must be written. Received: {error}. Redirect it.", file=sys.stderr)
        os._exit(2)
    sys.exit(code)
