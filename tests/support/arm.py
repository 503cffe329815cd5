"""A small valid model on which bad calls are tried."""

import mbsvib as mv


def arm():
    model = mv.Model("robot")
    model.add_body("arm", 2.0, (0.1, 0.2, 0.15), position=(0, 0, 0.5))
    model.add_body("hand", 1.0, (0.1, 0.1, 0.1), position=(0, 0, 1.2))
    model.add_joint("hinge", "revolute", "ground", "arm", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_joint("wrist", "spherical", "arm", "hand", position=(0, 0, 1))
    model.add_bushing("mount", "arm", "hand", (0, 0, 1), (1e3,) * 6, (1.0,) * 6)
    model.add_spring("strut", "ground", "arm", (1, 0, 0), (0, 0, 0.5), stiffness=1e4, damping=2.0)
    model.add_input("push", "hand", "x")
    model.add_base_motion("shake", "z")
    model.add_output("sway", "hand", "x")
    model.add_force_output("tension", "strut")
    return model
