"""Mechanisms that move far: a double pendulum in space, a falling four-bar linkage, a platform on six soft legs."""

import numpy as np

import mbsvib as mv

TIMES = np.linspace(0.0, 1.0, 21)
FALL = (0.0, 0.0, -9.81)


def double_pendulum():
    """Two links on hinges that are not parallel, let go from the side."""
    model = mv.Model("double_pendulum", gravity=FALL)
    model.add_body("a", 1.2, (0.02, 0.03, 0.04), (0.3, 0.0, 0.02), orientation=(0.1, 0.2, 0.3))
    model.add_body("b", 0.8, (0.01, 0.015, 0.02, 0.001, 0.002, -0.003), (0.75, 0.05, 0.0))
    model.add_joint("shoulder", "revolute", "ground", "a", (0, 0, 0), axis=(0, 1, 0))
    model.add_joint("elbow", "revolute", "a", "b", (0.5, 0, 0), axis=(1, 1, 0.5))
    return measured(model, ("a", "b"))


def four_bar():
    """The linkage of the library without its spring, as its crank swings down and through."""
    return measured(mv.library.four_bar().with_parts(springs={}, inputs={}, outputs={}), ("coupler", "rocker"))


def platform():
    """A platform on six legs with spherical joints at both ends, which a side load and its weight take away."""
    model = mv.library.stewart(leg_stiffness=800.0, leg_damping=1.0, payload_mass=0.5, foot="spherical", ports="none")
    model.gravity = FALL
    model.add_load("push", "platform", (26.0, 14.0, 0.0), (0.0, 0.4, 0.8))
    return measured(model, ("platform", "leg1.upper", "leg4.lower"))


def measured(model, bodies):
    for body in bodies:
        for d in "xyz":
            model.add_output(f"{body}.{d}", body, d)
    return model


SCENES = {"double_pendulum": double_pendulum, "four_bar": four_bar, "platform": platform}
