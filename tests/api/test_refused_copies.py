"""Models that cannot be added to others: refused by name, and nothing is added; gravity that is left out."""

import numpy as np
import pytest

import mbsvib as mv
from tests.api.test_add_models import chassis, wheel


def sum_on_ground(model):
    model.add_force_output("sum", "ground", "z")


def shaken(model):
    model.add_base_motion("shake", "z")


def held(model):
    model.add_superelement("plate", np.eye(6), None, np.eye(6), {"a": (0, 0, 0)}, grounded=True)


@pytest.mark.parametrize(
    ("add", "words", "message"),
    [
        (sum_on_ground, {"ground": "chassis"}, "force output 'sum': it is the sum of all forces on the ground"),
        (shaken, {"ground": "chassis"}, "base motion 'shake': it moves the ground"),
        (held, {"ground": "chassis"}, "superelement 'plate': the ground holds it within"),
        (None, {"mirror": "w"}, "mirror = 'w'; expected 'x', 'y' or 'z'"),
        (None, {"position": (0, 0)}, "position = .* expected the point"),
        (None, {"ground": "chasis"}, "is not a body of model 'car'. Did you mean 'chassis'"),
        (None, {"orientation": np.diag((1, 1, -1.0))}, "left-handed"),
    ],
)  # fmt: skip
def test_refusals(add, words, message):
    part, model = wheel(), chassis()
    if add:
        add(part)
    with pytest.raises(mv.ModelError, match=message):
        model.add_model("left", part, **words)
    assert list(model.bodies) == ["chassis"]


def test_taken_names_add_nothing():
    model = chassis()
    model.add_output("left.lift", "chassis", "z")
    with pytest.raises(mv.ModelError, match=r"'left.lift'.* the name is taken"):
        model.add_model("left", wheel())
    assert list(model.bodies) == ["chassis"]
    with pytest.raises(mv.ModelError, match="other = 3; expected a Model"):
        model.add_model("left", 3)


def test_rods_in_couplers_are_refused_where_axes_turn():
    part = wheel()
    part.add_body("bob", 1.0, (1, 1, 1), position=(0, 0, 1))
    part.add_joint("rod", "distance", "hub", "bob", (0, 0.5, 0.3), end=(0, 0, 1))
    part.add_coupler("tie", {"pivot": 1.0, "rod.x": 1.0})
    model = mv.Model("car")
    model.add_model("left", part, (1, 0, 0))
    with pytest.raises(mv.ModelError, match="joint 'rod': its coordinate x is coupled"):
        model.add_model("right", part, mirror="y")


def test_gravity_is_that_of_the_model():
    part, model = mv.Model("part", gravity=(0, 0, -9.81)), mv.Model("whole", gravity=(0, 0, -9.81))
    part.add_body("b", 1.0, (1, 1, 1))
    model.add_model("same", part)
    with pytest.warns(mv.LeftOutWarning, match="model 'left': it was described under gravity"):
        mv.Model("none").add_model("left", part)
