"""A polynomial as arrays of floating point, for its values and derivatives; nothing here decides."""

from typing import Any

import numpy as np

from quakedesign.sos.exact.polynomial import Polynomial


class Arrays:
    """A polynomial as arrays, for values and gradients at many points."""

    def __init__(self, polynomial: Polynomial, variables: int) -> None:
        self.exponents = np.array(list(polynomial), dtype=np.int64).reshape(-1, variables)
        self.coefficients = np.array([float(c) for c in polynomial.values()])
        self._slopes = self.exponents.T * self.coefficients
        self._lower = np.maximum(self.exponents - np.eye(variables, dtype=np.int64)[:, None], 0)

    def __call__(self, x: Any) -> float:
        """Value at a point."""
        return float(self.coefficients @ np.prod(np.asarray(x) ** self.exponents, axis=1))

    def at(self, points: Any) -> Any:
        """Values at points, one a row."""
        return np.prod(points[:, None, :] ** self.exponents[None, :, :], axis=2) @ self.coefficients

    def gradient(self, x: Any) -> Any:
        """Gradient at a point."""
        return (self._slopes * np.prod(np.asarray(x) ** self._lower, axis=2)).sum(axis=1)

    def hessian(self, x: Any) -> Any:
        """Matrix of second derivatives at a point."""
        x, size = np.asarray(x), len(x)
        result = np.zeros((size, size))
        for i in range(size):
            for j in range(i, size):
                factor = self.exponents[:, i] * (self.exponents[:, j] - (i == j)) * self.coefficients
                lower = self.exponents.copy()
                lower[:, i] -= 1
                lower[:, j] -= 1
                result[i, j] = result[j, i] = factor @ np.prod(x[None, :] ** np.maximum(lower, 0), axis=1)
        return result
