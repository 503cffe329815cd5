"""Passive design of a Stewart isolator: how soft, how damped, how high, and what isolation costs in stiffness.

Free are stiffness and damping of its six legs, torsional stiffness of the 36 axes of flexures in its joints, and the
height of the payload's centre of mass. The best of them let least of the floor's noise through, while the payload must
not sag more than 20 um, the peak of transmissibility is below 1.25, and no leg strokes more than half a micrometre.
Gradients are exact. A front then shows what isolation costs in compliance to forces on the payload.

A cubic hexapod has it easier: its legs are orthogonal, and J^T k J gives all six stiffnesses without a computer.
"""

import time

import numpy as np

from mbsvib import isolation, library

FLOOR = {"x y z": [(1.0, 1e-6), (10.0, 1e-5), (200.0, 1e-5), (1000.0, 1e-7)]}  # acceleration [(m/s^2)^2/Hz]

model = library.stewart_isolator(leg_stiffness=2e6, leg_damping=20.0, payload_mass=1.0, torsion_stiffness=2.0)
goal = isolation.passive(model, "platform", length=0.1)
flexures = {f"leg{i}.{end}.k.stiffness.{axis}": 1.0
            for i in range(1, 7) for end in ("foot", "head") for axis in ("rx", "ry", "rz")}  # fmt: skip
variables = {"leg*.k.stiffness": (5e4, 1e7), "leg*.k.damping": (5.0, 2000.0), "flexures": (-1.9, 5.0),
             "platform.position.z": (0.06, 0.12)}  # fmt: skip
ties = {"flexures": flexures}
rms = goal.rms(FLOOR)
limits = (goal.sag() <= 20e-6, goal.peak() <= 1.25, goal.stroke(FLOOR) <= 0.5e-6)

start = time.perf_counter()
best = goal.optimize(variables, rms, limits, ties=ties)
seconds = time.perf_counter() - start
assert best.success
assert best.optimum.objective < 0.5 * best.optimum.began
assert best.after.amplification < 1.25 * (1 + 1e-6)

compliances = np.geomspace(0.9, 0.2, 3) * goal.compliance()(best.after.scene.system)
front = goal.front(variables, rms, goal.compliance(), compliances, limits, ties=ties)
assert (np.diff(front.objective) >= -1e-9).all()  # a stiffer platform shakes more

cubic = library.cubic_hexapod(edge=0.2, stiffness=1e6)
ideal = isolation.struts(cubic, "platform")
exact = np.linalg.inv(isolation.study(cubic, "platform", frequencies=[0.0]).compliance[:, :, 0].real)
assert np.allclose(ideal.stiffness, exact, rtol=1e-9, atol=1e-3)
assert ideal.coupling < 1e-12


def draw():
    """Transmissibility before and after, and the front."""
    import matplotlib.pyplot as plt

    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for name, study in (("as it was", best.before), ("best", best.after)):
        left.loglog(study.frequencies, study.index, label=name)
    left.set(xlabel="frequency [Hz]", ylabel="index of transmissibility [1]")
    left.legend()
    right.plot(1e6 * front.price, 1e3 * front.objective, "o-")
    right.set(xlabel="compliance of the payload [µm/N]", ylabel="vibration of the payload, rms [mm/s²]")
    plt.show()


if __name__ == "__main__":
    print(best)
    print(f"{seconds:.2f} s")
    print(front)
    draw()
