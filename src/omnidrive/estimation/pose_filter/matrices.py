"""Compiled products and the inverse of small matrices.

Explicit loops compile faster than calls of the linear-algebra library.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled


@compiled
def product(
    a: Float[Array, "rows n"], b: Float[Array, "n columns"]
) -> Float[Array, "rows columns"]:
    """Return the matrix product ``a b``."""
    rows, inner, columns = a.shape[0], a.shape[1], b.shape[1]
    result = np.zeros((rows, columns))
    for i in range(rows):
        for k in range(inner):
            if a[i, k] != 0.0:
                for j in range(columns):
                    result[i, j] += a[i, k] * b[k, j]
    return result


@compiled
def congruence(a: Float[Array, "rows n"], p: Float[Array, "n n"]) -> Float[Array, "rows rows"]:
    """Return ``a p a^T`` for a symmetric p; the result is symmetric without rounding errors.

    Both products skip the zeros of ``a``, most of a transition between blocks of the state.
    """
    result = product(a, product(a, p).T)
    for i in range(len(result)):
        for j in range(i):
            result[j, i] = result[i, j]
    return result


@compiled
def correct_covariance(
    p: Float[Array, "n n"], observation: Float[Array, " n"], gain: Float[Array, " n"], noise: float
) -> None:
    """Correct a covariance in place with one measurement of variance ``noise``.

    Joseph's form, ``(I - gain observation) p (I - gain observation)^T + noise gain gain^T``, keeps
    it positive semidefinite (Bar-Shalom, Li & Kirubarajan, 2001, eq. 5.2.3-18). Both products are
    changes of rank one.
    """
    n = len(p)
    row, column = np.zeros(n), np.zeros(n)
    for j in range(n):
        if observation[j] != 0.0:
            for i in range(n):
                row[i] += observation[j] * p[j, i]
    for i in range(n):
        for j in range(n):
            p[i, j] -= gain[i] * row[j]
    for j in range(n):
        if observation[j] != 0.0:
            for i in range(n):
                column[i] += observation[j] * p[i, j]
    for i in range(n):
        change = noise * gain[i] - column[i]
        for j in range(i + 1):
            p[i, j] += change * gain[j]
    for i in range(n):
        for j in range(i):
            p[j, i] = p[i, j]


@compiled
def inverse(m: Float[Array, "3 3"]) -> tuple[Float[Array, "3 3"], float]:
    """Return the inverse of a matrix by cofactors, and its determinant."""
    result = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            result[j, i] = m[a, c] * m[b, d] - m[a, d] * m[b, c]
    determinant = m[0, 0] * result[0, 0] + m[0, 1] * result[1, 0] + m[0, 2] * result[2, 0]
    for i in range(3):
        for j in range(3):
            result[i, j] /= determinant
    return result, determinant
