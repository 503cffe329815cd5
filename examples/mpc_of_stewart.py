"""Model predictive control of a Stewart platform: a shove, six legs of limited force, and end stops not to be hit.

Every 2 ms the forces of the next 30 ms are planned so that energy, effort, sum q^T K q + q'^T M q' + r |f|^2 and what
comes after, become least while no force and no elongation passes its limit; the first forces are applied. The plant is
a function of CasADi that steps exactly. Without limits the plan must be the linear-quadratic regulator's, f = -F x, and
it is. That regulator has forces to spare and runs into the stops; the plan spends them before it gets there.
"""

import casadi
import control
import numpy as np

import mbsvib_export as mx
from mbsvib.library import stewart

STEP, AHEAD, SHOWN = 2e-3, 15, 25  # s, steps
FORCE, STROKE, EFFORT = 12.0, 0.5e-3, 4e-4  # N, m, weight of squared forces

system = stewart(leg_stiffness=2e4, leg_damping=1.0, part_mass=0.02, ports="legs").linearize()
plant = mx.to_casadi(system, STEP)
into = np.eye(len(plant.inputs))[:, [plant.inputs.index(f"leg{i}.f") for i in range(1, 7)]]
strokes = [plant.outputs.index(f"leg{i}.elongation") for i in range(1, 7)]
x, f = casadi.MX.sym("x", 12), casadi.MX.sym("f", 6)
after, y = plant.step(x, into @ f, [])
step = casadi.Function("step", [x, f], [after, y[strokes]])

energy = np.kron([[1, 0], [0, 0]], system.K) + np.kron([[0, 0], [0, 1]], system.M)
discrete = mx.to_control(system, dt=STEP)
regulator, future, _ = control.dlqr(discrete.A, discrete.B @ into, energy, EFFORT * np.eye(6), method="scipy")
shove = np.linalg.solve(system.body_motion[system.bodies.index("platform")], [0, 0, -0.2, 2, 0, 0])  # m/s, rad/s
start = np.concatenate([np.zeros(6), shove])


def planner(force, stroke):
    """Return the function x -> forces (6, AHEAD) that are best within the limits."""
    opti = casadi.Opti()
    path, plan, now = opti.variable(12, AHEAD + 1), opti.variable(6, AHEAD), opti.parameter(12)
    total = casadi.bilin(future, path[:, -1]) + EFFORT * casadi.sumsqr(plan)
    opti.subject_to([path[:, 0] == now, opti.bounded(-1, casadi.vec(plan) / force, 1)])
    for k in range(AHEAD):
        after, _ = step(path[:, k], plan[:, k])
        opti.subject_to([path[:, k + 1] == after, opti.bounded(-1, step(after, 0)[1] / stroke, 1)])
        total += casadi.bilin(energy, path[:, k])
    opti.minimize(total)
    opti.solver("ipopt", {"print_time": 0}, {"print_level": 0, "tol": 1e-9, "sb": "yes"})
    return opti.to_function("plan", [now], [plan])


def run(law, x=start):
    """Return elongations [mm] and forces [N] (SHOWN, 6) of the closed loop after the shove."""
    found = []
    for f in (law(x) for _ in range(SHOWN)):
        x, y = (each.full().ravel() for each in step(x, f))
        found.append((1e3 * y, f))
    return [np.array(each) for each in zip(*found, strict=True)]


free, bound = planner(1e4, 1.0), planner(FORCE, STROKE)
disagreement = np.abs(free(start).full()[:, 0] + regulator @ start).max() / np.abs(regulator @ start).max()
assert disagreement < 1e-6
runs = {"planned": run(lambda x: bound(x).full()[:, 0]), "regulator": run(lambda x: -regulator @ x)}
(plan_y, plan_f), (lqr_y, lqr_f) = ((np.abs(y).max(), np.abs(f).max()) for y, f in runs.values())
assert plan_y < 1.001e3 * STROKE < 0.8 * lqr_y
assert lqr_f < plan_f < 1.001 * FORCE
print(f"no limits: plan and regulator agree to {disagreement:.0e}; planned: {plan_y:.3f} mm of {1e3 * STROKE} mm "
      f"with {plan_f:.2f} N of {FORCE} N; regulator: {lqr_y:.3f} mm with {lqr_f:.2f} N")  # fmt: skip

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for (name, lines), color in zip(runs.items(), ("C0", "C1"), strict=True):
        for each, values in zip(axes, lines, strict=True):
            each.step(1e3 * STEP * np.arange(SHOWN), values, color, where="post", label=[name] + ["_"] * 5)
    for each, limit, name in zip(axes, (1e3 * STROKE, FORCE), ("elongations [mm]", "forces [N]"), strict=True):
        each.hlines([-limit, limit], 0, 1e3 * STEP * SHOWN, color="k", ls=":")
        each.set(xlabel="time [ms]", ylabel=name)
        each.legend()
    plt.show()
