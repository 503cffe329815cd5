"""Which parameter of a leg moves which mode of a Stewart platform, and by how much.

All derivatives come in one pass and without differences: stiffness, masses, and where the joints of the leg are. The
platform has two pairs of modes that coincide by symmetry. What is done to one leg alone parts them: each has a
derivative of its own, and one of both often has none, as its motion is at right angles to what changed.
"""

import numpy as np

from mbsvib.library import stewart

model = stewart()
system = model.linearize()


def outwards(joint):
    """Return how a joint's coordinates change as it moves away from the platform's axis."""
    x, y, _ = model.joints[joint].position
    return {f"{joint}.position.x": x / np.hypot(x, y), f"{joint}.position.y": y / np.hypot(x, y)}


# what is done to leg 1: a linear map of parameters, and how far
STEPS = {
    "stiffness, 1 %": ({"leg1.k.stiffness": 1.0}, 0.01 * model.parameters["leg1.k.stiffness"]),
    "mass of upper part, 1 %": ({"leg1.upper.mass": 1.0}, 0.01 * model.parameters["leg1.upper.mass"]),
    "foot outwards, 0.5 mm": (outwards("leg1.foot"), 0.5e-3),
    "foot upwards, 0.5 mm": ({"leg1.foot.position.z": 1.0}, 0.5e-3),
    "head outwards, 0.5 mm": (outwards("leg1.head"), 0.5e-3),
    "head upwards, 0.5 mm": ({"leg1.head.position.z": 1.0}, 0.5e-3),
}
sizes = np.array([step for _, step in STEPS.values()])[:, None]
slopes = system.eigenvalue_sensitivities({name: rates for name, (rates, _) in STEPS.items()})[:, ::2]
values = system.modes().eigenvalues[::2]
shift = (slopes * values.conj()).real / np.abs(values) / (2 * np.pi) * sizes  # Hz

# The third mode is a single one: a step that small may be taken, and moves it as foretold.
for row, (rates, step) in zip(shift, STEPS.values(), strict=True):
    moved = model.with_values({name: model.parameters[name] + 0.01 * step * rate for name, rate in rates.items()})
    change = moved.linearize().modes().frequencies[2] - system.modes().frequencies[2]
    assert np.isclose(change, 0.01 * row[2], rtol=5e-3, atol=1e-9)
# Stiffness of one leg moves one of each pair, and all six together move what a common factor would: f ~ sqrt(k).
every = system.eigenvalue_sensitivities("leg*.k.stiffness")[0, ::2].imag
assert np.allclose(every * 2e7, 0.5 * values.imag, rtol=1e-4)
assert np.allclose(shift[0, [0, 3]], 0.0, atol=1e-6)


def draw():
    """Bars of the shift of each mode, one colour for each change of the leg."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 4.5), layout="constrained")
    place, width = np.arange(shift.shape[1]), 0.8 / len(STEPS)
    for i, (name, row) in enumerate(zip(STEPS, shift, strict=True)):
        axes.bar(place + (i - 2.5) * width, row, width, label=name)
    names = ("lower of x, y", "higher of x, y", "z", "lower of rx, ry", "higher of rx, ry", "rz")
    axes.set_xticks(place, [f"{name}\n{f:.0f} Hz" for name, f in zip(names, system.modes().frequencies, strict=True)])
    axes.axhline(0.0, color="0.3", linewidth=0.8)
    axes.grid(axis="y", alpha=0.3)
    axes.set(xlabel="mode", ylabel="shift of the frequency [Hz]",
             title="What is done to leg 1 alone, and which mode it moves")  # fmt: skip
    axes.legend(ncols=2, fontsize=8)
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
