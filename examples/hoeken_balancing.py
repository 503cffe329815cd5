"""Balancing of Hoeken's linkage: no shaking force after Berkof and Lowen, or less of force, moment and torque at once.

The crank of a four-bar linkage turns at constant speed. Counterweights on crank and rocker can take away all of its
shaking force, at the price of more shaking moment and more drive torque. How heavy they are is a trade-off, which the
exact gradients of the cycle find: no design is better than one of the front in force, moment and torque at once.
"""

import numpy as np

from mbsvib import library, studies

ANGLES = 2 * np.pi * np.arange(72) / 72
WHAT = ("force", "moment", "torque")
NAMES = ("link1.counterweight.mass", "link3.counterweight.mass")


def cycle_of(model):
    return model.cycle("crank.rz", ANGLES, speed=2 * np.pi)


plain, balanced = library.hoeken(), library.hoeken(balance_radius=0.08)
before, berkof = cycle_of(plain), cycle_of(balanced)
assert berkof.rms("force") < 1e-12 < 4.09 < before.rms("force")

places = {f"link{i}": (0.0, balanced.bodies[f"counterweight{i}"].position) for i in (1, 3)}
model = studies.with_counterweights(plain, places)
measures = studies.cycle("crank.rz", ANGLES[::2], speed=2 * np.pi)
variables = dict.fromkeys(NAMES, (0.0, 3.0))
force_only = studies.optimize(model, variables, measures.mean_square("force"))
assert np.allclose([force_only.values[name] for name in NAMES], [0.4375, 1.5625], rtol=1e-4)

front = studies.trade_off(model, variables, {what: measures.mean_square(what) for what in WHAT}, divisions=5)
rms = {what: np.sqrt(values) / before.rms(what) for what, values in front.values.items()}
assert len(front) > 10
assert (np.diff(rms["force"]) > 0.0).all()
assert (np.diff(rms["moment"]) < 0.0).all()  # on this front moment and torque go together, against the force
middle = front.optima[len(front) // 2]
between = cycle_of(middle.model)


def draw():
    """The linkage, the force on its frame, and the front."""
    import matplotlib.pyplot as plt

    _, panels = plt.subplot_mosaic("ac;bc", figsize=(8.6, 5.8), layout="constrained", width_ratios=(5, 4))
    left, hodograph, right = (panels[name] for name in "abc")
    for i in range(0, 72, 9):
        ends = {name: [before.positions[name][i] + sign * 0.5 * length * before.orientations[name][i][:, 0]
                       for sign in (-1, 1)] for name, length in (("link1", 0.1), ("link2", 0.25), ("link3", 0.25))}
        for colour, (name, points) in zip(("#0072B2", "#D55E00", "#009E73"), ends.items(), strict=True):
            x, y, _ = 1e3 * np.array(points).T
            left.plot(x, y, color=colour, alpha=1.0 if i == 9 else 0.25, lw=2.5, label=name if i == 9 else None)
    left.plot([0, 200], [0, 0], "k^", ms=8)
    left.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", title="Hoeken's linkage, eight positions")
    for what, mark in (("moment", "o-"), ("torque", "s--")):
        right.plot(rms["force"], rms[what], mark, ms=4, label=f"{what} of optimal designs")
    right.plot([1, 1], [1, 1], "k*", ms=11, label="without counterweights")
    right.plot([0, 0], [berkof.rms(what) / before.rms(what) for what in WHAT[1:]], "kx", ms=8, label="Berkof and Lowen")
    right.set(xlabel="rms shaking force, relative [1]", ylabel="rms moment and torque, relative [1]", title="Trade-off")
    for cycle, label in ((before, "without"), (between, "in between"), (berkof, "Berkof and Lowen")):
        force = np.vstack((cycle.shaking_force, cycle.shaking_force[:1]))
        hodograph.plot(force[:, 0], force[:, 1], ".-" if cycle is not berkof else "ko", label=label)
    hodograph.set(xlabel="force along x [N]", ylabel="force along y [N]", aspect="equal", title="Shaking force")
    for axes in (left, hodograph):
        axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False)
    plt.show()


if __name__ == "__main__":
    print(before, force_only, front, sep="\n")
    draw()
