"""A gain-scheduled hexapod over its workspace: decoupling control designed at 25 poses, against that of home.

Six legs position a payload. State feedback to forces in the legs is to make all six motions alike: 60 Hz with a damping
ratio of 0.7. It does so in the pose in which it was designed. As the payload shifts and tilts, a force in a leg becomes
another wrench, so that gains of home couple the motions, and some ring. Gains of 25 poses, all in the same named
coordinates, are interpolated between these over shift and tilt.

The plant between the poses is a function of the pose (``interpolated``) with a stated error bound.
"""

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from mbsvib import library

SHIFT, TILT = np.linspace(-0.06, 0.06, 5), np.radians([-40.0, -20.0, 0.0, 20.0, 40.0])  # m, rad
OMEGA, ZETA = 2 * np.pi * 60.0, 0.7

hexapod = library.cubic_hexapod(stiffness=2e5, damping=5.0, ports=["platform", "legs"])
family = hexapod.family({"platform.free.x": SHIFT, "platform.free.ry": TILT}, grid=True)
LEGS = slice(family.inputs.index("leg1.f"), family.inputs.index("leg6.f") + 1)


def decoupling(system):
    """Gains (6, 12) with which M q'' + C q' + K q = B u becomes q'' + 2 zeta w q' + w^2 q = 0."""
    wanted = np.hstack((OMEGA**2 * system.M - system.K, 2 * ZETA * OMEGA * system.M - system.C))
    return np.linalg.solve(system.B[:, LEGS], wanted)


def least_damping(system, gains):
    """The smallest damping ratio of the closed loop."""
    space = system.state_space()
    poles = np.linalg.eigvals(space.A - space.B[:, LEGS] @ gains)
    return float((-poles.real / abs(poles)).min())


designs = np.array([decoupling(system) for system in family]).reshape(5, 5, 6, 12)
scheduled, home = RegularGridInterpolator((SHIFT, TILT), designs), designs[2, 2]

plant = family.interpolated(1e-5)
shifts, tilts = np.linspace(SHIFT[0], SHIFT[-1], 25), np.linspace(TILT[0], TILT[-1], 25)
damping = {"gains of home": np.zeros((25, 25)), "gains scheduled over 25 poses": np.zeros((25, 25))}
fixed, varying = damping.values()
for i, shift in enumerate(shifts):
    for j, tilt in enumerate(tilts):
        system = plant.at({"platform.free.x": shift, "platform.free.ry": tilt})
        fixed[i, j] = least_damping(system, home)
        varying[i, j] = least_damping(system, scheduled((shift, tilt)))

worst = family.worst(lambda system: least_damping(system, home), largest=False)
assert np.isclose(fixed[12, 12], ZETA, atol=1e-4)  # at home
assert fixed.min() < 0.3 < 0.67 < varying.min() <= varying.max() < ZETA + 1e-3
assert np.isclose(worst.value, fixed.min(), rtol=1e-3)  # in a corner


def draw():
    """Damping of the closed loop over the workspace, by fixed and by scheduled gains."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(10, 4.4), sharey=True, layout="constrained")
    for axes, (label, values) in zip(panels, damping.items(), strict=True):
        over = np.degrees(tilts), 1e3 * shifts, values
        image = axes.pcolormesh(*over, vmin=0.2, vmax=0.7, shading="gouraud")
        axes.clabel(axes.contour(*over, [0.3, 0.4, 0.5, 0.6, 0.69], colors="w", linewidths=0.8))
        axes.set(title=label, xlabel="tilt [deg]")
    x, y = np.meshgrid(np.degrees(TILT), 1e3 * SHIFT)
    panels[0].plot(0.0, 0.0, "o", color="C3", clip_on=False, label="pose of a design")
    panels[1].plot(x.ravel(), y.ravel(), "o", color="C3", clip_on=False)
    panels[0].set_ylabel("shift [mm]")
    panels[0].legend(loc="lower right")
    figure.colorbar(image, ax=panels, label="smallest damping ratio of the closed loop [1]")
    plt.show()


if __name__ == "__main__":
    print(plant, f"through {plant.poses} poses")
    print(f"gains of home: damping ratio {fixed.min():.2f} or more, scheduled ones: {varying.min():.2f} or more")
    print(worst)
    draw()
