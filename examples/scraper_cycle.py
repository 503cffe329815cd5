"""A carpet scraper through one turn of its crank: its edge, the torque, what pins carry and what the floor feels.

Hoeken's linkage draws a nearly straight line, a pantograph doubles it. Seven bars and ten pins make three loops, whose
nine redundant constraints leave forces across the plane open: they are named. A counterweight on the crank and
another on the rocker are then searched for by the exact gradients of the cycle: that on the crank is of no use.
"""

import numpy as np

from mbsvib import library, studies

ANGLES = 2 * np.pi * np.arange(144) / 144
BARS = {"link1": 1.0, "link2": 5.0, "link3": 2.5, "link4": 8.0, "link5": 4.5, "link6": 9.0, "link7": 4.0}  # times 0.1 m

model = library.carpet_scraper()
cycle = model.cycle("crank.rz", ANGLES, speed=2 * np.pi)
assert np.isclose(cycle.rms("torque"), 57.72, atol=0.1)
assert set(cycle.undetermined) == set(model.joints)
assert all(directions == ("z", "rx", "ry") for directions in cycle.undetermined.values())

ends = {name: cycle.positions[name][:, None] + np.array([-0.05, 0.05])[:, None] * length * cycle.orientations[name][
    :, None, :, 0] for name, length in BARS.items()}  # fmt: skip
edge, tip = ends["link6"][:, 1], ends["link2"][:, 1]
pivot = np.array([0.2, 0.8, 0.0])
assert np.allclose(edge - pivot, 2.0 * (tip - pivot), atol=1e-12)  # the pantograph

forces = {name: np.hypot(*cycle.reactions[name][:, :2].T) for name in model.joints}
assert max(forces, key=lambda name: forces[name].max()) in ("crank", "pin12")

full = studies.with_counterweights(model, {"link1": (0.0, (-0.1, 0, 0)), "link3": (0.0, (0.25, -0.245, 0))})
measures = studies.cycle("crank.rz", ANGLES[::4], speed=2 * np.pi)
variables = {f"{link}.counterweight.mass": (0.0, 20.0) for link in ("link1", "link3")}
best = studies.optimize(full, variables, measures.weighted(model, {"force": 1.0, "moment": 0.2, "torque": 0.2}))
after = best.model.cycle("crank.rz", ANGLES, speed=2 * np.pi)
assert after.rms("force") < cycle.rms("force")


def draw():
    """The machine in six positions with the path of its edge; torque, pin forces and shaking force over the crank."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(11, 6.4), layout="constrained")
    places = figure.add_gridspec(3, 2, width_ratios=(1, 1.25))
    machine = figure.add_subplot(places[:, 0])
    for i in range(0, 144, 24):
        for k, points in enumerate(ends.values()):
            machine.plot(*points[i, :, :2].T, color=f"C{k}", alpha=1.0 if i == 24 else 0.18, lw=2.2)
    for k, name in enumerate(BARS):
        machine.annotate(name, ends[name][24].mean(axis=0)[:2], color=f"C{k}", fontsize=8)
    machine.plot(*np.vstack((edge, edge[:1]))[:, :2].T, "k-", lw=1.2, label="edge")
    machine.plot(*np.vstack((tip, tip[:1]))[:, :2].T, "k:", lw=1.2, label="tip of the coupler")
    machine.plot([0, 0.2, 0.2], [0, 0, 0.8], "k^", ms=7)
    machine.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="Carpet scraper")
    machine.legend(loc="upper left", bbox_to_anchor=(0.0, 0.86))
    degrees = np.degrees(ANGLES)
    pins = {name: forces[name] for name in ("crank", "pin03", "pin04")}
    curves = (("torque [N m]", {"as it is": cycle.torque, "counterweight": after.torque}), ("force in pins [N]", pins),
              ("shaking force [N]", {"as it is": np.linalg.norm(cycle.shaking_force, axis=1),
                                     "counterweight": np.linalg.norm(after.shaking_force, axis=1)}))  # fmt: skip
    for row, (label, lines) in enumerate(curves):
        axes = figure.add_subplot(places[row, 1])
        for name, values in lines.items():
            axes.plot(degrees, values, label=name)
        axes.set(ylabel=label, xlabel="crank [deg]" if row == 2 else "", xticks=range(0, 361, 60))
        axes.grid(alpha=0.3)
        axes.legend()
    plt.show()


if __name__ == "__main__":
    print(cycle, best, sep="\n")
    draw()
