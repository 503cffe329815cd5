"""Frequencies of a wafer stage put where they ought to be, and followed on their way there.

The base frame is to get out of the way of the stage's servo control: its modes along x and y are to be separated, that
along z is to go beyond all of the control. On the way it meets others. A search that took "mode 15" for the fifteenth
lowest would run after another mode from there on; here modes are followed by their shapes, each keeps its name.

Values and gradients are exact, so that a dozen systems are evaluated.
"""

import numpy as np

import mbsvib as mv
from mbsvib.studies import frequency, placement

model = mv.library.wafer_stage()
modes = model.linearize().modes()
names = [" ".join(most) for most in modes.strongest()]
TARGETS = {"metrology z": 0.8, "base y": 16.0, "base x": 18.0, "base z": 36.0}  # Hz
numbers = {name: names.index(name) + 1 for name in TARGETS}  # counted from 1, as print(modes) does

variables = {
    "isolator*.stiffness.z": (1e3, 1e5), "foot*.stiffness.x": (1e5, 1e8), "foot*.stiffness.y": (1e5, 1e8),
    "foot*.stiffness.z": (1e6, 1e9),
}  # fmt: skip
found = mv.optimize(model, variables, placement({numbers[name]: f for name, f in TARGETS.items()}))
assert found.success
assert found.evaluations < 40
after = found.model.linearize().modes()
for wanted in TARGETS.values():
    assert np.min(np.abs(after.frequencies / wanted - 1)) < 1e-5

# The way there, in equal steps, each mode by its name.
way = {name: np.linspace(found.start[name], value, 40) for name, value in found.values.items()}
tracks = mv.track(model, way, numbers, how="paired")
for name, wanted in TARGETS.items():
    assert np.isclose(tracks.mode(name)[-1], wanted, rtol=1e-5)
assert np.argsort(tracks["frequencies"][-1]).tolist() != list(range(21)), "modes have changed places"

# With the feet's stiffness along x and y tied, both cannot be had; then one of the two is kept, the other bounded.
tied = mv.optimize(model, {"foot*.stiffness.[xy]": (1e5, 1e8)}, (frequency(numbers["base x"]) / 18.0 - 1) ** 2,
                   frequency(numbers["base y"]) <= 16.0)  # fmt: skip
assert tied.success
assert np.isclose(frequency(13)(tied.model.linearize()), 16.0, rtol=1e-5)


def draw():
    """Frequencies along the way, those with a target in colour."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    share = np.linspace(0.0, 1.0, len(tracks))
    for name, track in zip(tracks.modes, tracks["frequencies"].T, strict=True):
        if name in TARGETS:
            (line,) = axes.semilogy(share, track, linewidth=2, label=f"{name}: {track[0]:.3g} to {track[-1]:.3g} Hz")
            axes.plot(1.0, TARGETS[name], "o", color=line.get_color())
        else:
            axes.semilogy(share, track, color="0.75", linewidth=1, zorder=0)
    axes.set_yticks([0.5, 1, 2, 5, 10, 20, 40], labels=["0.5", "1", "2", "5", "10", "20", "40"])
    axes.minorticks_off()
    axes.set(xlabel="share of the way from start to optimum [1]", ylabel="natural frequency [Hz]", xlim=(0, 1.02),
             title="Wafer stage: four frequencies are placed, the others go along")  # fmt: skip
    axes.legend(loc="center", bbox_to_anchor=(0.5, 0.46))
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(found)
    draw()
    plt.show()
