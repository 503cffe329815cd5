"""Rotations as matrices of expressions, from ``linalg.components``; they can be differentiated also at angle 0."""

from __future__ import annotations

from typing import Any

import casadi as ca

from mbsvib.linalg import components as c

Expression = Any


def matrix(rows: c.Rotation) -> Expression:
    """Return a rotation of components as a matrix (3, 3)."""
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def entries(vector: Expression) -> c.Triple:
    """Return the components of a vector (3,)."""
    x, y, z = ca.vertsplit(vector)
    return x, y, z


def rows_of(matrix: Expression) -> c.Rotation:
    """Return the components of a matrix (3, 3), row by row."""
    x, y, z = ca.vertsplit(matrix)
    return entries(x.T), entries(y.T), entries(z.T)


def axial(matrix: Expression) -> Expression:
    """Return the vector w (3,) whose [w]x is the antisymmetric part of a matrix (3, 3)."""
    return ca.vertcat(*c.axial(rows_of(matrix)))


def exponential(w: Expression) -> Expression:
    """Return the rotation matrix (3, 3) of a rotation vector (3,) [rad]."""
    return matrix(c.exponential(entries(w)))


def logarithm(rotation: Expression) -> Expression:
    """Return the rotation vector (3,) [rad] of a rotation matrix (3, 3), less than half a turn long."""
    return ca.vertcat(*c.rotation_vector(rows_of(rotation)))
