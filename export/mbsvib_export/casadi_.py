"""CasADi: the equations as functions that it differentiates, with parameters as unknowns where they enter affinely; and
eigenvalues and frequency responses with the toolbox's own derivatives: callbacks for design.

CasADi cannot look into an eigensolver, but asks a callback for its Jacobian. So every parameter may be an unknown of
it, not those alone that enter affinely: positions and orientations too. There are no second derivatives: tell IPOPT so,
``{"ipopt": {"hessian_approximation": "limited-memory"}}``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.casadi_function import casadi_function
from mbsvib.common.display import Displayed
from mbsvib.common.expected import angular, kind_of
from mbsvib.common.selection import Names, port_numbers
from mbsvib.equations.matrices import MATRICES
from mbsvib.equilibrium.search import at_equilibrium
from mbsvib.errors import ExportError, MbsvibError, counted
from mbsvib.linalg.balancing import exponents
from mbsvib.linalg.sparse_interpolation import points_of
from mbsvib.responses.state_space import StateSpace
from mbsvib_export.affine import Affine, names_of, origin_of, physical_affine
from mbsvib_export.neutral import Source, only_port, refusal, state_space_of, with_ports
from mbsvib_export.packages import need
from mbsvib_export.sampling import check_step, doubt_step, step_of

if TYPE_CHECKING:
    from mbsvib.api.lpv import LPVSystem

Ask = Callable[[System], Complex]

# Pade approximant of degree 13 and the norm up to which it is right to rounding.
# Source: N. J. Higham, "The scaling and squaring method for the matrix exponential revisited" (2005), table 2.3.
_PADE = (64764752532480000.0, 32382376266240000.0, 7771770303897600.0, 1187353796428800.0, 129060195264000.0,
         10559470521600.0, 670442572800.0, 33522128640.0, 1323241920.0, 40840800.0, 960960.0, 16380.0, 182.0, 1.0)
_NORM = 5.371920351148152
_SPARE = 3  # more squarings than the nominal values need: parameters may make A eight times as large


@dataclass(frozen=True, repr=False, eq=False)
class CasadiModel(Displayed):
    """A system as functions of CasADi, with the names and units of inputs and outputs.

    ``rates``: (x, u, p) -> (xdot, y);  ``step``: (x, u, p) -> (x_next, y), exact over ``dt`` [s] for inputs that are
    held, None without a step;  ``matrices``: p -> (M, C, K, B, Cq, Cv, Ca, D), None without parameters. ``values`` are
    the parameters' own; p is empty where there are none.
    """

    name: str
    rates: Any
    step: Any
    matrices: Any
    dt: float | None
    states: tuple[str, ...]
    state_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    parameters: tuple[str, ...]
    parameter_units: tuple[str, ...]
    values: Array

    def __repr__(self) -> str:
        parts = {"state": self.states, "input": self.inputs, "output": self.outputs, "parameter": self.parameters}
        return f"CasadiModel({self.name!r}: {', '.join(counted(len(part), name) for name, part in parts.items())})"


def to_casadi(
    system: Source | LPVSystem, step: float | None = None, parameters: Names = None, realization: str = "physical", *,
    outputs: Names = None, inputs: Names = None,
) -> CasadiModel:  # fmt: skip
    """Return a system as functions of CasADi, for optimal control, estimation and design.

    xdot = A x + B u,  y = C x + D u;  with parameters M(p) q'' + C(p) q' + K(p) q = B(p) u, solved for q''

    ``model.step.generate("step.c")`` writes a function as C code without CasADi in it.

    Parameters
    ----------
    system : System, ClosedLoop, Controller, StateSpace, control.StateSpace, SystemData or LPVSystem
        The equations of motion, or a state space that is ready. Of an LPVSystem p is the pose, displacements of its
        ``names``.
    step : float, optional
        Step [s] of the exactly discretised equations. With parameters, its matrix exponential is exact as long as they
        make A no more than eight times as large as it is.
    parameters : str or sequence of str, optional
        Names or patterns (``"leg*.k.stiffness"``) of stiffness, damping and mass parameters of a System, which become
        the vector p. States are physical then.
    realization : str
        The states of a System: "physical", "modal" or "balanced".
    outputs, inputs : str or sequence of str, optional
        Names or patterns of those to export; default: all.

    Returns
    -------
    CasadiModel
        Functions (MX) and names; SI units and radians.

    Raises
    ------
    ExportError
        If CasADi is not installed, the step is not a positive number, the equations are not affine in a parameter, or
        an LPVSystem is given with parameters or another realization.
    ModelError
        If a parameter is unknown.
    ResponseError
        If the realization, or the name of an output or input, is unknown.

    Warns
    -----
    AccuracyWarning
        If the step is many periods of all poles.
    """
    casadi = need("casadi", "to_casadi")
    if kind_of(system) == "lpv system":
        return _over_poses(casadi, system, step, (parameters, realization), (outputs, inputs))
    system = with_ports(system, outputs, inputs)
    if parameters is not None:
        return _with_parameters(casadi, system, step, parameters, realization)
    space = state_space_of(system, realization, "to_casadi")
    x, u = casadi.MX.sym("x", len(space.states)), casadi.MX.sym("u", len(space.inputs))
    sampled = None if step is None else step_of(space, step, "to_casadi")[:2]
    if step is not None:
        doubt_step(space, step, "to_casadi")
    rates, y, after = (None if pair is None else _dm(casadi, pair[0]) @ x + _dm(casadi, pair[1]) @ u
                       for pair in ((space.A, space.B), (space.C, space.D), sampled))  # fmt: skip
    return _model(casadi, space, (x, u, casadi.MX.sym("p", 0)), (rates, after, y), step)


def _with_parameters(
    casadi: Any, system: object, step: float | None, parameters: str | Sequence[str], realization: str
) -> CasadiModel:
    form = physical_affine(system, parameters, realization, "to_casadi", "parameters")
    system = form.nominal
    p = casadi.MX.sym("p", len(form.names))
    matrix = {label: _affine_matrix(casadi, form, label, p) for label in MATRICES}
    return _of_matrices(casadi, system, p, matrix, step, (form.names, form.units, form.values))


def _over_poses(
    casadi: Any, lpv: Any, step: float | None, options: tuple[Any, str], ports: tuple[Names, Names]
) -> CasadiModel:
    """The functions of a system whose matrices are polynomials in the pose."""
    if options != (None, "physical"):
        raise ExportError("to_casadi: an LPVSystem has its pose as parameters, and physical states; leave parameters "
                          "and realization out.")  # fmt: skip
    o, i = port_numbers(*ports, (lpv.outputs, lpv.inputs), lpv.name)
    p, indices = casadi.MX.sym("p", len(lpv.names)), lpv.polynomial.indices
    points, products = lpv.scaled(p), casadi.DM.ones(len(indices), 1)
    for k, degrees in enumerate(indices.T):
        basis = [casadi.MX(1.0)]
        t = points_of(np.arange(degrees.max() + 1))
        for j in range(1, len(t)):
            basis.append(casadi.MX(1.0))
            for before in t[:j]:
                basis[j] *= (points[k] - before) / (t[j] - before)
        products *= casadi.vertcat(*basis)[degrees.tolist()]
    values, start, matrix = casadi.DM(lpv.polynomial.surpluses.T) @ products, 0, {}
    for label in MATRICES:
        rows, columns = getattr(lpv.nominal, label).shape
        # entries follow one another along rows
        matrix[label] = casadi.reshape(values[start : start + rows * columns], columns, rows).T
        start += rows * columns
    matrix |= {label: matrix[label][o, :] for label in ("Cq", "Cv", "Ca")}
    matrix |= {"B": matrix["B"][:, i], "D": matrix["D"][o, i]}
    nominal = with_ports(lpv.nominal, *ports)
    return _of_matrices(casadi, nominal, p, matrix, step, (lpv.names, lpv.units, 0.5 * (lpv.low + lpv.high)))


def _of_matrices(
    casadi: Any, system: Any, p: Any, matrix: dict[str, Any], step: float | None,
    parameters: tuple[tuple[str, ...], tuple[str, ...], Array],
) -> CasadiModel:  # fmt: skip
    """The functions of matrices that are expressions of p; ``system`` has the ``parameters``' own values."""
    space, m = system.state_space(), system.dof
    x, u = casadi.MX.sym("x", 2 * m), casadi.MX.sym("u", len(system.inputs))
    solved = casadi.solve(matrix["M"], casadi.horzcat(-matrix["K"], -matrix["C"], matrix["B"]), "qr")
    a, b = solved[:, : 2 * m], solved[:, 2 * m :]
    acceleration = a @ x + b @ u
    y = matrix["Cq"] @ x[:m] + matrix["Cv"] @ x[m:] + matrix["Ca"] @ acceleration + matrix["D"] @ u
    after = None
    if step is not None:
        check_step(step, "to_casadi")
        doubt_step(space, step, "to_casadi", stacklevel=5)
        state_matrix = casadi.vertcat(casadi.horzcat(casadi.DM(m, m), casadi.DM.eye(m)), a)
        input_matrix = casadi.vertcat(casadi.DM(m, len(system.inputs)), b)
        phi, gamma = _exponential_step(casadi, state_matrix, input_matrix, space, float(step))
        after = phi @ x + gamma @ u
    matrices = casadi.Function("matrices", [p], [matrix[label] for label in MATRICES], ["p"], list(MATRICES))
    return _model(casadi, space, (x, u, p), (casadi.vertcat(x[m:], acceleration), after, y), step, matrices, parameters)


