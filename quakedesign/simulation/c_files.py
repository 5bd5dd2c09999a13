"""The parts of generated C that never change stand in C files beside this one; their numbers are put in by name."""

from functools import cache
from importlib.resources import files
from string import Template


@cache
def _template(name: str) -> Template:
    return Template(files("quakedesign.simulation").joinpath(name).read_text(encoding="utf-8"))


def c_file(name: str, **numbers: object) -> str:
    """Text of a C file with numbers in the place of ``${…}``."""
    return _template(name).substitute(numbers)
