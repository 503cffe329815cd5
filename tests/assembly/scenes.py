"""A base and a payload, apart and as one model, with what assemblies must keep."""

import mbsvib as mv

POINT = (0.6, 0.05, 0.2)


def add_base(model):
    """A plate on four mounts that differ, with an arm and its motor spring."""
    model.add_body("base", 10.0, (0.5, 0.6, 0.7), position=(0, 0, 0.1))
    for i, (x, y) in enumerate(((0.2, 0.2), (-0.2, 0.2), (-0.2, -0.2), (0.2, -0.25))):
        model.add_bushing(f"mount{i}", "ground", "base", (x, y, 0), (1e5, 2e5, 3e5, 10, 20, 30),
                          damping=(10, 20, 30, 1, 2, 3))  # fmt: skip
    model.add_body("link", 3.0, (0.1, 0.2, 0.1), position=(0.3, 0, 0.2))
    model.add_joint("arm", "revolute", "base", "link", (0, 0, 0.2), axis=(0, 1, 0))
    model.add_torsion_spring("motor", "base", "link", axis=(0, 1, 0), stiffness=500.0, damping=0.5)
    model.add_input("F", "base", "x", (0, 0, 0.5))
    model.add_force_output("arm.force", "arm", "z")
    model.add_force_output("link.force", "link", "rx")


def add_payload(model):
    """A body that carries another one on a spherical joint with springs."""
    model.add_body("pay", 2.0, (0.1, 0.05, 0.07), position=(0.7, 0.1, 0.3))
    model.add_body("tip", 0.5, (0.01, 0.012, 0.015), position=(0.9, 0.1, 0.4))
    model.add_joint("ball", "spherical", "pay", "tip", (0.8, 0.1, 0.3))
    model.add_bushing("wrist", "pay", "tip", (0.8, 0.1, 0.3), (0, 0, 0, 40, 50, 60), damping=(0, 0, 0, 0.1, 0.1, 0.2))
    model.add_output("z", "tip", "z")
    model.add_output("a", "pay", "x", quantity="acceleration")


def apart(point=POINT, orientation=None):
    """The two parts with their ports."""
    base, payload = mv.Model("base"), mv.Model("payload")
    add_base(base)
    add_payload(payload)
    base.add_port("tip", "link", point, orientation)
    payload.add_port("root", "pay", point, orientation)
    return base, payload


def whole(join):
    """One model of both; ``join(model)`` adds what is between 'link' and 'pay'."""
    model = mv.Model("whole")
    add_base(model)
    add_payload(model)
    join(model)
    return model


def fixed(model):
    """Join link and payload by a fixed joint."""
    model.add_joint("weld", "fixed", "link", "pay", POINT)


RIGID = [("base.tip", "payload.root", "rigid")]
