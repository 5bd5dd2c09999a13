"""Options that several commands share, each told once."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from cyclopts import Parameter

from quakedesign.cli.shared import print_json, print_lines


def _fault_name(_type: Any, tokens: Sequence[Any]) -> str:
    """Name of a fault, refused before anything else is loaded if there is none."""
    from quakedesign.fault.sources import require_source

    return require_source(tokens[0].value)


FaultName = Annotated[
    str, Parameter(help="Preset (real-fault, lab-fault) or path of a .toml file.", converter=_fault_name)
]
Box = Annotated[str | None, Parameter(help="Uncertainty box: paper or ten-percent.")]
Force = Annotated[bool, Parameter(negative="", help="Replace what an earlier run has written.")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Output:
    """How an answer is printed.

    Parameters
    ----------
    json
        Print JSON, in SI units.
    """

    json: Annotated[bool, Parameter(negative="")] = False

    def show(self, facts: dict[str, Any], said: Iterable[str] | Callable[[], object]) -> None:
        """Print facts as JSON, or else what is said for people: lines, or a call that prints them."""
        if self.json:
            print_json(facts)
        elif callable(said):
            said()
        else:
            print_lines(said)


PLAIN = Output()
