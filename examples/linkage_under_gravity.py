"""A four-bar linkage on a spring, under gravity: where it comes to rest, and why gravity counts twice.

Its own weight takes the linkage away from how it was drawn, and ``equilibrium`` finds out where to. Then gravity acts a
second time: pins and spring carry forces, whose second-order terms K_g are part of the stiffness. With q the crank's
angle, V(q) the potential and M(q) the inertia that the crank feels,

    V'(q) = 0,    omega^2 = V''(q) / M(q);    the minimum of V is the pose found, its curvature K + K_g.
"""

import numpy as np

import mbsvib as mv

GRAVITY, HOOK = 9.81, (0.4, 0, 1.1)
A, B, C, D = (np.array(point) for point in ((0, 0, 0), (0.2, 0, 0.25), (1.05, 0, 0.65), (1.2, 0, 0)))  # pins [m]

drawn = mv.Model("linkage", gravity=(0, 0, -GRAVITY))
for name, p, q in (("crank", A, B), ("coupler", B, C), ("rocker", C, D)):
    length, tilt = float(np.linalg.norm(q - p)), -np.arctan2((q - p)[2], (q - p)[0])
    inertia = (1e-4, length**3 / 6, length**3 / 6)  # 2 kg a metre
    drawn.add_body(name, 2.0 * length, inertia, (p + q) / 2, orientation=(0, tilt, 0))
chain = ("ground", "crank", "coupler", "rocker", "ground")
for pin, point, first, second in zip("ABCD", (A, B, C, D), chain, chain[1:], strict=False):
    drawn.add_joint(pin, "revolute", first, second, point, axis=(0, -1, 0))
drawn.add_spring("spring", "ground", "coupler", HOOK, (B + C) / 2, stiffness=60.0, damping=0.5, free_length=0.3)

found = drawn.equilibrium(report=True)
rest = found.model
print(found)
system = rest.linearize(independent=["A.rz"])
spring = system.row_owner == 0  # the rows that the spring owns; those of K_g are others'
elastic = float(system.row_stiffness[spring] @ system.elastic_rows[spring, 0] ** 2)
right, wrong = system.modes().frequencies[0], np.sqrt(elastic / system.M[0, 0]) / (2 * np.pi)
print(f"{right:.4f} Hz; {wrong:.4f} Hz if gravity and the spring's tension counted once")


def potential(angle):
    """Weight and spring [J] when the crank is turned by an angle and the linkage goes along."""
    model = rest.moved({"A.rz": angle})
    lifted = sum(body.mass * GRAVITY * body.position[2] for body in model.bodies.values())
    middle = np.add(model.joints["B"].position, model.joints["C"].position) / 2
    return lifted + 30.0 * (np.linalg.norm(middle - HOOK) - 0.3) ** 2


angles = np.linspace(-0.9, 0.9, 61)
energy = np.array([potential(angle) for angle in angles])
assert abs(angles[np.argmin(energy)]) < 1e-12
h = 2e-3
v = [potential(k * h) for k in (-2, -1, 0, 1, 2)]
assert abs(v[0] - 8 * v[1] + 8 * v[3] - v[4]) / (12 * h) < 1e-9
assert np.isclose(system.K[0, 0], (-v[0] + 16 * v[1] - 30 * v[2] + 16 * v[3] - v[4]) / (12 * h**2), rtol=1e-7)
held = drawn.equilibrium(preload="spring")
print(f"{held.springs['spring'].preload:.3f} N in the spring hold it as drawn")


def draw():
    """The linkage as drawn and at rest, and its potential."""
    import matplotlib.pyplot as plt

    figure, (scene, curve) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for model, style, label in ((drawn, "C7--", "as drawn"), (rest, "C0-", "at rest")):
        x, _, z = np.array([model.joints[pin].position for pin in "ABCD"]).T
        scene.plot(x, z, style, marker="o", label=label)
        scene.plot((HOOK[0], (x[1] + x[2]) / 2), (HOOK[2], (z[1] + z[2]) / 2), f"{style[:2]}:")
    scene.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="A four-bar linkage on a spring")
    curve.plot(np.degrees(angles), energy - v[2], "C0", label="potential")
    curve.plot(np.degrees(angles), system.K[0, 0] * angles**2 / 2, "C1--", label="(K + K_g) q²/2")
    curve.plot(np.degrees(angles), elastic * angles**2 / 2, "C3:", label="K q²/2 alone")
    curve.set(xlabel="crank [deg]", ylabel="energy [J]", title=f"{right:.3f} Hz, not {wrong:.3f} Hz")
    scene.legend()
    curve.legend()
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
