"""Truncation error of modal responses of many bodies, and its static correction.

Well below their frequencies the omitted modes respond statically: their contribution to the displacements is the full
static compliance minus that of the included modes, a constant matrix. If the mechanism has free motions, it is the
compliance about the free motion, under loads that the inertia of the free motion balances.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.modes.general import is_general
from mbsvib.modes.undamped import undamped
from mbsvib.responses.basis import Basis
from mbsvib.responses.frequency_response import frequency_response as dense_response
from mbsvib.sparse.operator import operator
from mbsvib.sparse.reduction import RTOL
from mbsvib.sparse.response import frequency_response, static_compliance

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array
    from mbsvib.sparse.equations import SparseEquations

E = TypeVar("E", bound=Equations)


def corrected(system: SparseEquations, small: E, count: int) -> E:
    """Return the system of the lowest modes with the static displacements of all others in its D.

    D + Cq (K^-1 - sum_i phi_i phi_i^T / omega_i^2) B, the sum over the included modes without free motions; with spin,
    circulatory forces or motions without mass, the static response of the small system replaces the sum

    Refused if free motions are not all among the ``count`` modes, or exist together with spin, circulatory forces or
    motions without mass.
    """
    if is_general(small):
        # G(0) - G_small(0); K is regular, or static_compliance refuses
        full = static_compliance(system) - system.D
        return replace(small, D=small.D + (full - small.Cq @ np.linalg.solve(small.K, small.B)))
    t = operator(system, None, system.dof)
    rigid = t.rigid.shape[1]
    basis = undamped(small, RTOL)
    if t.sigma or basis.rigid < rigid:
        free = f"at least {rigid}" if rigid else "others"
        raise ResponseError(
            f"reduced: static correction of '{system.name}' with {count} modes; free motions have no static part, so "
            f"all of them must be among the modes, and differ from slow ones: ask for more modes ({free}), or for no "
            f"correction."
        )
    force = np.asarray(system.input_rows.toarray().T)
    force = force - t.wt @ t.deflated[:, :rigid] @ (t.rigid.T @ force)
    full = np.asarray(system.output_rows[0] @ t.flexible(t.factor.solve(t.right(force))))
    phi = basis.shapes[:, basis.rigid :]
    modal = (small.Cq @ phi / basis.square[basis.rigid :]) @ (phi.T @ small.B)
    at_once = 0.0 if system.separation is None else system.separation.at_once  # is in ``full`` too
    return replace(small, D=small.D - at_once + (full - modal))


def truncation_error(system: SparseEquations, small: Equations, omega: ArrayLike) -> Array:
    """Return the errors of the responses of a reduced system at ``omega`` (n,) [rad/s], (outputs, inputs, n).

    |G_small - G| / max over omega of |G|, for each output and input; 0 where the response is 0
    """
    if (small.inputs, small.outputs) != (system.inputs, system.outputs):
        raise ResponseError(f"truncation_error: '{small.name}' has the inputs {', '.join(small.inputs)} and outputs "
                            f"{', '.join(small.outputs)}; expected those of '{system.name}', {', '.join(system.inputs)}"
                            f" and {', '.join(system.outputs)}.")  # fmt: skip
    full = frequency_response(system, omega)
    off = np.abs(dense_response(Basis(small), omega) - full)
    size = np.abs(full).max(axis=2, keepdims=True, initial=0.0)
    return np.asarray(off / np.where(size > 0.0, size, 1.0))
