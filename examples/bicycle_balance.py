"""A bicycle that balances itself: eigenvalues over the speed, and a rider's torque where it does not.

Between the weave speed, 4.292 m/s, and the capsize speed, 6.024 m/s, the uncontrolled bicycle is stable. At 3 m/s it
weaves with growing amplitude; a steering torque in proportion to the rate of lean, which a gyroscope on the frame
measures, makes it stable. Exact slopes over the speed lead Newton's method to both speeds in a few steps.

The bicycle and its eigenvalues are those of J. P. Meijaard, J. M. Papadopoulos, A. Ruina and A. L. Schwab, Proc. R.
Soc. A 463 (2007) 1955-1982.
"""

import numpy as np

import mbsvib as mv

SPEEDS = np.linspace(0.0, 10.0, 101)
GAIN, SLOW = -15.0, 3.0  # torque of steering [N m] for each rad/s of lean; m/s


def moving(system):
    """The four eigenvalues that are not 0 by structure."""
    values = system.modes().eigenvalues
    return values[np.argsort(-np.abs(values))][:4]


def crossing(speed, pick):
    """The speed at which the real part of an eigenvalue is 0, by Newton's method with exact slopes."""
    step = 1.0
    while abs(step) > 1e-6:
        system = mv.library.bicycle(speed=speed).linearize()
        values = system.modes().eigenvalues
        k = pick(values)
        step = values[k].real / system.eigenvalue_sensitivities("travel.x")[0, k].real
        speed -= step
    return speed


bicycle = mv.library.bicycle(speed=SLOW)
system = bicycle.linearize()
print(system.explain())
weave = crossing(4.0, lambda values: np.argmax(values.imag))
capsize = crossing(6.5, lambda values: np.argmin(np.where((values.imag == 0) & (values != 0), abs(values), np.inf)))
assert abs(weave - 4.2924) < 1e-4
assert abs(capsize - 6.0243) < 1e-4

values = np.array([moving(mv.library.bicycle(speed=float(v)).linearize()) for v in SPEEDS])
assert (values.real.max(axis=1)[(weave < SPEEDS) & (capsize > SPEEDS)] < 0.0).all()

loop = system.feedback([[GAIN]], "lean.rate", "steer.torque")
assert moving(system).real.max() > 0.5
assert np.sort(loop.poles().real)[-1] < 1e-9  # place and heading stay at 0
t = np.linspace(0.0, 4.0, 801)
push = np.zeros((len(system.inputs), len(t)))
push[system.inputs.index("side.force"), t < 0.1] = 50.0  # N, for a tenth of a second
lean = [np.degrees(one.time_response(t, push, hold="zero")[system.outputs.index("lean")]) for one in (system, loop)]
assert np.abs(lean[1][-100:]).max() < 0.2 * np.abs(lean[1]).max()


def draw():
    """Eigenvalues over the speed, and the lean after a push at 3 m/s."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
    left.axvspan(weave, capsize, color="0.92", label="stable without control")
    left.plot(np.repeat(SPEEDS, 4), values.real.ravel(), ".", markersize=3, label="real part")
    oscillates = values.imag > 0.0
    left.plot(np.repeat(SPEEDS, 4)[oscillates.ravel()], values.imag[oscillates], ".", markersize=3,
              label="imaginary part")  # fmt: skip
    left.axhline(0.0, color="0.5", linewidth=0.8)
    left.set(xlabel="speed [m/s]", ylabel="eigenvalue [1/s]", ylim=(-10.0, 10.0), title="Benchmark bicycle")
    left.legend(loc="lower right")
    right.plot(t, lean[0], label="hands off")
    right.plot(t, lean[1], label=f"torque {GAIN:g} N m s/rad times rate of lean")
    right.set(xlabel="time [s]", ylabel="lean [deg]", ylim=(-3.0, 3.0), title=f"Push from the side at {SLOW:g} m/s")
    right.legend(loc="upper left")
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
