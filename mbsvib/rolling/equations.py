"""First-order equations of mechanisms on rolling wheels, about steady forward motion.

The mechanism, in axes that travel along, has M q'' + C q' + K q = B u + J^T f, with the spin of the wheels in C, and in
K the stiffness of all loads and of the contact forces that hold them. The wheels demand J q' + A q = 0: normal rows tie
q = H z, the others the speeds, z' = N w + G z: rates follow from speeds and from where it stands. With P = H N

P^T M P w' = -P^T [K H z + C q' + M H G z'] + P^T B u,   q' = H z',   x = (z, w).

Source: Meijaard, Papadopoulos, Ruina & Schwab, Proc. R. Soc. A 463 (2007) 1955-1982, appendix A; Schwab & Meijaard,
"Dynamics of flexible multibody systems with non-holonomic constraints", Multibody System Dynamics 10 (2003) 107-123.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mbsvib.common.arguments import DIRECTIONS
from mbsvib.common.arrays import Array
from mbsvib.elements.load import Load
from mbsvib.elements.motion_input import MotionInput
from mbsvib.elements.ports import ForceOutput, make_input
from mbsvib.elements.rotor import Rotor
from mbsvib.equations.assembly import assembled, linearized
from mbsvib.equations.equations import Equations
from mbsvib.equations.expansion import expanded
from mbsvib.equations.scene import scene, with_maxwell_nodes
from mbsvib.errors import ModelError, SingularPoseError
from mbsvib.linalg.qr import gram_solution
from mbsvib.linalg.rank import DEPENDENT_ROWS, ZERO_SUM
from mbsvib.linalg.rotations import skew
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.responses.first_order import RATE_UNITS
from mbsvib.rolling.choice import RankDecision, dependence, dependent_columns
from mbsvib.rolling.contact import STILL, Contact, contact


@dataclass(frozen=True, slots=True)
class RollingEquations:
    """x' = A x + B u, y = C x + D u, and (q, q') = ``transform`` x + ..., with the states' names and units.

    ``contact_forces`` (wheels, 3) [N] are those on the wheels in steady motion, world axes; ``spins`` (wheels,)
    [rad/s]. ``tied`` are the coordinates that the normals tie, ``driven`` those whose speeds follow from others, and
    ``groups`` the decisions on the rank of both.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    transform: Array
    states: tuple[str, ...]
    units: tuple[str, ...]
    equations: Equations
    contact_forces: Array
    spins: Array
    tied: tuple[str, ...]
    driven: tuple[str, ...]
    groups: tuple[RankDecision, ...]


def rolling_equations(model: Mechanism, independent: Sequence[str] = ()) -> RollingEquations:
    """Return the equations of deviations from steady forward motion.

    ``independent``: names of coordinates whose speeds are to be among the states.
    """
    wheels = list(model.rolling.values())
    contacts = [contact(wheel, model.travel or STILL) for wheel in wheels]
    _check(model)
    plain = _spinning(model, contacts)
    statics = _unchecked(plain)
    rows, slip = _conditions(statics, model, contacts)
    forces = _holding(statics, rows)
    system: Equations = linearized(_held(plain, model, contacts, forces), origin=model)
    if system.massless or len(system.coordinates) != len(statics.coordinates):
        raise ModelError(f"model '{model.name}': bodies without mass beside rolling wheels are not supported; give "
                         f"them a mass.", element=model.name)  # fmt: skip
    return _Reduced(system, model, contacts, forces, rows, slip, tuple(independent)).result()


def _check(model: Mechanism) -> None:
    """Refuse parts whose meaning beside rolling wheels is not stated."""
    for name, driver in model.inputs.items():
        if isinstance(driver, MotionInput):
            raise ModelError(f"input '{name}': motions as inputs beside rolling wheels are not supported; move a body "
                             f"by a force, or the ground by add_base_motion.", element=name)  # fmt: skip
    for name, part in model.outputs.items():
        if isinstance(part, ForceOutput) and (part.element == "ground" or part.element in model.bodies):
            raise ModelError(f"output '{name}' is the sum of the forces on '{part.element}', which would lack those at "
                             f"the contacts of rolling wheels; ask for forces in joints and springs one by one.",
                             element=name, field="element")  # fmt: skip


