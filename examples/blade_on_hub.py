"""A turbine blade over the speed of its hub: Campbell diagram in the rotating frame, and the speeds to avoid.

Centrifugal tension stiffens the blade, so that its frequencies rise with the speed. In the rotating frame the tower and
the wind shear excite it at multiples of the speed; where a multiple meets a mode, the blade resonates. The flapping
frequencies are close to those of Southwell's formula, f^2 = f0^2 + s (speed / 2 pi)^2 with a constant s.

Southwell's formula: R. Southwell, F. Gough, British A.R.C. Reports and Memoranda 766 (1921).
"""

from itertools import pairwise

import numpy as np

import mbsvib as mv

LENGTH, HUB, SPEEDS = 6.0, 0.4, np.linspace(0.0, 12.0, 25)  # m, m, rad/s
GLASS = {"E": 3.0e10, "nu": 0.25, "rho": 1900.0}

blade = mv.Model("blade")
blade.add_hub("hub", speed=0.0, axis=(0, 0, 1))
stations = np.linspace(0.0, LENGTH, 7)
for k, (start, end) in enumerate(pairwise(stations)):  # a taper of six sections
    share = (start + end) / (2 * LENGTH)
    section = {"type": "rectangle", "width": 0.55 - 0.35 * share, "height": 0.14 - 0.10 * share}
    blade.add_beam(f"part{k}", "hub" if k == 0 else f"part{k - 1}.2", None, section, GLASS, (HUB + start, 0, 0),
                   (HUB + end, 0, 0), elements=2, damping_ratio=0.005, y_axis=(0, 1, 0))  # fmt: skip
blade.add_input("gust", "part5.2", "z")
blade.add_output("tip", "part5.2", "z")

batch = blade.linearize(values={"hub.speed": SPEEDS})
frequencies = batch.modes().frequencies[:, :4]
shapes = [blade.with_values({"hub.speed": 6.0}).linearize().modes().body_shapes["part5.2"][:, k] for k in range(4)]
words = ["flap" if abs(shape[2]) > abs(shape[1]) else "lag" for shape in shapes]
labels = [f"{word} {words[: k + 1].count(word)}" for k, word in enumerate(words)]

# Southwell: the square of a flapping frequency is linear in that of the speed, as long as its shape stays.
flap = frequencies[:, words.index("flap")]
southwell = (flap[1:] ** 2 - flap[0] ** 2) / (SPEEDS[1:] / (2 * np.pi)) ** 2
assert southwell.min() > 1.0
assert np.ptp(southwell) < 0.1 * southwell.mean()

rated, multiples = 9.0, (1, 2, 3, 4, 6)
crossings = [(float(np.interp(0.0, (difference := n * SPEEDS / (2 * np.pi) - frequencies[:, k]), SPEEDS)), n, labels[k])
             for k in range(4) for n in multiples if n * SPEEDS[-1] / (2 * np.pi) > frequencies[-1, k]]  # fmt: skip
for speed, n, label in sorted(crossings):
    print(f"{label} meets {n} per revolution at {speed:.2f} rad/s")
assert min(abs(speed - rated) for speed, *_ in crossings) > 0.2


def draw():
    """Frequencies over the speed with its multiples."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.0, 4.6), layout="constrained")
    for k, label in enumerate(labels):
        axes.plot(SPEEDS, frequencies[:, k], label=label)
    for n in multiples:
        axes.plot(SPEEDS, n * SPEEDS / (2 * np.pi), color="0.6", linewidth=0.8)
        at = min(SPEEDS[-1], 2 * np.pi * 1.02 * frequencies.max() / n)
        axes.annotate(f"{n} per rev.", (at, n * at / (2 * np.pi)), color="0.3", fontsize=8, ha="right", va="center",
                      bbox={"boxstyle": "square,pad=0.1", "color": "white"})  # fmt: skip
    axes.plot([speed for speed, *_ in crossings], [n * speed / (2 * np.pi) for speed, n, _ in crossings], "k.",
              label="resonance")  # fmt: skip
    axes.axvline(rated, color="0.3", linestyle="--", label=f"rated speed, {rated:g} rad/s")
    axes.set(xlabel="speed of the hub [rad/s]", ylabel="frequency [Hz]", xlim=(0, SPEEDS[-1]), ylim=(0, None),
             title="Blade in the rotating frame")  # fmt: skip
    axes.legend(loc="center left", bbox_to_anchor=(0.0, 0.7))
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
