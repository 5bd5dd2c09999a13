"""The e-LQR's loop as a polytope of exact matrices."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance

from quakedesign.certificates import Loop
from quakedesign.errors import ParameterError
from quakedesign.symbolic.terms import value
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix, floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Polytope:
    """x' = A(t)x with A(t) anywhere in the convex hull of some matrices.

    Attributes
    ----------
    states : tuple of str
    vertices : mapping of str to Matrix
        Exact, by the name of the vertex.
    """

    states: tuple[str, ...]
    vertices: Mapping[str, Matrix]

    def floats(self) -> list[Any]:
        """Vertices as arrays (n × n)."""
        return list(map(floats, self.vertices.values()))

    def slowest(self) -> float:
        """Largest real part of an eigenvalue of a vertex [1/s]; no V decays faster than its negative."""
        return max(float(np.linalg.eigvals(A).real.max()) for A in self.floats())


def polytope_of(loop: Loop) -> Polytope:
    """Polytope of a loop on the reals whose field is linear in the states.

    Raises
    ------
    ParameterError
        For a field that is not linear.
    """
    linear = all(
        len(t.factors) == 1 and t.factors[0][1:] == (Fraction(1), "s") for terms in loop.field.values() for t in terms
    )
    if loop.domain != "reals" or not linear:
        raise ParameterError(f"a polytope needs a linear field. Received the one of {loop.law}.")
    names = tuple(loop.uncertain)
    vertices = {}
    for ends in product(*(sorted(set(loop.uncertain[n])) for n in names)):
        chosen = dict(zip(names, ends, strict=True))
        label = " ".join(f"{n}={v}" for n, v in chosen.items())
        vertices[label] = tuple(_row(loop, state, {**loop.parameters, **chosen}) for state in loop.states)
    return Polytope(states=tuple(loop.states), vertices=vertices)


def _row(loop: Loop, state: str, parameters: Mapping[str, Fraction]) -> tuple[Fraction, ...]:
    entries = dict.fromkeys(loop.states, Fraction(0))
    for term in loop.field[state]:
        entries[term.factors[0][0]] += value(term, parameters)
    return tuple(entries.values())


@dataclass(frozen=True, slots=True)
class ModalScaling:
    """Real coordinates x = T·z in which the mean of a polytope is block diagonal and its input as large as its poles.

    They do not depend on the units of x; time is counted in 1/pace.

    Attributes
    ----------
    transform : ndarray, shape (n, n)
        T.
    inverse : ndarray, shape (n, n)
    poles : ndarray, shape (n,)
        Moduli of the mean's eigenvalues over `pace` [-].
    pace : float
        Largest modulus [rad/s].
    """

    transform: Any
    inverse: Any
    poles: Any
    pace: float

    def matrices(self, polytope: Polytope) -> list[Any]:
        """Vertices in z and scaled time."""
        return [self.inverse @ A @ self.transform / self.pace for A in polytope.floats()]

    def back(self, form: Any) -> Any:
        """Matrix of the quadratic form zᵀFz in x."""
        return self.inverse.T @ form @ self.inverse


def modal_scaling(polytope: Polytope, entries: Sequence[Sequence[float]]) -> ModalScaling:
    """Modal coordinates of the mean of the vertices, balanced so that the modes couple as weakly as they can.

    Parameters
    ----------
    polytope : Polytope
    entries : sequence of sequence of float
        Columns through which the disturbances, or the uncertainty, enter.
    """
    modes, moduli = _modes(np.mean(polytope.floats(), axis=0))
    pace, poles = float(moduli.max()), moduli / moduli.max()
    modes = modes / np.max(np.linalg.norm(np.linalg.solve(modes, np.asarray(entries, dtype=float).T), axis=1))
    inverse = np.linalg.inv(modes)
    coupling = np.max([np.abs(inverse @ A @ modes) for A in polytope.floats()], axis=0) / pace
    roots = np.sqrt(np.maximum(poles, 1e-12))
    _, (factors, _) = matrix_balance(coupling / roots[:, None] / roots[None, :], permute=False, separate=True)
    T = modes * factors
    pushed = np.abs(np.linalg.solve(T, np.asarray(entries, dtype=float).T)) / pace
    T = T * (float((pushed / poles[:, None]).max()) or 1.0)
    return ModalScaling(transform=T, inverse=np.linalg.inv(T), poles=poles, pace=pace)


def _modes(mean: Any) -> tuple[Any, Any]:
    """Real eigenvectors as columns (real and imaginary part of a pair) and the moduli of their eigenvalues."""
    values, vectors = np.linalg.eig(mean)
    columns, moduli = [], []
    for pole, vector in zip(values, vectors.T, strict=True):
        if pole.imag >= 0:
            columns += [vector.real] if pole.imag == 0 else [vector.real, vector.imag]
            moduli += [abs(pole)] * (1 if pole.imag == 0 else 2)
    return np.array(columns).T, np.array(moduli)
