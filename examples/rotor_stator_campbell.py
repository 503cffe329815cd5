"""A heavy rotor on a soft stator: how its whirls part as it speeds up, and where unbalance meets them.

The rotor leans out of its bearing, so that it tilts as it whirls, and its angular momentum stiffens what goes forward
and softens what goes backward. Unbalance turns with the rotor: where a forward whirl is as quick as that, there is a
critical speed. With x + i y, s = i w and the speed W the whirls are roots of

    (1500 s^2 + s + 1000)(1281.25 s^2 + (10 - 1000 i W) s + 1e4) - 975^2 s^4 = 0.
"""

import numpy as np

from mbsvib.campbell import campbell
from mbsvib.library import rotor_stator

speeds = np.linspace(0.0, 6.0, 61)
data = campbell(rotor_stator(1.0), speeds)


def whirls(speed):
    """Frequencies [Hz] of the whirls in closed form, ascending, forward ones positive."""
    one, two = np.array([1500.0, 1.0, 1000.0]), np.array([1281.25, 10.0 - 1000.0j * speed, 1e4])
    roots = np.roots(np.polysub(np.polymul(one, two), [975.0**2, 0, 0, 0, 0]))
    return np.sort(roots.imag) / (2 * np.pi)


for k in (1, 30, 60):
    for frequency in whirls(speeds[k]):
        nearest = np.abs(data.frequencies[k] - abs(frequency)).min()
        assert nearest < 1e-11 * abs(frequency)

# Unbalance excites what goes round forward: i W solves the equation there, but for the little damping.
forward = [point for point in data.critical if point.whirl > 0.5]
for point in forward:
    assert np.abs(2 * np.pi * whirls(point.speed) - point.speed).min() < 1e-9 * point.speed
    print(f"forward whirl at {point.speed:.4f} rad/s, {60 / (2 * np.pi) * point.speed:.2f} revolutions per minute")
assert forward

# The bearing feels it: the force per unit force of unbalance along x, at the rotor's own speed.
force = np.array([abs(rotor_stator(w).linearize().frequency_response([w])[3, 0, 0]) for w in speeds[1:]])


def draw():
    """Campbell diagram, and the force in the bearing over the speed."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for mode in range(data.whirl.shape[1]):
        left.plot(speeds, data.frequencies[:, mode], "C0" if data.whirl[-1, mode] > 0.5 else "0.6")
    left.plot(speeds, speeds / (2 * np.pi), "C3--", label="unbalance")
    left.plot([p.speed for p in forward], [p.frequency for p in forward], "C3o", label="critical speed")
    left.set(xlabel="speed [rad/s]", ylabel="frequency [Hz]", ylim=(0.0, 1.2), title="Forward whirl: blue")
    right.semilogy(speeds[1:], force, "C0")
    right.set(xlabel="speed [rad/s]", ylabel="bearing force [N/N]", title="Unbalance")
    for axes in (left, right):
        axes.grid(alpha=0.3)
    left.legend()
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
