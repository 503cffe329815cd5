"""A gantry on ball screws with an elastic ram: from the motor to its encoder, and to the tool.

A bridge slides along x, a head on it along y, each on a ball screw with its motor; from the head hangs an elastic tube
with the tool. The encoder does not see the frequencies of the machine with the motor held. A scale at the tool sees the
tube bend: position control by it is unstable until a notch filter takes this resonance out.
"""

import control
import numpy as np

import mbsvib as mv
import mbsvib_export as mx

STEEL, ALUMINIUM, LEAD, RAM = 7850.0, 2700.0, 0.010, 0.45  # kg/m^3, m per turn, m
X, Y, CROSSOVER = (1, 0, 0), (0, 1, 0), 2 * np.pi * 12.0  # rad/s


def gantry(held=False):
    """The machine, its y motor under position control; ``held``: that of x does not turn."""
    model = mv.Model("gantry")
    model.add_body("bridge", shape={"type": "box", "size": (0.25, 1.0, 0.12)}, density=0.4 * ALUMINIUM)
    model.add_body("head", shape={"type": "box", "size": (0.2, 0.2, 0.1)}, density=ALUMINIUM, position=(0, 0, 0.11))
    screw = {"type": "cylinder", "radius": 0.008, "length": 0.9}
    model.add_body("screw.x", shape=screw, density=STEEL, position=(0, 0, -0.1), orientation=(0, np.pi / 2, 0))
    model.add_body("screw.y", shape=screw, density=STEEL, position=(0, 0, 0.07), orientation=(-np.pi / 2, 0, 0))
    stiff = {"lead": LEAD, "stiffness": 6e7, "damping": 5e3}
    model.add_ball_screw("x", "ground", "screw.x", "bridge", (0, 0, -0.1), X, **stiff)
    model.add_ball_screw("y", "bridge", "screw.y", "head", (0, 0, 0.07), Y, **stiff)
    model.add_torsion_spring("y.servo", "bridge", "screw.y", Y, stiffness=5.0, damping=0.03)
    if held:
        model.add_torsion_spring("x.brake", "ground", "screw.x", X, stiffness=1e9)
    model.add_body("tool", 3.0, (0.003, 0.003, 0.004), position=(0, 0, 0.06 - RAM))
    model.add_beam("ram", "head", "tool", {"type": "tube", "radius": 0.03, "wall": 0.004},
                   {"E": 2.1e11, "nu": 0.3, "rho": STEEL}, (0, 0, 0.06), (0, 0, 0.06 - RAM), damping_ratio=0.004)
    model.add_input("torque", "screw.x", "rx")
    model.add_output("encoder", "screw.x", (0, 0, 0, LEAD / (2 * np.pi), 0, 0))  # as travel [m]
    model.add_output("tool", "tool", "x")
    return model


model = gantry()
system = model.linearize()
# At low frequencies all moves as one mass, to which the screw adds its moment of inertia.
ratio, ram, slow = LEAD / (2 * np.pi), model.beams["ram"], 2 * np.pi * 0.1
mass = sum(model.bodies[name].mass for name in ("bridge", "head", "screw.y", "tool"))
mass += ram.material.rho * ram.properties.A * RAM + model.bodies["screw.x"].inertia[2] / ratio**2
assert np.allclose(system.frequency_response([slow]), -1.0 / (ratio * mass * slow**2), rtol=1e-4)

# What the encoder does not see, its zeros, are poles of the machine with the motor held.
zeros = system.transmission_zeros("encoder", "torque")
held = gantry(held=True).linearize().modes().eigenvalues
for zero in zeros[(zeros.imag > 1.0) & (abs(zeros) < 2 * np.pi * 500.0)]:
    assert np.abs(held - zero).min() < 1e-6 * abs(zero)

# Position control by the tool's scale: lead around the crossover, then a notch at the resonance of the ram along x.
omega = system.frequency_grid(f_min=2.0, f_max=250.0)
encoder, tool = system.frequency_response(omega)[:, 0]
w, s = omega[np.argmax(abs(tool) * omega**2)], control.tf("s")
lead = mass * ratio * CROSSOVER**2 / 3 * (1 + 3 * s / CROSSOVER) / (1 + s / (3 * CROSSOVER))
notch = (s**2 + 0.004 * w * s + w**2) / (s**2 + w * s + w**2)
plant = mx.to_control(system["tool", "torque"])
loops = {"lead: unstable": plant * control.ss(lead), "lead and notch: stable": plant * control.ss(lead * notch)}
unstable, stable = (control.feedback(loop, 1).poles().real.max() for loop in loops.values())
assert unstable > 1.0 > 0.0 > stable


def draw():
    """Responses to the motor's torque, and gains of both loops."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    gains = {name: loop(1j * omega) for name, loop in loops.items()}
    for axes, curves in zip(panels, ({"encoder, as travel": encoder, "tool": tool}, gains), strict=True):
        for name, values in curves.items():
            axes.loglog(omega / (2 * np.pi), abs(values), label=name)
        axes.set_xlabel("frequency [Hz]")
        axes.grid(alpha=0.3)
        axes.legend()
    panels[0].set(title="From the torque of the motor of x", ylabel="travel / torque [m/(N m)]")
    panels[1].set(title="Loops closed at the tool", ylabel="loop gain [1]")
    panels[1].axhline(1.0, color="black", linewidth=0.8)
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
