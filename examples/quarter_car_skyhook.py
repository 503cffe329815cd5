"""Skyhook damping of a quarter car: a damper to an inertial reference, realised by an actuator.

A damper between body and wheel suppresses the resonance but degrades isolation at higher frequencies. A damper between
body and inertial space would not. An actuator can replace it: it integrates the accelerometer on the body, and its
force is -g times that velocity. Signals are connected by their names. With a rigid tyre, road to body would be

    T(s) = w0^2 / (s^2 + (g/m) s + w0^2),    w0^2 = k/m.

The tyre is elastic: near 11 Hz the plot shows the resonance of the wheel, which has no damper of its own.
"""

import control
import numpy as np

from mbsvib.library import quarter_car
from mbsvib_export import to_control

BODY, WHEEL, SUSPENSION, TYRE = 317.5, 45.4, 22e3, 192e3
GAIN = 2 * 0.7 * np.sqrt(SUSPENSION * BODY)  # 70 % damping [N s/m]


def skyhook(**car):
    """Close the loop from the body's accelerometer by way of an integrator to the actuator."""
    plant = to_control(quarter_car(**car).linearize())
    controller = control.ss([[0]], [[1]], [[-GAIN]], [[0]], inputs=["body:az"], outputs=["actuator"], name="skyhook")
    return control.interconnect([plant, controller], inputs=["road"], outputs=["body:az"], check_unused=False)


def transmissibility(system):
    """Acceleration of the body for a unit acceleration of the road, over ``frequency``."""
    return control.frequency_response(system["body:az", "road"], 2 * np.pi * frequency).complex


frequency = np.geomspace(0.2, 30.0, 400)
s = 2j * np.pi * frequency
active, passive = skyhook(), to_control(quarter_car(suspension_damping=1500.0).linearize())
# The actuator pushes the wheel as much as the body: with body and wheel as unknowns,
body, wheel, force = BODY * s**2 + GAIN * s + SUSPENSION, WHEEL * s**2 + SUSPENSION + TYRE, GAIN * s + SUSPENSION
closed_form = SUSPENSION * TYRE / (body * wheel - SUSPENSION * force)
assert np.allclose(transmissibility(active), closed_form, rtol=1e-11, atol=0)
# and a tyre of stone leaves the textbook's isolator.
ideal = SUSPENSION / body
assert np.allclose(transmissibility(skyhook(tyre_stiffness=1e12)), ideal, rtol=1e-4, atol=0)

# A bump, 5 cm high and a quarter of a second long, given as the acceleration it is
time = np.linspace(0.0, 2.0, 4001)
bump = np.where(time < 0.25, 0.025 * (8 * np.pi) ** 2 * np.cos(8 * np.pi * time), 0.0)
ride = {name: control.forced_response(car["body:az", "road"], time, bump).outputs
        for name, car in (("damper 1.5 kN s/m", passive), ("skyhook", active))}  # fmt: skip
assert np.max(abs(ride["skyhook"])) < 0.8 * np.max(abs(ride["damper 1.5 kN s/m"]))


def draw():
    """Transmissibility, and the ride over the bump."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for (name, acceleration), car in zip(ride.items(), (passive, active), strict=True):
        left.loglog(frequency, abs(transmissibility(car)), label=name)
        right.plot(time, acceleration, label=name)
    left.loglog(frequency, abs(ideal), "k:", label="skyhook on a rigid tyre")
    left.set(title="Road to body", xlabel="frequency [Hz]", ylabel="transmissibility [1]", ylim=(1e-3, 5))
    left.set_xticks((0.2, 0.5, 1, 2, 5, 10, 20), labels=("0.2", "0.5", "1", "2", "5", "10", "20"))
    left.minorticks_off()
    right.set(title="Over a bump of 5 cm", xlabel="time [s]", ylabel="acceleration of the body [m/s²]")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
