"""Closed loops: a plant with its controllers, as accurate over frequency as the plant itself."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array, Complex, Index
from mbsvib.common.selection import Names, united
from mbsvib.equations.equations import Equations
from mbsvib.errors import ResponseError
from mbsvib.feedback.closing import ClosedSpace, closed_space, regular
from mbsvib.feedback.controller import Controller, as_controller
from mbsvib.feedback.feedback_loop import FeedbackLoop
from mbsvib.feedback.loop import LoopPlant, Resolution, with_noise
from mbsvib.feedback.loop_rounding import Closed, at_poles, blended, evaluated, inverse, usual
from mbsvib.feedback.participation import eigen
from mbsvib.feedback.sampled import SampledLoop
from mbsvib.linalg.products import nonzero_eigenrows
from mbsvib.linalg.rank import EPS
from mbsvib.linalg.spectrum import Spectrum, spectrum
from mbsvib.responses.first_order_solver import FirstOrderSolver, first_order_solver
from mbsvib.responses.from_control import of_control, sample_time
from mbsvib.responses.state_space import StateSpace

# Of the equilibration of a change of coordinates whose units are up to 24 orders apart.
ROUNDS = 12

E = TypeVar("E", bound=Equations)


def closed_system(system: E, gain: Array, sensors: list[int], actuators: list[int], name: str) -> E | None:
    """Return the system under u = w + G y with a static gain G, or None if that is no such system.

    (M - B_u G' Ca_y) q'' + (C - B_u G' Cv_y) q' + (K - B_u G' Cq_y) q = (B + B_u G' D_y) w,  G' = (1 - G D_yu)^-1 G,
    and likewise for the outputs; symmetric parts of the changes become rows with weights, antisymmetric ones gyroscopic
    and circulatory terms

    ``gain`` (actuators, sensors): static gains. Returns None if sensors of acceleration do anything but add mass to
    bodies that share none, there are motions without mass, or the loop is algebraic.
    """
    product = gain @ system.D[np.ix_(sensors, actuators)]
    if system.massless or not regular(product):
        return None
    back: Array = np.asarray(np.linalg.solve(np.eye(len(actuators)) - product, gain), dtype=float)
    forces = system.B[:, actuators]
    mass, m_rows, m_weights, skew = _change(forces, back, system.Ca[sensors])
    shared = len(system.inertia_factor) > 6 * len(system.bodies) > 0  # the mass would be taken for one of its bodies
    if skew is not None or (m_weights < 0.0).any() or (shared and mass.any()):
        return None
    stiffness, k_rows, k_weights, circulatory = _change(forces, back, system.Cq[sensors])
    damping, c_rows, c_weights, gyroscopic = _change(forces, back, system.Cv[sensors])
    through, direct = system.D[:, actuators] @ back, back @ system.D[sensors]
    count = len(k_weights) + len(c_weights)
    owner = len(system.provenance.springs)
    return replace(
        system, name=name, M=system.M + mass, C=system.C + damping, K=system.K + stiffness,
        B=system.B + forces @ direct,
        **{key: (was := getattr(system, key)) + through @ was[sensors] for key in ("Cq", "Cv", "Ca")},
        D=system.D + system.D[:, actuators] @ direct,
        inertia_factor=np.concatenate((system.inertia_factor, np.sqrt(m_weights)[:, None] * m_rows)),
        elastic_rows=np.concatenate((system.elastic_rows, k_rows, c_rows)),
        row_stiffness=np.concatenate((system.row_stiffness, k_weights, np.zeros(len(c_weights)))),
        row_damping=np.concatenate((system.row_damping, np.zeros(len(k_weights)), c_weights)),
        row_owner=np.concatenate((system.row_owner + (system.row_owner >= owner), np.full(count, owner))),
        gyroscopic=_sum(system.gyroscopic, gyroscopic), circulatory=_sum(system.circulatory, circulatory),
        provenance=replace(system.provenance, springs=system.provenance.springs + ("controller",) * bool(count),
                           closed_loop=True, truncation=None),
    )  # fmt: skip


def _change(forces: Array, back: Array, observed: Array) -> tuple[Array, Array, Array, Array | None]:
    """-B_u G' C_y, rows and weights of its symmetric part, and its antisymmetric part, None where that is rounding."""
    change = -forces @ (back @ observed)
    terms = np.abs(forces) @ (np.abs(back) @ np.abs(observed))
    noise = len(forces) * EPS * np.maximum(terms, terms.T)
    skew = 0.5 * (change - change.T)
    skew[np.abs(skew) <= noise] = 0.0
    symmetric = 0.5 * (change + change.T)
    scale = np.sqrt(usual(np.abs(symmetric)[None], ROUNDS)[0].diagonal())
    weights, rows = nonzero_eigenrows(symmetric, scale)
    return symmetric + skew, rows, weights, skew if skew.any() else None


def _sum(first: Array | None, second: Array | None) -> Array | None:
    return second if first is None else first if second is None else first + second


@dataclass(frozen=True, repr=False, eq=False)
class ClosedLoop(FeedbackLoop):
    """A plant with controllers, u = w + K y; has the inputs w and outputs of ``plant.system``, or some of them.

    It has all methods of a system. Under static gains without feedthrough the loop is a system of second order again,
    ``second_order``, of which its modes and states are; accelerations may add mass to it.
    """

    sampled_form: ClassVar[type[SampledLoop]] = SampledLoop

    def _forces(self, w: Array, plant: tuple[Complex, Complex]) -> tuple[Complex, Array]:
        k = self._gains(w)
        returned, passive = k @ plant[0], k @ plant[1]
        s = inverse(np.eye(len(self.actuators)) - returned)
        forces = s @ passive
        terms = np.abs(k) @ np.abs(plant[1]) + np.abs(k) @ np.abs(plant[0]) @ np.abs(forces)
        return forces, EPS * (np.abs(s) @ terms)

    def _gains(self, w: Array) -> Complex:
        """K (n, actuators, sensors) of the controllers, not a number at their poles."""
        return evaluated(lambda w: self.law.at(np.asarray(1j * w, dtype=complex)), w, self.law.D.shape)

    def _by_states(self, w: Array) -> Closed:
        space, (o, i) = self._space, self.selected_ports
        return self._solved(w, space.b[:, i], space.c[o], space.d[np.ix_(o, i)])

    def _solved(self, w: Array, b: Array, c: Array, d: Array) -> Closed:
        """Return c (i w - A)^-1 b + d with A of the closed loop as a function of rows, columns and points."""

        def closed(rows: Index, columns: Index, at: Index) -> tuple[Complex, Array]:
            ports = b[:, columns], c[rows], d[np.ix_(rows, columns)]
            s = np.asarray(1j * w[at], dtype=complex)
            value, terms = np.zeros((2, len(rows), len(columns), len(at)), dtype=complex)
            pole = at_poles(s, self._spectrum)
            if pole.any():  # which the response need not contain
                space = StateSpace.from_arrays(self._space.a, *ports, name=self.name)
                value[:, :, pole] = space.frequency_response(w[at][pole])
            value[:, :, ~pole], terms[:, :, ~pole] = self._solver.bounded(s[~pole], w[at][~pole], ports)
            return value, terms.real

        return closed

    @cached_property
    def _spectrum(self) -> Spectrum:
        return spectrum(self._space.a)

    def _loop_gain(self, w: Array) -> Complex:
        try:
            gains = self.law.at(np.asarray(1j * w, dtype=complex))
        except np.linalg.LinAlgError as error:
            raise ResponseError("closed loop: a controller has a pole at one of the frequencies (a pure integrator at "
                                "0 Hz?), where the loop gain is infinite; give it a leak, or leave this frequency out."
                                ) from error  # fmt: skip
        return -(gains @ self._between(w))

    def _sensitivity(self, w: Array) -> Complex:
        one = np.eye(len(self.actuators))
        k = self._gains(w)
        plant = evaluated(self._between, w, (len(self.sensors), len(self.actuators)))
        s = inverse(one - k @ plant)
        error = EPS * (np.abs(s) @ (one + np.abs(k) @ np.abs(plant)) @ np.abs(s))
        space, u = self._space, self.ports[1]
        closed = self._solved(w, space.b[:, u], space.gain, one + space.push[:, u])
        return blended(s, error, closed)

    @cached_property
    def _space(self) -> ClosedSpace:
        return self._closed(self.plant.space)

    @cached_property
    def _solver(self) -> FirstOrderSolver:
        return first_order_solver(self._space.a, self._space.b, self._space.c, self.name)

    def _closed(self, space: StateSpace) -> ClosedSpace:
        """Return the closed-loop equations with the states of some equations of the plant."""
        law, (y, u) = self.law, self.ports
        if not regular(space.D[np.ix_(y, u)] @ law.D):
            raise ResponseError(f"closed loop: {law.name} makes an algebraic loop: its feedthrough times that of the "
                                f"sensors is 1. Change the gain.")  # fmt: skip
        return closed_space((space.A, space.B, space.C, space.D), (law.A, law.B, law.C, law.D), y, u)

    @cached_property
    def second_order(self) -> Any:
        """The closed loop as a system, M' q'' + C' q' + K' q = B' w, or None if its controllers have states, or sensors
        of acceleration do more than add mass.
        """
        system = self.plant.system
        if len(self.law.A) or getattr(system, "basis", None) is None:
            return None
        closed = closed_system(system, self.law.D, *self.ports, self.name)
        return closed if closed is None or self.selection is None else closed.with_ports(*self.selection)

    def _first_order(self, realization: str) -> StateSpace:
        from mbsvib.responses.realizations import balanced_states

        if realization == "modal":
            closed, space = self._space, self.plant.space
        elif self.second_order is not None:
            second_order: StateSpace = self.second_order.state_space(realization)
            return second_order
        elif realization == "balanced":
            return balanced_states(self.state_space("physical"))
        else:
            space = self.plant.system.state_space(realization)
            closed = self._closed(space)
        k, shown, through = len(closed.a) - len(space.A), self.selected_ports, space.through
        states = tuple([f"controller{i + 1}" for i in range(k)])
        wide = np.concatenate((space.transform, np.zeros((len(space.transform), k))), axis=1)
        if through is not None:  # what the controllers demand changes rates at once
            acts = through[:, self.ports[1]]
            wide, through = wide + acts @ closed.gain, through + acts @ closed.push
        result = replace(space, name=self.name, A=closed.a.copy(), B=closed.b.copy(), C=closed.c.copy(),
                         D=closed.d.copy(), transform=wide, through=through,
                        states=(*space.states, *states), state_units=(*space.state_units, *("",) * k),
                        error_bound=None)  # fmt: skip
        if self.selection is None:
            return result
        return result.with_ports([space.outputs[i] for i in shown[0]], [space.inputs[i] for i in shown[1]])

    def _steady(self, at: Array) -> Complex:
        # of a mass that the loop adds, modes cancel where it hardly moves
        if self.second_order is not None and not (self.law.D @ self.plant.system.Ca[self.ports[0]]).any():
            return np.asarray(self.second_order.frequency_response(at))
        return super()._steady(at)

    @property
    def equations(self) -> Any:
        """The loop as a system where it is of second order, else its first-order equations."""
        return self.state_space() if self.second_order is None else self.second_order

    def poles(self) -> Complex:
        """Return the poles (states,) of the closed loop [1/s], in ascending magnitude."""
        return super().poles() if self.second_order is None else np.asarray(self.second_order.poles())

    @cached_property
    def _eigen(self) -> tuple[Complex, Array, Array]:
        return eigen(self._spectrum)

    @property
    def resolution(self) -> Resolution:
        """Poles and panels of the responses."""
        return Resolution(self.poles())

    @property
    def title(self) -> str:
        """The controllers' names."""
        return self.law.name


def close(plant: LoopPlant, *controllers: Controller, form: type[ClosedLoop] = ClosedLoop) -> ClosedLoop:
    """Return a plant with its loops closed."""
    if not controllers:
        raise ResponseError("closed loop: no controller is given; make one by force_feedback, skyhook, controller, ...")
    system = plant.system
    for law in controllers:
        if not isinstance(law, Controller):
            raise ResponseError(f"closed loop: {type(law).__name__} is not a controller; expected what force_feedback, "
                                f"skyhook, controller, ... return.")  # fmt: skip
        for kind, names, known in (("sensor", law.inputs, system.outputs), ("actuator", law.outputs, system.inputs)):
            for name in names:
                check.known(name, known, f"closed loop: {law.name} names the {kind} '{name}'; the plant has none",
                            error=ResponseError)  # fmt: skip
    return form(plant, controllers, united(*(c.inputs for c in controllers)), united(*(c.outputs for c in controllers)))


def connected(
    plant: LoopPlant, controller: Any, sensors: Names, actuators: Names, name: str | None,
    form: type[ClosedLoop] = ClosedLoop, noise: bool = False,
) -> ClosedLoop | SampledLoop:  # fmt: skip
    """Return a plant with a controller that feeds outputs back to inputs, u = w + K y.

    ``controller``: from sensors to actuators; an array has the shape (actuators, sensors); one of python-control in
    discrete time makes a sampled loop. ``sensors``, ``actuators``: names or patterns of outputs and inputs; default:
    the names that the controller has. ``name``: name of the controller in tables. ``noise``: whether the loop has the
    noise of sensors and actuators as inputs.
    """
    period = sample_time(controller) if of_control(controller) else None
    law = as_controller(controller, plant.system, sensors, actuators, name, period)
    if noise:
        noisy, law = with_noise(plant, law)
        loop = replace(close(noisy, law, form=form), selection=(plant.system.outputs, noisy.system.inputs))
    else:
        loop = close(plant, law, form=form)
    return loop if period is None else loop.sampled(1.0 / period)
