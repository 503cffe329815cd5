"""Small systems with closed-form responses."""

import pytest

import mbsvib as mv

MASS, STIFFNESS = 2.0, 5000.0


def _slider(damping=0.0, stiffness=STIFFNESS, name="slider"):
    model = mv.Model(name)
    model.add_body("mass", MASS, (1, 1, 1))
    model.add_joint("rail", "prismatic", "ground", "mass", axis=(1, 0, 0))
    if stiffness or damping:
        model.add_spring("k", "ground", "mass", (-1, 0, 0), (0, 0, 0), stiffness=stiffness, damping=damping)
    model.add_input("F", "mass", "x")
    model.add_base_motion("ax", "x")
    model.add_output("x", "mass", "x")
    model.add_output("v", "mass", "x", quantity="velocity")
    model.add_output("a", "mass", "x", quantity="acceleration")
    return model.linearize()


@pytest.fixture
def slider():
    """A function that makes a mass on a rail."""
    return _slider
