"""Six decentral controllers, one a leg, tuned for three poses of a hexapod at once.

A hexapod positions a tool in three poses. The force in each leg is measured and integrated with a leak: six gains, the
same in all poses. One gain that is best at home leaves more vibration in the others, where the legs share the load
unevenly. Tuned for all poses, the gains differ from leg to leg: the two worst poses are then equally good, at a price
at home. Legs that mirror each other get the same gain, although nothing asks for it: the poses have this symmetry.
"""

import numpy as np

import mbsvib as mv
from mbsvib import isolation, library

TURN = 2 * np.pi
LEAK = 30.0  # 1/s
POSES = {"home": {}, "aside": {"platform.free.x": 0.07, "platform.free.z": -0.03},
         "tilted": {"platform.free.ry": np.radians(30.0), "platform.free.z": 0.05}}  # m, rad
TOOL = ["tool.x", "tool.y", "tool.z"]

hexapod = library.cubic_hexapod(stiffness=2e5, damping=20.0)
for name in TOOL:
    hexapod.add_output(name, "platform", name[-1], position=(0, 0, 0.2))
# drives set the lengths of the legs: no spring is strained in any pose
active = [isolation.actuated(hexapod.moved(pose, relaxed=True), "platform") for pose in POSES.values()]
plants = dict(zip(POSES, [one.system for one in active], strict=True))
legs = active[0].legs

floor = isolation.shaped([TURN * 30], [1, TURN * 30], 1e-7)  # (m/s^2)^2/Hz
noise = {"base.[xyz]": floor, "leg*.force.noise": 1e-6, "leg*.actuator.noise": 1e-7}  # N^2/Hz


def controllers(shared):
    """Integrators with a leak behind each force sensor, and six gains, or one for all legs."""
    laws = []
    for leg in legs:
        integrator = mv.StateSpace.from_arrays([[-LEAK]], [[1.0]], [[1.0]], [[0.0]], inputs=[f"{leg}.force"],
                                               outputs=[f"{leg}.integral"])  # fmt: skip
        gain = mv.tunable.gain(f"{leg}.actuator", f"{leg}.integral", name="all legs" if shared else leg)
        laws.append(gain * integrator)
    return mv.tunable.diagonal(laws)


def tool_rms(system, sources):
    """Root mean square of the vibration of the tool [m]."""
    return float(np.linalg.norm(list(system.rms(TOOL, sources).values())))


goal = mv.goals.rms(TOOL, noise)
at_home = mv.tune(plants["home"], controllers(shared=True), goal, starts=1)
start = {f"{leg}.gain": at_home.values["all legs.gain"] for leg in legs}
for_all = mv.tune(list(plants.values()), controllers(shared=False), goal, starts=1, initial=start)
gains = [for_all.values[f"{leg}.gain"] for leg in legs]

passive = {"base.[xyz]": floor, "leg*.actuator": 1e-7}
rms = {"passive": [tool_rms(plant, passive) for plant in plants.values()]}
for label, design in (("tuned at home", at_home), ("tuned for all poses", for_all)):
    rms[label] = [tool_rms(plant.feedback(design.controller, noise=True), noise) for plant in plants.values()]

home, tuned = rms["tuned at home"], rms["tuned for all poses"]
assert max(tuned) < 0.97 * max(home) < 0.3 * max(rms["passive"])
assert np.isclose(tuned[1], tuned[2], rtol=1e-4)  # both worst poses
assert tuned[0] > home[0]  # no common controller is better at home than that of home
assert np.allclose(gains[:3], gains[:2:-1], rtol=1e-3)  # mirrored legs
assert 30.0 < min(gains) < max(gains) < 90.0


def draw():
    """Vibration of the tool in each pose, and the gains of the legs."""
    import matplotlib.pyplot as plt

    _, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for k, (label, values) in enumerate(rms.items()):
        left.bar(np.arange(3) + 0.27 * (k - 1), 1e6 * np.array(values), 0.25, label=label)
    left.set_xticks(range(3), list(POSES))
    left.set(ylabel="rms of the tool's vibration [µm]", ylim=(0, 1.3e6 * max(rms["passive"])))
    left.legend()
    right.bar(range(1, 7), gains, color="C2", label="tuned for all poses")
    right.axhline(at_home.values["all legs.gain"], color="C1", label="tuned at home")
    right.set(xlabel="number of the leg", ylabel="gain of force feedback [1/s]", ylim=(0, 1.35 * max(gains)))
    right.legend()
    plt.show()


if __name__ == "__main__":
    print(for_all)
    draw()
