"""Verdict on a given gain K for a fault, with its certificate files.

Definiteness of a matrix is written as a sum of squares (proofs/FORMAT.md).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from quakedesign.errors import OutputError
from quakedesign.exact import rational
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.guarantees import ContinuousProof, NoProof
from quakedesign.guarantees.exact.guarantee_files import save_guarantee
from quakedesign.guarantees.search.linear_design import certified_peaks
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.linear.linear_problem import LinearProblem, Matrix
from quakedesign.linear.riccati import smallest_gain
from quakedesign.linear.riccati_bounds import uncertainty_bounds
from quakedesign.linear.robust_stability import Analysis, analysis
from quakedesign.linear.sampled_stability import SampledStability, VaryingVerdict, sampled_stability
from quakedesign.lyapunov import Certificate
from quakedesign.sos import Answer
from quakedesign.sos.exact.polynomial import constant
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import Square, SumOfSquares

# ----------------------------------------------------------------------
# Definite matrices as files about polynomials (FORMAT.md): a sum of squares on all variables proves definiteness.

_LARGEST = 16


def sampled_files(problem: LinearProblem, gains: Sequence[Fraction], verdict: VaryingVerdict) -> list[Answer]:
    """Every form, in SI, whose definiteness proves stability of the sampled loop; none without a proof."""
    return definite_files(verdict.proof.forms(problem, gains)) if verdict.proof is not None else []


def definite_files(forms: Mapping[str, Matrix]) -> list[Answer]:
    """Results that together prove every matrix positive definite, each form with its own variables.

    Parameters
    ----------
    forms : mapping of str to matrix (n × n)
        The variables of a form are its name with the numbers 1 … n; n at most 16.
    """
    return [_answer(group) for group in _groups(forms)]


def _groups(forms: Mapping[str, Matrix]) -> Iterator[dict[str, Matrix]]:
    """Forms in order, in groups of at most 16 variables."""
    group: dict[str, Matrix] = {}
    for name, matrix in forms.items():
        if group and sum(map(len, group.values())) + len(matrix) > _LARGEST:
            yield group
            group = {}
        group[name] = matrix
    if group:
        yield group


def _answer(group: Mapping[str, Matrix]) -> Answer:
    names = [f"{name}{i + 1}" for name, matrix in group.items() for i in range(len(matrix))]
    units = [tuple(int(i == j) for j in range(len(names))) for i in range(len(names))]
    polynomial: dict[tuple[int, ...], Fraction] = {}
    squares, before = [], 0
    for matrix in group.values():
        size = len(matrix)
        basis = tuple(units[before : before + size])
        for i in range(size):
            for j in range(i, size):
                place = tuple(a + b for a, b in zip(basis[i], basis[j], strict=True))
                polynomial[place] = matrix[i][j] * (1 if i == j else 2)
        gram = tuple(matrix[i][j] for i in range(size) for j in range(i, size))
        squares.append(Square(basis=basis, gram=gram))
        before += size
    statement = Statement(
        variables=tuple(names),
        polynomial={e: c for e, c in polynomial.items() if c},
        degree=2,
        multiplier=constant(len(names)),
    )
    return Answer(statement=statement, proof=SumOfSquares(squares=tuple(squares)))


# ----------------------------------------------------------------------
# All results on a given K for a fault, with their certificate files.


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearVerdict:
    """Verdict on a K."""

    fault: Fault
    controller: ExtendedLQR
    analysis: Analysis
    facts: Json  # See `linear_entries`
    sampled: SampledStability  # Results with zero-order hold over the requested sampling period
    peaks: ContinuousProof | NoProof | None  # In continuous time; None if not requested
    peaks_class: str | None = None  # Class of the disturbance of requested peaks

    def to_dict(self) -> Json:
        """Plain values: exact numbers as strings, floating-point results as numbers, SI."""
        return {
            **self.analysis.to_dict(),
            **self.facts,
            "peaks": self.peaks.to_dict() if isinstance(self.peaks, ContinuousProof) else None,
        }

    def proofs(self) -> dict[str, Certificate | Answer | ContinuousProof]:
        """Every proof that has a file format, by name."""
        by_name: dict[str, Certificate | Answer | ContinuousProof] = dict(self.analysis.certificates)
        if isinstance(self.peaks, ContinuousProof):
            by_name["peaks"] = self.peaks
        problem, gains = LinearProblem.of(self.fault), tuple(self.controller.gains.values())
        sampled = sampled_files(problem, gains, self.sampled.verdict_at_step)
        return by_name | {f"held{f'-{n}' if n else ''}": answer for n, answer in enumerate(sampled)}

    def save(self, out: Path, *, force: bool = False) -> dict[str, str]:
        """Write every proof: that of stability to `out`, the others to the same folder with their names added.

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
        existing = [str(path) for path in paths.values() if path.exists()]
        if existing and not force:
            raise OutputError(
                f"certificate files must be new. Received {', '.join(existing)}, which exist. "
                "Give --force to replace them."
            )
        for name, proof in proofs.items():
            if isinstance(proof, ContinuousProof):
                save_guarantee(proof, paths[name])
            else:
                proof.save(paths[name])
        return {name: str(path) for name, path in paths.items()}


def judge(
    fault: Fault, controller: ExtendedLQR, *, step: float | str | None = None, peaks: str | None = None
) -> LinearVerdict:
    """Decide the properties of a given K on a fault over its uncertainty box.

    Parameters
    ----------
    fault : Fault
    controller : ExtendedLQR
    step : number or text, optional
        Sampling period [s]; by default that of the fault.
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
    sampled = sampled_stability(LinearProblem.of(fault), tuple(controller.gains.values()), period)
    return LinearVerdict(
        fault=fault,
        controller=controller,
        facts=linear_entries(fault, controller, sampled),
        analysis=analysis(fault, controller),
        sampled=sampled,
        peaks=bounded,
        peaks_class=peaks,
    )


def linear_entries(fault: Fault, controller: ExtendedLQR, sampled: SampledStability) -> Json:
    """Bounds of the uncertainty, smallest gains and sampled stability.

    Parameters
    ----------
    sampled : SampledStability
        Results on the same gains with zero-order hold.

    Returns
    -------
    dict
        Keys ``bounds``, ``smallest_gain`` and ``held``; SI.
    """
    least = smallest_gain(LinearProblem.of(fault))
    return {
        "bounds": uncertainty_bounds(fault).to_dict(),
        "smallest_gain": {"k1": least.slip, "k2": least.rate},
        "held": sampled.to_dict(),
    }