def _exponential_step(casadi: Any, a: Any, b: Any, space: StateSpace, dt: float) -> tuple[Any, Any]:
    """Return phi = e^(A dt) and gamma = int_0^dt e^(A s) ds B; ``space``: A, B with the parameters' own values."""
    n, i = space.B.shape
    power = exponents(space.A, space.B, space.C)
    nominal = np.ldexp(space.A, power[None, :] - power[:, None]) * dt
    # the size of inputs must not decide how often the exponential is squared
    largest = np.abs(np.ldexp(space.B, -power[:, None])).max(axis=0, initial=0.0)
    scale = np.exp2(-np.round(np.log2(np.where(largest > 0.0, largest, 1.0))))
    norm = float(np.abs(nominal).sum(axis=0).max(initial=0.0))
    squarings = _SPARE + max(0, int(np.ceil(np.log2(norm / _NORM))) if norm > 0.0 else 0)
    to, back = casadi.diag(casadi.DM(np.exp2(-power))), casadi.diag(casadi.DM(np.exp2(power)))
    augmented = casadi.horzcat(to @ a @ back * dt, to @ b @ casadi.diag(casadi.DM(scale)))
    augmented = casadi.vertcat(augmented, casadi.DM(i, n + i)) / 2.0**squarings
    result = _pade(casadi, augmented, n + i)
    for _ in range(squarings):
        result = result @ result
    gamma = back @ result[:n, n:] @ casadi.diag(casadi.DM(dt / scale)) if i else casadi.MX(n, 0)
    return back @ result[:n, :n] @ to, gamma


