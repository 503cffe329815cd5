"""How stiff is a robot's arm where it works? Its lowest structural mode over the plane in which it reaches.

The arm is a URDF file. Its gears are compliant, which a URDF cannot describe, so that their stiffness is an argument.
Each pose is a model of its own: links turn, joints stay as stiff as they are, and the lowest frequency falls as the
hand reaches out.
"""

from pathlib import Path

import numpy as np

import mbsvib as mv

ARM = Path(__file__).parent / "robots" / "arm.urdf"
STIFFNESS = {"pan": 2e4, "lift": 2e4, "elbow": 1.5e4, "wrist_1": 5e3, "wrist_2": 5e3, "wrist_3": 5e3}  # N m/rad


def arm(lift, elbow):
    pose = {"lift": lift, "elbow": elbow, "wrist_1": -lift - elbow}  # the hand stays level
    return mv.load_urdf(ARM, pose=pose, stiffness=STIFFNESS, tip="tool")


lifts, elbows = np.linspace(-0.4, 1.2, 9), np.linspace(0.3, 2.4, 8)
reach, height, lowest, sag = np.zeros((4, len(lifts), len(elbows)))
for i, lift in enumerate(lifts):
    for j, elbow in enumerate(elbows):
        model = arm(lift, elbow)
        system = model.linearize()
        reach[i, j], _, height[i, j] = model.outputs["tool.z"].position
        lowest[i, j] = system.modes().frequencies[0]
        static = system.frequency_response([0.0])
        sag[i, j] = static[system.outputs.index("tool.z"), system.inputs.index("tool.Fz"), 0].real

# Where both links stand on the tool's height, the sag is that of three springs in series, each at its lever.
model = arm(0.6, 1.2)
tool = np.array(model.outputs["tool.z"].position)
levers = {name: (tool - model.joints[name].position)[0] for name in ("lift", "elbow", "wrist_1")}
by_hand = sum(lever**2 / STIFFNESS[name] for name, lever in levers.items())
system = model.linearize()
compliance = system.frequency_response([0.0])[system.outputs.index("tool.z"), system.inputs.index("tool.Fz"), 0].real
assert np.isclose(compliance, by_hand, rtol=1e-12, atol=0)
assert lowest.max() > 1.4 * lowest.min()


def draw():
    """The lowest frequency and the compliance over reach and height of the hand."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained", sharey=True)
    for axes, values, what in zip(panels, (lowest, 1e6 * sag), ("lowest mode [Hz]", "sag under 1 N [µm]"), strict=True):
        drawn = axes.tricontourf(reach.ravel(), height.ravel(), values.ravel(), 14, cmap="viridis")
        axes.plot(reach.ravel(), height.ravel(), ".", color="white", markersize=2)
        axes.set_aspect("equal")
        axes.set_xlabel("reach [m]")
        figure.colorbar(drawn, ax=axes, label=what)
    panels[0].set_ylabel("height [m]")
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(f"lowest mode from {lowest.min():.1f} to {lowest.max():.1f} Hz")
    draw()
    plt.show()
