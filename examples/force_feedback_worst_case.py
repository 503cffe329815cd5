"""Worst case of integral force feedback: legs known to 10 %, a payload of 9 to 12 kg.

The resonance is to amplify vibration of the floor by 2 at most, whatever the stiffness of each leg and the payload are.
Which gain of force feedback is enough? Uncertain parameters enter the equations exactly, so that the largest
amplification within their limits is proven at all frequencies, and reached at values that are known.
"""

import numpy as np

from mbsvib import isolation, library

LIMITS = {"leg*.k.stiffness": 0.1, "platform.mass": (9.0, 12.0)}
ALLOWED = 2.0
GAINS = (30.0, 60.0, 120.0, 240.0)  # 1/s
PORTS = "acceleration.z", "base.z"

stage = library.cubic_hexapod(stiffness=2e5, damping=20.0)
active = isolation.actuated(stage, "platform")
plant = active.system.uncertain(LIMITS)


def loop_at(gain):
    """The uncertain loop with integral force feedback of a gain [1/s]."""
    return plant.feedback(isolation.force_feedback(active, gain, leak=0.6))


loops = {gain: loop_at(gain) for gain in GAINS}
nominal = {gain: loop.nominal.hinf_norm(*PORTS).value for gain, loop in loops.items()}
worst = {gain: loop.worst_gain(*PORTS) for gain, loop in loops.items()}
enough = min(gain for gain in GAINS if worst[gain].upper <= ALLOWED)
loop, bound = loops[enough], worst[enough]
there = loop.at(bound.values)  # linearized anew
stable = loop.robust_stability()

assert all(1.0 <= case.upper / case.lower < 1.02 for case in worst.values())
assert all(nominal[gain] < worst[gain].lower for gain in GAINS)
assert np.isclose(there.hinf_norm(*PORTS).value, bound.lower, rtol=1e-9)
assert all(case.hinf_norm(*PORTS).value < bound.upper for case in loop.sample(10, seed=1))
assert stable.lower > 1.0


def draw():
    """Amplification over the gain, and transmissibility at the gain that is enough."""
    import matplotlib.pyplot as plt

    _, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    left.semilogx(GAINS, list(nominal.values()), "o-", label="nominal")
    left.semilogx(GAINS, [case.upper for case in worst.values()], "s-", label="worst case, proven")
    left.semilogx(GAINS, [case.lower for case in worst.values()], "k+", markersize=12, label="worst case, reached")
    left.axhline(ALLOWED, color="0.5", linestyle="--", label="allowed")
    left.set(xlabel="gain of force feedback [1/s]", ylabel="largest transmissibility, vertical [1]", ylim=(0.0, None))
    left.set_xticks(GAINS, [f"{gain:.0f}" for gain in GAINS])
    left.minorticks_off()
    left.legend()
    f = np.geomspace(8.0, 120.0, 500)

    def transmissibility(case):
        return np.abs(case.with_ports(*PORTS).frequency_response(2 * np.pi * f)[0, 0])

    for number, case in enumerate(loop.sample(25, seed=1)):
        right.loglog(f, transmissibility(case), color="0.75", linewidth=0.8, label="samples" if number == 0 else None)
    right.loglog(f, transmissibility(loop.nominal), "k", label="nominal")
    right.loglog(f, transmissibility(there), "C3", label="worst values")
    right.axhline(bound.upper, color="C3", linestyle=":", label=f"proven: at most {bound.upper:.3f}")
    right.set(xlabel="frequency [Hz]", ylabel=f"transmissibility at {enough:.0f} 1/s [1]", ylim=(0.08, 3.0))
    right.legend(loc="lower left")
    plt.show()


if __name__ == "__main__":
    print(plant)
    print(bound)
    print(stable)
    draw()
