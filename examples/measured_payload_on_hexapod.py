"""A payload that is known from an impact test only, joined to the model of a hexapod.

Nobody has a model of the camera that is to stand on the platform. Hung in soft cords it was hit at nine places of its
base plate, and four triaxial accelerometers there and one on its lens measured, with 1 % noise. A virtual point makes
a port of these, `assemble` joins it to the hexapod at each measured line, and the noise of the test becomes a
deviation of the result. The curve agrees with that of the whole machine, which is simulated here to see it, and shows
what the rigid mass of the camera alone would have missed: its lens resonates on the stage at 105 Hz.
"""

import numpy as np

import mbsvib as mv

FOOT = (0.0, 0.0, 0.05)  # where the camera stands on the platform [m]
CORNERS = [(0.08, 0.06, 0.055), (-0.08, 0.06, 0.055), (-0.08, -0.06, 0.055), (0.08, -0.06, 0.075)]


def add_camera(model):
    """The camera, which only the test knows."""
    model.add_body("box", 3.0, (0.02, 0.025, 0.02), position=(0, 0.01, 0.12))
    model.add_body("lens", 0.6, (8e-4, 8e-4, 3e-4), position=(0.03, 0.01, 0.2))
    model.add_bushing("tube", "box", "lens", (0, 0.01, 0.19), (8e5, 8e5, 3e6, 600, 600, 2000),
                      (4, 4, 15, 4e-3, 4e-3, 1e-2))
    model.add_output("image", "lens", "z")


def impact_test(omega):
    """The test: simulated responses of the free camera with noise."""
    model, rng = mv.Model("camera"), np.random.default_rng(3)
    add_camera(model)
    sensors, hits = [(corner, direction) for corner in CORNERS for direction in "xyz"], []
    for k, (corner, direction) in enumerate(sensors):
        model.add_output(f"a{k}", "box", direction, corner, quantity="acceleration")
    for k in range(9):
        corner = np.add(CORNERS[k % 4], rng.uniform(-0.01, 0.01, 3))
        along = np.eye(3)[k // 3] * (1 if k % 2 else -1)
        model.add_input(f"hit{k}", "box", along, corner)
        hits.append((corner, along))
    system = model.linearize()
    exact = system.frequency_response(omega)
    deviation = 0.01 * np.abs(exact).mean(axis=2, keepdims=True) * np.ones(len(omega))
    noise = rng.standard_normal((2, *exact.shape)) / np.sqrt(2)
    return mv.Measurement(omega, exact + deviation * (noise[0] + 1j * noise[1]), system.outputs, system.inputs,
                          deviation**2, output_units=system.output_units, output_points=[None, *sensors],
                          input_units=system.input_units, input_points=hits)


omega = 2 * np.pi * np.geomspace(20.0, 250.0, 160)
test = impact_test(omega).virtual_point("foot", FOOT, "a*", "hit*")
stage = mv.library.cubic_hexapod(stiffness=8e5, damping=40.0)
stage.add_port("top", "platform", FOOT)
joined = mv.assemble({"stage": stage, "camera": test}, [("stage.top", "camera.foot", "rigid")])
joined = joined["camera.image", "stage.Fz"]

both = mv.library.cubic_hexapod(stiffness=8e5, damping=40.0)
add_camera(both)
both.add_joint("bolts", "fixed", "platform", "box", FOOT)
exact = both.linearize()["image", "Fz"].frequency_response(omega)[0, 0]
found, deviation = joined.responses[0, 0], np.sqrt(joined.variance[0, 0])

print(joined)
print(f"Sensors and hits follow a rigid plate to {100 * min(test.consistency.values()):.2f} % at least.")
apart = np.abs(found - exact) / deviation
print(f"Error over stated deviation: {np.sqrt(np.mean(apart**2)):.2f} rms")
assert 0.7 < np.sqrt(np.mean(apart**2)) < 1.4
assert min(test.consistency.values()) > 0.99


def draw():
    """The response of the image to a force on the platform."""
    import matplotlib.pyplot as plt

    rigid = both.with_values({name: 1e6 * value for name, value in both.parameters.items() if "tube.stiff" in name})
    f, (_, axes) = omega / (2 * np.pi), plt.subplots(figsize=(8, 5), layout="constrained")
    low, high = np.maximum(np.abs(found) - 2 * deviation, 1e-9), np.abs(found) + 2 * deviation
    axes.fill_between(f, low, high, alpha=0.3, label="two deviations")
    axes.loglog(f, np.abs(found), "-", label="hexapod with the measured camera")
    axes.loglog(f, np.abs(exact), "k--", lw=1, label="exact")
    response = rigid.linearize()["image", "Fz"].frequency_response(omega)[0, 0]
    axes.loglog(f, np.abs(response), ":", label="hexapod with a rigid mass")
    axes.set(xlabel="frequency [Hz]", ylabel="image z per force on the platform [m/N]")
    axes.set_xticks([20, 50, 100, 200], ["20", "50", "100", "200"])
    axes.set_xticks([], minor=True)
    axes.legend()
    plt.show()


if __name__ == "__main__":
    draw()