def _pade(casadi: Any, x: Any, size: int) -> Any:
    c, identity = _PADE, casadi.DM.eye(size)
    x2 = x @ x
    x4 = x2 @ x2
    x6 = x4 @ x2
    odd = x @ (x6 @ (c[13] * x6 + c[11] * x4 + c[9] * x2) + c[7] * x6 + c[5] * x4 + c[3] * x2 + c[1] * identity)
    even = x6 @ (c[12] * x6 + c[10] * x4 + c[8] * x2) + c[6] * x6 + c[4] * x4 + c[2] * x2 + c[0] * identity
    return casadi.solve(even - odd, even + odd, "qr")


def _affine_matrix(casadi: Any, form: Affine, label: str, p: Any) -> Any:
    """Nominal matrix and derivatives; one product, so that CasADi sees how few entries a parameter changes."""
    nominal, slopes = getattr(form.nominal, label), form.slopes[label]
    if not slopes.any():
        return casadi.MX(_dm(casadi, nominal))
    entries = np.stack([slope.ravel(order="F") for slope in slopes], axis=1)
    change = _dm(casadi, entries) @ (p - casadi.DM(form.values))
    return _dm(casadi, nominal) + casadi.reshape(change, *nominal.shape)


def _dm(casadi: Any, array: Array) -> Any:
    return casadi.sparsify(casadi.DM(array)) if array.size else casadi.DM(*array.shape)


def _model(
    casadi: Any, space: StateSpace, symbols: tuple[Any, Any, Any], results: tuple[Any, Any, Any], step: float | None,
    matrices: Any = None, parameters: tuple[tuple[str, ...], tuple[str, ...], Array] = ((), (), np.zeros(0)),
) -> CasadiModel:  # fmt: skip
    """The functions of x, u and p that give x', x after a step (or None), and y."""
    rates, sampled = (None if result is None else casadi.Function(name, symbols, [result, results[2]], ["x", "u", "p"],
                                                                  [first, "y"])
                      for name, first, result in (("rates", "xdot", results[0]), ("step", "x_next", results[1])))
    return CasadiModel(
        space.name, rates, sampled, matrices, None if step is None else float(step), space.states, space.state_units,
        space.inputs, space.input_units, space.outputs, space.output_units, *parameters[:2], parameters[2].copy(),
    )  # fmt: skip


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
    w = angular(omega, "to_casadi_response")

    def response(variant: System) -> Complex:
        result: Complex = variant.frequency_response(w)[row, column]
        return result

    def derivatives(variant: System) -> Complex:
        return variant.frequency_response_sensitivities(w, names, output_name, input_name)[:, 0, 0, :].T

    return _callback("response", system, names, response, derivatives)


def _names(system: System, parameters: str | Sequence[str], caller: str) -> tuple[str, ...]:
    need("casadi", caller)
    if not isinstance(system, System):
        raise refusal(system, caller, "a System (model.linearize())")
    return names_of(origin_of(system, caller).parameters, parameters, caller)


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
