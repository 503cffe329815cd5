"""One small mechanism of each class of damping, and its first-order equations written down by hand.

Three sliders between two walls, spring-dampers between neighbours, and a Maxwell element from the first to the last;
or a spinning wheel that tilts about two axes. Parameters have the names of the model's.
"""

import numpy as np
from scipy.linalg import expm

import mbsvib as mv

MASSES, STIFFNESS = (2.0, 1.0, 3.0), (900.0, 400.0, 700.0, 500.0)


def values(damping=(0.0,) * 4, stiffness=STIFFNESS, maxwell=None):
    """The parameters of the sliders."""
    result = {f"b{i}.mass": mass for i, mass in enumerate(MASSES)}
    for i in range(4):
        result |= {f"s{i}.stiffness": stiffness[i], f"s{i}.damping": damping[i]}
    return result | ({} if maxwell is None else {"mx.stiffness": maxwell[0], "mx.damping": maxwell[1]})


# second mode of the sliders without dampers, rad/s: where it is critically damped by dampers proportional to springs
K0 = np.array([[1300.0, -400.0, 0.0], [-400.0, 1100.0, -700.0], [0.0, -700.0, 1200.0]]) / np.sqrt(
    np.outer(MASSES, MASSES))  # fmt: skip
SECOND = float(np.sqrt(np.linalg.eigvalsh(K0)[1]))
FREE = (0.0, 400.0, 700.0, 0.0)
CLASSES = {
    "undamped": values(), "proportional": values(tuple(0.003 * k for k in STIFFNESS)),
    "critical": values(tuple(2 / SECOND * k for k in STIFFNESS)), "coupled": values((0.0, 3.0, 0.0, 0.5)),
    "defective": values((0.0, 0.0, 52.77897913776029, 0.0)),  # where two real eigenvalues of coupled modes meet
    "overdamped": values((300.0, 200.0, 250.0, 180.0)), "one overdamped": values((0.0, 0.0, 220.0, 0.0)),
    "strong damper": values((0.0, 5e3, 2.0, 0.0)), "free": values(stiffness=FREE),
    "free and coupled": values((0.0, 3.0, 0.5, 0.0), FREE), "braked": values((4.0, 0.0, 1.0, 0.0), FREE),
    "two brakes": values((4.0, 1.0, 0.0, 0.0), (0.0, 0.0, 700.0, 0.0)),
    "free and braked": values((0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 700.0, 0.0)),
    "unstable": values((0.0, 1.0, 0.0, 2.0), (900.0, 400.0, 700.0, -900.0)),
    "relaxation": values((0.0, 3.0, 0.0, 0.5), maxwell=(600.0, 20.0)),
    "relaxation alone": values(maxwell=(600.0, 20.0)),
    "spinning": {"wheel.inertia.xx": 0.4, "wheel.inertia.yy": 0.5, "spin.inertia": 0.6, "spin.speed": 9.0,
                 "k.stiffness.rx": 30.0, "k.stiffness.ry": 50.0, "k.damping.rx": 0.0, "k.damping.ry": 0.0},
}  # fmt: skip
CLASSES["spinning and damped"] = CLASSES["spinning"] | {"k.damping.rx": 0.7}
UNDAMPED_OR_FREE = ("undamped", "free", "free and coupled", "braked", "two brakes", "free and braked",
                    "spinning", "unstable")  # fmt: skip


