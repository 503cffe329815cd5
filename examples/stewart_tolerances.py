"""Ten thousand Stewart platforms, none as drawn: what tolerances do to its frequencies.

Legs come with 5 % of tolerance of their stiffness, parts with 2 % of their mass, joints sit within a tenth of a
millimetre. All samples are linearized in batches, in seconds. First order gives the same from derivatives alone, and
which tolerance is worth its money.

By symmetry the platform has two pairs of equal frequencies. These part as soon as anything is off: their derivatives
are matrices, and the scatter is that of the eigenvalues of a random matrix. No straight line would show that.
"""

import numpy as np

import mbsvib as mv
from mbsvib.studies import frequency

model = mv.library.stewart()
TOLERANCES = {
    "leg*.k.stiffness": "5 %", "*.mass": "2 %", "leg*.foot.position.[xyz]": 1e-4, "leg*.head.position.[xyz]": 1e-4,
}  # fmt: skip
found = mv.tolerances(model, TOLERANCES, {"frequency [Hz]": frequency()}, progress=__name__ == "__main__")
assert found.sampled.shape == (10_000, 6)
assert len(found.tolerance) == 55
assert not found.sweep.failed.any()
# First order is right about the scatter, of pairs that part as well.
assert np.allclose(found.std, found.first, rtol=0.03)
assert found.close_modes.tolist() == [True, True, False, True, True, False]
apart = found.sampled[:, 1] - found.sampled[:, 0]
assert np.isclose(apart.mean(), np.diff(found.linear[:, :2], axis=1).mean(), rtol=0.02)
# Stiffness is what counts, not the joints: their positions have less than a tenth of the variance.
joints = ["position" in name for name in found.tolerance]
assert (found.shares[:, joints].sum(axis=1) < 0.1).all()
assert found.within("frequency 3 [Hz]", 890.0, 915.0) > 0.998


def draw():
    """Samples and first order of a pair, and their difference."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    for i, colour in ((0, "C0"), (1, "C1")):
        edges = np.linspace(*np.quantile(found.sampled[:, i], (0.0005, 0.9995)), 50)
        left.hist(found.sampled[:, i], edges, color=colour, alpha=0.5, label=f"mode {i + 1}, samples")
        left.hist(found.linear[:, i], edges, color=colour, histtype="step", label="first order")
    left.axvline(found.nominal[0], color="0.3", linewidth=0.8, linestyle="--", label="as drawn")
    left.set(xlabel="frequency [Hz]", ylabel="number of platforms", title="Two frequencies that are one by symmetry")
    left.legend(fontsize=8)
    edges = np.linspace(0.0, np.quantile(apart, 0.999), 60)
    right.hist(apart, edges, color="0.7", label="samples")
    right.hist(found.linear[:, 1] - found.linear[:, 0], edges, histtype="step", color="C3", label="first order")
    right.set(xlabel="difference of modes 1 and 2 [Hz]", ylabel="number of platforms", title="Split modes repel")
    right.legend()
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(found)
    draw()
    plt.show()
