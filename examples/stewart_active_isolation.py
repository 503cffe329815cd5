"""Active isolation of a Stewart platform: damp it from within, then hang it on the sky.

Each leg of the isolator has an actuator beside its spring, a force sensor in series, and an accelerometer above. Low
authority control integrates each leg's own force: whatever the gain, that takes energy, as actuator and sensor are
collocated, poles and zeros interlaced. High authority control then feeds back the platform's absolute velocity in
modal coordinates, so that its six suspension modes behave as dampers to the sky would make them: HAC-LAC. Margins of
all twelve loops together show what model errors may do, and the delay of the computer what it does.

On one strut all is known: with a pole Omega and a zero z the most that force feedback damps is (Omega - z) / (2 z).
"""

import numpy as np

import mbsvib as mv
from mbsvib import isolation, library

strut = mv.Model("strut")
strut.add_body("payload", 12.0, (0.2, 0.2, 0.2), (0, 0, 0.3))
strut.add_joint("guide", "prismatic", "ground", "payload", axis=(0, 0, 1))
strut.add_spring("leg", "ground", "payload", (0, 0, 0), (0, 0, 0.2), 9e4)
strut.add_spring("beside", "ground", "payload", (0.1, 0, 0), (0.1, 0, 0.2), 3e4)
single = isolation.actuated(strut, "payload", "leg", directions="z")
gain, ratio = isolation.force_feedback_optimum(np.sqrt(1.2e5 / 12.0), np.sqrt(3e4 / 12.0))
assert np.isclose(single.with_gains(isolation.force_feedback(single, gain)).damping_ratios[0], ratio, rtol=1e-9)

stiff = library.stewart_isolator(leg_stiffness=20e6, leg_damping=20.0, payload_mass=1.0, torsion_stiffness=20.0,
                                 torsion_damping=5e-5)  # fmt: skip
plant = isolation.actuated(stiff, "platform", length=0.1)
pairs = isolation.collocation(plant, [("leg1.k.actuator", "leg1.k.force"), ("leg1.k.actuator", "leg2.k.force")])
assert pairs.pairs[0].passive  # its own force
assert not pairs.pairs[1].passive  # its neighbour's
gains = np.linspace(0.0, 2.5e4, 60)
locus = isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), gains)
assert locus.stable.all()

inner = isolation.force_feedback(plant, 2000.0, leak=2 * np.pi * 20.0)
outer = isolation.skyhook(plant, 0.4, "modal", leak=2 * np.pi * 2.0)
both = plant.with_gains(inner, outer)
studies = {"passive": plant.isolation(), "force feedback": plant.with_gains(inner).isolation(),
           "HAC-LAC": both.isolation()}  # fmt: skip
peaks = [study.amplification for study in studies.values()]
assert peaks[2] < 2.0 < peaks[1] < peaks[0]
margins = both.margins()
assert margins.all_phases > 25.0
on_computer = both.sampled(20e3, delay=20e-6)
assert on_computer.stable

try:  # the other sign drives what it ought to damp, and the mode is named
    plant.with_gains(isolation.velocity_feedback(plant, -500.0)).isolation()
except mv.ResponseError as error:
    refusal = str(error)
assert "mode 12 (1270 Hz, platform rz)" in refusal


def draw():
    """Root locus of force feedback, and transmissibility with each loop."""
    import matplotlib.pyplot as plt

    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained")
    mv.plots.root_locus(locus, imaginary=(0.0, 2000.0), real=(-1500.0, 50.0), ax=left)
    for name, study in studies.items():
        right.loglog(study.frequencies, study.index, label=name)
    right.set(xlim=(10, 5000), xlabel="frequency [Hz]", ylabel="index of transmissibility [1]")
    right.legend()
    plt.show()


if __name__ == "__main__":
    for thing in (pairs, both, margins, refusal):
        print(thing)
    draw()
