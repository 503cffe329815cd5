"""Places of channels and what partners they have: all directions, units, signs and time derivatives."""

from itertools import product

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ResponseError
from mbsvib.measurement import matching
from mbsvib.measurement.matching import Matching, Partner
from mbsvib.measurement.points import (
    Node,
    Place,
    Point,
    label_of,
    model_places,
    nodes_of,
    place_of,
    point_of,
    points_of,
)

AXES = ("X", "Y", "Z", "RX", "RY", "RZ")


@pytest.mark.parametrize(("axis", "sign"), [*product(range(6), "+-")])
def test_labels_of_all_directions(axis, sign):
    point = Point(12, (axis + 1) * (1 if sign == "+" else -1))
    for label in (f"12{AXES[axis]}{sign}", f"12{sign}{AXES[axis]}", f"arm: 12{sign}{AXES[axis].lower()}"):
        assert point_of(label) == point
    assert point_of(f"12{AXES[axis]}") == Point(12, axis + 1)
    assert point_of(label_of(12, axis)) == Point(12, axis + 1)
    assert point_of(f"12{sign}{AXES[axis]}{sign}") is None


@pytest.mark.parametrize("axes", [None, ((0.0, -1.0, 0.0), (0.6, 0.0, 0.8), (-0.8, 0.0, 0.6))])
@pytest.mark.parametrize("direction", [1, -2, 3, -4, 5, -6, 0])
def test_directions_at_a_node_in_world_axes(axes, direction):
    """Columns of the axes: translations first, then rotations; 0 is none."""
    node = Node(3, "arm", (0.1, 0.2, 0.3), axes)
    place = place_of(Point(3, direction), {3: node})
    assert place_of(Point(4, direction), {3: node}) is None
    if not direction:
        assert place is None
        return
    expected = np.zeros(6)
    first = 3 if abs(direction) > 3 else 0
    expected[first : first + 3] = np.sign(direction) * np.array(axes or np.eye(3))[:, (abs(direction) - 1) % 3]
    np.testing.assert_array_equal(place.direction, expected)
    assert (place.position.tolist(), place.body) == ([0.1, 0.2, 0.3], "arm")


@pytest.mark.parametrize("along", ["z", "ry", (0.0, 3.0, 4.0), (0, 0, 0, 0.0, 3.0, -4.0), (-1, 0, 0)])
def test_a_position_and_a_direction_become_a_node_of_its_own(along):
    """Numbers behind those that there are; what has no place has a number without node."""
    nodes = nodes_of({4: (1.0, 0.0, 0.0), 2: (0.0, 1.0, 0.0)})
    assert [(node.number, node.position) for node in nodes] == [(4, (1.0, 0.0, 0.0)), (2, (0.0, 1.0, 0.0))]
    points, every = points_of([Point(2, -3), None, ((0.1, 0.2, 0.3), along)], ["a", "b", "c"], nodes, "test")
    assert points[:2] == [Point(2, -3), Point(5, 0)]
    assert [node.number for node in every] == [4, 2, 6]
    place = place_of(points[2], {node.number: node for node in every})
    assert place_of(points[1], {node.number: node for node in every}) is None
    six = {"z": (0, 0, 1, 0, 0, 0), "ry": (0, 0, 0, 0, 1, 0)}.get(along, (*along, 0, 0, 0)[:6] if along else ())
    np.testing.assert_allclose(place.direction, np.array(six) / np.linalg.norm(six), atol=1e-15)
    np.testing.assert_allclose(place.position, [0.1, 0.2, 0.3])
    axes = np.array(every[-1].axes)
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_labels_and_other_names_have_numbers_apart():
    points, nodes = points_of(None, ["7X+", "left", "9RZ-", "right"], nodes_of({8: (0, 0, 0)}), "test")
    assert points == [Point(7, 1), Point(10, 0), Point(9, -6), Point(11, 0)]
    assert [node.number for node in nodes] == [8]


@pytest.mark.parametrize("item", [3, ((0, 0, 0),), ((0, 0, 0), "w"), ((0, 0, 0), (0, 0, 0)), ((0, 0), "z"),
                                  ((0, 0, 0), (1, 0, 0, 0, 0, 1))])  # fmt: skip
def test_points_that_are_none_are_named(item):
    with pytest.raises(ResponseError, match="test: the point of 'a'"):
        points_of([item], ["a"], [], "test")


