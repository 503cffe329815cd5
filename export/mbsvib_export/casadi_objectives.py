"""Eigenvalues and frequency responses as functions of CasADi, with the toolbox's own derivatives: callbacks for design.

CasADi cannot look into an eigensolver, but asks a callback for its Jacobian. So every parameter may be an unknown, not
those alone that enter affinely: positions and orientations too. There are no second derivatives: tell IPOPT so,
``{"ipopt": {"hessian_approximation": "limited-memory"}}``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.api.system import System
from mbsvib.common.casadi_function import casadi_function
from mbsvib.equilibrium.at_equilibrium import at_equilibrium
from mbsvib.errors import ExportError, MbsvibError
from mbsvib_export.affine import origin_of
from mbsvib_export.casadi_ import INSTALL
from mbsvib_export.neutral import only_port, refusal
from mbsvib_export.packages import need

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex

    Ask = Callable[[System], Complex]


def to_casadi_eigenvalues(system: System, parameters: str | Sequence[str]) -> Any:
    """Return the eigenvalues of a system as a function of CasADi: p -> (real, imag).

    Derivatives are those of ``system.eigenvalue_sensitivities``. Eigenvalues stand in the order of
    ``modes().eigenvalues``, by size: where two change places, so do two entries.

    Parameters
    ----------
    system : System
        The equations of motion, as ``model.linearize()`` returned them.
    parameters : str or sequence of str
        Names or patterns (``"leg*.k.stiffness"``) of any parameters of the model, the entries of p.

    Returns
    -------
    casadi.Callback
        p (parameters,) to real and imaginary parts [1/s], (eigenvalues,) each; ``parameters`` are the names of p,
        ``values`` the model's own. Keep it as long as expressions of it are used. Not a number where the parameters
        give no system of as many eigenvalues.

    Raises
    ------
    ExportError
        If CasADi is not installed, or the system is not one that a model gave.
    ModelError
        If a parameter is unknown, or the system has forces whose derivatives are not supported.
    """
    names = _names(system, parameters, "to_casadi_eigenvalues")
    if not system.dof:
        raise ExportError(f"to_casadi_eigenvalues: '{system.name}' has no degree of freedom, and no eigenvalues.")
    return _callback(
        "eigenvalues", system, names, lambda variant: variant.modes().eigenvalues,
        lambda variant: variant.eigenvalue_sensitivities(names).T,
    )  # fmt: skip


def to_casadi_response(
    system: System, omega: ArrayLike, parameters: str | Sequence[str], output: str | None = None,
    input: str | None = None,
) -> Any:  # fmt: skip
    """Return the frequency response from one input to one output as a function of CasADi: p -> (real, imag).

    Derivatives are those of ``system.frequency_response_sensitivities``.

    Parameters
    ----------
    system : System
        The equations of motion, as ``model.linearize()`` returned them.
    omega : array-like, shape (n,)
        Angular frequencies [rad/s].
    parameters : str or sequence of str
        Names or patterns (``"leg*.k.stiffness"``) of any parameters of the model, the entries of p.
    output, input : str, optional
        Names; may be left out where there is one.

    Returns
    -------
    casadi.Callback
        p (parameters,) to real and imaginary parts, (n,) each; as of ``to_casadi_eigenvalues``.

    Raises
    ------
    ExportError
        If CasADi is not installed, the system is not one that a model gave, or has several inputs and none is named.
    ModelError
        If a parameter is unknown, or the system has forces or ports whose derivatives are not supported.
    ResponseError
        If a frequency is not finite, or a port is unknown.
    """
    names = _names(system, parameters, "to_casadi_response")
    output_name, input_name = (only_port(system, name, kind, "to_casadi_response")
                               for name, kind in ((output, "output"), (input, "input")))  # fmt: skip
    row, column = system.outputs.index(output_name), system.inputs.index(input_name)
    w = np.atleast_1d(np.asarray(omega, dtype=float))

    def response(variant: System) -> Complex:
        result: Complex = variant.frequency_response(w)[row, column]
        return result

    def derivatives(variant: System) -> Complex:
        return variant.frequency_response_sensitivities(w, names, output_name, input_name)[:, 0, 0, :].T

    return _callback("response", system, names, response, derivatives)


def _names(system: System, parameters: str | Sequence[str], caller: str) -> tuple[str, ...]:
    need("casadi", caller, INSTALL)
    if not isinstance(system, System):
        raise refusal(system, caller, "a System (model.linearize())")
    known = origin_of(system, caller).parameters
    patterns = (parameters,) if isinstance(parameters, str) else tuple(parameters)
    return tuple(dict.fromkeys(name for pattern in patterns for name in known.matching(pattern)))


def _callback(name: str, system: System, names: tuple[str, ...], value: Ask, derivatives: Ask) -> Any:
    origin = system.provenance.origin
    assert origin is not None
    rows = len(value(system))
    derivatives(system)  # what cannot be differentiated is refused now, and not inside of a solver
    last: dict[bytes, System | None] = {}

    def at(p: Array) -> System | None:
        """The system at p; a solver requests values and derivatives at the same point."""
        key = p.tobytes()
        if key not in last:
            try:
                changed = origin.with_values(dict(zip(names, p.tolist(), strict=True)))
                variant: Any = at_equilibrium(changed, system.coordinates, system.cut_joints, "dense", System)[1]
            except MbsvibError:
                variant = None
            last.clear()
            last[key] = variant
        return last[key]

    def ask(function: Ask, p: Array, shape: tuple[int, ...]) -> list[Array]:
        variant = at(p)
        try:
            result = None if variant is None else function(variant)
        except MbsvibError:
            result = None
        if result is None or result.shape != shape:
            result = np.full(shape, complex(np.nan, np.nan))
        return [np.ascontiguousarray(result.real), np.ascontiguousarray(result.imag)]

    shape = rows, len(names)
    callback = casadi_function(name, shape, ("real", "imag"), lambda p: ask(value, p, (rows,)),
                               lambda p: ask(derivatives, p, shape))  # fmt: skip
    callback.parameters, callback.values = names, np.array([origin.parameters[key] for key in names])
    return callback
