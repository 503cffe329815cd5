"""A leg with closed loops, from its URDF to a regulator that keeps it standing.

Two motors at the hips drive a leg of five bars, the foot is pinned to the floor. In the file's zero pose both loops are
open; ``load_urdf`` closes them in the pose asked for. Soft drives carry the weight there, and the leg falls over: its
linear model is unstable. A linear-quadratic regulator of python-control stands it up again after a push.
"""

from pathlib import Path

import control
import numpy as np

import mbsvib as mv
from mbsvib_export import to_control

LEG = Path(__file__).parent / "robots" / "leg.urdf"
HIPS = ("front_hip", "rear_hip")
LIMIT = 40.0  # N m, effort of the motors in the file

leg = mv.load_urdf(LEG, pose={"front_hip": -0.7, "rear_hip": 0.5}, stiffness=dict.fromkeys(HIPS, 5.0),
                   gravity=(0, 0, -9.81))  # fmt: skip
standing = leg.equilibrium(preload="*_hip.k")  # the drives' torques at rest
system = standing.linearize(independent=["along.z", "height.z"])[
    ["along.travel", "height.travel"], [f"{hip}.torque" for hip in HIPS]]  # fmt: skip
holding = np.array([standing.springs[f"{hip}.k"].preload[5] for hip in HIPS])
plant = to_control(system)
assert system.dof == 2
assert plant.poles().real.max() > 1.0  # it falls over

# The torques that hold the weight, by virtual work: as the body rises, both hips turn and all links rise with it.
rise = system.displacements([0.0, 1.0])
turns = np.array([rise[f"{side}_thigh"][4] - rise["body"][4] for side in ("front", "rear")])
work = sum(9.81 * body.mass * rise[name][2] for name, body in standing.bodies.items())
assert np.isclose(holding @ turns, work, rtol=1e-9)

# 10 mm and 0.1 m/s cost as much as 2 N m; states are along, height and their rates.
Q, R = np.diag((1e2, 1e2, 1e1, 1e1)) ** 2, np.eye(2) / 2.0**2
gain, riccati, _ = control.lqr(plant, Q, R)
loop = control.ss(plant.A - plant.B @ gain, plant.B, plant.C, 0.0)
pushed = np.array((0.0, 0.0, 0.2, -0.3))  # m/s: a blow on the body, forwards and down
time = np.linspace(0.0, 1.2, 2401)
answer = control.initial_response(loop, time, X0=pushed)
torques = holding[:, None] - gain @ answer.states
costs = np.einsum("it,ij,jt->t", answer.states, Q + gain.T @ R @ gain, answer.states)
assert np.isclose(np.trapezoid(costs, time), pushed @ riccati @ pushed, rtol=1e-3)  # what Riccati's equation promises
assert np.abs(torques).max() < LIMIT


def draw():
    """The leg in its pose, the way of the body, and the torques of both motors."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(11, 4.2), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    for side, color in (("front", "C0"), ("rear", "C1")):
        pins = np.array([standing.joints[name].position for name in (f"{side}_hip", f"{side}_knee", "ankle")])
        left.plot(pins[:, 0], pins[:, 2], "o-", color=color, linewidth=4, label=f"{side} thigh and shin")
    hips = np.array([standing.joints[hip].position for hip in HIPS])
    left.plot(hips[:, 0], hips[:, 2], color="0.3", linewidth=12, solid_capstyle="round", zorder=0, label="body")
    left.axhline(0.0, color="0.6")
    left.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", ylim=(-0.03, 0.55))
    left.legend(loc="upper center")
    for way, name in zip(answer.outputs, ("along", "height"), strict=True):
        middle.plot(1e3 * time, 1e3 * way, label=name)
    middle.set_ylabel("displacement of the body [mm]")
    for torque, hip in zip(torques, HIPS, strict=True):
        right.plot(1e3 * time, torque, label=hip.replace("_", " "))
    right.set_ylabel("torque of the motor [N m]")
    for axes in (middle, right):
        axes.set_xlabel("time [ms]")
        axes.grid(alpha=0.3)
        axes.legend()
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(f"falls over at {plant.poles().real.max():.1f}/s; torque up to {np.abs(torques).max():.1f} of {LIMIT:g} N m")
    draw()
    plt.show()
