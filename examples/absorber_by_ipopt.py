"""An absorber on a Stewart platform, designed by IPOPT with the toolbox's own derivatives of frequency responses.

A mass of 5 % hangs in the platform by a spring and a damper. Which of these make the largest motion over a shaking
force least? IPOPT lowers a bar that |G(w)|^2 must not pass at any frequency of a grid; G and its derivatives to
stiffness and damping come from a callback. The undamped platform moves up and down as one mass on one spring, so that
the answer is known (O. Nishihara, T. Asami, "Closed-form solutions to the exact optimizations of dynamic vibration
absorbers", 2002): with mu the ratio of masses and r = sqrt(4 + 3 mu)

    (w_a/w)^2 = 8 (16 + 23 mu + 9 mu^2 + 2 (2 + mu) r) / (3 (1 + mu)^2 (64 + 80 mu + 27 mu^2))
    zeta^2 = (8 + 9 mu - 4 r) / (16 (1 + mu)),    peak^2 = ((8 + 9 mu)^2 (16 + 9 mu) - 128 r^3) / (27 mu^2 (32 + 27 mu))
"""

from typing import Any

import casadi
import numpy as np

import mbsvib_export as mx
from mbsvib.library import stewart

MU = 0.05  # mass of the absorber over that of the platform
model = stewart(leg_damping=0.0)
bare = model.linearize()
modes = bare.modes()
vertical = 2 * np.pi * modes.frequencies[np.argmax(np.abs(modes.body_shapes["platform"][2]))]
spring = 1 / bare.frequency_response(0.0)[bare.outputs.index("z"), bare.inputs.index("Fz"), 0].real
mass = spring / vertical**2  # of the platform with what moves of its legs

r = np.sqrt(4 + 3 * MU)
tuning = 8 * (16 + 23 * MU + 9 * MU**2 + 2 * (2 + MU) * r) / (3 * (1 + MU) ** 2 * (64 + 80 * MU + 27 * MU**2))
zeta = np.sqrt((8 + 9 * MU - 4 * r) / (16 * (1 + MU)))
truth = {
    "stiffness": MU * mass * vertical**2 * tuning, "damping": 2 * zeta * MU * mass * vertical * np.sqrt(tuning),
    "peak": np.sqrt(((8 + 9 * MU) ** 2 * (16 + 9 * MU) - 128 * r**3) / (27 * MU**2 * (32 + 27 * MU))),
}  # fmt: skip

# A first guess: tuned to the bare platform, 5 % damping
place, guess = (0, 0, 0.085), (MU * spring, 2 * 0.05 * MU * mass * vertical)
model.add_body("absorber", mass=MU * mass, inertia=(1e-6,) * 3, position=place)
model.add_joint("guide", "prismatic", "platform", "absorber", position=place, axis=(0, 0, 1))
model.add_spring("tie", "platform", "absorber", start=place, end=(0, 0, 0.105),
                 stiffness=guess[0], damping=guess[1])  # fmt: skip
system = model.linearize()
grid = vertical * np.linspace(0.85, 1.1, 121)
response = mx.to_casadi_response(system, grid, ("tie.stiffness", "tie.damping"), "z", "Fz")

factor, bar = casadi.MX.sym("factor", 2), casadi.MX.sym("bar")
real, imag = response(factor * response.values)
program = {"x": casadi.vertcat(factor, bar), "f": bar, "g": spring**2 * (real**2 + imag**2) - bar}
options: dict[str, Any] = {"print_level": 0, "sb": "yes", "tol": 1e-7, "hessian_approximation": "limited-memory"}
solver = casadi.nlpsol("design", "ipopt", program, {"ipopt": options, "print_time": False})
best = solver(x0=[1, 1, 100], lbx=[0.2, 0.2, 0], ubx=[5, 10, np.inf], ubg=0, lbg=-np.inf)["x"].full().ravel()
assert solver.stats()["success"]
stiffness, damping = best[:2] * response.values

designed = model.with_values({"tie.stiffness": stiffness, "tie.damping": damping}).linearize()
fine = vertical * np.linspace(0.8, 1.2, 2001)
curves = {name: spring * np.abs(each.frequency_response(fine)[each.outputs.index("z"), each.inputs.index("Fz")])
          for name, each in (("first guess", system), ("designed", designed))}  # fmt: skip
found = {"stiffness": stiffness, "damping": damping, "peak": curves["designed"].max()}
for name, value in found.items():
    print(f"{name}: {value:.6g}, closed form {truth[name]:.6g}")
    assert abs(value / truth[name] - 1) < (5e-3 if name == "damping" else 2e-4)  # the peak hardly feels it
assert curves["first guess"].max() > 1.5 * found["peak"]

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(layout="constrained")
    for name, curve in curves.items():
        axes.semilogy(fine / (2 * np.pi), curve, label=name)
    axes.axhline(truth["peak"], color="k", ls=":", label="least peak, closed form")
    axes.set(xlabel="frequency [Hz]", ylabel="displacement over static displacement [1]")
    axes.legend()
    plt.show()