def _spinning(model: Mechanism, contacts: Sequence[Contact]) -> Mechanism:
    """The mechanism without contacts, its wheels spinning, with six inputs at the centre of each wheel."""
    rotors, inputs = dict(model.rotors), dict(model.inputs)
    for wheel, state in zip(model.rolling.values(), contacts, strict=True):
        if any(rotor.body == wheel.body for rotor in model.rotors.values()):
            raise ModelError(f"rolling wheel '{wheel.name}': body '{wheel.body}' has a rotor too; a rolling wheel "
                             f"spins by itself, leave the rotor out.", element=wheel.name, field="body")  # fmt: skip
        rotors[wheel.name] = Rotor(wheel.name, wheel.body, state.spin, wheel.axis)
        for d in DIRECTIONS:
            inputs[_wrench(wheel.name, d)] = make_input(_wrench(wheel.name, d), wheel.body, d, None, "ground")
    return model.with_parts(rolling={}, rotors=rotors, inputs=inputs)


def _wrench(wheel: str, direction: str) -> str:
    return f"{wheel} contact {direction}"


def _unchecked(plain: Mechanism) -> Equations:
    """The equations of the mechanism without contacts, which nothing holds in balance."""
    whole = expanded(plain)
    return assembled(whole, scene(with_maxwell_nodes(whole)), None, plain, checked=False)


def _conditions(system: Equations, model: Mechanism, contacts: Sequence[Contact]) -> tuple[Array, Array]:
    """J and A (3 wheels, m) of J q' + A q = 0, along the normal, the way and across for each wheel."""
    rows, slip = [], []
    for wheel, state in zip(model.rolling.values(), contacts, strict=True):
        motion = system.body_motion[system.bodies.index(wheel.body)]
        rows.append(_product(state.directions, state.rows, motion))
        slip.append(_product(state.directions, state.slip, motion[3:]))
    return np.concatenate(rows), np.concatenate(slip)


def _holding(system: Equations, rows: Array) -> Array:
    """Contact forces (3 wheels,) along the directions of the rows that hold all loads, by least squares."""
    statics = system.provenance.statics
    if statics is None:
        return np.zeros(len(rows))
    force, *_ = np.linalg.lstsq(rows.T, -statics.residual, rcond=DEPENDENT_ROWS)
    size = np.linalg.norm(force)
    return np.where(np.abs(force) <= ZERO_SUM * size, 0.0, force)


def _held(plain: Mechanism, model: Mechanism, contacts: Sequence[Contact], forces: Array) -> Mechanism:
    """The mechanism with contact forces as loads on its wheels; ``linearized`` checks the balance."""
    loads = dict(plain.loads)
    wheels = model.rolling.values()
    for wheel, state, along in zip(wheels, contacts, forces.reshape(-1, 3), strict=True):
        force = along @ state.directions
        torque = np.cross(state.arm, force)
        torque[np.abs(torque) <= ZERO_SUM * wheel.radius * np.abs(force).max()] = 0.0
        if force.any():
            vectors: Any = tuple(force.tolist()), tuple(torque.tolist())
            loads[wheel.name] = Load(wheel.name, wheel.body, *vectors)
    return plain.with_parts(loads=loads)


def _product(*factors: Array, plus: Array | float = 0.0) -> Array:
    """The product of matrices and a further term, 0 where the sum is rounding of its terms."""
    value, size = plus + np.linalg.multi_dot(factors), np.abs(plus) + np.linalg.multi_dot([np.abs(f) for f in factors])
    value[np.abs(value) <= ZERO_SUM * size] = 0.0
    return np.asarray(value)


