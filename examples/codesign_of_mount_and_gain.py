"""Co-design of a mount and of the gain of its controller: which stiffness is best once the table is active?

A soft mount isolates from the floor, a stiff one resists forces on the table. The acceleration of the sample and the
gap of the coil are both limited, so that there is a best stiffness. Skyhook damping by an accelerometer moves it: the
gain suppresses the resonance, and brings the noise of the sensor, which a soft mount follows. A mount that is chosen
first and a gain that is tuned afterwards miss the best pair, which a search in both finds.
"""

import numpy as np

import mbsvib as mv
from mbsvib import isolation

TURN = 2 * np.pi
ALLOWED = {"sample": 2e-3, "gap": 20e-6}  # root mean squares [m/s^2, m]
FLOOR = isolation.shaped([TURN * 100], [1, TURN * 100], 3e-7)  # (m/s^2)^2/Hz
FORCES = isolation.shaped([TURN * 10], [1, TURN * 10], 0.03)  # N^2/Hz, of cables and stages
NOISE = {"floor": FLOOR, "forces": FORCES}
SENSOR = {"accelerometer.noise": 1e-8}  # (m/s^2)^2/Hz
WEIGHTS = {name: isolation.shaped([1 / most], [1.0]) for name, most in ALLOWED.items()}
LEAK = TURN * 0.5  # of the integrator [1/s]


def table(stiffness):
    """A table on a mount, with a sample on a flexible arm and a coil beside the mount."""
    model = mv.Model("table", gravity=None)
    model.add_body("table", mass=300.0, inertia=(20.0, 30.0, 40.0), position=(0, 0, 0.3))
    model.add_body("sample", mass=20.0, inertia=(1.0, 1.0, 1.0), position=(0, 0, 0.6))
    model.add_joint("guide", "prismatic", "ground", "table", axis=(0, 0, 1))
    model.add_joint("slide", "prismatic", "table", "sample", position=(0, 0, 0.5), axis=(0, 0, 1))
    model.add_spring("mount", "ground", "table", (0, 0, 0), (0, 0, 0.2), stiffness, damping=300.0)
    model.add_spring("arm", "table", "sample", (0, 0, 0.4), (0, 0, 0.5), 20 * (TURN * 40) ** 2, damping=100.0)
    model.add_base_motion("floor", "z")
    for name in ("forces", "coil"):
        model.add_input(name, "table", "z")
    model.add_output("accelerometer", "table", "z", quantity="acceleration")
    model.add_output("sample", "sample", "z", quantity="acceleration")
    model.add_output("gap", "table", "z")
    return model


def cost(system, noise):
    """Root of the sum of squares of both root mean squares, each in parts of what is allowed."""
    return float(np.linalg.norm(list(system.rms(list(ALLOWED), noise, weighting=WEIGHTS).values())))


integrator = mv.StateSpace.from_arrays([[-LEAK]], [[1.0]], [[1.0]], [[0.0]], inputs=["accelerometer"], outputs=["rate"])
skyhook = mv.tunable.gain("coil", "rate", name="skyhook", start={"gain": -1e4}) * integrator
goal = mv.goals.rms(list(ALLOWED), NOISE | SENSOR, weighting=WEIGHTS)

stiffnesses = np.geomspace(4e3, 1.6e7, 7)  # N/m
passive = [cost(table(k).linearize(), NOISE) for k in stiffnesses]
active = [mv.tune(table(k).linearize(), skyhook, goal, starts=1).objective for k in stiffnesses]
first = stiffnesses[int(np.argmin(passive))]
one_by_one = mv.tune(table(first).linearize(), skyhook, goal, starts=1)
together = mv.tune(table(first), skyhook, goal, {"mount.stiffness": (1e3, 1e8)}, starts=1, initial=one_by_one.values)
best, gain = together.values["mount.stiffness"], together.values["skyhook.gain"]


def neighbour(stiffness, gain):
    """The cost with another stiffness and gain."""
    law = mv.StateSpace.from_arrays([[-LEAK]], [[1]], [[gain]], [[0]], inputs=["accelerometer"], outputs=["coil"])
    return cost(table(stiffness).linearize().feedback(law, noise=True), NOISE | SENSOR)


assert np.isclose(neighbour(best, gain), together.objective, rtol=1e-6)
assert all(neighbour(best * a, gain * b) > together.objective for a, b in ((1.2, 1), (0.8, 1), (1, 1.2), (1, 0.8)))
assert together.objective < 0.7 * one_by_one.objective


def draw():
    """Cost over the stiffness, passive and with the best gain of each."""
    import matplotlib.pyplot as plt

    _, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    axes.loglog(stiffnesses, passive, "o-", label="passive")
    axes.loglog(stiffnesses, active, "s-", label="with the best gain of each")
    axes.loglog(first, one_by_one.objective, "kX", markersize=10, label=f"mount first: {one_by_one.objective:.2f}")
    axes.loglog(best, together.objective, "k*", markersize=13, label=f"both at once: {together.objective:.2f}")
    axes.set(xlabel="stiffness of the mount [N/m]", ylabel="cost / allowed cost [1]")
    axes.set_yticks([2, 5, 10, 20, 50], ["2", "5", "10", "20", "50"])
    axes.minorticks_off()
    axes.legend()
    plt.show()


if __name__ == "__main__":
    print(together)
    draw()
