"""Snap-through and snap-back: paths of equilibria of an over-centre latch and of an arch that a spring pushes.

A latch of two arms is turned over its stretched pose; an arch is pushed flat through a spring. `model.path` leads one
joint coordinate along values, finds the equilibria of all others, and goes on through the extremes of force and of
coordinate, where a loaded or a driven mechanism would jump.
"""

import numpy as np

import mbsvib as mv

ANGLE, ARM, STIFFNESS = 0.284, 0.1, 1e4
latch = mv.library.toggle(angle=ANGLE, arm=ARM, spring_stiffness=STIFFNESS)
over = latch.path("base.rz", -np.linspace(0.0, 0.6, 25))


def moment(theta):
    """The moment on the first arm, the derivative of k (2 l cos(theta) - 2 l cos(theta0))^2 / 2."""
    return -STIFFNESS * (2 * ARM) ** 2 * (np.cos(theta) - np.cos(ANGLE)) * np.sin(theta)


assert np.abs(over.forces - moment(ANGLE + over.values)).max() < 1e-9
assert [point.kind for point in over.points] == ["limit", "limit"]

HEIGHT, ROD, PUSHERS = 0.5, 1000.0, (400.0, 120.0, 60.0)


def arch(pusher):
    """Two springs of a flat arch, and a slider above that pushes its top through a spring."""
    model = mv.Model("arch")
    model.add_body("top", 2.0, (1, 1, 1), position=(0, 0, HEIGHT))
    model.add_joint("guide", "prismatic", "ground", "top", position=(0, 0, HEIGHT), axis=(0, 0, 1))
    for side in (-1, 1):
        model.add_spring(f"rod{side}", "ground", "top", start=(side, 0, 0), end=(0, 0, HEIGHT), stiffness=ROD)
    model.add_body("slider", 1.0, (1, 1, 1), position=(0, 0, HEIGHT + 2))
    model.add_joint("drive", "prismatic", "ground", "slider", position=(0, 0, HEIGHT + 2), axis=(0, 0, 1))
    model.add_spring("pusher", "top", "slider", start=(0, 0, HEIGHT), end=(0, 0, HEIGHT + 2), stiffness=pusher)
    return model


paths = {pusher: arch(pusher).path("drive.z", -np.linspace(0.0, 1.2, 25)) for pusher in PUSHERS}
turning = {pusher: sum(point.kind == "turning" for point in path.points) for pusher, path in paths.items()}
assert turning == {400.0: 0, 120.0: 2, 60.0: 2}  # softer than the arch at its softest, it snaps, held or not


def draw():
    """Moment and frequency of the latch, and the force of the pushed arch."""
    import matplotlib.pyplot as plt

    _, (left, middle, right) = plt.subplots(1, 3, figsize=(12.5, 4.1), layout="constrained")

    def curve(axes, path, colour, label):
        stable = path.curve_stable[:-1] | path.curve_stable[1:]
        for wanted, dash in ((True, "-"), (False, "--")):
            ends = np.stack((path.curve[:-1], path.curve[1:], np.full_like(path.curve[1:], np.nan)), axis=1)
            ends[stable != wanted] = np.nan
            axes.plot(*ends.reshape(-1, 2).T, dash, color=colour, label=label if wanted else None)
        axes.plot([point.value for point in path.points], [point.force for point in path.points], "o", color=colour,
                  mfc="white", ms=5)  # fmt: skip

    curve(left, over, "C0", "path")
    left.plot(over.values, moment(ANGLE + over.values), "k.", ms=3, label="closed form")
    left.set(xlabel="angle of the first arm [rad]", ylabel="holding moment [N m]", title="Latch, dashed: unstable")
    middle.plot(over.values, over.frequencies[:, 0], "o-", ms=3)
    middle.set(xlabel="angle of the first arm [rad]", ylabel="natural frequency [Hz]", title="Latch", ylim=(0, None))
    for i, (pusher, path) in enumerate(paths.items()):
        curve(right, path, f"C{i}", f"{pusher:.0f} N/m")
    right.set(xlabel="displacement of the slider [m]", ylabel="force [N]", title="Arch pushed by a spring")
    for axes in (left, right):
        axes.legend(frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=3)
    for axes in (left, middle, right):
        axes.grid(alpha=0.3)
        axes.axhline(0.0, color="k", lw=0.6)
    plt.show()


if __name__ == "__main__":
    print(over)
    print(paths[60.0])
    draw()
