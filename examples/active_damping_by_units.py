"""A Stewart platform and its active damping as two units, co-simulated: how wrong is it, and from which step on?

Force sensors in the legs and integral force feedback damp all six modes: each leg's actuator pushes with a force that
follows the integral of what the leg carries, spring and actuator together. With the spring's force as measurement that
is a first-order filter,

    (s + a + g) f = g k e,

with a small leak a, so that the platform does not fall down slowly. Plant and controller become functional mock-up
units, as they would for any other simulation tool; the check plays that tool. Most tools let both step at once and hold
inputs meanwhile (Jacobi): an error of first order in the step, and active damping that is lost and then turns into its
contrary when steps get long.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import control
import numpy as np

import mbsvib_export as mx
from mbsvib.library import stewart

GAIN, LEAK = 2 * np.pi * 300.0, 2 * np.pi * 20.0  # 1/s
STEP = 1e-4  # s
legs = [f"leg{i}" for i in range(1, 7)]

plant = stewart(ports=("platform", "legs")).linearize()
# python-control has no '.' in names; the exporter gives the signals their names back
law = control.ss(
    -(GAIN + LEAK) * np.eye(6), np.eye(6), GAIN * np.eye(6), np.zeros((6, 6)), name="force feedback",
    inputs=[f"{leg}:force" for leg in legs], outputs=[f"{leg}:f" for leg in legs],
)  # fmt: skip

with TemporaryDirectory() as folder:
    units = [mx.to_fmu(system, Path(folder) / name, "2.0")
             for system, name in ((plant, "plant.fmu"), (law, "law.fmu"))]  # fmt: skip
    check = mx.check_cosimulation(units[0], units[1], STEP)

assert check.growth < 0  # damped, as one system
assert all(each.difference < 1e-9 for each in check.masters)  # the units do what numpy says they should
orders = {each.method: each.order for each in check.masters}
assert np.allclose([orders["jacobi"], orders["slopes"], orders["iteration"]], [1, 2, 2], atol=0.25)
assert check["iteration"].errors[0] < check["jacobi"].errors[0] / 5
# with inputs held, the step is what decides whether damping is damping
assert STEP < check["jacobi"].largest_stable_step < 100 * STEP

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(check)
    figure = plt.figure(figsize=(8, 5))
    axes = figure.subplots()
    for each in check.masters:
        axes.loglog(each.steps, each.errors, "o-", label=f"{each.method}, order {each.order:.1f}")
    axes.set(xlabel="step [s]", ylabel="error of the platform's motion [-]", title="Co-simulated active damping")
    axes.legend()
    plt.show()