@dataclass(frozen=True)
class _Reduced:
    """Equations of motion with contact forces, and the conditions of the wheels, on their way to states.

    ``system`` has six inputs of each wheel behind those of the model. ``rows`` J and ``slip`` A (3 wheels, m).
    """

    system: Equations
    model: Mechanism
    contacts: Sequence[Contact]
    forces: Array
    rows: Array
    slip: Array
    independent: tuple[str, ...]

    def result(self) -> RollingEquations:
        system, m = self.system, self.system.dof
        tied, kept, h, normals = self._positions()
        driven, n, g, speeds = self._speeds(kept, h)
        inputs = len(self.model.inputs)
        stiffness = self._stiffness()
        # q = h z, q' = e z + p w, with p = h n and e = h g
        p, e = _product(h, n), _product(h, g)
        k, w = h.shape[1], n.shape[1]
        right = np.concatenate((
            -_product(p.T, system.M @ e @ g, plus=_product(p.T, stiffness, h, plus=_product(p.T, system.C, e))),
            -_product(p.T, system.M @ e @ n, plus=_product(p.T, system.C, p)), _product(p.T, system.B[:, :inputs])),
            axis=1)  # fmt: skip
        factor = system.inertia_factor @ p
        rates = gram_solution(factor, right)
        inverse = gram_solution(factor, np.eye(w))
        rates[np.abs(rates) <= ZERO_SUM * (np.abs(inverse) @ np.abs(right))] = 0.0
        a = np.block([[g, n], [rates[:, : k + w]]])
        b = np.concatenate((np.zeros((k, inputs)), rates[:, k + w :]))
        transform = np.block([[h, np.zeros((m, w))], [e, p]])
        c, d = self._outputs(transform, a, b, stiffness, inputs)
        free = [kept[i] for i in range(k) if i not in driven]
        names, units = system.coordinates, system.coordinate_units
        return RollingEquations(
            a, b, c, d, transform, (*[names[i] for i in kept], *[f"d({names[i]})/dt" for i in free]),
            (*[units[i] for i in kept], *[RATE_UNITS[units[i]] for i in free]), system,
            np.array([f @ s.directions for f, s in zip(self.forces.reshape(-1, 3), self.contacts, strict=True)]),
            np.array([s.spin for s in self.contacts]), tuple([names[i] for i in tied]),
            tuple([names[kept[i]] for i in driven]), (normals, speeds),
        )  # fmt: skip

    def _groups(self, kept: Sequence[int]) -> list[list[int]]:
        """Coordinates in the order in which they are made dependent: wheel angles, translations, other rotations."""
        system, names = self.system, self.system.coordinates
        for name in self.independent:
            if name not in names:
                raise ModelError(f"linearize: independent = {name!r} is not a coordinate of model '{self.model.name}'; "
                                 f"it has {', '.join(names)}.", element=name, field="independent")  # fmt: skip
        spins = set()
        for wheel, state in zip(self.model.rolling.values(), self.contacts, strict=True):
            motion = system.body_motion[system.bodies.index(wheel.body)]
            across = np.concatenate((motion[:3], np.cross(np.array(wheel.axis), motion[3:], axis=0)))
            spins |= {i for i in kept if motion[:, i].any() and np.abs(across[:, i]).max() <= ZERO_SUM
                      and abs(state.directions[1] @ state.rows @ motion[:, i]) > 0.0}  # fmt: skip
        wanted = {i for i in kept if names[i] in self.independent}
        shifts = {i for i in kept if system.coordinate_units[i] == "m"}
        order = (spins - wanted, shifts - wanted - spins, set(kept) - wanted - spins - shifts, wanted)
        return [[kept.index(i) for i in sorted(group)] for group in order]

    def _positions(self) -> tuple[list[int], list[int], Array, RankDecision]:
        """Coordinates that the normal rows tie, the others z, H (m, k) of q = H z, and the decision on the rank."""
        rows, m = self.rows[::3], self.system.dof
        groups = self._groups(range(m))
        tied, decision = dependent_columns(rows, groups[1:] + groups[:1], tuple(self.model.rolling))
        kept = [i for i in range(m) if i not in tied]
        h = np.zeros((m, len(kept)))
        h[kept, np.arange(len(kept))] = 1.0
        h[tied] = dependence(rows, tied, rows[:, kept])
        return tied, kept, h, decision

    def _speeds(self, kept: Sequence[int], h: Array) -> tuple[list[int], Array, Array, RankDecision]:
        """Coordinates z whose speeds follow from others, N (k, speeds) and G (k, k) of z' = N w + G z, and the decision
        on the rank.
        """
        along = np.arange(len(self.rows)) % 3 > 0
        rows, slip = _product(self.rows[along], h), _product(self.slip[along], h)
        driven, decision = dependent_columns(rows, self._groups(kept), tuple(self.model.rolling))
        free = [i for i in range(h.shape[1]) if i not in driven]
        got = [self.system.coordinates[kept[i]] for i in free]
        for name in self.independent:
            if name not in got:
                raise ModelError(f"linearize: independent = {list(self.independent)}; the speed of '{name}' follows "
                                 f"from the others. {len(got)} speeds are independent, such as those of "
                                 f"{', '.join(got)}.", element=name, field="independent")  # fmt: skip
        n, g = np.zeros((len(h.T), len(free))), np.zeros((len(h.T), len(h.T)))
        n[free, np.arange(len(free))] = 1.0
        n[driven], g[driven] = dependence(rows, driven, rows[:, free]), dependence(rows, driven, slip)
        left = rows @ g + slip
        if np.abs(left).max(initial=0.0) > DEPENDENT_ROWS * np.abs(slip).max(initial=0.0):
            names = ", ".join(f"'{name}'" for name in self.model.rolling)
            raise SingularPoseError(f"model '{self.model.name}': the wheels {names} roll without slip along the way "
                                    f"only; any deviation would make one slip ({len(driven)} of {len(rows)} conditions "
                                    f"are independent). Leave one out, or let it steer.")  # fmt: skip
        return driven, n, g, decision

    def _stiffness(self) -> Array:
        """K, with the moments of the contact forces about wheels whose contact points move along the edge."""
        result = self.system.K
        for wheel, state, along in zip(self.model.rolling.values(), self.contacts, self.forces.reshape(-1, 3),
                                       strict=True):  # fmt: skip
            turn = self.system.body_motion[self.system.bodies.index(wheel.body), 3:]
            result = _product(turn.T, skew(along @ state.directions) @ state.turned_arm, turn, plus=result)
        return result

    def _outputs(self, transform: Array, a: Array, b: Array, stiffness: Array, inputs: int) -> tuple[Array, Array]:
        """C and D of the outputs; forces in joints see those at the contacts."""
        system, m = self.system, self.system.dof
        position, speed = transform[:m], transform[m:]
        c = _product(system.Cq, position, plus=_product(system.Cv, speed, plus=_product(system.Ca, speed @ a)))
        d = _product(system.Ca, speed @ b, plus=system.D[:, :inputs])
        seen = system.D[:, inputs:]
        if not seen.any():
            return c, d
        force = np.linalg.pinv(self.rows.T, rcond=DEPENDENT_ROWS)
        undetermined = force @ self.rows.T - np.eye(len(self.rows))
        of_states = force @ (stiffness @ position + system.C @ speed + system.M @ speed @ a)
        of_inputs = force @ (system.M @ speed @ b - system.B[:, :inputs])
        for k, (wheel, state) in enumerate(zip(self.model.rolling.values(), self.contacts, strict=True)):
            turn = system.body_motion[system.bodies.index(wheel.body), 3:]
            own, sees = slice(3 * k, 3 * k + 3), seen[:, 6 * k : 6 * k + 6]
            wrench = sees @ state.rows.T @ state.directions.T
            for row in np.flatnonzero(np.abs(wrench @ undetermined[own]).max(axis=1) > DEPENDENT_ROWS):
                name = system.outputs[row]
                raise ModelError(f"output '{name}': the wheels share their contact forces in more than one way, so "
                                 f"that it is not determined; leave it out.", element=name)  # fmt: skip
            moment = -skew(self.forces[own] @ state.directions) @ state.turned_arm @ turn @ position
            c = c + wrench @ of_states[own] + sees[:, 3:] @ moment
            d = d + wrench @ of_inputs[own]
        return c, d
