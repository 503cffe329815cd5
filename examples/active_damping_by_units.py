"""A Stewart platform and its active damping as two FMUs, co-simulated: error and largest stable step.

Force sensors in the legs and integral force feedback damp all six modes: the force of each leg's actuator is the
integral of the total force in the leg, spring and actuator together. If the spring force is measured, this is a
first-order filter,

    (s + a + g) f = g k e,

with a small leak a, so that the platform does not sink slowly. Plant and controller become functional mock-up units
(FMUs), as for any other simulation tool; the check acts as that tool. Most tools step both in parallel and hold the
inputs over the step (Jacobi): the error is of first order in the step, and the loop becomes unstable when steps get
long.
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
feedback = control.ss(
    -(GAIN + LEAK) * np.eye(6), np.eye(6), GAIN * np.eye(6), np.zeros((6, 6)), name="force feedback",
    inputs=[f"{leg}:force" for leg in legs], outputs=[f"{leg}:f" for leg in legs],
)  # fmt: skip

with TemporaryDirectory() as folder:
    fmus = [mx.to_fmu(system, Path(folder) / name, "2.0")
            for system, name in ((plant, "plant.fmu"), (feedback, "feedback.fmu"))]  # fmt: skip
    check = mx.check_cosimulation(fmus[0], fmus[1], STEP)

assert check.growth < 0  # damped, as one system
assert all(each.difference < 1e-9 for each in check.masters)  # the FMUs agree with the reference
orders = {each.method: each.order for each in check.masters}
assert np.allclose([orders["jacobi"], orders["slopes"], orders["iteration"]], [1, 2, 2], atol=0.25)
assert check["iteration"].errors[0] < check["jacobi"].errors[0] / 5
# with inputs held, the loop is stable for short steps only
assert STEP < check["jacobi"].largest_stable_step < 100 * STEP

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(check)
    figure = plt.figure(figsize=(8, 5))
    axes = figure.subplots()
    for each in check.masters:
        axes.loglog(each.steps, each.errors, "o-", label=f"{each.method}, order {each.order:.1f}")
    axes.set(xlabel="step [s]", ylabel="error of the platform's motion [1]", title="Co-simulated active damping")
    axes.legend()
    plt.show()
