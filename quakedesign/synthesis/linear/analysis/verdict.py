"""Everything that is decided of a given K on a fault, with the files that prove it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from quakedesign.certificates import Certificate, Verdict
from quakedesign.certificates.guarantee import ContinuousPeaks, NoGuarantee
from quakedesign.certificates.guarantee.files import save_guarantee
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.errors import OutputError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.sos import Answer
from quakedesign.synthesis.guaranteed.continuous import certified_peaks
from quakedesign.synthesis.linear.analysis.definite_files import held_files, inverse_optimality_files
from quakedesign.synthesis.linear.analysis.inverse_optimality import inverse_optimality
from quakedesign.synthesis.linear.analysis.printed_theorem import both_tests, printed_row
from quakedesign.synthesis.linear.analysis.robust_stability import Analysis, analysis
from quakedesign.synthesis.linear.design.admissible_weights import smallest_gain
from quakedesign.synthesis.linear.plant.feedback import compare_feedback
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.plant.uncertainty_bounds import uncertainty_bounds
from quakedesign.synthesis.linear.sampled.held import HeldLoop, held_loop


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearVerdict:
    """Verdict on a K.

    Attributes
    ----------
    fault : Fault
    controller : ExtendedLQR
    analysis : Analysis
    facts : mapping
        See `linear_facts`.
    held : HeldLoop
        What is decided when p is held over the sampling period asked for.
    peaks : ContinuousPeaks, NoGuarantee or None
        In continuous time; None when they were not asked for.
    asked : str or None
        Class of the disturbance for which peaks were asked for.
    """

    fault: Fault
    controller: ExtendedLQR
    analysis: Analysis
    facts: Mapping[str, Any]
    held: HeldLoop
    peaks: ContinuousPeaks | NoGuarantee | None
    asked: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain values: exact numbers as texts, measured ones as numbers, SI."""
        return {
            **self.analysis.to_dict(),
            **self.facts,
            "peaks": self.peaks.to_dict() if isinstance(self.peaks, ContinuousPeaks) else None,
        }

    def proofs(self) -> dict[str, Certificate | Answer | ContinuousPeaks]:
        """Every proof that has a file format, by name."""
        by_name: dict[str, Certificate | Answer | ContinuousPeaks] = dict(self.analysis.certificates)
        if isinstance(self.peaks, ContinuousPeaks):
            by_name["peaks"] = self.peaks
        problem, gains = LinearProblem.of(self.fault), tuple(self.controller.gains.values())
        several = {"inverse-optimal": inverse_optimality_files(inverse_optimality(problem, gains))}
        several["held"] = held_files(problem, gains, self.held.runs)
        for name, answers in several.items():
            by_name |= {f"{name}{f'-{n}' if n else ''}": answer for n, answer in enumerate(answers)}
        return by_name

    def save(self, out: Path, *, force: bool = False) -> dict[str, str]:
        """Write every proof: the one of stability to `out`, the others beside it with their names added.

        Returns
        -------
        dict of str to str
            Path of every proof, by name.

        Raises
        ------
        OutputError
            When one of the files exists and `force` is not given, or the folder cannot be written.
        """
        proofs = self.proofs()
        paths = {
            name: out if name == "stability" else out.with_name(f"{out.stem}-{name}{out.suffix}") for name in proofs
        }
        known = [str(path) for path in paths.values() if path.exists()]
        if known and not force:
            raise OutputError(
                f"certificate files must be new. Received {', '.join(known)}, which exist. "
                "Give --force to replace them."
            )
        for name, proof in proofs.items():
            if isinstance(proof, ContinuousPeaks):
                save_guarantee(proof, paths[name])
            else:
                proof.save(paths[name])
        return {name: str(path) for name, path in paths.items()}


def judge(
    fault: Fault, controller: ExtendedLQR, *, step: float | str | None = None, peaks: str | None = None
) -> LinearVerdict:
    """Decide what holds for a given K on a fault over its uncertainty box.

    Parameters
    ----------
    fault : Fault
    controller : ExtendedLQR
    step : number or text, optional
        Sampling period [s]; the fault's without.
    peaks : str, optional
        Class of the disturbance, ``"amplitude"`` or ``"rate"``, for which peaks are certified.

    Raises
    ------
    UnknownNameError
        For an unknown class.
    ParameterError
        For friction with a state, or a period that is not positive.
    """
    fault.require_memoryless("a verdict on gains")
    period = rational(fault.sampling_time if step is None else step, "step")
    bounded = certified_peaks(fault, controller, disturbance_class=peaks) if peaks is not None else None
    held = held_loop(LinearProblem.of(fault), tuple(controller.gains.values()), period)
    return LinearVerdict(
        fault=fault,
        controller=controller,
        facts=linear_facts(fault, controller, held),
        analysis=analysis(fault, controller),
        held=held,
        peaks=bounded,
        asked=peaks,
    )


def linear_facts(fault: Fault, controller: ExtendedLQR, held: HeldLoop) -> dict[str, Any]:
    """Bounds, both tests of Theorem 2, sampled stability and the cost of both kinds of feedback.

    Parameters
    ----------
    fault : Fault
    controller : ExtendedLQR
    held : HeldLoop
        What is decided of the same gains when p is held.

    Returns
    -------
    dict
        Keys ``inverse_optimal`` (whether K is optimal for a Q that covers the uncertainty; None when undecided),
        ``tests``, ``bounds``, ``smallest_gain``, ``held`` and ``feedback``; SI.
    """
    gains, problem = tuple(controller.gains.values()), LinearProblem.of(fault)
    tests = both_tests(problem, gains, printed_row(fault))
    least = smallest_gain(problem)
    decided = {Verdict.PROVED: True, Verdict.REFUTED: False, Verdict.UNDECIDED: None}
    return {
        "inverse_optimal": decided[tests.sound.verdict],
        "tests": tests.to_dict(),
        "bounds": uncertainty_bounds(fault).to_dict(),
        "smallest_gain": {"k1": least.slip, "k2": least.rate},
        "held": held.to_dict(),
        "feedback": [
            {"feedback": c.feedback, "lag": c.lag, "largest_term": c.largest_term, "pressure": c.pressure}
            for c in (compare_feedback(fault, gains) if gains[3] else ())
        ],
    }
