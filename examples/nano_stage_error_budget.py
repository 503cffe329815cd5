"""Error budget of a nano-positioning stage on a hexapod, before and after active isolation.

A floor that just meets criterion VC-C shakes the stage by micrometres at the resonances of its legs. Integral force
feedback damps these, and brings the noise of force sensors and amplifiers to the stage. Which gain is best, and what
dominates the error there? The budget of each gain answers that: its contributions are exact, and their squares add up.

The derivative of the root mean square to the gain is exact as well: at the best gain it is zero.
"""

import numpy as np
from scipy.optimize import brentq

from mbsvib import isolation, library

TURN = 2 * np.pi
stage = library.cubic_hexapod(stiffness=2e5, damping=2.0)
active = isolation.actuated(stage, "platform")
plant = active.system

floor = isolation.vc_spectrum("VC-C")  # (m/s^2)^2/Hz
amplifier = isolation.shaped([TURN * 1000], [1, TURN * 1000], 1e-8)  # N^2/Hz, a low-pass filter at 1 kHz
open_noise = {"base.[xyz]": floor, "leg*.actuator": amplifier}
noise = {"base.[xyz]": floor, "leg*.force.noise": 1e-6, "leg*.actuator.noise": amplifier}


def budget_at(gain):
    """The budget of the vertical error under integral force feedback of a gain [1/s]."""
    controller = isolation.force_feedback(active, gain, leak=TURN * 1.0)
    return plant.feedback(controller, noise=True).budget(noise, "z")


def slope(gain):
    """Derivative of the root mean square to the gain, which is the diagonal of the controller's matrix C."""
    return budget_at(gain).controller_sensitivities()["z"]["C"].diagonal().sum()


before = plant.budget(open_noise, "z")
best = brentq(slope, 20.0, 400.0, rtol=1e-6)
after = budget_at(best)
assert after.rms["z"] < 0.08 * before.rms["z"]
assert all(after.rms["z"] < budget_at(factor * best).rms["z"] for factor in (0.9, 1.1))
assert np.isclose(sum(part**2 for part in after.contributions["z"].values()), after.rms["z"] ** 2)

gains = np.geomspace(10.0, 1000.0, 25)
parts = {"floor": "base", "force sensors": "force.noise", "amplifiers": "actuator.noise"}
curves: dict[str, list[float]] = {name: [] for name in ("all", *parts)}
for gain in gains:
    each = budget_at(gain)
    curves["all"].append(each.rms["z"])
    for name, word in parts.items():
        squares = [value**2 for source, value in each.contributions["z"].items() if word in source]
        curves[name].append(np.sqrt(sum(squares)))


def draw():
    """Contributions over the gain, and cumulative errors before and after."""
    import matplotlib.pyplot as plt

    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for name, values in curves.items():
        left.loglog(gains, 1e6 * np.array(values), label=name, linewidth=2.5 if name == "all" else 1.5)
    left.plot(best, 1e6 * after.rms["z"], "ko", label=f"best gain {best:.0f} 1/s")
    left.set(xlabel="gain of force feedback [1/s]", ylabel="rms of the error z [µm]", ylim=(1e-3, 2))
    left.legend()
    f = np.geomspace(0.5, 200.0, 600)
    for name, budget in (("passive", before), ("active", after)):
        right.loglog(f, 1e6 * budget.cumulative(f)[0], label=f"{name}: {1e6 * budget.rms['z']:.2f} µm")
    right.set(xlabel="frequency [Hz]", ylabel="cumulative rms of the error z [µm]")
    right.legend()
    plt.show()


if __name__ == "__main__":
    print(before)
    print(after)
    draw()
