"""Twelve leg parameters of a hexapod from noisy frequency responses, and the sensor that should be added.

The legs of a platform on six struts differ by some 20 % in stiffness and by a factor of two in damping from the
drawing. A shaker pushes the platform beside its centre and three triaxial accelerometers measure, with 2 % noise. A
fit of the model to the responses gives all twelve values with intervals of 95 %; the intervals hold the true values.
With one accelerometer alone the data are ten times fewer: the fit shows how wide its intervals are then, and which
channel would add the most information.
"""

import numpy as np

import mbsvib as mv

POINTS = [(0.15, 0.0, 0.03), (-0.075, 0.13, 0.03), (-0.075, -0.13, 0.03)]
LEGS = [f"leg{k}.k" for k in range(1, 7)]


def hexapod():
    """The hexapod as drawn, with a shaker and accelerometers."""
    model = mv.library.cubic_hexapod(stiffness=2e5, damping=20.0)
    model.add_input("shaker", "platform", (0.5, 0.3, 0.81), (0.1, 0.05, -0.02))
    for k, point in enumerate(POINTS, 1):
        for direction in "xyz":
            model.add_output(f"a{k}{direction}", "platform", direction, point, quantity="acceleration")
    return model


drawn = hexapod()
free = [f"{leg}.{field}" for leg in LEGS for field in ("stiffness", "damping")]
rng = np.random.default_rng(7)
limits = {"stiffness": (0.8, 1.2), "damping": (0.5, 2.0)}
true = {name: drawn.parameters[name] * rng.uniform(*limits[name.rpartition(".")[2]]) for name in free}
rig = drawn.with_values(true).linearize()[["a*"], "shaker"]

omega = 2 * np.pi * np.linspace(15.0, 80.0, 261)
exact = rig.frequency_response(omega)
deviation = 0.02 * np.abs(exact).mean(axis=2, keepdims=True) * np.ones(len(omega))
noise = rng.standard_normal((2, *exact.shape)) / np.sqrt(2)
data = mv.Measurement(omega, exact + deviation * (noise[0] + 1j * noise[1]), rig.outputs, rig.inputs,
                      variance=deviation**2, quantity="acceleration")

fit = drawn.fit(data, free)
one = drawn.fit(data["a1z", :], free)
candidates = one.next_sensor(["a*"])


def width(result):
    """Half the width of each interval, as a share of the true value."""
    return np.array([0.5 * (high - low) / true[name] for name, (low, high) in result.intervals.items()])


errors = {name: fit.values[name] / true[name] - 1.0 for name in free}
held = sum(low <= true[name] <= high for name, (low, high) in fit.intervals.items())
print(fit)
largest = 100 * max(map(abs, errors.values()))
print(f"{held} of {len(free)} intervals hold the true value; the largest error is {largest:.2f} %")
print(f"a1z alone: intervals {np.median(width(one) / width(fit)):.0f} times as wide; best to add: {candidates[0].name}")
assert fit.residual_test.passed
assert held >= 10
assert max(abs(errors[name]) for name in free if "stiffness" in name) < 2e-3


def draw():
    """Responses before and after the fit, and the intervals."""
    import matplotlib.pyplot as plt

    _, (left, right) = plt.subplots(1, 2, figsize=(12, 4.8), layout="constrained")
    k = data.outputs.index("a1z")
    left.semilogy(data.frequencies, np.abs(data.responses[k, 0]), ".", ms=3, color="0.6", label="measured")
    before = drawn.linearize()["a1z", "shaker"].frequency_response(omega)[0, 0]
    left.semilogy(data.frequencies, np.abs(before), "--", label="as drawn")
    left.semilogy(data.frequencies, np.abs(fit.responses()[k, 0]), label="fitted")
    left.set(xlabel="frequency [Hz]", ylabel="acceleration a1z per force [m/s$^2$/N]")
    left.legend()
    at = np.arange(len(free))
    for shift, result, label in ((-0.2, one, "a1z alone"), (0.2, fit, "nine accelerations")):
        found = np.array([100 * abs(result.values[name] / true[name] - 1.0) for name in free])
        right.bar(at + shift, 100 * width(result), 0.4, label=label, alpha=0.7)
        right.plot(at + shift, found, "k.", label="error" if shift > 0.0 else None)
    right.set(ylabel="half the interval of 95 %, and error [%]", yscale="log", ylim=(3e-4, 3e3))
    right.set_xticks(at, [name.replace(".k.stiffness", " k").replace(".k.damping", " c") for name in free], rotation=60)
    right.legend()
    plt.show()


if __name__ == "__main__":
    draw()
