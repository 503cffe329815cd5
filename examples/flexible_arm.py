"""A robot's arm that bends: what the motor's encoder sees, and what the tip does instead.

A hub on a vertical axis swings a thin aluminium bar with a gripper at its end. Encoder and motor sit at the same
place, so that resonances and antiresonances alternate, and the antiresonances are what is left when the motor stands
still: the frequencies of the clamped bar. The camera at the tip looks at the other end of a wave that takes its time.
Its zeros are real, one in the right half plane for each in the left: the tip sets off the wrong way, and no
controller at the motor can change that.
"""

import numpy as np

import mbsvib as mv
from mbsvib.beams import Material, Rectangle

LENGTH, GRIPPER = 0.9, 0.15
BAR = Rectangle(width=0.004, height=0.05)  # it swings towards its thin side, the section's y
ALUMINIUM = Material(E=7e10, nu=0.33, rho=2700.0)


def arm(gripper=GRIPPER, elements=12):
    """The arm, ready to swing about z."""
    model = mv.Model("flexible arm")
    model.add_body("hub", mass=1.5, inertia=(0.002, 0.002, 0.004))
    model.add_joint("motor", "revolute", "ground", "hub", position=(0, 0, 0), axis=(0, 0, 1))
    held = model.add_body("gripper", gripper, (1e-5,) * 3, position=(LENGTH, 0, 0)) if gripper else None
    model.add_beam("bar", "hub", held, BAR, ALUMINIUM, start=(0, 0, 0), end=(LENGTH, 0, 0), elements=elements,
                   damping_ratio=0.002)  # fmt: skip
    tip = "gripper" if gripper else f"bar.{elements}"
    model.add_input("torque", "hub", "rz")
    model.add_output("encoder", "hub", "rz")
    model.add_output("tip", tip, (0, 1 / LENGTH, 0))  # as an angle too
    return model


system = arm().linearize()
assert system.modes().frequencies[0] == 0.0  # the motor is free to turn

# Without a gripper the encoder's zeros are the cantilever of the textbooks,
plain = arm(gripper=0.0).linearize()
section = BAR.properties(ALUMINIUM.poisson)
beta = np.array([1.87510407, 4.69409113, 7.85475744])
clamped = beta**2 / LENGTH**2 * np.sqrt(ALUMINIUM.E * section.Iz / (ALUMINIUM.rho * section.A)) / (2 * np.pi)
zeros = plain.transmission_zeros("encoder", "torque")
hertz = np.sort(abs(zeros[zeros.imag > 1.0])) / (2 * np.pi)
assert all(np.abs(hertz / f - 1.0).min() < 1e-3 for f in clamped)
# and those of the tip come in pairs +-s: it is not minimum phase.
wrong = plain.transmission_zeros("tip", "torque")
lowest = wrong[abs(wrong) < 2 * np.pi * 60.0]
assert (lowest.real > 10.0).any()

time = np.linspace(0.0, 0.6, 1201)
push = np.where(time < 0.1, 1.0, np.where(time < 0.2, -1.0, 0.0))
encoder, tip = system.time_response(time, push[None], hold="zero")
assert tip[20:60].min() < 0.0 < encoder[20:60].min()  # the tip first goes backwards


def draw():
    """Responses over frequency, and a swing by two pushes."""
    import matplotlib.pyplot as plt

    omega = system.frequency_grid(f_min=0.3, f_max=200.0)
    response = system.frequency_response(omega)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for k, name in enumerate(system.outputs):
        left.loglog(omega / (2 * np.pi), abs(response[k, 0]), label=name)
        right.plot(time, np.degrees((encoder, tip)[k]), label=name)
    left.set(title="From the motor's torque", xlabel="frequency [Hz]", ylabel="angle [rad/(N m)]")
    right.set(title="Pushed forth and back, 1 N m", xlabel="time [s]", ylabel="angle [deg]")
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
