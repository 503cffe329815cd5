"""A nano-stage on flexures: a piezo, a lever on notch hinges that enlarges its stroke, and a guide of two leaf springs.

Ideal hinges would enlarge the stroke by the ratio of the arms, 5. Real ones bend, which costs force, and stretch, which
costs stroke. Thick necks raise the first mode, which limits the bandwidth, thin ones leave more stroke. The
derivatives of the first mode show which dimension of a flexure has to be made with care.

The bending stiffness of a circular notch is that of Paros and Weisbord (How to design flexure hinges, 1965).
"""

from typing import Any

import numpy as np

import mbsvib as mv

ALUMINIUM = {"E": 7.1e10, "nu": 0.33, "rho": 2770}
NOTCH: dict[str, Any] = {"type": "notch", "radius": 0.002, "thickness": 0.0006, "width": 0.012}
LEAF: dict[str, Any] = {"type": "leaf", "length": 0.03, "width": 0.012, "thickness": 0.0005}
NEAR, FAR, PIEZO = 0.012, 0.060, 2e7  # m, m, N/m

model = mv.Model("nano stage")
model.add_body("lever", 0.025, (1.2e-6, 9e-6, 9e-6), position=(0.03, 0, 0.006))
model.add_body("stage", 0.12, (2e-5, 2.5e-5, 2e-5), position=(0.06, 0, 0.03))
model.add_flexure("pivot", "ground", "lever", NOTCH, ALUMINIUM, position=(0, 0, 0), beta=2e-6)
model.add_flexure("link", "lever", "stage", NOTCH, ALUMINIUM, position=(FAR, 0, 0.012), beta=2e-6)
for name, z in (("low", 0.02), ("high", 0.04)):  # leaves along x, soft along z
    model.add_flexure(name, "stage", "ground", LEAF, ALUMINIUM, position=(0.095, 0, z), orientation=(0, np.pi / 2, 0),
                      beta=2e-6)  # fmt: skip
model.add_spring("piezo", "ground", "lever", (NEAR, 0, -0.03), (NEAR, 0, 0.002), stiffness=PIEZO, damping=20.0)
model.add_input("drive", "lever", "z", (NEAR, 0, 0.002))
model.add_output("z", "stage", "z")
model.add_output("tilt", "stage", "ry")
system = model.linearize()

# With hinges that only bend all turn by theta = F NEAR / k, and the leaves bend by the stroke.
E, B = ALUMINIUM["E"], NOTCH["thickness"] / (2 * NOTCH["radius"])
g, s = 1 + B, 2 * B + B * B
flexibility = 3 / (2 * E * NOTCH["width"] * NOTCH["radius"] ** 2 * s) * (
    1 / g + (3 + 2 * B + B * B) / (g * s) + 6 * g / s**1.5 * np.arctan(np.sqrt((2 + B) / B)))  # fmt: skip
leaves = 2 * E * LEAF["width"] * (LEAF["thickness"] / LEAF["length"]) ** 3
bending = NEAR * FAR / (2 / flexibility + PIEZO * NEAR**2 + leaves * FAR**2)
static = system.frequency_response([0.0])[0, 0, 0].real
stiff = model.with_values({f"{name}.E": 1e6 * E for name in model.beams})  # that are rigid
assert bending * 0.7 < static < bending < NEAR * FAR / (PIEZO * NEAR**2)
assert abs(stiff.linearize().frequency_response([0.0])[0, 0, 0]) < 1e-3 * static

# Necks of both hinges from 0.1 to 2 mm, all at once.
necks = np.geomspace(1e-4, 2e-3, 41)
variants = model.linearize(values={"pivot.thickness": necks, "link.thickness": necks})
stroke = PIEZO * variants.frequency_response([0.0])[:, 0, 0, 0].real
first = np.array([variant[0] for variant in variants.modes().frequencies])
assert (np.diff(stroke) < 0).all()
assert (np.diff(first) > 0).all()

# The derivatives of the first mode are its slopes: a pivot that is 10 um thicker has it where they say.
modes = system.modes()
names = ["pivot.thickness", "link.thickness", "pivot.radius", "low.thickness", "low.length"]
slopes = 1e-5 * system.mode_sensitivities(names).frequencies[:, 0]
changed = model.with_values({"pivot.thickness": NOTCH["thickness"] + 1e-5}).linearize().modes().frequencies[0]
assert abs(changed - modes.frequencies[0] - slopes[0]) < 0.02 * abs(slopes[0])


def draw():
    """Stroke and first mode over the thickness of the necks, and what 10 um of each dimension do to the first mode."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
    above = left.twinx()
    left.semilogx(1e3 * necks, stroke, "C0")
    above.semilogx(1e3 * necks, first, "C1--")
    left.set(xlabel="thickness of the necks [mm]", ylim=(0, 5), title=f"arms of {FAR / NEAR:g} to 1")
    left.set_ylabel("stroke / free stroke of the piezo [1]", color="C0")
    above.set_ylabel("first mode [Hz]", color="C1")
    above.set_ylim(0, None)
    left.set_xticks([0.1, 0.2, 0.5, 1.0, 2.0], ["0.1", "0.2", "0.5", "1", "2"])
    left.minorticks_off()
    right.barh(names, slopes)
    right.axvline(0.0, color="k", lw=0.8)
    right.set(xlabel="change of the first mode by 10 µm [Hz]", title=f"first mode: {modes.frequencies[0]:.0f} Hz")
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(f"{1e9 * static:.1f} nm per N, with hinges that only bend {1e9 * bending:.1f} nm per N", modes, sep="\n")
    draw()
    plt.show()
