"""Outputs of a run: displacements, velocities, accelerations, and forces in springs, since the pose as described."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from mbsvib.elements.bushing import Bushing
from mbsvib.elements.ports import BaseMotion, ForceOutput, Output
from mbsvib.elements.torsion_spring import TorsionSpring
from mbsvib.finite_motion.forces import velocity
from mbsvib.finite_motion.rotations import logarithm
from mbsvib.simulation.states import continued

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.finite_motion.lagrange import FiniteMotion
    from mbsvib.finite_motion.rotations import Expression
    from mbsvib.mechanism.mechanism import Mechanism

# Where the force of an element stands among the six of its axes.
ABOUT_Z, ALONG_Z = 5, 2


@dataclass(frozen=True)
class Measured:
    """Outputs as functions (q, q', q'', y, bases, u) -> (values, rotation vectors, angular velocities, rates).

    ``weights`` (outputs, 3) are those of the rotation vectors; ``refused`` tells why outputs have no value, and
    ``needs_accelerations`` whether q'' has an effect.
    """

    names: tuple[str, ...]
    weights: Array
    function: Any
    refused: Mapping[str, str]
    needs_accelerations: bool

    def values(self, time: Array, arguments: tuple[Array, ...]) -> tuple[dict[str, Array], dict[str, Array]]:
        """Return all outputs and their rates by name, (samples,) each.

        ``arguments`` are those of the function, (n, samples) each. The rates of accelerations and forces are not
        told; they are NaN.
        """
        values, vectors, spins, rates = (np.asarray(array) for array in self.function(*arguments))
        result, slope = {}, {}
        for i, name in enumerate(self.names):
            result[name] = values[i]
            if self.weights[i].any():
                own = slice(3 * i, 3 * i + 3)
                result[name] = values[i] + continued(vectors[own].T, spins[own].T, time) @ self.weights[i]
            slope[name] = rates[i]
        return result, slope


def measured(model: Mechanism, statement: FiniteMotion) -> Measured:
    """Return the outputs of a model.

    Parameters
    ----------
    model : Mechanism
        The model.
    statement : FiniteMotion
        Its finite motion.

    Returns
    -------
    Measured
        What they are in any state.
    """
    motion = statement.motion
    qdd = ca.SX.sym("qdd", len(motion.names))
    values: list[Expression] = []
    vectors: list[Expression] = []
    spins: list[Expression] = []
    rates: list[Expression] = []
    weights: list[Array] = []
    names: list[str] = []
    refused: dict[str, str] = {}
    u = ca.SX.sym("u", len(statement.inputs))
    base = {name: part for name, part in model.inputs.items() if isinstance(part, BaseMotion)}
    ground = sum((u[i] * ca.SX(np.array(base[name].wrench[:3])) for i, name in enumerate(statement.inputs) if name in
                  base), ca.SX.zeros(3))  # fmt: skip

    def onward(expression: Expression) -> Expression:
        """The rate of an expression of q and q'."""
        return motion.rate(expression) + ca.jtimes(expression, motion.qd, qdd)

    for name, part in model.outputs.items():
        vector, spin, weight = ca.SX.zeros(3), ca.SX.zeros(3), np.zeros(3)
        if type(part) is Output and part.inertial and base and part.quantity != "acceleration":
            refused[name] = (f"output '{name}': an absolute {part.quantity} would integrate the acceleration of the "
                             f"ground; ask for absolute=False")  # fmt: skip
            continue
        if type(part) is Output:
            point = ca.SX(np.array(model.bodies[part.body].position if part.position is None and part.body in
                                   model.bodies else part.position or (0.0, 0.0, 0.0)))  # fmt: skip
            (v, w), (v0, w0) = velocity(motion, part.body, point), velocity(motion, part.relative_to, point)
            wrench = np.array(part.wrench)
            speed = ca.dot(ca.SX(wrench[:3]), v - v0) + ca.dot(ca.SX(wrench[3:]), w - w0)
            if part.quantity == "displacement":
                apart = motion.point(part.body, point) - motion.point(part.relative_to, point)
                value, rate = ca.dot(ca.SX(wrench[:3]), apart), speed
                if wrench[3:].any():
                    turn = motion.frames[part.body].rotation @ motion.frames[part.relative_to].rotation.T
                    vector, spin, weight = logarithm(turn), w - w0, wrench[3:]
            elif part.quantity == "velocity":
                value, rate = speed, onward(speed)
            else:
                value, rate = onward(speed), ca.SX(np.nan)
                if part.inertial:
                    value += ca.dot(ca.SX(wrench[:3]), ground)
        elif isinstance(part, ForceOutput) and part.element in statement.connections:
            value = _force(model, part, statement, onward)
            rate = ca.SX(np.nan)
        else:
            refused[name] = f"output '{name}': a run tells no forces in joints and no strain yet"
            continue
        names.append(name)
        values.append(value)
        vectors.append(vector)
        spins.append(spin)
        rates.append(rate)
        weights.append(weight)
    arguments = [motion.q, motion.qd, qdd, statement.yields, motion.bases, u]
    function = ca.Function("outputs", arguments, [
        ca.vertcat(*part) for part in (values, vectors, spins, rates)])  # fmt: skip
    return Measured(tuple(names), np.array(weights).reshape(-1, 3), function, refused,
                    bool(ca.depends_on(ca.vertcat(*values, *rates), qdd)))  # fmt: skip


def _force(model: Mechanism, part: ForceOutput, statement: FiniteMotion, onward: Any) -> Expression:
    """The force in an element along a direction of its axes, less that in the pose as described."""
    element, connection = model.springs[part.element], statement.connections[part.element]
    force = connection.force
    if hasattr(element, "inertance"):
        force = element.inertance * onward(statement.motion.rate(connection.deformation))
    six = ca.SX.zeros(6)
    if isinstance(element, Bushing):
        six = force
    else:
        six[ABOUT_Z if isinstance(element, TorsionSpring) else ALONG_Z] = force
    along = ca.dot(ca.SX(np.array(part.wrench)), six)
    q, qd, y = statement.motion.q, statement.motion.qd, statement.yields
    rest = ca.Function("rest", [q, qd, y, statement.motion.bases], [ca.dot(ca.SX(np.array(part.wrench)), six)]) if not \
        hasattr(element, "inertance") else None  # fmt: skip
    if rest is None:
        return along
    eye = np.tile(np.eye(3).reshape(-1), len(statement.motion.based))
    return along - float(rest(np.zeros(q.shape), np.zeros(qd.shape), np.zeros(y.shape), eye))
