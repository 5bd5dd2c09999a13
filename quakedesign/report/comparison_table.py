"""Comparisons as JSON, as figures, and in notebooks."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.laws import Controller
from quakedesign.loop.loop_setup import IDEAL, LoopSetup, Quantity
from quakedesign.report.figures import figures
from quakedesign.report.page import table_html
from quakedesign.report.sentences import brief, headline, remarks
from quakedesign.studies.comparison import AS_IN_THE_PAPER, Compared, compared, designs_of
from quakedesign.synthesis import Design, assess
from quakedesign.text import Progress, silent

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Comparison(Compared):
    """Runs of one fault without control and with published and designed controllers; see `Compared`."""

    def to_dict(self) -> Json:
        """Keys of ``design --json``, see docs/reference/json.md."""
        by_origin = {
            o: {e.design.name: e.to_dict() | {"headline": headline(e), "remarks": remarks(e)} for e in self.of(o)}
            for o in ("designed", "published")
        }
        run = self.uncontrolled
        return {
            "controllers": by_origin["designed"],
            "published": by_origin["published"],
            "uncontrolled": {
                "outcome": run.outcome.to_dict(),
                "metrics": run.metrics.to_dict(),
                "events": dict(run.events),
                "run": dict(run.provenance),
                "cycle": run.cycle,
            },
            "not_applicable": self.left_out,
        }

    def figures(self) -> "dict[str, Figure]":
        """Matplotlib figures by name."""
        return figures(self)

    def __repr__(self) -> str:
        return "\n".join((f"Comparison on {self.fault.name}:", *(f"  {e.label}: {brief(e)}" for e in self.entries)))

    def _repr_html_(self) -> str:
        return table_html(self)


def compare(
    fault: Fault,
    designs: Sequence[Design | Controller] = (),
    *,
    setup: LoopSetup = IDEAL,
    with_published: bool = True,
    scheme: str | None = None,
    published_scheme: str | None = None,
    whole_task: bool = False,
    plant: str | None = None,
    progress: Progress | None = None,
    **entered: Quantity | None,
) -> Comparison:
    """Run all controllers of a fault at its T_s, for the whole task, or for 500 D_c/V if friction has a state.

    Parameters
    ----------
    fault : Fault
    designs : sequence of Design, Controller or SampledLaw
        Designs, and given laws, which are first assessed; a design without a controller is reported but not run.
    setup : LoopSetup
        Loop setup of the given laws; a design has its own.
    with_published : bool
        Add the paper's gains for the fault, if any, with their verdicts and premises; not with designs that have a
        delay, a lag or a diffusion path, for which those gains are not designed.
    scheme, published_scheme : str
        Schemes of the runs of designed and published gains in continuous time, see `quakedesign.loop.schemes`; by
        default ``continuous``, as in the paper. Labels distinguish schemes that differ. All other laws run in the
        scheme for which they are designed.
    whole_task : bool
        Run the whole task for friction with a state, however slow.
    plant : str, optional
        Plant of the runs for friction without a state: ``stick-slip`` (default) or ``printed``, as in `simulate`.
    progress : callable, optional
        Called with the current activity and the fraction done [-].
    **entered : str, float or Fraction
        Fields of `LoopSetup` that replace those of `setup`, such as ``delay="20 ms"``.

    Returns
    -------
    Comparison

    Raises
    ------
    ParameterError
        For a loop setup without a given law.
    """
    setup, laws = setup.with_given(**entered), [one for one in designs if not isinstance(one, Design)]
    if setup != IDEAL and not laws:
        raise ParameterError(
            f"a loop setup of a comparison needs given laws. Received {setup!r} without any. Give the setup to design."
        )
    progress = progress or (silent)
    how: dict[str, Any] = {
        "with_published": with_published and not any(getattr(one, "setup", setup).path for one in designs),
        "whole_task": whole_task,
        "schemes": _schemes(scheme, published_scheme),
        "plant": plant,
    }
    made: Any = ((one, False) if isinstance(one, Design) else (assess(fault, one, setup), True) for one in designs)
    return Comparison(**vars(compared(fault, made, progress, **how)))


def designed_comparison(
    fault: Fault,
    names: Iterable[str],
    progress: Progress,
    *,
    options: Mapping[str, Any] | None = None,
    whole_task: bool = False,
    plant: str | None = None,
    **schemes: Any,
) -> Comparison:
    """Design the named laws for a fault, and compare them with the published gains.

    Parameters
    ----------
    fault : Fault
    names : iterable of str
        Names of control laws.
    progress : callable
        Called with the current activity and the fraction done [-].
    options : mapping, optional
        Options of `quakedesign.design`, such as ``objective`` and ``continuous``.
    whole_task, plant : bool, str
        As in `compare`; the plant also as in `quakedesign.design`.
    **schemes
        ``scheme`` and ``published_scheme`` of `compare`.
    """
    options_of_all = {**(options or {}), "plant": plant}
    made = ((one, False) for one in designs_of(fault, names, progress, options_of_all))
    how: dict[str, Any] = {"whole_task": whole_task, "plant": plant, "schemes": _schemes(**schemes)}
    how["with_published"] = not options_of_all.get("setup", IDEAL).path
    return Comparison(**vars(compared(fault, made, progress, **how)))


def _schemes(scheme: str | None = None, published_scheme: str | None = None) -> dict[str, str]:
    """Scheme by origin of the gains."""
    return {"designed": scheme or AS_IN_THE_PAPER, "published": published_scheme or AS_IN_THE_PAPER}
