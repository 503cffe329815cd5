"""A hexapod by H-infinity synthesis: the smallest peak of transmissibility, and what robustness costs.

Six legs carry a payload of 10 kg; each has an actuator, and an accelerometer above it. Without damping to speak of, the
open loop amplifies the floor's vibration 791-fold at its resonances. The synthesis keeps the largest response small,
from the floor's acceleration and the sensors' noise to the payload's acceleration and the forces that this takes.

The controller of the least norm has fast poles, and little phase lag makes its loops unstable. One that is allowed a
norm 1.2 times as large bears four times the lag in all loops at once. Structured singular values state by how much the
gains of all six actuators may be wrong, each in its own way: 11 and 78 %.

Needs ctrlsys:  pip install "mbsvib[ctrlsys]"
"""

from importlib.util import find_spec

import numpy as np

from mbsvib import isolation, library

if find_spec("ctrlsys") is None:
    raise SystemExit('This example needs ctrlsys:  pip install "mbsvib[ctrlsys]"')

plant = isolation.actuated(library.cubic_hexapod(damping=2.0), "platform")
sensors = plant.names("acceleration")
frequencies = np.geomspace(1.0, 5e3, 800)  # [Hz]

laws = {name: isolation.hinf(plant, sensors, effort=1.0, noise=0.1, relaxation=allowed)
        for name, allowed in (("least norm", 1.0), ("1.2 times the norm", 1.2))}  # fmt: skip
loops = {name: plant.with_gains(law) for name, (law, _) in laws.items()}
studies = {"open": plant.isolation(frequencies), **{name: loop.isolation(frequencies) for name, loop in loops.items()}}
margins = {name: loop.margins() for name, loop in loops.items()}

peaks = [study.amplification for study in studies.values()]
assert all(loop.stable for loop in loops.values())
assert peaks[0] > 700.0
assert peaks[1] < peaks[2] < 0.005 * peaks[0]
for (_, norm), peak in zip(laws.values(), peaks[1:], strict=True):
    assert peak <= norm
tight, relaxed = (each.all_phases for each in margins.values())
assert relaxed > 25.0 > 1.9 * tight

# T = 1 - S at the actuators: loops whose gains are (1 + d_i) times as large are stable for |d_i| < 1 / mu(T)
uncertain = {}
for name, loop in loops.items():
    complementary = np.eye(6)[:, :, None] - loop.sensitivity(2 * np.pi * frequencies)
    uncertain[name] = isolation.structured_singular_values(complementary)
allowed = [1.0 / each.max() for each in uncertain.values()]
assert allowed[1] > 2.5 * allowed[0] > 0.2


def draw():
    """Transmissibility, open and closed, and how much uncertain actuators matter at each frequency."""
    import matplotlib.pyplot as plt

    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4.8), layout="constrained")
    for name, study in studies.items():
        left.loglog(study.frequencies, study.index, label=name)
    left.set(xlabel="frequency [Hz]", ylabel="index of transmissibility [1]")
    left.legend()
    for name, values in uncertain.items():
        right.semilogx(frequencies, values, label=name)
    right.set(xlabel="frequency [Hz]", ylabel="structured singular value of T [1]")
    right.legend()
    plt.show()


if __name__ == "__main__":
    for name, (_, norm) in laws.items():
        print(f"{name}: norm {norm:.2f}, amplification {studies[name].amplification:.2f} instead of {peaks[0]:.0f}")
        print(margins[name])
    for name, part in zip(loops, allowed, strict=True):
        print(f"{name}: stable with all actuators' gains wrong by up to {100 * part:.0f} %, each in its own way")
    draw()
