"""The sparse system: equations of motion of many bodies behind the same names as the dense one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.elsewhere import tell_where
from mbsvib.api.system import System
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.display import Displayed
from mbsvib.common.selection import Names, port_numbers
from mbsvib.errors import ResponseError, counted
from mbsvib.responses.linear import PortedVerbs
from mbsvib.responses.state_space import StateSpace
from mbsvib.sparse.equations import SparseEquations, with_ports

if TYPE_CHECKING:
    from mbsvib.api.some_modes import SomeModes
    from mbsvib.sensitivities.shapes import ModeSensitivities

Requested = str | Iterable[str] | Mapping[str, Mapping[str, float]] | None


@dataclass(frozen=True, repr=False, eq=False)
class SparseSystem(PortedVerbs, SparseEquations, Displayed):
    """The linear equations of motion of a large mechanism, as sparse rows over displacements and joint coordinates.

    Names and units are those of ``System``. ``joint_coordinates`` are all coordinates of the spanning tree, the
    dependent ones of loops included. Nothing in here is larger than a constant times the number of bodies.

    ``elastic_rows`` (rows, unknowns) with ``row_stiffness``, ``row_damping`` and ``row_owner`` (rows,),
    ``inertia_factor`` W of M = W^T W (6 bodies, unknowns), ``input_rows`` (inputs, unknowns) and ``output_rows`` (three
    of them, for displacement, velocity and acceleration, each (outputs, unknowns)) are scipy sparse; ``D`` (outputs,
    inputs).
    ``model`` is what was linearized, ``removed`` what ``reachable`` left out. Owners of rows are ``springs`` and then
    ``loading``: loads, preloads, joints and bodies whose forces make geometric stiffness; ``undetermined`` is what
    redundant constraints leave open of the forces in joints that are outputs.

    ``System.from_matrices`` makes one of the ``matrices`` of scipy.sparse: ``joint_coordinates`` are theirs, and there
    are neither bodies nor rows.
    """

    def _with_ports(self, outputs: Names, inputs: Names) -> Self:
        return with_ports(self, outputs, inputs)

    def modes(self, count: int | None = None, *, near: float = 0.0, rtol: float | None = None) -> SomeModes:
        """Return some of the modes: the lowest ones, or those nearest to a frequency.

        Parameters
        ----------
        count : int
            How many.
        near : float
            The frequency [Hz] whose ``count`` nearest modes are wanted; default: the lowest, rigid-body modes first.
        rtol : float, optional
            Required relative accuracy of every eigenvalue. They are as accurate as possible; a warning
            (AccuracyWarning) states the numbers of modes whose error estimate is larger.

        Returns
        -------
        SomeModes
            Eigenvalues, frequencies, damping ratios, body shapes and error estimates, in ascending frequency.

        Raises
        ------
        ResponseError
            If ``count`` is not given, not positive, or more than there are.

        Warns
        -----
        UnstableWarning
            If the stiffness of matrices is negative for modes, which grow, that are not among these: their natural
            frequencies, abs(lambda) / 2 pi, are farther away.
        """
        from mbsvib.api.some_modes import SomeModes
        from mbsvib.sparse.modes import modes

        if count is None:
            raise ResponseError(
                f"modes: '{self.name}' has {self.dof} degrees of freedom and is held sparse; say how many modes are "
                f"wanted, modes(10), or modes(10, near=f) around a frequency. For all of them: "
                f"{self.dense_form}."
            )
        result = modes(self, count, near, System, SomeModes)
        if rtol is not None:
            result.check_accuracy(rtol)
        return result

    def mode_sensitivities(
        self, parameters: Requested = None, modes: int | None = None, *, near: float = 0.0
    ) -> ModeSensitivities:  # fmt: skip
        """Return the derivatives of natural frequencies and damping ratios of some modes to parameters.

        d lambda / dp = -y^T (lambda^2 dM/dp + lambda dC/dp + dK/dp) x / y^T (2 lambda M + C) x

        Parameters
        ----------
        parameters : str, iterable of str or mapping, optional
            Names; a pattern ties all that it picks to one variable (``"leg*.k.stiffness"``), a mapping gives linear
            maps, {variable: {parameter: rate}}. Default: every parameter of the model.
        modes : int
            Number of modes.
        near : float
            The frequency [Hz] whose nearest modes are taken; default: the lowest.

        Returns
        -------
        ModeSensitivities
            ``frequencies``, ``damped_frequencies``, ``damping_ratios`` and ``eigenvalues``, one row a variable, of its
            ``modes``. Not a number where a parameter, changed alone, takes degrees of freedom away; asked for all
            parameters, also where one by itself would be refused.

        Raises
        ------
        ModelError
            If a parameter is unknown, or moves the equilibrium of a loaded model.
        ResponseError
            If the number of modes is not given, or is no such number.
        """
        from mbsvib.api.some_modes import SomeModes
        from mbsvib.sensitivities.sparse_modes import sparse_mode_sensitivities

        self._check_mechanism("mode_sensitivities")
        if modes is None:
            self._refuse("mode_sensitivities", "mode_sensitivities(parameters, modes=k)")
        return sparse_mode_sensitivities(self, parameters, modes, near, System, SomeModes)

    def _response(self, part: SparseSystem, w: Array) -> Complex:
        from mbsvib.sparse.response import frequency_response

        # one sparse factorisation a frequency, which all parts share
        rows, columns = port_numbers(part.outputs, part.inputs, (self.outputs, self.inputs), self.name)
        return frequency_response(self, w)[np.ix_(rows, columns)]

    def static_compliance(self) -> Array:
        """Return the static displacements of the outputs per unit input, Cq K^-1 B (and D where it has accelerations).

        Returns
        -------
        array, shape (outputs, inputs)
            Compliances [output unit / input unit].

        Raises
        ------
        ResponseError
            If the mechanism can move without any spring holding it.
        """
        from mbsvib.sparse.response import static_compliance

        return static_compliance(self)

    def reachable(self, outputs: Names = None, inputs: Names = None) -> SparseSystem:
        """Return the controllable and observable bodies for the given inputs and outputs, with these ports only.

        Bodies that are coupled to others only through ground move independently. Such a part has no share in the
        transfer function if no given input acts on it, or no given output depends on it.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names of ports; default: all.

        Returns
        -------
        SparseSystem
            The same equations without the other bodies; ``explain`` names them.

        Raises
        ------
        ResponseError
            If a name is unknown, there is none, or no body is left.
        """
        from mbsvib.sparse.reachable import reachable

        self._check_mechanism("reachable")
        return reachable(self, outputs, inputs)

    def reduced(
        self, order: int | None = None, near: float | Sequence[float] = 0.0, *, correction: bool = False,
        method: str = "modal", error: float | None = None,
    ) -> System:  # fmt: skip
        """Return the system that the lowest modes make: a small dense one with the coordinates mode1, mode2, ...

        Everything that systems offer works on it, time responses, state space and exports included. What higher modes
        contribute to a response is missing, see ``truncation_error``; its static part may be put into D.

        Parameters
        ----------
        order : int
            Number of modes.
        near : float, or sequence of float for "krylov"
            Frequency [Hz] around which modes are taken, or about which moments are matched; default: the lowest modes,
            static moments.
        correction : bool
            Whether displacements, and forces in springs and joints, get the static part of all other modes. Velocities
            and accelerations have none.
        method : str
            "modal", or "static-corrected" for modal with the correction. Of matrices also "craig-bampton": outputs'
            displacements and those where inputs act, and modes with these held; "krylov": motions by which responses
            and some of their derivatives are exact at the frequencies ``near``, static ones at 0; and "balanced": a
            state space, by way of modes with static correction. Dense systems have all but "krylov".
        error : float, optional
            Of matrices: largest error instead of an order, for displacement outputs and C = alpha M + beta K. The
            models of matrices have a bound of it, ``error_bound``, from the static compliance that the modes left out
            have, and their least damping; it is infinite where no bound is known. ``truncation_error`` has the error of
            a given order.

        Returns
        -------
        System, or StateSpace by "balanced"
            M = 1, C and K in modal coordinates, with the factors and the way back to the bodies.

        Raises
        ------
        ResponseError
            If the modes are not the lowest, or free motions are missing, and a correction is requested. If there is no
            order, or an error or another method is given.
        """
        if self.matrices is not None and (method == "krylov" or not near):
            small = self._reduced_matrices(order, error, "static-corrected" if correction else method, near)
            return cast("System", small)
        if isinstance(near, Sequence) or np.ndim(near):
            raise ResponseError(f"reduced: near = {near!r} with method = {method!r}; expected one frequency [Hz].")
        known = method in ("modal", "static-corrected")
        if error is not None or order is None or not known:
            asked = f"error = {error!r}" if error is not None else "no order" if known else f"method = {method!r}"
            raise ResponseError(
                f"reduced: {asked}; '{self.name}' is held sparse and is reduced to some of its modes. Say how many, "
                f"reduced(20, correction=True), and see truncation_error; linearize(method='dense') has error bounds "
                f"and the other methods."
            )
        correction = correction or method == "static-corrected"
        small = cast("System", self.modes(order, near=near).reduced)
        if not correction:
            return small
        if near:
            raise ResponseError(
                f"reduced: correction of '{self.name}' around near = {near:g} Hz; modes below that have no static "
                f"part. Take the lowest modes (near=0), or no correction."
            )
        from mbsvib.sparse.response import corrected

        return corrected(self, small, order)

    def _reduced_matrices(self, order: int | None, error: float | None, method: str, near: Any) -> Any:
        from mbsvib.sparse.matrix_reduction import reduced_matrices

        if method != "balanced":
            return reduced_matrices(self, order, error, method, System, near)
        half = None if error is None else 0.5 * error
        count = None if order is None else min(2 * order, self.dof)
        return reduced_matrices(self, count, half, "static-corrected", System).reduced(order, half, "balanced")

    def truncation_error(self, small: System, omega: ArrayLike) -> Array:
        """Return how far responses of a reduced system are off, as shares of the largest response in these frequencies.

        |G_small - G| / max over omega of |G|, for each output and input

        Parameters
        ----------
        small : System
            What ``reduced`` made of this one.
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (outputs, inputs, n)
            Errors; 0 where nothing responds.

        Raises
        ------
        ResponseError
            If the ports are not the same, a frequency is not finite, or is an undamped pole.
        """
        from mbsvib.sparse.response import truncation_error

        return truncation_error(self, small, omega)

    def state_space(
        self, realization: str = "modal", modes: int | None = None, *, correction: bool = False
    ) -> StateSpace:
        """Return first-order equations of the lowest modes.

        Parameters
        ----------
        realization : str
            "modal", or "physical" with modal amplitudes and their rates as the states.
        modes : int
            Number of modes.
        correction : bool
            Whether D holds the static part of all other modes, as in ``reduced``.

        Returns
        -------
        StateSpace
            Matrices, names and units.

        Raises
        ------
        ResponseError
            If the number of modes is not given.
        """
        if modes is None:
            self._refuse("state_space", "state_space(modes=k)")
        return self.reduced(modes, correction=correction).state_space(realization)

    def time_response(self, t: ArrayLike, u: ArrayLike, hold: str = "first", modes: int | None = None) -> Array:
        """Return the time response of the lowest modes, from rest.

        Parameters
        ----------
        t : array-like, shape (n,)
            Ascending times [s].
        u : array-like, shape (inputs, n), or (n,) for a single input
            Inputs at these times.
        hold : str
            "first": linear between samples; "zero": constant from each sample to the next.
        modes : int
            Number of modes.

        Returns
        -------
        array, shape (outputs, n)
            Outputs at these times.

        Raises
        ------
        ResponseError
            If the number of modes is not given, or the data are refused.
        """
        if modes is None:
            self._refuse("time_response", "time_response(t, u, modes=k)")
        return self.reduced(modes).time_response(t, u, hold)

    def explain(self) -> str:
        """Return in words how the equations came about: topology, loops, rank decisions, and what was skipped."""
        from mbsvib.explain.sparse import explain

        return explain(self)

    def _refuse(self, method: str, instead: str) -> NoReturn:
        raise ResponseError(
            f"{method}: '{self.name}' has {self.dof} degrees of freedom and is held sparse; say with how many modes it "
            f"is to be computed, {instead}, or take {self.dense_form}."
        )

    def __repr__(self) -> str:
        ports = f"{counted(len(self.inputs), 'input')}, {counted(len(self.outputs), 'output')}"
        return f"SparseSystem({self.name!r}: {self.dof} DOF, {ports})"


tell_where(SparseSystem, System, "dense systems have it, system.reduced(20, correction=True).{name} or that of "
                                 "linearize(method='dense').")  # fmt: skip
System.large = SparseSystem
