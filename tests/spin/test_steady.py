"""Spins that are not steady, or not supported, are refused by name."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ModelError
from tests.spin.test_rotors import rotor_and_stator, shaft


def base(**inertia):
    model = mv.Model("base")
    model.add_body("carrier", 2.0, (0.3, 0.4, 0.5))
    model.add_body("disk", 1.0, inertia.get("disk", (0.1, 0.1, 0.2)), position=(0, 0, 0.1))
    return model


def refused(model, *words):
    with pytest.raises(ModelError) as error:
        model.linearize()
    for word in words:
        assert word in str(error.value)


def test_values():
    model = base()
    for words, message in (
        ({"body": "ground", "speed": 1.0, "axis": (0, 0, 1)}, "'ground'"),
        ({"body": "disk", "speed": np.nan, "axis": (0, 0, 1)}, "rad/s"),
        ({"body": "disk", "speed": 1.0, "axis": (0, 0, 0)}, "axis"),
        ({"body": "disk", "speed": 1.0, "axis": (0, 0, 1), "inertia": 0.0}, "positive"),
        ({"body": "dish", "speed": 1.0, "axis": (0, 0, 1)}, "disk"),
    ):
        with pytest.raises(ModelError, match=message):
            model.add_rotor("spin", **words)
    with pytest.raises(ModelError, match="taken by a body"):
        model.add_rotor("disk", "disk", 1.0, (0, 0, 1))


def test_bodies():
    model = base(disk=(0.1, 0.12, 0.2))
    model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
    refused(model, "rotor 'spin'", "body 'disk'", "not symmetric")
    model = base()
    model.add_rotor("spin", "disk", 5.0, (1, 0, 0))
    refused(model, "rotor 'spin'", "not symmetric")
    model.replace("spin", axis=(0, 0, 1)).linearize()


def test_moving_axes():
    """A wheel whose axis the body's own spin would turn; a body that a joint holds; a body that is carried around."""
    model = base()
    model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
    model.add_rotor("wheel", "disk", 5.0, (0, 1, 0), inertia=0.01)
    refused(model, "rotor 'wheel'", "axis that moves", "'spin'")
    for words in ({"kind": "revolute", "axis": (0, 1, 0)}, {"kind": "fixed"}, {"kind": "prismatic", "axis": (0, 0, 1)},
                  {"kind": "revolute", "axis": (0, 0, 1), "position": (0.1, 0, 0)}):  # fmt: skip
        model = base()
        model.add_joint("hold", first="carrier", second="disk", **{"position": (0, 0, 0), **words})
        model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
        refused(model, "rotor 'spin'", "joint 'hold'", "inertia")
        model.replace("spin", inertia=0.2).linearize()
    model = base()
    model.add_joint("hold", None, "carrier", "disk", position=(0, 0, 0), free=("x", "rz"))
    model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
    refused(model, "joint 'hold'", "is not axisymmetric")
    for words in ({"kind": "cylindrical", "axis": (0, 0, -1)}, {"kind": "spherical"},
                  {"kind": "planar", "axis": (0, 0, 1), "position": (3.0, 0, 0)}):  # fmt: skip
        model = base()
        model.add_joint("hold", first="carrier", second="disk", **{"position": (0, 0, 0), **words})
        model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
        assert model.linearize().gyroscopic is not None