def rig():
    """A body away from the origin and a beam, with ports that act on one body, between two, or with a factor."""
    model = mv.Model("rig")
    model.add_body("m", 2.0, (0.1, 0.2, 0.3), position=(0.4, 0.5, 0.6))
    model.add_body("n", 1.0, (0.1, 0.2, 0.3), position=(1.4, 0.5, 0.6))
    model.add_bushing("k", "ground", "m", (0, 0, 0), [1e4] * 3 + [300.0] * 3, [5.0] * 3 + [0.1] * 3)
    model.add_bushing("l", "m", "n", (1.0, 0.5, 0.6), [1e4] * 3 + [300.0] * 3, [5.0] * 3 + [0.1] * 3)
    model.add_input("F", "m", (0.6, 0.0, 0.8), (0.1, 0.2, 0.3))
    model.add_input("M", "n", "rx")
    model.add_output("centre", "m", "y")
    model.add_output("turn", "n", "rz", quantity="velocity")
    model.add_output("between", "n", "x", relative_to="m")
    model.add_output("twice", "m", (2.0, 0.0, 0.0))
    model.add_force_output("load", "k", "z")
    return model


def test_places_of_a_model_are_those_of_ports_that_act_on_one_body():
    model = rig()
    system = model.linearize()
    for linear in (model, system):
        places = model_places(linear)
        assert set(places) == {("input", "F"), ("input", "M"), ("output", "centre"), ("output", "turn")}
        np.testing.assert_allclose(places["input", "F"].direction, [0.6, 0, 0.8, 0, 0, 0])
        assert places["input", "F"].position.tolist() == [0.1, 0.2, 0.3]
        assert places["output", "centre"].position.tolist() == [0.4, 0.5, 0.6]  # the centre of mass
        assert places["output", "turn"].direction.tolist() == [0, 0, 0, 0, 0, 1]
        assert [places[key].body for key in (("input", "M"), ("output", "centre"))] == ["n", "m"]
    assert model_places(system.state_space()) == {}
    closed = system.feedback([[-1.0]], "centre", "F")
    assert {key: place.position.tolist() for key, place in model_places(closed).items()} == {
        key: place.position.tolist() for key, place in places.items()}  # fmt: skip
    data = mv.Measurement([1.0], np.ones((1, 2, 1)), ["1X-"], ["2RZ+", "u"], nodes={1: (0, 0, 0), 2: (1, 0, 0)})
    assert set(model_places(data)) == {("output", "1X-"), ("input", "2RZ+")}


def test_angles_of_lines():
    """0 along and against a direction, pi/2 between a translation and a rotation; small ones keep their digits."""
    def place(*direction):
        return Place(np.zeros(3), np.array([*direction, 0, 0, 0][:6], dtype=float))

    x, turned = place(1, 0, 0), place(np.cos(1e-9), np.sin(1e-9), 0)
    assert matching._angle(x, x) == matching._angle(x, place(-1, 0, 0)) == 0.0
    assert matching._angle(x, turned) == pytest.approx(1e-9, rel=1e-6)
    assert matching._angle(place(-1, 0, 0), turned) == pytest.approx(1e-9, rel=1e-6)
    assert matching._angle(x, place(0.6, 0, 0.8)) == pytest.approx(np.arccos(0.6))
    assert matching._angle(x, place(0, 0, 0, 1, 0, 0)) == pytest.approx(np.pi / 2)
    assert x.cosine(place(0, 0, 0, 1, 0, 0)) == 0.0
    limits = 0.01, 0.1
    off = Place(np.array([0.0, 0.0099, 0.0]), turned.direction)
    assert matching._fits(off, x, limits)
    assert not matching._fits(Place(np.array([0.0, 0.0101, 0.0]), x.direction), x, limits)
    assert not matching._fits(place(np.cos(0.11), np.sin(0.11), 0), x, limits)
    assert not matching._fits(None, x, limits)


