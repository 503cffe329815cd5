"""From a mechanism to the statement of its finite motion.

On hubs, energies are those of what turns steadily, in the frame that turns with it. In that frame, which has the
angular velocity W, the kinetic energy of a body is that of the velocities v + W x (r - p) and w + W. Its parts are
T2 + T1 + T0, of second, first and no order in the rates: T1 is gyroscopic, -T0 the centrifugal potential. T2 + V - T0
is constant without dampers (Jacobi's integral).

Source: Meirovitch, Methods of Analytical Dynamics (1970), section 2.13.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.elements import Body
from mbsvib.elements.motion_input import DrivenCoordinate, acting_inputs
from mbsvib.elements.rotor import Rotor
from mbsvib.equations.hubs import check_steady, on_held, on_hubs, refuse_superelements, velocity
from mbsvib.errors import ModelError
from mbsvib.finite_motion.connections import connected
from mbsvib.finite_motion.elastic import elastic_energies
from mbsvib.finite_motion.elastic_block import ALL_SIX, ElasticBlock, elastic_blocks, with_interface
from mbsvib.finite_motion.excited import at_rest, touched, with_interfaces
from mbsvib.finite_motion.forces import (
    base_power,
    input_power,
    load_power,
    momentum_of,
    moved_end_force,
    rotor_momentum,
)
from mbsvib.finite_motion.frames import Expression
from mbsvib.finite_motion.kinematics import Kinematics, kinematics
from mbsvib.finite_motion.lagrange import FiniteMotion
from mbsvib.finite_motion.numbers import Numbers, not_a_symbol
from mbsvib.mechanism.mechanism import Mechanism

__all__ = ["FiniteMotion", "finite_motion"]


def finite_motion(
    model: Mechanism, parameters: Sequence[str] = (), *, cut: Sequence[str] | None = None, bases: bool = False,
    without: Sequence[str] = (), tree: Collection[str] = (),
) -> FiniteMotion:  # fmt: skip
    """Return the finite motion of a mechanism as expressions of CasADi.

    Beams and superelements are linear in the frame of the body that carries them; what of them neither the rest of the
    mechanism nor a force moves is left out.

    Parameters
    ----------
    model : Mechanism
        The mechanism; the coordinates are displacements from its pose.
    parameters : sequence of str
        Names of numbers that become symbols, ``motion.numbers.symbols``, so that all expressions can be differentiated
        to them: masses, centres, inertias, positions of joints, numbers of springs and loads, gravity.
    cut : sequence of str, optional
        Joints at which loops are to be cut.
    bases : bool
        Whether joints with three free rotations get a rotation on top of which theirs come.
    without : sequence of str
        Names of loads to leave out.
    tree : collection of str
        Joints that are to be in the spanning tree where ``cut`` is not given.

    Returns
    -------
    FiniteMotion
        Kinematics, energies and forces.

    Raises
    ------
    ModelError
        If a part has no statement in finite motion, by its name, or a parameter cannot be a symbol.
    """
    refuse_superelements(model)
    model = on_held(model)
    if model.composed:
        return _flexible(model, parameters, cut, bases, without, tree)
    return _stated(model, (), (), parameters, cut, bases, without, tree=tree)


def with_virtual_displacements(
    model: Mechanism, statement: FiniteMotion, joints: Sequence[str], without: Sequence[str] = ()
) -> FiniteMotion:
    """Return the finite motion of a mechanism with virtual displacements that its joints do not allow.

    Where these are 0 it is that of the mechanism; along them, mass @ q'' - f - J^T lambda is what the joints carry.

    ``joints``: the joints, and ``"ground"`` for what holds the ground. Six coordinates for each joint follow those of
    the mechanism.
    """
    topology, names = statement.motion.topology, set(statement.motion.names)
    cut = [topology.joints[k].name for k in topology.cut]
    inactive = [name for block in statement.blocks for name in block.mode_names if name not in names]
    plain = with_interfaces(on_held(model), statement.blocks)
    parameters = statement.motion.numbers.names
    return _stated(plain, statement.blocks, inactive, parameters, cut, bool(statement.motion.based), without, joints)


def _stated(
    model: Mechanism, blocks: Sequence[ElasticBlock], inactive: Collection[str], parameters: Sequence[str],
    cut: Sequence[str] | None, bases: bool, without: Sequence[str], joints: Sequence[str] = (),
    tree: Collection[str] = (),
) -> FiniteMotion:  # fmt: skip
    """The statement of a mechanism whose beams and superelements are blocks."""
    numbers = Numbers(model, parameters)
    motion = kinematics(model, numbers, cut, bases, blocks, inactive, joints, tree)
    parts = {name: connected(part, motion) for name, part in model.springs.items()}
    fall = numbers.gravity(model)
    requested = tuple(parameters)
    massive = {name: body for name, body in model.bodies.items()
               if body.mass or any(body.inertia) or any(word.startswith(f"{name}.") for word in requested)}  # fmt: skip
    kinetic = {name: body_energy(body, motion) for name, body in massive.items()}
    kinetic |= {name: part.kinetic for name, part in parts.items() if not part.kinetic.is_zero()}
    potential = {name: _weight(body, motion, fall) for name, body in massive.items()}
    potential |= {name: part.potential for name, part in parts.items()}
    loads = {name: load_power(part, model, motion) for name, part in model.loads.items() if name not in without}
    yields = {name: part for name, part in parts.items() if part.yields.numel()}
    bends = {block.name: elastic_energies(block, *motion.elastic[block.name], motion) for block in blocks}
    turning = replace(motion, spins=spins(model))
    bent = sum((part.momentum for part in bends.values()), ca.SX.zeros(3))
    acting = acting_inputs(model.inputs, model.springs)
    for part in acting.values():
        if isinstance(part, DrivenCoordinate):
            raise ModelError(f"motion input '{part.source}': a driven joint has no statement in finite motion; "
                             f"model.cycle prescribes the motion of '{part.element}' without this input.",
                             element=part.source)  # fmt: skip
    inputs = {
        name: base_power(part, massive.values(), bent, motion) if part.moves_ground else
        input_power(part, model, motion) if part.element is None else
        ca.dot(moved_end_force(part, parts[part.element]), motion.rate(parts[part.element].deformation))
        for name, part in acting.items() if not (part.moves_ground and any(part.wrench[3:]))
        and (part.element is None or not parts[part.element].yields.numel())
    }  # fmt: skip
    kinetic |= {name: part.kinetic for name, part in bends.items()}
    potential |= {name: part.potential for name, part in bends.items()}
    dissipation = {name: part.dissipation for name, part in (parts | bends).items()}
    gyroscopic = sum((rotor_term(part, motion) for part in model.rotors.values()), ca.SX(0.0))
    if turning.spins:
        whole = {name: body_energy(body, turning) for name, body in massive.items()}
        whole |= {name: rotor_term(part, turning) for name, part in model.rotors.items()}
        whole |= {block.name: elastic_energies(block, *motion.elastic[block.name], turning).kinetic for block in blocks}
        fields, gyroscopic = of_frame(whole, motion)
        potential = {name: potential.get(name, 0.0) + fields.get(name, 0.0) for name in (*potential, *fields)}
    numbers.check_taken()
    return FiniteMotion(
        motion, kinetic, gyroscopic, potential, dissipation, loads, inputs, parts,
        ca.vertcat(ca.SX(0, 1), *(part.yields for part in yields.values())), tuple([
            f"{name}.z" if part.yields.numel() == 1 else f"{name}.{k}" for name, part in yields.items()
            for k in range(part.yields.numel())]),
        ca.vertcat(ca.SX(0, 1), *(part.yield_rates for part in yields.values())), bends, tuple(blocks),
    )  # fmt: skip


def _flexible(
    model: Mechanism, parameters: Sequence[str], cut: Sequence[str] | None, bases: bool, without: Sequence[str],
    tree: Collection[str],
) -> FiniteMotion:  # fmt: skip
    """The statement of a mechanism with beams and superelements, without what of these stays at rest."""
    blocks = elastic_blocks(model)
    plain = with_interfaces(model, blocks)
    for name in parameters:
        if name in model.parameters and name not in plain.parameters:
            raise not_a_symbol(name)
    statement = _stated(plain, blocks, (), parameters, cut, bases, without, tree=tree)
    directions = touched(statement, blocks)
    if any(len(held) < len(ALL_SIX) for held in directions.values()):
        blocks = tuple([with_interface(block, directions) for block in blocks])
        statement = _stated(plain, blocks, (), parameters, cut, bases, without, tree=tree)
    inactive = at_rest(statement, blocks)
    return _stated(plain, blocks, inactive, parameters, cut, bases, without, tree=tree) if inactive else statement


def body_energy(body: Body, motion: Kinematics) -> Expression:
    """Return the kinetic energy [J] of a body, T = 1/2 m v . v + 1/2 w . I w."""
    numbers = motion.numbers
    v = motion.velocity(body.name, motion.point(body.name, numbers.vector(body, "position")))
    spin = ca.dot(motion.angular_velocity(body.name), momentum_of(body, motion))
    return 0.5 * numbers.scalar(body, "mass") * ca.dot(v, v) + 0.5 * spin


def rotor_term(rotor: Rotor, motion: Kinematics) -> Expression:
    """Return what a rotor of constant angular momentum h along an axis of its body adds to the Lagrangian [J], h . w.
    """
    if rotor.inertia is None:
        raise ModelError(
            f"rotor '{rotor.name}': body '{rotor.body}' itself spins, which is a motion of its joint in finite motion; "
            f"give the inertia of what spins on the body, or start with a rate of its joint.",
            element=rotor.name, field="inertia",
        )  # fmt: skip
    return ca.dot(rotor_momentum(rotor, motion), motion.angular_velocity(rotor.body))


def _weight(body: Body, motion: Kinematics, fall: Expression) -> Expression:
    centre = motion.numbers.vector(body, "position")
    return -motion.numbers.scalar(body, "mass") * ca.dot(fall, motion.point(body.name, centre) - centre)


def spins(model: Mechanism) -> dict[str, tuple[Array, Array]]:
    """Return the angular velocity (3,) [rad/s] and a point of the axis (3,) [m] of the hub of each body on one."""
    if not model.hubs:
        return {}
    of = on_hubs(model)
    check_steady(model, of)
    return {body: (velocity(model.hubs[hub]), np.array(model.hubs[hub].position)) for body, hub in of.items()}


def of_frame(energies: Mapping[str, Expression], motion: Kinematics) -> tuple[dict[str, Expression], Expression]:
    """Return -T0 [J] by name, 0 as described, and the sum of T1, of kinetic energies with turning frames."""
    none, pose = ca.SX.zeros(motion.qd.shape), ca.vertcat(motion.q, motion.bases)
    described = np.concatenate((np.zeros(motion.q.shape[0]), motion.no_turns))
    potentials = {}
    for name, energy in energies.items():
        still = ca.substitute(energy, motion.qd, none)
        potentials[name] = ca.substitute(still, pose, described) - still
    momenta = ca.gradient(sum(energies.values(), ca.SX(0.0)), motion.qd)
    return potentials, ca.dot(ca.substitute(momenta, motion.qd, none), motion.qd)