def test_springs():
    model = base()
    model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
    for words, message in (
        ({"position": (0, 0, 0), "stiffness": (1, 1, 1, 1, 1, 1)}, "wound up"),
        ({"position": (0.1, 0, 0), "stiffness": (1, 1, 1, 0, 0, 0)}, "off its axis"),
    ):
        held = base()
        held.add_rotor("spin", "disk", 5.0, (0, 0, 1))
        held.add_bushing("mount", "carrier", "disk", **words)
        refused(held, "rotor 'spin'", "'mount'", message)
    held = base()
    held.add_rotor("spin", "disk", 5.0, (0, 0, 1))
    held.add_bushing("film", "carrier", "disk", position=(0, 0, 0), stiffness=(1, 2, 1, 1, 3, 0), damping=(1,) * 6)
    held.linearize()  # a bearing whose film is stiffer one way stays with what does not spin
    uneven = shaft(10.0).replace("bend", stiffness=(400, 300, 0, 0, 0, 0))
    refused(uneven, "'bend'", "is not axisymmetric")
    line = base()
    line.add_rotor("spin", "disk", 5.0, (0, 0, 1))
    line.add_spring("wire", "ground", "disk", start=(1, 0, 0), end=(0.2, 0, 0), stiffness=3.0)
    refused(line, "'wire'", "off its axis")


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_inerters_along_the_axis(method):
    model = base()
    model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
    model.add_bushing("mount", "ground", "disk", (0, 0, 0), stiffness=(9, 9, 40, 3, 3, 0), damping=(0, 0, 2, 0, 0, 0))
    model.add_input("F", "disk", "z")
    model.add_output("z", "disk", "z")
    model.add_inerter("flywheel", "ground", "disk", (0, 0, -1), (0, 0, 0.1), 3.0)
    response = model.linearize(method=method).frequency_response([7.0])[0, 0, 0]
    np.testing.assert_allclose(response, 1 / (40 - 7.0**2 * (1.0 + 3.0) + 2j * 7.0), rtol=1e-13)
    model.add_inerter("beside", "ground", "disk", (0, 0, -1), (0.2, 0, 0.1), 3.0)
    with pytest.raises(ModelError, match=r"'beside'.* off its axis, by 0.2 m"):
        model.linearize(method=method)


def test_elements_with_a_node_of_their_own():
    model = base()
    model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
    model.add_maxwell("strut", "ground", "disk", (0, 0, -1), (0, 0, 0.1), 3.0, 2.0)
    refused(model, "'strut'", "is a Maxwell element, whose node does not spin")


@pytest.mark.parametrize("ends", [("ground", "shaft"), ("shaft", "ground")])
def test_a_shaft_that_sags_in_its_bearings(ends):
    """Gravity moves the shaft: the point of a bearing stays on its axis where the shaft is the second body."""
    model = mv.Model("sagging", gravity=(0, 0, -9.81))
    model.add_body("shaft", 10.0, (0.1, 0.5, 0.5))
    model.add_joint("way", "free", "ground", "shaft", position=(0, 0, 0))
    for k, x in enumerate((-0.3, 0.3)):
        model.add_bushing(f"bearing{k}", *ends, position=(x, 0, 0), stiffness=(1e5, 1e6, 2e6, 0, 10, 10))
    model.add_rotor("rotor", "shaft", 100.0, (1, 0, 0))
    there = model.equilibrium()
    if ends[0] == "ground":
        assert there.linearize().gyroscopic is not None
    else:
        refused(there, "'bearing0'", "off its axis", "give 'shaft' as its second body")


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_neither_units_nor_size_decide(scale):
    """A joint off the axis by 1e-4 of the size of the disk, a weak torsion spring beside a stiff bearing."""
    for offset, words in ((1e-4, ("joint 'hold'", "does not allow")), (1e-9, ())):
        model = mv.Model("disk")
        model.add_body("disk", 1.0, scale**2 * np.array((0.1, 0.1, 0.2)), position=(0, 0, 0.1 * scale))
        model.add_joint("hold", "revolute", "ground", "disk", position=(offset * scale, 0, 0))
        model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
        if words:
            refused(model, *words)
        else:
            model.linearize()
    for torsion in (1e-3, 0.0):
        model = mv.Model("disk")
        model.add_body("disk", 1.0, scale**2 * np.array((0.1, 0.1, 0.2)), position=(0, 0, 0.1 * scale))
        model.add_bushing("film", "ground", "disk", (0, 0, 0.1 * scale), (1e8, 1e8, 1e8, 0, 0, torsion * scale**2))
        model.add_rotor("spin", "disk", 5.0, (0, 0, 1))
        if torsion:
            refused(model, "'film'", "wound up")
        else:
            model.linearize()


def test_what_does_not_know_spin_refuses_it():
    model = rotor_and_stator(3.0)
    model.add_base_motion("tilt", "rx")
    refused(model, "base motion 'tilt'", "rotor 'spin'")
