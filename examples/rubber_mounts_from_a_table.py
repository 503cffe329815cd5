"""Rubber mounts from a table: an engine on a frame, with mounts whose stiffness and loss depend on frequency.

A supplier states the dynamic stiffness of a mount at a few frequencies: rubber is stiffer when it is shaken fast, and
its loss factor hardly changes. A dashpot that has the loss of the resonance is too stiff above it. Relaxations that are
fitted to the table are a model with states, for modes and time responses, and their error is stated.

Symmetric mounts leave up and down alone, so that two masses and the table itself have the exact response.
"""

import numpy as np

import mbsvib as mv

HERTZ = np.array([5.0, 10, 20, 50, 100, 200, 400])
STORAGE = np.array([1.00, 1.05, 1.11, 1.21, 1.30, 1.41, 1.54])
FACTORS = STORAGE * (1 + 1j * np.array([0.08, 0.09, 0.10, 0.12, 0.13, 0.14, 0.15]))
ENGINE, FRAME, MOUNT, AIR, SLOW = 180.0, 900.0, (1.2e5, 1.2e5, 2.5e5, 0, 0, 0), 1.5e5, 2e3  # kg, kg, N/m, N/m, N s/m
BAND = (5.0, 400.0)
FEET = [(x, y, -0.12) for x in (-0.35, 0.35) for y in (-0.25, 0.25)]


def on_mounts(damping=0.0, **rubber):
    """Return an engine on a frame, with four mounts between them."""
    model = mv.Model("engine on mounts")
    model.add_body("engine", ENGINE, (6, 14, 12))
    model.add_body("frame", FRAME, (150, 300, 400), position=(0, 0, -0.3))
    for k, (x, y, z) in enumerate(FEET, start=1):
        model.add_bushing(f"mount{k}", "frame", "engine", (x, y, z), MOUNT, damping * np.array(MOUNT), **rubber)
        model.add_bushing(f"air{k}", "ground", "frame", (2 * x, 2 * y, -0.5), 3 * (AIR,) + 3 * (0,),
                          3 * (SLOW,) + 3 * (0,))  # fmt: skip
    model.add_input("shake", "engine", "z")
    model.add_output("z", "frame", "z")
    return model.linearize()


table = mv.Dynamic.table(HERTZ, FACTORS)
rubber = table.rational(BAND)
resonance = np.sqrt(4 * MOUNT[2] * (1 / ENGINE + 1 / FRAME))  # rad/s
loss = table.factor([resonance])[0].imag
with_states, dashpot = on_mounts(dynamic=rubber), on_mounts(loss / resonance)

omega = 2 * np.pi * np.geomspace(*BAND, 400)
mount, air = 4 * MOUNT[2] * table.factor(omega), 4 * (AIR + 1j * omega * SLOW)
exact = mount / ((mount - ENGINE * omega**2) * (mount + air - FRAME * omega**2) - mount**2)
response, stiff = (system.frequency_response(omega)[0, 0] for system in (with_states, dashpot))
assert rubber.least_error <= rubber.error < 0.05
assert np.abs(response / exact - 1).max() < 5 * rubber.error
assert abs(stiff[-1]) > 1.8 * abs(exact[-1])  # the dashpot lets through what the rubber isolates


def draw():
    """The table with its fit, and how the frame moves."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    hertz = omega / (2 * np.pi)
    for part, marker, label in ((np.real, "o", "storage"), (np.imag, "s", "loss")):
        left.semilogx(HERTZ, part(FACTORS), f"k{marker}", label=f"{label}, table")
        left.semilogx(hertz, part(rubber.factor(omega)), label=f"{label}, {len(rubber.weights)} relaxations")
    left.set(xlabel="frequency [Hz]", ylabel="stiffness / 250 N/mm [1]", ylim=(0, 2.3), title="a mount along z")
    left.legend(ncols=2, loc="upper left")
    for values, style, label in ((exact, "k", "table"), (response, "C1--", "relaxations"), (stiff, "C0", "dashpot")):
        right.loglog(hertz, np.abs(values), style, label=label)
    right.set(xlabel="frequency [Hz]", ylabel="frame / force on the engine [m/N]", title="from the engine to the frame")
    right.legend()
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(f"{rubber}, error {rubber.error:.1%}, least {rubber.least_error:.1%}")
    draw()
    plt.show()
