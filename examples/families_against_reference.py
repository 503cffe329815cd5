"""A chain, a tree and a ladder against frequencies known to 50 digits.

Jiang, Chen and Luo (2011) tried their method on these three families and met a commercial code within 5e-5 Hz. The
references below were computed with 50 digits, in absolute coordinates, with every constraint written out. The toolbox
sees nothing of that: it goes from a spanning tree straight to the minimal equations, in doubles. How many digits are
left?

The chapter's chain runs along z, the axis of its joints, and only twists. The reference is of one along y, which bends.
"""

import numpy as np

from mbsvib.library import chain, ladder, tree

# Number of a mode, counted from 1, and its natural frequency in rad/s
REFERENCE = {
    "C50RF1": {1: 5.103438369533680728, 2: 28.48527951514399462, 10: 414.7723836339756647, 50: 1513.138453052639828},
    "T5RF1": {1: 12.60482249742428970, 2: 29.45829681482165643, 16: 419.3106563769565883, 31: 1622.616325936210913},
    "L20RF1": {1: 324.4651983202645970, 2: 739.7666873916981119, 10: 1058.330336573672669, 20: 1067.765509687178818},
}
FAMILIES = {"C50RF1": "chain, 50 bodies", "T5RF1": "tree, 31 bodies", "L20RF1": "ladder, 60 bodies, 20 loops"}

models = {"C50RF1": chain(50, line=(0, 1, 0)), "T5RF1": tree(5), "L20RF1": ladder(20)}
systems = {name: model.linearize() for name, model in models.items()}
modes = {name: system.modes() for name, system in systems.items()}
errors = {}
for name, reference in REFERENCE.items():
    omega = 2 * np.pi * modes[name].frequencies
    errors[name] = {k: abs(omega[k - 1] / value - 1) for k, value in reference.items()}
    assert max(errors[name].values()) < 1e-12, name
    # spring-dampers are all alike, so damping is proportional to stiffness: zeta = c omega / (2 k), c / k = 1 ms
    assert np.allclose(modes[name].damping_ratios, 0.5e-3 * omega, rtol=1e-11, atol=0)

# A plane ladder of joints in space is held too often: three constraint rows a loop say nothing new.
assert (systems["L20RF1"].dof, len(systems["L20RF1"].redundant)) == (20, 60)


def draw():
    """All natural frequencies, and how far those with a reference are off it."""
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 6), height_ratios=(2, 1))
    figure.set_layout_engine("constrained")
    for name, label in FAMILIES.items():
        number = np.arange(1, systems[name].dof + 1)
        known = np.array(list(REFERENCE[name]))
        (line,) = above.semilogy(number, modes[name].frequencies, ".", markersize=4, label=label)
        above.semilogy(known, np.array(list(REFERENCE[name].values())) / (2 * np.pi), "o", markersize=9,
                       markerfacecolor="none", color=line.get_color())  # fmt: skip
        # an error of exactly nothing has no place on a logarithmic axis
        below.semilogy(known, np.maximum(list(errors[name].values()), 1e-17), "o", color=line.get_color())
    below.axhline(np.finfo(float).eps, color="0.5", linewidth=0.8)
    below.text(51, 1.3 * np.finfo(float).eps, "spacing of doubles", ha="right", va="bottom", color="0.4")
    below.text(51, 1.3e-17, "no difference", ha="right", va="bottom", color="0.4")
    above.plot([], [], "o", markerfacecolor="none", color="0.3", markersize=9, label="reference, 50 digits")
    above.set(title="Natural frequencies of the three families", ylabel="natural frequency [Hz]")
    above.legend(loc="lower right")
    below.set(xlabel="number of the mode", ylabel="relative error [1]", ylim=(3e-18, 1e-11))
    for axes in (above, below):
        axes.grid(alpha=0.3)
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    for name, label in FAMILIES.items():
        print(f"{label}: largest relative error {max(errors[name].values()):.0e}")
    draw()
    plt.show()
