"""Geometry of a Stewart platform: how wide, how high and how far apart its legs should stand.

Eight variables: stiffness and damping of the legs, radius of base and platform, height of the platform, spread of the
legs on both rings, and the height of the payload's centre of mass. The legs have bodies and joints of their own, which
follow wherever the ends go. The payload is to yield to forces as little as can be, while the floor's noise shakes it by
no more than 0.08 m/s^2. All gradients are exact, those of the geometry too. Springs and dampers alone leave it 1.7
times as compliant: the geometry decides how stiff a platform is sideways and in torsion for what it is along its axis.
"""

import time
from math import radians

import numpy as np

from mbsvib import isolation, library

FLOOR = {"x y z": [(1.0, 1e-6), (10.0, 1e-5), (200.0, 1e-5), (1000.0, 1e-7)]}  # acceleration [(m/s^2)^2/Hz]

model = library.stewart(leg_stiffness=2e5, leg_damping=100.0)
goal = isolation.passive(model, "platform", length=0.1)
geometry = isolation.platform(model, "platform")

legs = {"leg*.k.stiffness": (5e4, 1e7), "leg*.k.damping": (5.0, 2000.0)}
shape = {"base.radius": (0.08, 0.2), "platform.radius": (0.05, 0.12), "platform.height": (0.05, 0.15),
         "base.spread": (radians(5), radians(20)), "platform.spread": (radians(5), radians(20)),
         "platform.position.z": (0.06, 0.12)}  # fmt: skip
limit = goal.rms(FLOOR) <= 0.08

springs = goal.optimize(legs, goal.compliance(), limit)
start = time.perf_counter()
best = goal.optimize(legs | shape, goal.compliance(), limit, ties=geometry.ties)
seconds = time.perf_counter() - start
assert springs.success
assert best.success
assert best.optimum.objective < 0.65 * springs.optimum.objective

# the mechanism that comes out is the one that the library builds with these numbers
found = best.values
low = np.radians([0, 0, 120, 120, 240, 240]) + found["base.spread"] * np.array([-1, 1] * 3)
high = np.radians([-60, 60, 60, 180, 180, 300]) + found["platform.spread"] * np.array([1, -1] * 3)
anew = library.stewart(
    leg_stiffness=found["leg*.k.stiffness"], leg_damping=found["leg*.k.damping"], base_radius=found["base.radius"],
    platform_radius=found["platform.radius"], platform_height=found["platform.height"], base_angles=low,
    platform_angles=high, payload_height=found["platform.position.z"],
)  # fmt: skip
found_again, built_anew = (each.linearize().modes().frequencies for each in (best.model, anew))
assert np.allclose(found_again, built_anew, rtol=1e-10)


def draw():
    """Transmissibility before and after, and the legs from above."""
    import matplotlib.pyplot as plt

    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for name, study in (("as it was", best.before), ("best springs", springs.after), ("best geometry", best.after)):
        left.loglog(study.frequencies, study.index, label=name)
    left.set(xlabel="frequency [Hz]", ylabel="index of transmissibility [1]")
    left.legend()
    for each, style in ((model, "C0:"), (best.model, "C2-")):
        for leg in each.springs.values():
            right.plot(*np.array([leg.start, leg.end]).T[:2], style)
    right.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    plt.show()


if __name__ == "__main__":
    print(springs)
    print(best)
    print(f"{seconds:.2f} s, {best.optimum.evaluations} systems")
    draw()
