"""Hubs in finite motion: energies of what turns steadily, in the frame that turns with it.

In that frame, which has the angular velocity W, the kinetic energy of a body is that of the velocities v + W x (r - p)
and w + W. Its parts are T2 + T1 + T0, of second, first and no order in the rates: T1 is gyroscopic, -T0 the centrifugal
potential. T2 + V - T0 is constant without dampers (Jacobi's integral).

Source: Meirovitch, Methods of Analytical Dynamics (1970), section 2.13.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from mbsvib.equations.hubs import check_steady, on_hubs, velocity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from mbsvib.common.arrays import Array
    from mbsvib.finite_motion.kinematics import Kinematics
    from mbsvib.finite_motion.rotations import Expression
    from mbsvib.mechanism.mechanism import Mechanism


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
