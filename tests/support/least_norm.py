"""Forces in joints of least norm from scratch: every joint's wrench is unknown, bodies balance, nothing is reduced.

Minimum of sum |f|^2 + |m / L|^2 over all joints of one mechanism whose loops all hang together, moments about the
joints' points, L their root mean square distance from their mean; by the minimum's own linear equations.
"""

import numpy as np


def point_of(model, joint):
    """The joint's point; of one that has none the centre of its second body, on ground of its first."""
    if joint.point is not None:
        return np.array(joint.point)
    return np.array(model.bodies[joint.second if joint.second != "ground" else joint.first].position)


def length_of(model):
    points = np.array([point_of(model, joint) for joint in model.joints.values()])
    return np.sqrt(np.square(points - points.mean(axis=0)).sum() / len(points))


def joint_wrenches(model, applied):
    """Wrenches (joints, 6) on second bodies for wrenches ``applied`` (bodies, 6) at the centres of mass."""
    joints, couplers = list(model.joints.values()), list(model.couplers.values())
    number = {name: i for i, name in enumerate(model.bodies)}
    unknowns = 6 * len(joints) + len(couplers)
    balance = np.zeros((6 * len(number), unknowns))
    free = []
    for k, joint in enumerate(joints):
        for body, sign in ((joint.second, 1.0), (joint.first, -1.0)):
            if body == "ground":
                continue
            arm = point_of(model, joint) - model.bodies[body].position
            rows = slice(6 * number[body], 6 * number[body] + 6)
            for i, unit in enumerate(np.eye(6)):
                balance[rows, 6 * k + i] = sign * np.array([*unit[:3], *(unit[3:] + np.cross(arm, unit[:3]))])
        for direction, twist in joint.freedom:
            row = np.zeros(unknowns)
            row[6 * k : 6 * k + 6] = twist
            for c, coupler in enumerate(couplers):
                row[6 * len(joints) + c] = -dict(coupler.terms).get(f"{joint.name}.{direction}", 0.0)
            free.append(row)
    rows = np.concatenate((balance, np.array(free).reshape(-1, unknowns)))
    right = np.concatenate((-np.reshape(applied, -1), np.zeros(len(free))))
    weight = np.diag([*np.repeat((1.0, length_of(model) ** -2), 3).tolist() * len(joints), *np.zeros(len(couplers))])
    full = np.block([[weight, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    result, *_ = np.linalg.lstsq(full, np.concatenate((np.zeros(unknowns), right)), rcond=1e-12)
    assert np.abs(rows @ result[:unknowns] - right).max() < 1e-9 * max(1.0, np.abs(right).max()), "the bodies balance"
    return result[: 6 * len(joints)].reshape(-1, 6)


def at_rest(model):
    """Wrenches (bodies, 6) of gravity, loads and preloaded bushings at the centres of mass."""
    result = {name: np.zeros(6) for name in model.bodies}

    def put(body, point, force, torque):
        if body != "ground":
            at = model.bodies[body].position
            result[body] += [*force, *(torque + np.cross(np.subtract(at if point is None else point, at), force))]

    for name, body in model.bodies.items():
        put(name, None, body.mass * np.array(model.gravity or (0.0, 0.0, 0.0)), np.zeros(3))
    for load in model.loads.values():
        put(load.body, load.position, np.array(load.force), np.array(load.torque))
    for spring in model.springs.values():
        if not np.any(getattr(spring, "preload", None) or 0.0):
            continue
        axes = np.array(spring.orientation)
        force, torque = np.reshape(spring.preload, (2, 3)) @ axes.T
        put(spring.second, spring.position, force, torque)
        put(spring.first, spring.position, -force, -torque)
    return np.array(list(result.values()))
