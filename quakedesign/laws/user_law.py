"""User-defined sampled linear laws: from matrices, gains or a PID, and from untrusted files.

Chapters: the law; an integrator perturbed by rounding; files.
"""

import io
import json
import re
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, ScenarioError, require_known
from quakedesign.exact import rational, shortly
from quakedesign.fault.units import exact_value
from quakedesign.files import Json, read_bytes, write_whole
from quakedesign.laws.sampled_controller import SampledController
from quakedesign.laws.sampled_law import MOST_STATES, LinearLaw, Matrix, Row, steady_states

# ----------------------------------------------------------------------
# The law.

SIGNALS = ("slip_error", "slip_rate_error", "slip", "slip_rate", "reference", "reference_rate")
"""Signals that a law may measure: x1 − r, x2 − r′, x1, x2, r and r′ [m, m/s]."""
OUTPUT = "pressure"
_PLACES: dict[str, tuple[int | None, int | None]] = {
    "slip_error": (0, None),
    "slip_rate_error": (1, None),
    "slip": (0, 0),
    "slip_rate": (1, 1),
}
_PLACES |= {"reference": (None, 0), "reference_rate": (None, 1)}


@checked_dataclass(frozen=True, kw_only=True)
class SampledLaw(SampledController):
    """A user-defined sampled linear law: p = Cz + Dy and z⁺ = Az + By every T_s, matrices rational, z = 0 initially.

    Built by `from_statespace`, `from_gains`, `from_pid` or `load`; accepted by `guarantee`, `simulate`,
    `loop_transfer`, `compare`, `campaign_problem` and `export_controller`.

    Attributes
    ----------
    gains : mapping of str to Fraction
        Derived from the law: p = −k1·e1 − k2·e2 − Σ gain·state.
    law : LinearLaw
    step : Fraction
        T_s [s].
    delay, lag, diffusion, longest : Fraction
        Path between law and fault, and longest sampling interval, in runs; see `Sampling` [s].
    rest_limit : RestLimit, optional
        None: the law does not receive the pressure applied at a limit.
    label : str
        Name for display.
    notes : tuple of str
        Changes made by the conversion of floats to exact numbers.
    """

    name: ClassVar[str] = "user-law"
    title: ClassVar[str] = "user-defined law"
    source: ClassVar[str] = "quakedesign.laws.user_law"

    label: str = "user-defined law"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "title", self.label)  # replaces that of the class, as instances differ
        object.__setattr__(self, "name", re.sub(r"[^A-Za-z0-9_-]+", "-", self.label).strip("-") or type(self).name)

    @classmethod
    def from_statespace(
        cls, system: Any, *, inputs: Sequence[str] = (), output: str = OUTPUT, label: str = "user-defined law"
    ) -> Self:
        """Law of a discrete-time system of python-control, or of any object with A, B, C, D and dt.

        Parameters
        ----------
        system : control.StateSpace or control.TransferFunction
            Its single output is the pressure p [Pa]. Give −K for a law K that was designed for p = −Ky.
        inputs : sequence of str
            Signals in the order of its inputs: slip_error, slip_rate_error, slip, slip_rate, reference or
            reference_rate [m, m/s].
        output : str
            ``"pressure"``.

        Raises
        ------
        ParameterError
            For continuous time, wrong sizes, more than 12 states, absent or unknown signals, or non-finite numbers.
        """
        if hasattr(system, "num") and not hasattr(system, "A"):
            import control

            system = control.ss(system)
        parts = [getattr(system, name, None) for name in "ABCD"]
        if any(part is None for part in parts):
            raise ParameterError(
                f"a system must have the matrices A, B, C, D and a dt. Received {type(system).__name__}. "
                "Use control.ss(A, B, C, D, dt)."
            )
        step = getattr(system, "dt", None)
        if step is None or isinstance(step, bool | np.bool_) or not step:
            raise ParameterError(
                f"a law must be in discrete time, with its sampling time as dt [s]. Received dt = {step!r}. "
                "Use control.sample_system(system, T_s), or control.ss(A, B, C, D, T_s)."
            )
        if not inputs:
            raise ParameterError(
                "inputs of a law must be named in the order of its columns. Received none. Give some of "
                f'{", ".join(SIGNALS)}, such as inputs=["slip_error", "slip_rate_error"].'
            )
        return cls._of_matrices(parts, rational(step, "dt"), tuple(inputs), output, label)

    @classmethod
    def from_gains(
        cls,
        gains: Any,
        *,
        step: str | float | Fraction,
        inputs: Sequence[str] = ("slip_error", "slip_rate_error"),
        label: str = "state feedback",
    ) -> Self:
        """p = −k1·e1 − k2·e2 − k3·ξ1 − k4·ξ2 with ξ1⁺ = ξ1 + T_s·e1 and ξ2⁺ = ξ2 + T_s·ξ1.

        Parameters
        ----------
        gains : sequence or array
            One to four gains [Pa/m, Pa·s/m, Pa/(m s), Pa/(m s²)]: P, PD, PID, double integral; (k1, 0, k3) is a PI. The
            K of ``control.dlqr`` for these states (u = −Kx) can be given unchanged.
        step : str, float or Fraction
            T_s, [s] or with a unit, positive.
        inputs : (str, str)
            Signals of k1 and k2: slip_error or slip, slip_rate_error or slip_rate. Integrals are those of the error.
        """
        values = [rational(v, f"k{i}") for i, v in enumerate(np.asarray(gains, dtype=object).ravel().tolist(), 1)]
        if not 1 <= len(values) <= 4:
            raise ParameterError(
                f"gains of a law must be one to four numbers, k1 to k4. Received {len(values)}. "
                "Use SampledLaw.from_statespace for other laws."
            )
        errors = (("slip_error", "slip"), ("slip_rate_error", "slip_rate"))
        if len(inputs) != 2 or any(name not in pair for name, pair in zip(inputs, errors, strict=True)):
            raise ParameterError(
                "inputs of gains must be slip_error or slip, then slip_rate_error or slip_rate. "
                f"Received {', '.join(map(str, inputs))}."
            )
        time = _step(step)
        k1, k2, *rest = [*values, *[Fraction(0)] * (2 - len(values))]
        rest = rest if any(rest) else []
        one, size = Fraction(1), len(rest)
        update = [[one * (i == j) + time * (i == j + 1) for j in range(size)] for i in range(size)]
        seen = [[time * (i == 0), Fraction(0), Fraction(0)] for i in range(size)]
        names = ["slip_error", *inputs]
        return cls._of_matrices((update, seen, [[-k for k in rest]], [[0, -k1, -k2]]), time, names, OUTPUT, label)

    @classmethod
    def from_pid(
        cls,
        kp: str | float | Fraction,
        ki: str | float | Fraction = 0,
        kd: str | float | Fraction = 0,
        N: str | float | Fraction = 100,
        *,
        step: str | float | Fraction,
        label: str = "PID",
    ) -> Self:
        """PID of the slip error alone: p = −(kp·e + ki·Σ T_s·e + kd·D), the derivative filtered.

        Parameters
        ----------
        kp, ki, kd : str, float or Fraction
            [Pa/m], [Pa/(m s)], [Pa·s/m].
        N : str, float or Fraction
            Bandwidth [1/s], positive, of the filtered derivative D = s·N/(s + N)·e, by backward differences.
        step : str, float or Fraction
            T_s, [s] or with a unit.
        """
        named = zip(("kp", "ki", "kd", "N"), (kp, ki, kd, N), strict=True)
        p, i, d, rate = (rational(v, name) for name, v in named)
        time = _step(step)
        if rate <= 0:
            raise ParameterError(f"N of a PID must be positive. Received {shortly(rate)} 1/s.")
        share, zero, one = 1 / (1 + rate * time), Fraction(0), Fraction(1)
        states = [  # rows of A, entries of B and C: the sum of T_s·e, and the filter state w with D = N(e − w⁺)
            ([one, zero], time, -i),
            ([zero, share], 1 - share, d * rate * share),
        ]
        used = [place for place, k in enumerate((i, d)) if k]
        update = [[states[a][0][b] for b in used] for a in used]
        output = [[states[a][2] for a in used]]
        feed = -p - d * rate * share
        seen = [[states[a][1]] for a in used]
        return cls._of_matrices((update, seen, output, [[feed]]), time, ("slip_error",), OUTPUT, label)

    @classmethod
    def _of_matrices(cls, parts: Sequence[Any], step: Fraction, inputs: Sequence[str], output: str, label: str) -> Self:
        require_known(output, (OUTPUT,), "output of a law")
        for name in inputs:
            require_known(name, SIGNALS, "input of a law")
        A, B, C, D = (exact_matrix(part, name) for name, part in zip("ABCD", parts, strict=True))
        size = len(A)
        if size > MOST_STATES:
            raise ParameterError(
                f"a law must have at most {MOST_STATES} states. Received {size}. Reduce it, with control.minreal, say."
            )
        _require_shapes(
            {"A": (A, size, size), "B": (B, size, len(inputs)), "C": (C, 1, size), "D": (D, 1, len(inputs))}
        )
        A, notes = integrating(A, C[0] if C else ())
        zero, of_errors, of_reference = Fraction(0), [], []
        for row in (*B, D[0]):
            errors, moved = [zero, zero], [zero, zero]
            for name, v in zip(inputs, row, strict=True):
                error, of_reference_input = _PLACES[name]
                if error is not None:
                    errors[error] += v
                if of_reference_input is not None:
                    moved[of_reference_input] += v
            of_errors.append(tuple(errors))
            of_reference.append(tuple(moved))
        law = LinearLaw(
            states=tuple(f"z{i + 1}" for i in range(size)),
            update=A,
            measured=tuple(of_errors[:-1]),
            output=C[0] if C else (),
            feedback=of_errors[-1],
            of_reference=tuple(of_reference) if any(map(any, of_reference)) else (),
        )
        return cls(law=law, step=step, label=label, notes=notes)

    # ------------------------------------------------------------------
    # Files.

    def to_dict(self) -> Json:
        """Content of a file of the law: exact numbers as strings, SI."""
        law, inputs = self.law, ["slip_error", "slip_rate_error"]
        rows = [*law.measured, law.feedback]
        if law.of_reference:
            rows = [(*a, *b) for a, b in zip(rows, law.of_reference, strict=True)]
            inputs += ["reference", "reference_rate"]
        return {
            "label": self.label,
            "step": str(self.step),
            "inputs": inputs,
            "output": OUTPUT,
            "A": [list(map(str, row)) for row in law.update],
            "B": [list(map(str, row)) for row in rows[:-1]],
            "C": [list(map(str, law.output))],
            "D": [list(map(str, rows[-1]))],
        }

    def save(self, path: str | Path) -> None:
        """Write the law as a JSON file: whole, or not at all."""
        write_whole(Path(path), json.dumps(self.to_dict(), indent=1) + "\n")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a law from a ``.json`` or ``.npz`` file; no code of the file is run.

        The keys are those of `to_dict`, with numbers or texts (``"184 ms"``). In place of the matrices a file may have
        ``gains`` or ``pid`` (kp, ki, kd, N); ``step`` is always required. ``dt`` may stand for ``step``.

        Raises
        ------
        ScenarioError
            When the file cannot be read, or lacks a key or has others.
        ParameterError
            For a law that cannot be built.
        """
        content = read_bytes(path, "law", largest=_LARGEST, refusal=ScenarioError)
        entries = _of_npz(content, path) if str(path).endswith(".npz") else _of_json(content, path)
        step = entries.pop("step", entries.pop("dt", None))
        label = str(entries.pop("label", Path(path).stem))[:60]
        if step is None:
            raise ScenarioError(f"law {path} must have the key step, its sampling time [s]. Received none.")
        if "pid" in entries:
            pid = dict(entries.pop("pid")) if isinstance(entries["pid"], dict) else {}
            named = {name: pid.pop(name) for name in ("kp", "ki", "kd", "N") if name in pid}
            if pid or entries or "kp" not in named:
                raise ScenarioError(
                    f"pid of law {path} must have the key kp and may have ki, kd and N; the file may have only step, "
                    'pid and label. Write {"step": "50 ms", "pid": {"kp": 4e8, "ki": 1e8, "kd": 3e8, "N": 50}}.'
                )
            return cls.from_pid(**named, step=step, label=label)
        if set(entries) in ({"gains"}, {"gains", "inputs"}):
            return cls.from_gains(**entries, step=step, label=label)
        if set(entries) - {"output"} != {"A", "B", "C", "D", "inputs"}:
            keys = ", ".join(sorted(map(str, entries)))[:100] or "none"
            raise ScenarioError(
                f"law {path} must have the key step and, besides label, either A, B, C, D and inputs, or gains, or "
                f"pid. Received besides step: {keys}. Omit keys of other names."
            )
        parts, inputs = [entries[name] for name in "ABCD"], entries["inputs"]
        if not isinstance(inputs, list) or not all(isinstance(name, str) for name in inputs):
            raise ScenarioError(f"inputs of law {path} must be a list of names.")
        return cls._of_matrices(parts, _step(step), inputs, str(entries.get("output", OUTPUT)), label)


def _step(value: Any) -> Fraction:
    if not isinstance(value, str | float | int | Fraction) or isinstance(value, bool):
        raise ParameterError(f"step of a law must be a number [s] or a string with a unit. Received {value!r:.60}.")
    step = exact_value(value, "s", "step")
    if step <= 0:
        raise ParameterError(f"step of a law must be positive. Received {shortly(step)} s.")
    return step


def exact_matrix(part: Any, name: str) -> Matrix:
    """Matrix as rows of rationals."""
    rows = part.tolist() if hasattr(part, "tolist") else part
    if not isinstance(rows, list | tuple) or not all(isinstance(row, list | tuple) for row in rows):
        raise ParameterError(f"matrix {name} of a law must be a list of rows. Received {rows!r:.60}.")
    return tuple(tuple(rational(v, f"an entry of {name}") for v in row) for row in rows)


def _require_shapes(shapes: Mapping[str, tuple[Matrix, int, int]]) -> None:
    for name, (matrix, height, width) in shapes.items():
        if [len(row) for row in matrix] != [width] * height and not (height * width == 0 and not any(matrix)):
            sizes = sorted({len(row) for row in matrix})
            raise ParameterError(
                f"matrix {name} of a law must be {height} x {width}, as A has {shapes['A'][1]} rows and inputs "
                f"{shapes['B'][2]} names. Received {len(matrix)} rows of {', '.join(map(str, sizes)) or 'no'} entries."
            )


# ----------------------------------------------------------------------
# An integrator perturbed by rounding. A guarantee needs z with Az = z and Cz = 1, exactly: the law can then command any
# constant pressure with zero errors. If no such z exists, but A has a pole within 1e-6 of 1, let v and q be its right
# and left eigenvectors with Cv = 1 and qv = 1. Then A′ = A − (Av − v)q has A′v = v exactly, and differs from A by
# rounding alone.

_NEAR = 1e-6
_DEPENDENT = 1e-6


def integrating(A: Matrix, C: Row) -> tuple[Matrix, tuple[str, ...]]:
    """Matrix A with an exact integrator in place of one perturbed by rounding, and a note of the change."""
    size = len(A)
    with suppress(ParameterError):
        still = tuple(tuple(v - (i == j) for j, v in enumerate(row)) for i, row in enumerate(A))
        steady_states(still, C, (Fraction(0),) * size, Fraction(1))
        return A, ()
    if not size:
        return A, ()
    table = np.array([[float(v) for v in row] for row in A])
    poles, vectors = np.linalg.eig(table)
    place = int(np.argmin(np.abs(poles - 1)))
    if abs(poles[place] - 1) > _NEAR:
        return A, ()
    v, response = vectors[:, place].real, np.array([float(c) for c in C])
    if abs(response @ v) <= 1e-12 * (np.abs(response) @ np.abs(v)):
        return A, ()
    v = v / (response @ v)
    left_poles, rows = np.linalg.eig(table.T)
    q = rows[:, int(np.argmin(np.abs(left_poles - 1)))].real
    strongest = int(np.argmax(np.abs(q * v)))
    if abs(q @ v) <= _DEPENDENT * (np.abs(q) @ np.abs(v)):
        q = np.eye(size)[strongest]
    q = q / (q @ v)
    exact = [rational(float(f"{x:.15g}")) for x in v]
    j = max((i for i in range(size) if C[i]), key=lambda i: abs(C[i] * exact[i]))
    exact[j] = (1 - sum((c * x for i, (c, x) in enumerate(zip(C, exact, strict=True)) if i != j), Fraction(0))) / C[j]
    share = [rational(float(f"{x:.4g}")) for x in q]
    others = sum((a * b for i, (a, b) in enumerate(zip(share, exact, strict=True)) if i != strongest), Fraction(0))
    share[strongest] = (1 - others) / exact[strongest]
    off = [sum((a * x for a, x in zip(row, exact, strict=True)), -x) for row, x in zip(A, exact, strict=True)]
    changed = tuple(tuple(a - d * s for a, s in zip(row, share, strict=True)) for row, d in zip(A, off, strict=True))
    moved = max(abs(d * s) for d in off for s in share)
    pole = f"{poles[place].real:.12g}"
    return changed, (
        f"the pole at {pole} is taken for an integrator perturbed by rounding, and is set to exactly 1: entries of A "
        f"change by at most {float(moved):.1g}",
    )


# ----------------------------------------------------------------------
# Files, which may be untrusted.

_LARGEST = 1 << 20


def _of_json(content: bytes, path: str | Path) -> Json:
    try:
        entries = json.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise ScenarioError(f"law {path} must be JSON. Received text that is not ({str(error)[:80]}).") from None
    if not isinstance(entries, dict):
        raise ScenarioError(f"law {path} must be an object with keys. Received {type(entries).__name__}.")
    return entries


def _of_npz(content: bytes, path: str | Path) -> Json:
    """Arrays of a file as lists; rejects pickles, and arrays above the size limit of files."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as folder:
            if sum(entry.file_size for entry in folder.infolist()) > _LARGEST:
                raise ValueError(f"more than {_LARGEST} bytes unpacked")
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return {name: arrays[name].tolist() for name in arrays.files}
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, NotImplementedError) as error:
        raise ScenarioError(
            f"law {path} must be a .npz file without pickles. Received an unreadable file ({str(error)[:80]})."
        ) from None