def model(p):
    """The mechanism with these parameters."""
    result = mv.Model("class")
    if "spin.speed" in p:
        result.add_body("wheel", 1.0, (p["wheel.inertia.xx"], p["wheel.inertia.yy"], 0.6))
        result.add_joint("tilt", "universal", "ground", "wheel", (0, 0, 0))
        ways = (0, 0, 0, p["k.stiffness.rx"], p["k.stiffness.ry"], 0), (
            0, 0, 0, p["k.damping.rx"], p["k.damping.ry"], 0)  # fmt: skip
        result.add_bushing("k", "ground", "wheel", (0, 0, 0), *ways)
        result.add_rotor("spin", "wheel", p["spin.speed"], (0, 0, 1), inertia=p["spin.inertia"])
        ends, way = ("wheel", "wheel"), ("rx", "ry")
    else:
        for i in range(3):
            result.add_body(f"b{i}", p[f"b{i}.mass"], (1.0, 1.0, 1.0), (i + 1.0, 0, 0))
            result.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        names = ("ground", "b0", "b1", "b2", "ground")
        for i in range(4):
            if p[f"s{i}.stiffness"] or p[f"s{i}.damping"]:
                result.add_spring(f"s{i}", names[i], names[i + 1], (float(i), 0, 0), (i + 1.0, 0, 0),
                                  stiffness=p[f"s{i}.stiffness"], damping=p[f"s{i}.damping"])  # fmt: skip
        if "mx.stiffness" in p:
            result.add_maxwell("mx", "b0", "b2", (1, 0, 0), (3, 0, 0), p["mx.stiffness"], p["mx.damping"])
        ends, way = ("b0", "b2"), ("x", "x")
    for i in range(2):
        result.add_input(f"F{i}", ends[i], way[i])
    for quantity in ("displacement", "velocity", "acceleration"):
        result.add_output(quantity, ends[1], way[1], quantity=quantity)
    return result


def by_hand(p):
    """A, B, C, D with the states q, q' and the force in the Maxwell element."""
    if "spin.speed" in p:
        m = np.diag([p["wheel.inertia.xx"], p["wheel.inertia.yy"]])
        k, c = (np.diag([p[f"k.{what}.rx"], p[f"k.{what}.ry"]]) for what in ("stiffness", "damping"))
        h = p["spin.inertia"] * p["spin.speed"]
        c = c + np.array([[0.0, h], [-h, 0.0]])  # -[h]x
        push, at = np.eye(2), 1
    else:
        m = np.diag([p[f"b{i}.mass"] for i in range(3)])
        rows = np.array([[1.0, 0, 0], [-1, 1, 0], [0, -1, 1], [0, 0, -1]])
        k, c = (rows.T @ np.diag([p[f"s{i}.{what}"] for i in range(4)]) @ rows for what in ("stiffness", "damping"))
        push, at = np.eye(3)[:, [0, 2]], 2
    n = len(m)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(m, k), -np.linalg.solve(m, c)]])
    b = np.vstack((np.zeros((n, 2)), np.linalg.solve(m, push)))
    if "mx.stiffness" in p:  # f' = k (x2' - x0') - k / c f
        pull = np.array([1.0, 0, -1])
        a = np.block([[a, np.vstack((np.zeros((n, 1)), np.linalg.solve(m, pull)[:, None]))],
                      [np.zeros((1, n)), -p["mx.stiffness"] * pull[None], np.array(
                          [[-p["mx.stiffness"] / p["mx.damping"]]])]])  # fmt: skip
        b = np.vstack((b, np.zeros((1, 2))))
    c = np.array([np.eye(len(a))[at], np.eye(len(a))[n + at], a[n + at]])
    return a, b, c, np.vstack((np.zeros((2, 2)), b[n + at]))


def frequency_response(p, omega):
    a, b, c, d = by_hand(p)
    s = 1j * np.asarray(omega)[:, None, None]
    return np.moveaxis(c @ np.linalg.solve(s * np.eye(len(a)) - a, np.broadcast_to(b, (len(s), *b.shape))) + d, 0, -1)


def time_response(p, t, u, hold, initial):
    """Outputs at the samples by the exponential of the states and inputs of each step."""
    a, b, c, d = by_hand(p)
    n = len(a)
    x = np.zeros(n)
    start = np.concatenate(initial)
    x[: len(start)] = start
    y = [c @ x + d @ u[:, 0]]
    for i, h in enumerate(np.diff(t)):
        full = np.zeros((n + 4, n + 4))
        full[:n, :n], full[:n, n : n + 2], full[n : n + 2, n + 2 :] = a, b, np.eye(2)
        slope = (u[:, i + 1] - u[:, i]) / h if hold == "first" else np.zeros(2)
        x = (expm(full * h) @ np.concatenate((x, u[:, i], slope)))[:n]
        y.append(c @ x + d @ u[:, i + 1])
    return np.array(y).T


def slope(of, p, name, step=1e-4):
    """d of(p) / d name by central differences, extrapolated."""
    h = step * max(abs(p[name]), 1.0)
    near, far = ((of(p | {name: p[name] + x}) - of(p | {name: p[name] - x})) / (2 * x) for x in (h, 2 * h))
    return (4 * near - far) / 3