# unit and quantity that were measured, unit of the model, time derivatives; None: another kind
DERIVATIVES = [
    ("", "", "m", 0), ("", "velocity", "m", 1), ("", "displacement", "m/s^2", -2), ("", "acceleration", "rad", 2),
    ("m", "displacement", "m", 0), ("m/s^2", "acceleration", "m", 2), ("m", "displacement", "m/s", -1),
    ("m/s", "velocity", "m/s^2", -1), ("rad", "displacement", "m", None), ("m", "displacement", "rad/s", None),
    ("N", "", "N", 0), ("N", "", "N m", None), ("m", "displacement", "N", None), ("N", "", "m", None),
    ("V", "", "m", 0), ("V", "velocity", "m", 1), ("V", "", "N", 0), ("", "velocity", "N", None), ("", "", "N", 0),
    ("mm", "", "m", None), ("g", "", "m/s^2", None), ("kN", "", "N", None), ("deg/s", "", "rad/s", None),
    ("N m", "", "N m", 0), ("", "", "", 0), ("m", "displacement", "", 0), ("", "velocity", "V", 0),
    ("rad/s^2", "acceleration", "rad", 2),
]  # fmt: skip


@pytest.mark.parametrize(("unit", "quantity", "other", "order"), DERIVATIVES)
def test_time_derivatives_between_units(unit, quantity, other, order):
    assert matching._derivatives(unit, quantity, other) == order


@pytest.mark.parametrize(("outputs", "inputs"), [*product(range(-2, 3), (-2, 0, 1))])
def test_factors_between_quantities(outputs, inputs):
    """s_o s_i (i w)^(k_o - k_i), not known at 0 Hz for negative powers."""
    def partner(sign, order):
        return Partner("a", "b", "name", sign, order, "", "", None, None)

    w = np.array([0.0, 0.7, 20.0])
    match = Matching((partner(1, 0), partner(-1, outputs)), (partner(-1, inputs), partner(1, 0)))
    found = match.factor(w)
    for o, (row, k_o) in enumerate(((1, 0), (-1, outputs))):
        for i, (column, k_i) in enumerate(((-1, inputs), (1, 0))):
            np.testing.assert_allclose(found[o, i, 1:], row * column * (1j * w[1:]) ** (k_o - k_i), rtol=1e-14)
            at_zero = found[o, i, 0]
            power = k_o - k_i
            assert np.isnan(at_zero) if power < 0 else at_zero == (row * column if power == 0 else 0.0)


def test_a_matching_prints_what_was_found():
    one = Partner("101X-", "tip.x", "place", -1, 2, "m/s^2", "m", 0.0123, np.radians(4.0))
    text = str(Matching((one,), (Partner("F", "G", "name", 1, 0, "", "N", None, None),)))
    rows = {line.split()[0]: line.split() for line in text.splitlines() if line.strip()}
    assert rows["output"] == ["output", "101X-", "tip.x", "place", "12.3", "4", "−", "m/s^2", "/", "m", "(iω)^2"]
    assert rows["input"] == ["input", "F", "G", "name", "+", "?", "/", "N"]


@pytest.mark.parametrize("name", ["tip", "centre"])
@pytest.mark.parametrize("against", [False, True])
def test_rotations_and_names_with_places(name, against):
    """A gyro finds the rotation at its place; a name with a place against the model's is a sign."""
    model = rig()
    along = (0, 0, 0, 0, 0, -1.0 if against else 1.0)
    data = mv.Measurement([1.0], np.ones((1, 1, 1)), ["gyro"], ["M"], output_units=["rad/s"],
                          output_points=[((1.4, 0.5, 0.6), along)])  # fmt: skip
    (partner,) = data.matched(model).outputs
    assert (partner.name, partner.sign, partner.derivatives) == ("turn", -1 if against else 1, 0)
    named = mv.Measurement([1.0], np.ones((1, 1, 1)), [name], ["M"], output_units=["m"],
                           output_points=[((0.4, 0.5, 0.6), (0, -1.0 if against else 1.0, 0))])  # fmt: skip
    (partner,) = named.matched(model).outputs
    assert (partner.name, partner.how, partner.sign) == ("centre", "name" if name == "centre" else "place",
                                                         -1 if against else 1)  # fmt: skip
    (partner,) = named.matched(model, names={name: "centre"}).outputs
    assert (partner.how, partner.sign) == ("name", -1 if against else 1)


def test_all_channels_without_partner_are_told_at_once():
    data = mv.Measurement([1.0], np.ones((2, 2, 1)), ["lost", "centre"], ["M", "gone"])
    with pytest.raises(ResponseError, match=r"(?s)output 'lost' has no partner.*input 'gone' has no partner"):
        data.matched(rig())
    renamed = data.matched(rig(), names={"lost": "load", "gone": "F"})
    assert (renamed.output_names, renamed.input_names) == (("load", "centre"), ("M", "F"))
