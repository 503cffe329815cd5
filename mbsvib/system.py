"""The system: minimal linear equations of motion with names, units and the way back to the bodies."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np

from mbsvib.errors import ResponseError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from mbsvib.damped import Damped
    from mbsvib.energy_schur import EnergySchur
    from mbsvib.general import General
    from mbsvib.loads.shares import StiffnessShares
    from mbsvib.loads.statics import Statics
    from mbsvib.loops import Reduction
    from mbsvib.massless import Separation
    from mbsvib.modal_sum import ModalSum
    from mbsvib.modes import Modes
    from mbsvib.parameters import Parameters
    from mbsvib.parts._part import Part
    from mbsvib.reachable import Dropped
    from mbsvib.state_space import StateSpace
    from mbsvib.topology import Topology

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]


# Responses want the modes as accurate as they come without effort; what falls short is used nevertheless.
RESPONSE_RTOL = 1e-13


@dataclass(frozen=True, slots=True)
class Provenance:
    """How a system came about, for ``explain``: topology, loops, all joint coordinates, all spring-dampers; ``parts``
    are the bodies, joints and spring-dampers themselves, for ``parameters``; ``massless`` tells what became of motions
    without mass, ``statics`` what the loads do at the pose, ``dropped`` what
    ``reachable`` left out.
    """

    topology: Topology
    reduction: Reduction
    joint_coordinates: tuple[str, ...]
    springs: tuple[str, ...]
    parts: tuple[Part, ...] = ()
    massless: Separation | None = None
    statics: Statics | None = None
    dropped: Dropped | None = None


@dataclass(frozen=True, repr=False, eq=False)
class System:
    """M q'' + C q' + K q = B u,  y = Cq q + Cv q' + Ca q'' + D u, in minimal coordinates q.

    ``M``, ``C``, ``K`` (m, m), ``B`` (m, inputs), ``Cq``, ``Cv``, ``Ca`` (outputs, m), ``D`` (outputs, inputs); SI
    units and radians. ``coordinates``, ``inputs`` and ``outputs`` are their names, ``..._units`` their units.

    The factors are kept: M = W^T W with W = ``inertia_factor`` (6 bodies, m), K = D^T diag(k) D and C = D^T diag(c) D
    with D = ``elastic_rows`` (rows, m), k = ``stiffness`` and c = ``damping`` (rows,); ``row_owner`` (rows,) numbers
    the spring-damper of each row. ``body_motion`` (bodies, 6, m) gives the bodies' displacements. Arrays are read-only.

    What no such rows can be is None where the mechanism has none: ``gyroscopic`` G (m, m), antisymmetric, is part of C
    beside D^T diag(c) D, as spinning bodies add it; ``circulatory`` N (m, m), antisymmetric, is part of K beside
    D^T diag(k) D, as follower loads add it. M is singular if ``massless`` > 0: the motions ``null_inertia``
    (m, massless) move no mass but dampers (their damping is regular), each has one first-order state in place of two,
    and there are 2m - massless eigenvalues. Massless motions that no damper feels are not among the coordinates: they
    follow from statics, and what inputs do to them at once is in D (``explain()`` names them).
    """

    name: str
    coordinates: tuple[str, ...]
    coordinate_units: tuple[str, ...]
    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    bodies: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    B: Array
    Cq: Array
    Cv: Array
    Ca: Array
    D: Array
    inertia_factor: Array
    elastic_rows: Array
    stiffness: Array
    damping: Array
    row_owner: NDArray[np.intp]
    body_motion: Array
    provenance: Provenance = field(repr=False)
    gyroscopic: Array | None = None
    circulatory: Array | None = None
    massless: int = 0
    null_inertia: Array | None = None

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            array = getattr(self, name)
            if array is not None:
                array.setflags(write=False)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, m."""
        return len(self.coordinates)

    @property
    def tree(self) -> tuple[str, ...]:
        """Names of the joints of the spanning tree, from ground outwards."""
        return self.provenance.topology.tree

    @property
    def cut_joints(self) -> tuple[str, ...]:
        """Names of the joints at which loops are cut."""
        return self.provenance.topology.cut_joints

    @property
    def redundant(self) -> tuple[str, ...]:
        """Names of the constraint rows of cut joints that the others imply (``"pin4.rx"``)."""
        return tuple(name for group in self.provenance.reduction.groups for name in group.redundant)

    @cached_property
    def parameters(self) -> Parameters:
        """Every number that the system was made of by its name (``"leg1.k.stiffness"``), read-only; see ``units``."""
        from mbsvib.parameters import Parameters

        return Parameters(self.provenance.parts)

    def displacements(self, q: ArrayLike) -> dict[str, Array]:
        """Return the displacements of the bodies, x = B' B'' q.

        Parameters
        ----------
        q : array-like, shape (m,) or (m, n)
            Minimal coordinates [m, rad].

        Returns
        -------
        dict of str to array, shape (6,) or (6, n)
            Translation of each body's centre of mass [m] and its rotation [rad], world axes.

        Raises
        ------
        ResponseError
            If ``q`` does not have one entry for each coordinate.
        """
        vector = np.asarray(q)
        if vector.ndim not in (1, 2) or len(vector) != self.dof:
            raise ResponseError(
                f"displacements: q has shape {vector.shape}; expected ({self.dof},) or ({self.dof}, n), one entry for "
                f"each of the coordinates {', '.join(self.coordinates[:6])}{', ...' if self.dof > 6 else ''}."
            )
        return dict(zip(self.bodies, self.body_motion @ vector, strict=True))

    @cached_property
    def _modes(self) -> Modes:
        from mbsvib.modes import RTOL, modes

        return modes(self, RTOL, clean=False)

    def _modes_within(self, rtol: float) -> Modes:
        from mbsvib.modes import modes

        good = float(self._modes.errors.max(initial=0.0)) <= rtol
        return self._modes if good else modes(self, rtol, clean=False)

    @cached_property
    def _clean_modes(self) -> Modes:
        """For responses: near a resonance an error of a frequency counts 1 / (2 damping ratio) times, one of a shape at
        once.
        """
        from mbsvib.modes import modes

        result = self._modes
        good = max(result.mixed, float(result.errors.max(initial=0.0))) <= RESPONSE_RTOL
        return result if good else modes(self, RESPONSE_RTOL)

    @cached_property
    def _modal(self) -> Damped | General:
        """The basis of the responses."""
        return self._clean_modes.damped

    @cached_property
    def _modal_sum(self) -> ModalSum:
        from mbsvib.modal_sum import modal_sum

        return modal_sum(self, self._modal)

    @cached_property
    def _schur(self) -> EnergySchur:
        from mbsvib.energy_schur import energy_schur

        return energy_schur(cast("Damped", self._modal))

    @cached_property
    def _strong_dampers(self) -> Array | None:
        from mbsvib.frequency_response import strong_dampers

        return strong_dampers(self, cast("Damped", self._modal))

    def modes(self, count: int | None = None, *, near: float = 0.0, rtol: float | None = None) -> Modes:
        """Return modes: eigenvalues, frequencies, damping ratios, shapes and error estimates.

        Parameters
        ----------
        count : int, optional
            How many; default: all.
        near : float
            The frequency [Hz] whose ``count`` nearest modes are wanted; default: the lowest.
        rtol : float, optional
            Relative accuracy asked of every eigenvalue, 1e-12 if none is; more accurate and slower methods are taken
            as far as needed. Modes whose error estimate stays larger are warned of by number (AccuracyWarning).

        Returns
        -------
        Modes
            In ascending natural frequency. Modes at the default accuracy are kept, so that asking again costs nothing.

        Raises
        ------
        ResponseError
            If ``count`` is no positive whole number.
        """
        result = self._modes if rtol is None else self._modes_within(rtol)
        if count is not None:
            result = result.nearest(count, near)
        if rtol is not None:
            result.check_accuracy(rtol)
        return result

    def frequency_response(self, omega: ArrayLike) -> Complex:
        """Return the frequency response of all inputs and outputs.

        G(i w) = (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 B + D

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].

        Returns
        -------
        array, shape (outputs, inputs, n)
            Complex responses [output unit / input unit].

        Raises
        ------
        ResponseError
            If a frequency is not finite or is an undamped pole of the system.
        """
        from mbsvib.frequency_response import frequency_response

        return frequency_response(self, omega)

    def time_response(
        self, t: ArrayLike, u: ArrayLike, hold: str = "first", initial: tuple[ArrayLike, ArrayLike] | None = None
    ) -> Array:
        """Return the time response to inputs that are held or vary linearly between the samples; exact for these.

        Parameters
        ----------
        t : array-like, shape (n,)
            Ascending times [s].
        u : array-like, shape (inputs, n), or (n,) for a single input
            Inputs at these times.
        hold : str
            "first": linear between samples; "zero": constant from each sample to the next.
        initial : pair of array-like, shape (m,), optional
            q and q' at t[0]; default: rest.

        Returns
        -------
        array, shape (outputs, n)
            Outputs at these times.

        Raises
        ------
        ResponseError
            If times do not ascend, shapes do not match, or the hold is unknown.
        """
        from mbsvib.time_response import time_response

        return time_response(self, t, u, hold, initial)

    def poles(self) -> Complex:
        """Return the poles: all 2m eigenvalues, (lambda^2 M + lambda C + K) phi = 0, as accurate as responses need.

        Returns
        -------
        array, shape (2m - massless,)
            Poles [1/s] in pairs but for those of massless motions, in ascending natural frequency; 0 for rigid-body
            modes.
        """
        return self._clean_modes.eigenvalues.copy()

    def eigenvalue_sensitivities(
        self, parameters: str | Iterable[str] | Mapping[str, Mapping[str, float]] | None = None
    ) -> Complex:
        """Return the derivatives of all eigenvalues to parameters, without finite differences.

        d lambda / dp = -y^T (lambda^2 dM/dp + lambda dC/dp + dK/dp) x / y^T (2 lambda M + C) x

        Parameters
        ----------
        parameters : str, iterable of str or mapping, optional
            Names; a pattern ties all that it picks to one variable (``"leg*.k.stiffness"``), a mapping gives linear
            maps, {variable: {parameter: rate}}. Default: every parameter of the system.

        Returns
        -------
        array, shape (parameters, eigenvalues)
            Derivatives [1/s per unit of the parameter], eigenvalues in the order of ``modes().eigenvalues``; those that
            coincide have the derivatives of their branches, an eigenvalue 0 that a parameter would move infinity. Not a
            number where a parameter, changed alone, takes degrees of freedom away.

        Raises
        ------
        ModelError
            If a parameter is unknown, or the system has forces whose derivatives are not supported.
        """
        from mbsvib.sensitivities import eigenvalue_sensitivities

        return eigenvalue_sensitivities(self, parameters)

    def transmission_zeros(
        self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
    ) -> Complex:
        """Return the invariant zeros from some inputs to some outputs.

        The finite s at which [[K + s C + s^2 M, -B], [Cq + s Cv + s^2 Ca, D]] has less than its normal rank.

        Parameters
        ----------
        inputs, outputs : str or sequence of str, optional
            Names; default: all. Their numbers may differ.

        Returns
        -------
        array, shape (zeros,)
            Zeros [1/s] in ascending magnitude. A mode that the inputs do not reach or the outputs do not show is one
            too.

        Raises
        ------
        ResponseError
            If a name is unknown.
        """
        from mbsvib.transmission_zeros import transmission_zeros

        return transmission_zeros(self, inputs, outputs)

    def frequency_grid(
        self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None,
        n: int | None = None, *, f_min: float | None = None, f_max: float | None = None,
    ) -> Array:  # fmt: skip
        """Return angular frequencies that miss no resonance and no antiresonance of responses from inputs to outputs.

        Parameters
        ----------
        inputs, outputs : str or sequence of str, optional
            Names; default: all. Each pair's zeros count, so that a choice saves points and time.
        n : int, optional
            Number of points on an even logarithmic spacing, to which the others are added; default: 150 a decade.
        f_min, f_max : float, optional
            First and last frequency [Hz]; default: a tenth of the lowest and three times the highest natural
            frequency, rounded outwards to 1, 2 or 5.

        Returns
        -------
        array, shape (points,)
            Ascending angular frequencies [rad/s], as ``frequency_response`` takes them; next to w no farther apart than
            half the distance of i w to the nearest pole or zero.

        Raises
        ------
        ResponseError
            If a name is unknown, n is less than 2, or f_min and f_max are not positive and in ascending order.
        """
        from mbsvib.frequency_grid import frequency_grid

        return frequency_grid(self, inputs, outputs, n, f_min=f_min, f_max=f_max)

    def reachable(
        self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
    ) -> System:
        """Return the system of what asked inputs reach and asked outputs see, with these ports only.

        Coordinates that no entry of M, C or K joins to the others move by themselves; parts that no asked input acts
        on, or no asked output sees, have no share in the transfer function, which stays the same exactly.

        Parameters
        ----------
        inputs, outputs : str or sequence of str, optional
            Names of ports; default: all.

        Returns
        -------
        System
            The same equations without the other coordinates; ``explain`` names them.

        Raises
        ------
        ResponseError
            If a name is unknown, or there is none.
        """
        from mbsvib.reachable import reachable

        return reachable(self, inputs, outputs)

    def state_space(self, realization: str = "physical", reachable: bool = False) -> StateSpace:
        """Return first-order equations x' = A x + B u, y = C x + D u.

        Parameters
        ----------
        realization : str
            "physical": x = (q, q'); "modal": one 2x2 block for each mode.
        reachable : bool
            Whether to leave out states of parts that no input reaches or no output sees.

        Returns
        -------
        StateSpace
            Matrices, names and units.

        Raises
        ------
        ResponseError
            If the realization is unknown.
        """
        from mbsvib.state_space import state_space

        return state_space(self.reachable() if reachable else self, realization)

    @property
    def reactions(self) -> dict[str, Array]:
        """Wrench in each joint at the pose, {joint: (6,)}: force [N] and moment [N m] on its second body at its point.

        World axes; its first body takes the opposite. A rod (distance joint) has its point at its end, a joint without
        position at the centre of mass of its second body. Zeros where nothing loads the mechanism.
        """
        from mbsvib.loads.statics import joint_wrenches

        return joint_wrenches(self)

    def stiffness_shares(self, modes: Modes | None = None) -> StiffnessShares:
        """Return who holds the modes: shares of springs, preloads, loads and joint reactions in their strain energy.

        Parameters
        ----------
        modes : Modes, optional
            Some of this system's modes, ``system.modes(6)``; default: all.

        Returns
        -------
        StiffnessShares
            Signed shares, 1 in sum for each mode; printed as a table.
        """
        from mbsvib.loads.shares import stiffness_shares

        return stiffness_shares(self, modes)

    def explain(self) -> str:
        """Return in words how the equations came about: topology, loops, rank decisions, and what was skipped."""
        from mbsvib.explain import explain

        return explain(self)

    def __repr__(self) -> str:
        return f"System({self.name!r}: {self.dof} DOF, {len(self.inputs)} inputs, {len(self.outputs)} outputs)"


_ARRAYS = tuple(item.name for item in fields(System) if "Array" in str(item.type) or "NDArray" in str(item.type))
