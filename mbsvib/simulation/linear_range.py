"""How far the linear model holds: amplitudes at which the second-order part of a free vibration reaches a share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.errors import ModelError
from mbsvib.finite_motion.statement import finite_motion
from mbsvib.kinematics.pose import size_of
from mbsvib.simulation.outputs import measured
from mbsvib.simulation.reactions import is_reaction
from mbsvib.simulation.second_order import SecondOrder, second_order

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.equations.equations import Equations
    from mbsvib.mechanism.mechanism import Mechanism
    from mbsvib.modes.result import Modes

# Parts of outputs below this share of the terms that they are sums of are rounding.
ROUNDING = 1e-10
# Outputs that a mode moves by less than this share of what its coordinates could are rounding of its shape.
NOT_SHOWN = 1e-8
# Outputs whose second-order part is as large as the first when a coordinate has moved by this much [rad, mechanism
# sizes] have no first-order part: poses, also those of equilibria, are known no better.
POSE = 1e-11
# Modes must solve the equations of finite motion, linearized, to this share of the forces: another model otherwise.
SAME_EQUATIONS = 1e-6


def linear_range(system: Equations, modes: Modes, share: float) -> tuple[Array, Array]:
    """Return the amplitude of each output in each mode at which the second-order part reaches a share of the first.

    Returns (modes, outputs): amplitudes [unit of the output]; inf where there is no second-order part; (modes,
    outputs): amplitudes of the coordinate of largest motion there [rad, mechanism sizes].
    """
    model = _mechanism(system)
    statement = finite_motion(model, cut=system.cut_joints)
    if statement.yields.numel():
        element = statement.yield_names[0].rpartition(".")[0]
        family = model.springs[element].family
        raise ModelError(f"linear_range: '{element}' is a {family}, whose first-order state has no second-order "
                         f"part here yet; compare with model.simulate().", element=element)  # fmt: skip
    names = statement.motion.names
    unknown = [name for name in system.coordinates if name not in names]
    if unknown:
        raise ModelError(f"linear_range: '{unknown[0]}' is not a coordinate of finite motion; linearize with others as "
                         f"independent=[...]. It has {', '.join(names[:8])}.")  # fmt: skip
    motions = {name: part for name, part in model.outputs.items() if not is_reaction(model, part)}
    outputs = measured(model.with_parts(outputs=motions), statement)
    independent = np.array([names.index(name) for name in system.coordinates], dtype=np.intp)
    parts = second_order(statement, outputs, independent, np.zeros(len(statement.inputs)))
    scale, _ = statement.motion.scales(size_of(model))
    values, travel = (np.full((len(modes), len(system.outputs)), np.nan) for _ in range(2))
    columns = [outputs.names.index(name) for name in system.outputs if name in outputs.names]
    selected = [i for i, name in enumerate(system.outputs) if name in outputs.names]
    for k in range(len(modes)):
        reached, moved = _of_mode(parts, modes.shapes[:, k], modes.pairs[k, 0], scale, share)
        values[k, selected], travel[k, selected] = reached[columns], moved[columns]
    return values, travel


def _mechanism(system: Equations) -> Mechanism:
    """The model in whose pose a system is linear."""
    origin = system.provenance
    if origin.from_matrices or origin.truncation is not None or origin.closed_loop or origin.origin is None:
        raise ModelError(f"linear_range: '{system.name}' is not the system of a mechanism alone (it is reduced, closed "
                         f"by a controller, or made of matrices); ask model.linearize().")  # fmt: skip
    if origin.moved_to_equilibrium:
        raise ModelError(f"linear_range: '{system.name}' is linear about another pose than the model's; ask "
                         f"model.equilibrium().linearize().")  # fmt: skip
    if origin.removed is not None or origin.separation is not None:
        raise ModelError(f"linear_range: coordinates of '{system.name}' were condensed or left out; ask the system as "
                         f"linearized, and give every motion a mass.")  # fmt: skip
    if origin.origin.composed:
        part = next(iter(origin.origin.composed))
        raise ModelError(f"linear_range: '{part}' is a beam or superelement, whose modes are other coordinates in "
                         f"finite motion; compare with model.simulate().", element=part)  # fmt: skip
    return origin.origin


def _of_mode(parts: SecondOrder, shape: Array | Complex, s: complex, scale: Array, share: float) -> \
        tuple[Array, Array]:  # fmt: skip
    """Amplitudes (outputs,) of outputs and of the coordinate of largest motion, in one mode."""
    n = len(scale)
    if parts.residual(shape, s) > SAME_EQUATIONS and s != 0.0:
        raise ModelError("linear_range: the modes do not solve the equations of finite motion in this pose; linearize "
                         "the model as it is described.")  # fmt: skip
    x = parts.first(shape, s)
    first = np.abs(parts.outputs @ x[: 3 * n])
    amplitude = float(np.abs(x[:n] / scale).max())
    units = amplitude * np.concatenate((scale, abs(s) * scale, abs(s) ** 2 * scale))
    noise = NOT_SHOWN * np.abs(parts.outputs) @ units
    kinematic, largest = np.zeros(len(first)), np.zeros(len(first))
    reached = True
    for rate, (force, opening, direct) in zip((2.0 * s, s + np.conj(s)), parts.along(x), strict=True):
        follow = parts.dependent_part(opening)
        kinematic += np.abs(direct + parts.outputs @ _motion(follow, rate))
        if s != 0.0:
            q, exists = parts.forced(force, opening, rate)
            reached &= exists
            largest = np.maximum(largest, np.abs(direct + parts.outputs @ _motion(q, rate)))
    second = np.maximum(kinematic, largest)
    second[second <= ROUNDING * first * amplitude] = 0.0
    first[(first <= noise) | (first * amplitude <= POSE * second)] = 0.0
    size = np.divide(share * first, second, out=np.full(len(first), np.inf), where=second > 0.0)
    if not reached:
        size[:] = 0.0
    values = np.where(second > 0.0, 0.0, np.inf)
    np.multiply(size, first, out=values, where=first > 0.0)
    return values, size * amplitude


def _motion(q: Complex, s: complex) -> Complex:
    return np.concatenate((q, s * q, s**2 * q))
