"""The work H(x, y) of forces at the pose on small motions to second order: the geometric stiffness, with derivatives.

Bodies move by exponentials of twists. A force f and torque t at p on a second body, that go with the first one as those
of joints and bushings do, see its motion (v, w) at p and the relative one (V, W) to second order; between motions x, y

H = f . (w_x x V_y - W_x x v_y - W_x x V_y) / 2 + t . (w_x x W_y) / 2 + the same with x and y exchanged

and across a line e of length L that carries T, T/L V_x . (1 - e e^T) V_y more. With two successive rotations about a
and b, by x_a and x_b, half of t . (a x b) (x_a y_b + x_b y_a) is added. Weights and dead forces are forces against
ground. What has no potential is antisymmetric: t . (w_x x W_y) / 2 of dead torques, -f . (w_x x v_y - w_y x v_x) / 2 -
t . (w_x x w_y) / 2 of forces and torques that follow their body, all of their part. At rest, where the forces on every
body cancel, the sum of H is the geometric stiffness.

Source: Baker-Campbell-Hausdorff, log(exp(-x) exp(y)) = y - x - [x, y] / 2, put into the Lagrangian.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.vectors import cross, dot, wide

if TYPE_CHECKING:
    from mbsvib.linalg.vectors import Field
    from mbsvib.sensitivities.forces import Forces


def motion_slopes(forces: Forces, relative_motions: tuple[Field, Field], side: int = 0) -> tuple[Field, Field]:
    """Return the derivatives (n, 6, ...) of H(x, y) to what forces see of one motion, for what they see of the other:
    to that of the first body, and to the relative one.

    ``relative_motions`` (n, 6, ...): what they see of the other; ``side``: 1: that is y; -1: that is x; 0: both are the
    same motion, for which nothing antisymmetric counts.
    """
    (first, relative), like = relative_motions, relative_motions[0]
    f, t = wide(forces.wrench[:, :3], like), wide(forces.wrench[:, 3:], like)
    v, w, rv, rw = first[:, :3], first[:, 3:], relative[:, :3], relative[:, 3:]
    across = rv - wide(forces.line, like) * dot(wide(forces.line, like), rv)
    on_first = 0.5 * np.concatenate((cross(rw, f), cross(rw, t) + cross(rv, f)), axis=1)
    on_both = 0.5 * np.concatenate((cross(f, w - rw), cross(t, w) + cross(f, v + rv)), axis=1)
    on_both[:, :3] += wide(forces.tension_over_length[:, None], like) * across
    if len(forces.twice):
        on_both[forces.twice, 3:] += 0.5 * wide(forces.couple, like) * _coupled(forces, rw[forces.twice])
    k = forces.follower
    on_both[k] = 0.0
    if side:
        on_both[forces.dead, 3:] += 0.5 * side * cross(rw, t)[forces.dead]
        on_both[k, :3] = 0.5 * side * cross(f[k], rw[k])
        on_both[k, 3:] = -0.5 * side * (cross(rw[k], t[k]) + cross(rv[k], f[k]))
    return on_first, on_both


def geometric_wrenches(forces: Forces, body: Field, side: int, turned: Field | None = None) -> Field:
    """Return the wrenches (bodies, 6, ...) at the centres of mass by which forces answer motions, as springs do;
    ``side`` as of ``motion_slopes``, joints ``turned`` open (joints, 3, ...): t . (turned x W) / 2 more in H.
    """
    on_first, on_both = motion_slopes(forces, forces.relative_motions(body), side)
    if turned is not None:
        joints = forces.counts[0]
        on_both[:joints, 3:] += 0.5 * cross(wide(forces.wrench[:joints, 3:], turned), turned)
    return forces.onto_bodies(on_first - on_both, on_both)


def wrench_slopes(forces: Forces, x: tuple[Field, Field], y: tuple[Field, Field] | None) -> Field:
    """Return the derivatives of H(x, y) to the wrenches, (n, 6, ...), by which bodies give way. None: y = x."""
    same, y = y is None, x if y is None else y
    (a, r), (b, s) = x, y
    force = 0.5 * (cross(a[:, 3:], s[:, :3]) - cross(s[:, 3:], a[:, :3]) + cross(b[:, 3:], r[:, :3])
                   - cross(r[:, 3:], b[:, :3]) - cross(r[:, 3:], s[:, :3]) - cross(s[:, 3:], r[:, :3]))  # fmt: skip
    torque = 0.5 * (cross(a[:, 3:], s[:, 3:]) + cross(b[:, 3:], r[:, 3:]))
    line = wide(forces.line, force)
    across = dot(r[:, :3], s[:, :3]) - dot(line, r[:, :3]) * dot(line, s[:, :3])
    force -= line * wide(1.0 / forces.length[:, None], force) * across
    if len(k := forces.twice):
        torque[k] += 0.5 * wide(forces.normal[k], torque) * dot(_coupled(forces, r[k, 3:]), s[k, 3:])
    follower = forces.follower
    force[follower] = 0.0
    if not same:
        turned = 0.5 * cross(r[:, 3:], s[:, 3:])
        torque[forces.dead] += turned[forces.dead]
        torque[follower] = -turned[follower]
        r, s = r[follower], s[follower]
        force[follower] = 0.5 * (cross(s[:, 3:], r[:, :3]) - cross(r[:, 3:], s[:, :3]))
    return np.concatenate((force, torque), axis=1)


def point_slopes(forces: Forces, x: tuple[Field, Field], y: tuple[Field, Field] | None) -> tuple[Field, Field]:
    """Return the derivatives of H(x, y) to the points of forces and to the starts of lines, (n, 3, ...) each, while
    bodies move and are loaded as they are. None: y = x.
    """
    if y is None:
        point, y = 2.0 * _levers(motion_slopes(forces, x), x), x
    else:
        point = _levers(motion_slopes(forces, x, -1), y) + _levers(motion_slopes(forces, y, 1), x)
    r, s = x[1][:, :3], y[1][:, :3]
    line = wide(forces.line, point)
    tension_over_length = wide(forces.tension_over_length[:, None], point)
    inverse = wide(1.0 / forces.length[:, None], point)
    along, along_other = dot(line, r), dot(line, s)
    turned = r * along_other + s * along
    turned = turned - line * dot(line, turned)
    stretched = -tension_over_length * inverse * (turned + line * (dot(r, s) - along * along_other))
    return point + stretched, -stretched


def _levers(slopes: tuple[Field, Field], relative_motions: tuple[Field, Field]) -> Field:
    """What moving the points of forces does to slopes times motions."""
    (on_first, on_both), (first, relative) = slopes, relative_motions
    return np.asarray(cross(on_first[:, :3], first[:, 3:]) + cross(on_both[:, :3], relative[:, 3:]))


def turn_slopes(forces: Forces, x: tuple[Field, Field], y: tuple[Field, Field]) -> Field:
    """Return the derivatives of H(x, y) to turns of joints with two successive rotations, (joints, 3, ...)."""
    k = forces.twice
    r, s = x[1][k, 3:], y[1][k, 3:]
    on_r, on_s = _coupled(forces, s), _coupled(forces, r)
    normal = wide(np.cross(forces.normal[k], forces.wrench[k, 3:]), on_r)
    return np.asarray(0.5 * (normal * dot(on_r, r) - wide(forces.couple, on_r) * (cross(r, on_r) + cross(s, on_s))))


def work_slopes(forces: Forces, left: Field, gap: Field) -> tuple[Field, Field, Field]:
    """Return the derivatives of minus the work of the forces on relative motions ``left`` + ``gap``, to the wrenches
    (n, 6, ...), their points (n, 3, ...) and the starts of lines (n, 3, ...).

    ``left`` (n, 6, ...): what is left of the motions where bodies give way by ``gap``; 0 in joints, which allow it;
    ``gap`` (n, 6, ...): how far bodies give way, see ``wrench_slopes``.
    """
    f, line = wide(forces.wrench[:, :3], left), wide(forces.line, left)
    across = left[:, :3] - line * dot(line, left[:, :3])
    stretched = wide(forces.tension_over_length[:, None], left) * across
    return -left, stretched - cross(f, left[:, 3:] + gap[:, 3:]), -stretched


def _coupled(forces: Forces, turn: Field) -> Field:
    """The derivatives of x_a y_b + x_b y_a to the relative rotation of y, for that of x (joints, 3, ...)."""
    p, q = (wide(pick[forces.twice], turn) for pick in forces.picks)
    return np.asarray(p * dot(q, turn) + q * dot(p, turn))
