"""Running machines: the method of models, and the cycle with what can be asked of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array
from mbsvib.common.columnar import Columnar
from mbsvib.cycles.result import CycleData
from mbsvib.errors import MbsvibError
from mbsvib.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from mbsvib.cycles.machine import Machine
    from mbsvib.cycles.periodic import Periodic
    from mbsvib.cycles.reactions import Reactions
    from mbsvib.cycles.sensitivities import CycleSensitivities


class Cycle(Columnar, CycleData):
    """A running machine: its motion, drive torques, shaking force and moment, and what joints carry."""

    @cached_property
    def _reactions(self) -> Reactions:
        from mbsvib.cycles.reactions import reactions

        return reactions(self)

    @property
    def reactions(self) -> Mapping[str, Array]:
        """What each joint's first body does to its second by constraint: force [N] and moment about the joint's point
        [N m], arrays (n, 6) in world axes by joint, without the torques of drives. Of a joint without a point it is
        about the centre of mass of its second body, or of the first where that is the ground.

        Where redundant constraints leave forces open, those of least norm are taken in each pose, as by
        ``System.reactions``; ``undetermined`` names them.
        """
        return self._reactions.wrenches

    @property
    def undetermined(self) -> Mapping[str, tuple[str, ...]]:
        """Directions x ... rz of reactions, by joint, that redundant constraints leave open."""
        return self._reactions.undetermined

    def columns(self) -> dict[str, Array]:
        """Return the cycle as columns by name: coordinates, torques of drives, shaking force and moment, reactions.

        Returns
        -------
        dict of str to array, shape (n,)
            ``crank.rz`` [rad], ``crank.rz.rate``, ``crank.rz.acceleration`` of every coordinate;
            ``crank.rz.torque`` [N m, N] of every drive; ``shaking_force.x`` [N], ``shaking_moment.x`` [N m] about
            ``about``; ``pin12.reaction.x`` [N] to ``pin12.reaction.rz`` [N m] of every joint.
        """
        result: dict[str, Array] = dict(self.coordinates)
        result |= {f"{name}.rate": values for name, values in self.rates.items()}
        result |= {f"{name}.acceleration": values for name, values in self.accelerations.items()}
        result |= {f"{name}.torque": values for name, values in self.torques.items()}
        for name, vectors in (("shaking_force", self.shaking_force), ("shaking_moment", self.shaking_moment)):
            result |= {f"{name}.{axis}": vectors[:, i] for i, axis in enumerate("xyz")}
        for name, wrenches in self.reactions.items():
            result |= {f"{name}.reaction.{axis}": wrenches[:, i] for i, axis in enumerate(DIRECTIONS)}
        return result

    def sensitivities(self, parameters: Any = None) -> CycleSensitivities:
        """Return exact derivatives of torques, reactions, shaking force and moment to parameters.

        The motion of the drives stays as it is; the others follow the lengths, and beams and superelements bend in the
        periodic motion that belongs to them.

        Parameters
        ----------
        parameters : str or sequence of str, optional
            Names or patterns of masses, centres (``"link1.position.x"``), inertias, positions of joints, and numbers of
            springs, loads and gravity, none of beams; default: masses, centres and inertias of all bodies.

        Returns
        -------
        CycleSensitivities
            Derivatives of the samples, of rms values and peaks.

        Raises
        ------
        ModelError
            If a parameter is unknown or has no derivative here, or takes the loops apart.
        """
        from mbsvib.cycles.sensitivities import sensitivities

        return sensitivities(self, parameters)

    def periodic(
        self, released: Mapping[str, tuple[float, float]] | Sequence[str] | None = None, *, period: float | None = None
    ) -> Periodic:
        """Return the linear equations of small motions about the cycle, whose coefficients are periodic.

        M(t) delta'' + (C(t) + c) delta' + (K(t) + k) delta = 0

        Released drives keep the torque of the cycle and deviate by delta from their motion; the others stay on theirs.
        Beams and superelements deviate with the coordinates in which they bend, whatever is released.

        Parameters
        ----------
        released : mapping of str to (stiffness, damping), or sequence of str, optional
            Drives that may deviate, with what stiffness k [N m/rad, N/m] and damping c [N m s/rad, N s/m] they have
            about their motion, of a shaft or a controller; default: all, with none. None at all, ``[]``, where beams
            bend.
        period : float, optional
            Period [s], over which the samples are evenly spread; default: one turn of a drive at constant speed, or the
            period in which beams bend.

        Returns
        -------
        Periodic
            Coefficients, ``frozen`` and ``averaged`` eigenvalues, Floquet ``multipliers``, and whether it is
            ``stable``.

        Raises
        ------
        ModelError
            If a name is no drive, the samples are not evenly spread over a period, or the coefficients do not repeat
            after it, as after one turn of a shaft that gears reduce.

        Source: G. Floquet, Sur les equations differentielles lineaires a coefficients periodiques (1883).
        """
        from mbsvib.cycles.periodic import periodic

        return periodic(self, released, period)


class Running(Mechanism):
    """Method of ``Model`` for prescribed motion."""

    def cycle(
        self, drive: str | None = None, angles: ArrayLike | None = None, *, speed: float | None = None,
        motion: Mapping[str, Any] | None = None, about: ArrayLike | None = None, period: float | None = None,
    ) -> Cycle:  # fmt: skip
        """Return the inverse dynamics of a running machine: what drives must supply, joints carry and the ground feels.

        tau = (dq/dq_i)^T (M(q) q'' - f(q, q')),  F = -sum of m a,
        M_O = -sum of (r - O) x m a + I alpha + w x I w

        over finite motion, loops followed exactly from the pose as described. Gravity, springs, dampers and loads count
        in torques and reactions; the shaking force F and moment M_O are those of inertia alone. Inputs are left out.
        Beams and superelements bend in the periodic motion that belongs to the period, in the small displacements of
        ``simulate``: the steady state, from which they follow the drives at all harmonics.

        Parameters
        ----------
        drive : str, optional
            Driven joint coordinate, ``"crank.rz"``.
        angles : array-like, shape (n,), optional
            Its values at the samples, displacements from the pose as described [rad, m].
        speed : float, optional
            Its rate, the same at all samples [rad/s, m/s].
        motion : mapping of str to (q, qd, qdd), optional
            Instead of these: for each driven coordinate its values, rates and accelerations, arrays (n,) or numbers.
        about : array-like, shape (3,), optional
            Point O of the shaking moment [m], world axes; default: the joint of the first drive as
            described, the origin where that has no point.
        period : float, optional
            Of models with beams or superelements: period [s], over which the samples are evenly spread, without its
            end; default: one turn of a drive at constant speed.

        Returns
        -------
        Cycle
            ``torque``, ``shaking_force``, ``shaking_moment``, ``reactions``, the motion of all bodies and nodes of
            beams, ``rms`` and ``peak`` values, exact ``sensitivities``, and ``periodic`` equations.

        Raises
        ------
        ModelError
            If a drive is unknown, does not move the mechanism with rigid beams, or leaves some of its motion open; a
            part has no statement in finite motion; or beams have no periodic motion that is found.
        SingularPoseError
            If the cycle meets a singular pose, with the angle where.
        MbsvibError
            If CasADi is not installed (``pip install "mbsvib[casadi]"``).

        Warns
        -----
        NearSingularWarning
            If the cycle comes so near a singular pose that digits are lost.
        AccuracyWarning
            If the samples do not resolve the motion of beams.
        LargeDisplacementWarning
            If a beam bends too far for small displacements.

        Source: H. Chaudhary, S. K. Saha, "Dynamics and Balancing of Multibody Systems" (2009), chapters 3 to 6.
        A. H. Nayfeh, D. T. Mook, "Nonlinear Oscillations" (1979), section 4.1, for the periodic motion.
        """
        kwargs = {"drive": drive, "angles": angles, "speed": speed, "motion": motion, "about": about}
        return cycle_of(self, kwargs, period=period)


def cycle_of(
    model: Mechanism, kwargs: Mapping[str, Any], like: Machine | None = None, period: float | None = None
) -> Cycle:
    """Return the cycle of a model.

    ``kwargs``: the arguments of ``Model.cycle`` but the ``period``. ``like``: a machine that differs by values of
    symbols only: its equations are used, and its motion if it is the same.
    """
    _check_casadi()
    from mbsvib.cycles.inverse_dynamics import inverse_dynamics
    from mbsvib.cycles.machine import machine

    plant = machine(model, **kwargs, like=like)
    if plant.statement.elastic:
        from mbsvib.cycles.elastic import with_elastic_motion

        plant = with_elastic_motion(plant, period)
    return inverse_dynamics(plant, Cycle)


def compiled_for(model: Mechanism, kwargs: Mapping[str, Any], parameters: tuple[str, ...]) -> Machine:
    """Return a machine in motion whose equations have some of its numbers as symbols.

    ``kwargs``: the arguments of ``Model.cycle``.
    """
    _check_casadi()
    from mbsvib.cycles.machine import machine

    running_machine = machine(model, **kwargs)
    return replace(running_machine, compiled=running_machine.with_symbols(parameters))


def _check_casadi() -> None:
    if find_spec("casadi") is None:
        raise MbsvibError('cycle: needs CasADi, which is not installed; pip install "mbsvib[casadi]".')
