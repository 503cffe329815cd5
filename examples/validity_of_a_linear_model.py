"""How far a linear model holds: a toggle near its stretched pose, by second derivatives and by nonlinear runs.

Two arms push a slider against a spring. The nearer they are to their stretched pose, the less the slider moves to first
order, and the sooner its second-order part is as large. `linear_range` finds from one linearization at which amplitude
that part reaches a tenth; nonlinear runs released there, and at other amplitudes, show what really happens.
"""

import numpy as np

import mbsvib as mv

ANGLES = np.geomspace(0.005, 0.3, 9)
FACTORS = np.geomspace(0.03, 2.0, 7)
LONG, SHARE = 0.1, 0.1


def linear(angle):
    """The toggle without damping to speak of, in the angle of its first arm."""
    model = mv.library.toggle(angle=angle, spring_damping=1e-9)
    return model, model.linearize(independent=["base.rz"])


def deviation(angle, factor):
    """Times in periods, angles of the run and of the linear model, released at a multiple of the range."""
    model, system = linear(angle)
    start = factor * float(system.linear_range(SHARE).values[0, 1])
    w = float(system.modes().natural[0])
    time = np.linspace(0.0, 2.0 * np.pi / w, 121)
    run = model.simulate(time, initial={"base.rz": start})
    return time * w / (2.0 * np.pi), run["angle"], start * np.cos(w * time)


def harmonics(turns, angles):
    """The larger of mean and second harmonic over the first."""
    waves = np.array([turns**0, *(f(2.0 * np.pi * k * turns) for k in (1, 2) for f in (np.cos, np.sin))]).T
    c = np.linalg.lstsq(waves, angles, rcond=None)[0]
    return max(abs(c[0]), np.hypot(c[3], c[4])) / np.hypot(c[1], c[2])


ranges = np.array([linear(angle)[1].linear_range(SHARE).values[0] for angle in ANGLES])
closed_form = 0.4 * LONG * np.sin(ANGLES) * np.tan(ANGLES)
assert np.abs(ranges[:, 0] / closed_form - 1.0).max() < 1e-8

ANGLE = 0.1
runs = [deviation(ANGLE, factor) for factor in FACTORS]
shares = np.array([harmonics(turns, angles) for turns, angles, _ in runs])
assert np.abs(shares[:2] / (SHARE * FACTORS[:2]) - 1.0).max() < 0.02  # of second order where motion is small
at_range = deviation(ANGLE, 1.0)


def draw():
    """Range over the angle, a run at the range, and the second-order part over the amplitude."""
    import matplotlib.pyplot as plt

    _, (left, middle, right) = plt.subplots(1, 3, figsize=(12.5, 3.8), layout="constrained")
    left.loglog(ANGLES, 1e3 * ranges[:, 0], "o", label="linear_range")
    left.loglog(ANGLES, 1e3 * closed_form, "k-", lw=1, label="closed form")
    left.set(xlabel="angle of the arms [rad]", ylabel="slider where 10 % is reached [mm]", title="Linear range")
    turns, angles, expected = at_range
    middle.plot(turns, 1e3 * angles, label="nonlinear run")
    middle.plot(turns, 1e3 * expected, "k--", lw=1, label="linear model")
    middle.set(xlabel="time [periods]", ylabel="angle of the first arm [mrad]", title="Released at the range")
    right.loglog(FACTORS, 100.0 * shares, "o", label="nonlinear runs")
    right.loglog(FACTORS, 100.0 * SHARE * FACTORS, "k-", lw=1, label="second order")
    right.set(xlabel="amplitude over the range [1]", ylabel="mean or second harmonic [%]", title="Second-order part")
    for axes in (left, middle, right):
        axes.legend(frameon=False)
        axes.grid(alpha=0.3, which="both")
    plt.show()


if __name__ == "__main__":
    draw()
