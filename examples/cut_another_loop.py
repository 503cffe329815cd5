"""Cutting the loops of a mechanism elsewhere changes the coordinates, and nothing that can be measured.

A Stewart platform has 18 joints and 13 bodies, hence 5 loops, and each is cut at one of its joints before the rest is
a tree. Cut at the slides or at the feet, the six minimal coordinates are angles of quite different joints, and mass
matrices have little in common. Frequencies and compliance are those of the platform all the same. So the cut is a
matter of numbers only, and unless one asks for certain coordinates, it is best left to the toolbox.
"""

import numpy as np

from mbsvib.library import stewart

CUTS = {
    "left to the toolbox": None,
    "at the feet": [f"leg{i}.foot" for i in range(1, 6)],
    "at the slides": [f"leg{i}.slide" for i in range(1, 6)],
    "at other heads": [f"leg{i}.head" for i in range(1, 6)],
    "here and there": ["leg1.foot", "leg2.slide", "leg3.head", "leg4.foot", "leg5.slide"],
}
model = stewart()
systems = {name: model.linearize(cut=cut) for name, cut in CUTS.items()}

usual = systems["left to the toolbox"]
stiff = usual.frequency_response([0.0])[:, :, 0].real
for name, system in systems.items():
    assert len(system.cut_joints) == 5, name
    assert np.allclose(system.modes().frequencies, usual.modes().frequencies, rtol=1e-12, atol=0), name
    static = system.frequency_response([0.0])[:, :, 0].real
    assert np.allclose(static, stiff, rtol=0, atol=1e-12 * np.max(stiff)), name
assert systems["at the feet"].coordinates != systems["at the slides"].coordinates
assert abs(usual.modes().frequencies[0] - 780.601788) < 1e-6

# Coordinates may be asked for as well: here the angles at the foot of three legs.
angles = [f"leg{i}.foot.{d}" for i in (1, 3, 5) for d in ("rx", "ry")]
chosen = model.linearize(independent=angles)
assert sorted(chosen.coordinates) == angles
assert np.allclose(chosen.modes().frequencies, usual.modes().frequencies, rtol=1e-12, atol=0)


def draw():
    """Mass matrices in their own coordinates, above frequencies that do not know about them."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, len(systems), figsize=(8.6, 4.0), layout="constrained", height_ratios=(3, 2))
    for (name, system), above, below in zip(systems.items(), *panels, strict=True):
        size = np.sqrt(np.diag(system.M))
        image = above.imshow(system.M / np.outer(size, size), cmap="RdBu_r", vmin=-1, vmax=1)
        above.set_title(name, fontsize=9)
        above.set_xticks(range(6), system.coordinates, rotation=90, fontsize=7)
        above.set_yticks([])
        below.stem(range(1, 7), system.modes().frequencies)
        below.set(xlabel="mode", ylabel="frequency [Hz]" if above is panels[0, 0] else "", ylim=(0, 1400),
                  yticks=(0, 500, 1000), yticklabels=("0", "500", "1000") if above is panels[0, 0] else ())
        below.set_xticks(range(1, 7))
        below.grid(alpha=0.3)
    figure.colorbar(image, ax=list(panels[0]), label="mass, unit diagonal [1]")
    figure.suptitle("One platform, five ways to cut its loops")
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    for name, system in systems.items():
        print(f"{name:>20}: {', '.join(system.coordinates)}")
    draw()
    plt.show()
