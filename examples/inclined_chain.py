"""Eight masses on an inclined rail: the inclination changes no result.

Nine equal springs, both ends fixed, the rail rises 3 on 4: case SDLD02 of the French guide for checking structural
codes. Nothing in the answer depends on the slope, which makes it a test of every rotation matrix on the way. Shapes
and frequencies are those of a string of beads:

    f_i = (1/pi) sqrt(k/m) sin(i pi/18),    shape_i(j) = sin(i j pi/9).
"""

import numpy as np

from mbsvib.library import inclined_chain

system = inclined_chain().linearize()
modes = system.modes()

number = np.arange(1, 9)
closed_form = np.sqrt(1e5 / 10.0) / np.pi * np.sin(number * np.pi / 18)
assert np.allclose(modes.frequencies, closed_form, rtol=1e-13, atol=0)

# Displacement of every mass along the rail; columns are modes, scaled to fit the closed form.
rail = np.array([0.8, 0.6, 0.0])
shapes = np.array([rail @ modes.body_shapes[f"mass{j}"][:3] for j in number])
expected = np.sin(np.outer(number, number) * np.pi / 9)
shapes *= np.sum(shapes * expected, axis=0) / np.sum(shapes * shapes, axis=0)
assert np.allclose(shapes, expected, atol=1e-12)

# Pushed at one end, at rest, the first mass sees one spring in parallel with eight in series.
assert np.isclose(system.frequency_response([0.0])[0, 0, 0].real, 1 / (1e5 + 1e5 / 8), rtol=1e-12, atol=0)


def draw():
    """The eight shapes, each beside the sine it should be."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, 4, sharex=True, sharey=True, figsize=(10, 5), layout="constrained")
    along = np.linspace(0, 9, 200)
    for i, axes in enumerate(panels.flat):
        (closed,) = axes.plot(along, np.sin((i + 1) * along * np.pi / 9), color="0.7", label="closed form")
        (beads,) = axes.plot(number, shapes[:, i], "o", label="mbsvib")
        axes.plot([0, 9], [0, 0], "k|", markersize=14)
        axes.set_title(f"{modes.frequencies[i]:.3f} Hz", fontsize=10)
        axes.grid(alpha=0.3)
    figure.legend(handles=[closed, beads], loc="outside upper right", ncols=2)
    figure.suptitle("Beads on an inclined rail", x=0.01, ha="left")
    for axes in panels[:, 0]:
        axes.set_ylabel("displacement [1]")
    for axes in panels[1]:
        axes.set_xlabel("along the rail [m]")
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(modes)
    draw()
    plt.show()
