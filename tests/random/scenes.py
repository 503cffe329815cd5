"""Scenes of random vibration whose answers are known in closed form."""

import mbsvib as mv


def oscillator(m=2.0, k=800.0, c=3.0):
    """One mass on a spring and a damper, driven by forces and by its base."""
    model = mv.Model("oscillator")
    model.add_body("b", m, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    model.add_spring("s", "ground", "b", (0, 0, -1), (0, 0, 0), stiffness=k, damping=c)
    for name in ("F", "F2"):
        model.add_input(name, "b", "z")
    model.add_base_motion("base", "z")
    for name, quantity in (("x", "displacement"), ("v", "velocity"), ("a", "acceleration")):
        model.add_output(name, "b", "z", quantity=quantity)
    model.add_output("a_abs", "b", "z", quantity="acceleration", absolute=True)
    return model


def two_masses(c1=1.5, c2=0.4):
    """A chain of two masses; the first is held by a spring."""
    model = mv.Model("two")
    before = "ground"
    for i, (m, k, c) in enumerate(((2.0, 900.0, c1), (1.0, 300.0, c2))):
        name = f"m{i + 1}"
        model.add_body(name, m, (1, 1, 1), position=(0, 0, float(i)))
        model.add_joint(f"j{i + 1}", "prismatic", "ground", name, axis=(0, 0, 1))
        model.add_spring(f"k{i + 1}", before, name, (0, 0, i - 1.0), (0, 0, float(i)), stiffness=k, damping=c)
        model.add_input(f"F{i + 1}", name, "z")
        model.add_output(f"x{i + 1}", name, "z")
        before = name
    model.add_output("v2", "m2", "z", quantity="velocity")
    return model
