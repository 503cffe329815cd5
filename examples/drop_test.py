"""A beam drops its load while two arms hang from it: where passing the singular pose damps, and where it stores.

Structural damping takes little from the slow first mode of a beam. Two pinned arms between its middle and the ground
change that without any damper: whenever they pass their stretched pose, the middle of the beam is caught for an
instant at the end of its way, whatever the speed of the arms. Light arms are jerked through, and what they give back
goes into high modes of the beam, which structural damping takes away within a second. Heavy arms keep the energy for
themselves: they swing on while the beam stands still, and its vibration dies more slowly than without them.
"""

import warnings

import numpy as np

import mbsvib as mv

# 30 N bend the beam by 1.7 of its thickness; a real one would stretch, this is the linear beam of the source
warnings.simplefilter("ignore", mv.LargeDisplacementWarning)

SECOND = np.linspace(0.0, 1.0, 401)
MASSES = np.geomspace(2e-3, 0.2, 7)
GAPS = {"stretch 3 mm early": 3e-3, "stretch 1 mm early": 1e-3, "never stretch": -8e-3}
LENGTHS = np.array([0.06, 0.08, 0.1, 0.14, 0.2])
BETAS = np.array([5e-6, 1e-5, 2e-5, 4e-5])


def drop(mass, gap, beta=2e-5, arm=0.1):
    """One second after the load of 30 N is dropped."""
    model = mv.library.singular_beam(mass, gap, beta, arm=arm, elements=4)
    return model.simulate(SECOND, without="drop", tolerance=1e-6)


def left(run, gap):
    """Share of the energy above rest that is left in the end; where arms stretch early, the beam rests bent."""
    rest = 0.5 * 4300.8 * max(gap, 0.0) ** 2
    return float((run.energy.total[-1] - rest) / (run.energy.total[0] - rest))


by_mass = {name: [left(drop(mass, gap), gap) for mass in MASSES] for name, gap in GAPS.items()}
by_length = {mass: [left(drop(mass, 1e-3, arm=arm), 1e-3) for arm in LENGTHS] for mass in (0.01, 0.1)}
by_damping = {mass: [left(drop(mass, 1e-3, beta), 1e-3) for beta in BETAS] for mass in (0.01, 0.1)}

# Light arms that stretch take nearly all; heavy ones keep it, better than arms that never stretch.
assert by_mass["stretch 1 mm early"][0] < 0.1 < 0.6 < by_mass["never stretch"][0]
assert by_mass["stretch 1 mm early"][-1] > by_mass["never stretch"][-1] > 0.85

light, heavy = drop(0.01, 1e-3), drop(0.1, 1e-3)
for run in (light, heavy):
    assert np.abs(run.energy.balance).max() < 1e-5 * run.energy.total[0]
stretched = {run: run.crossings("theta", -np.arccos(1.0 - 5.975446428571e-3 / 0.2)) for run in (light, heavy)}
assert len(stretched[heavy]) > 20

def draw():
    """Two figures: what is left after a second, and how it goes."""
    import matplotlib.pyplot as plt

    _, axes = plt.subplots(1, 3, figsize=(10.5, 3.6), sharey=True, layout="constrained")
    for (name, shares), mark in zip(by_mass.items(), "osD", strict=True):
        axes[0].semilogx(1e3 * MASSES, shares, f"{mark}-", label=name)
    for group, x, panel in ((by_length, 1e3 * LENGTHS, axes[1]), (by_damping, 1e6 * BETAS, axes[2])):
        for (mass, shares), mark in zip(group.items(), "vo", strict=True):
            panel.plot(x, shares, f"{mark}-", label=f"arms of {1e3 * mass:g} g")
    axes[0].set_ylabel("energy left after 1 s [1]")
    for panel, words in zip(axes, ("mass of an arm [g]", "length of an arm [mm]", "damping beta [µs]"), strict=True):
        panel.set(xlabel=words, ylim=(0.0, 1.05))
        panel.legend(fontsize=8)

    _, axes = plt.subplots(2, 2, figsize=(10.5, 5.0), sharex=True, sharey="row", layout="constrained")
    for column, (run, name) in enumerate(((light, "arms of 10 g: damped"), (heavy, "arms of 100 g: stored"))):
        top, bottom = axes[:, column]
        top.plot(run.time, 1e3 * (run["w"] - 6.975446428571e-3), lw=1.0)
        top.plot(stretched[run], np.full(len(stretched[run]), -1.0), "|", color="tab:red", label="arms in line")
        top.set_title(name, loc="left")
        bottom.plot(run.time, 1e3 * run.energy.total, "k", label="all")
        bottom.plot(run.time, 1e3 * run.energy.of("beam"), lw=0.8, label="beam")
        bottom.set_xlabel("time [s]")
    axes[0, 0].set_ylabel("middle of the beam [mm]")
    axes[1, 0].set_ylabel("energy [mJ]")
    for panel in axes[:, 1]:
        panel.legend(loc="center right", fontsize=8)
    plt.show()


if __name__ == "__main__":
    draw()
