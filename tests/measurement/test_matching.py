"""Channels of a measurement and of a model: by name, by place, with signs and time derivatives."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.measurement.points import Node, Point, point_of


def rig():
    """A plate on a bushing with ports at a corner, along an inclined line, and one for each quantity."""
    model = mv.Model("rig")
    model.add_body("plate", 2.0, (0.1, 0.2, 0.3))
    model.add_bushing("k", "ground", "plate", (0, 0, 0), [1e4, 2e4, 3e4, 300.0, 200.0, 100.0], [5.0] * 3 + [0.1] * 3)
    corner = (0.2, 0.1, 0.0)
    model.add_input("F", "plate", "z", position=corner)
    model.add_output("z", "plate", "z", position=corner)
    model.add_output("z.a", "plate", "z", position=corner, quantity="acceleration")
    model.add_output("slant", "plate", (0.6, 0.0, 0.8), position=(-0.2, 0.1, 0.0))
    model.add_output("turn", "plate", "rz")
    model.add_force_output("load", "k", "z")
    return model


OMEGA = 2 * np.pi * np.array([0.0, 3.0, 11.0])


def measured(outputs, inputs=("F",), **more):
    return mv.Measurement(OMEGA, np.ones((len(outputs), len(inputs), 3)), outputs, inputs, **more)


def test_labels():
    assert [point_of(text) for text in ("101X+", "101+X", "plate:7rz-", "3Y", "x1", "12", "a+X")] == [
        Point(101, 1), Point(101, 1), Point(7, -6), Point(3, 2), None, None, None]  # fmt: skip


def test_measured_responses_are_the_factor_times_those_of_the_model():
    """Accelerometer and hammer against the axes of the model, 4 mm and 6 deg off; the model has displacements."""
    model = rig()
    system = model.linearize()
    turn = np.radians(6.0)
    nodes = {101: (0.203, 0.1, 0.0026), 7: (0.2, 0.1, 0.0)}
    along = turn + np.arctan(0.75)
    data = measured(["101Z-", "s"], ["7Z-"], nodes=nodes, quantity=("acceleration", "velocity"), output_points=[
        Point(101, -3), ((-0.2, 0.1, 0.0), (np.sin(along), 0, np.cos(along)))])  # fmt: skip
    for linear in (model, system):
        match = data.matched(linear)
        assert match.output_names == ("z.a", "slant")  # the same quantity before another one
        assert match.input_names == ("F",)
        assert [(p.how, p.sign, p.derivatives) for p in (*match.outputs, *match.inputs)] == [
            ("place", -1, 0), ("place", 1, 1), ("place", -1, 0)]  # fmt: skip
        assert match.outputs[0].distance == pytest.approx(np.hypot(0.003, 0.0026))
        assert match.outputs[1].angle == pytest.approx(turn)
    expected = [[[1.0, 1.0, 1.0]], [-1j * OMEGA]]
    np.testing.assert_allclose(match.factor(OMEGA), expected, rtol=1e-15)
    lines = str(match).splitlines()[3:]
    assert lines[1].split()[0] == "output"
    assert lines[1].split()[1:4] == ["101Z-", "z.a", "place"]
    without = data.matched(system[["z", "slant"], :])
    np.testing.assert_allclose(without.factor(OMEGA)[0, 0], -(OMEGA**2), rtol=1e-15)
    truth = system.frequency_response(OMEGA[1:])
    np.testing.assert_allclose(without.factor(OMEGA)[0, 0, 1:] * truth[0, 0], truth[1, 0], rtol=1e-12)


def test_names_come_first_and_need_no_place():
    data = measured(["z", "load", "turn"])
    match = data.matched(rig())
    assert [p.how for p in match.outputs] == ["name"] * 3
    np.testing.assert_array_equal(match.factor(OMEGA), np.ones((3, 1, 3)))  # the quantity is the model's
    renamed = measured(["laser"]).matched(rig(), names={"laser": "z"})
    assert renamed.output_names == ("z",)
    receptance = measured(["z.a"], quantity="displacement").matched(rig()).factor(OMEGA)[0, 0]
    assert np.isnan(receptance[0])  # not from an acceleration at 0 Hz
    np.testing.assert_allclose(receptance[1:], -1.0 / OMEGA[1:] ** 2, rtol=1e-15)


@pytest.mark.parametrize(
    ("outputs", "more", "message"),
    [
        (["zz"], {}, "output 'zz' has no partner. Did you mean 'z'\\? The model has z, z.a, slant, turn, load"),
        (["8Z+"], {}, r"'8Z\+' has no partner. Where node 8 is, is not known: give nodes=\{8: \(x, y, z\)\}."),
        (["8Z+"], {"nodes": {8: (0.2, 0.1, 0.05)}}, r"'8Z\+' has no partner. Nearest are 'z' \(50 mm, 0 deg\), 'z.a' "),
        (["8X+"], {"nodes": {8: (0.2, 0.1, 0.0)}}, r"'8X\+' has no partner. Nearest are 'z' \(0 mm, 90 deg\)"),
        (["z"], {"output_points": [((0.2, 0.1, 0.0), "x")]}, "one name, but are 0 mm and 90 deg apart"),
        (["z"], {"output_points": [((0.2, 0.4, 0.0), "z")]}, "one name, but are 300 mm and 0 deg apart"),
        (["z"], {"output_units": ["mm"]}, "'z' has the unit mm, and 'z' of the model m. Convert the data to SI units."),
        (["z"], {"input_units": ["kN"]}, "'F' has the unit kN, and 'F' of the model N. Convert"),
        (["z"], {"output_units": ["g"]}, "'z' has the unit g, and"),
        (["z"], {"output_units": ["rad"]}, "'z' has the unit rad, and 'z' of the model m"),
        (["load"], {"quantity": "acceleration"}, "'load' has the unit of an acceleration, and 'load' of the model N"),
    ],
)  # fmt: skip
def test_channels_without_partner_are_refused(outputs, more, message):
    with pytest.raises(mv.ResponseError, match=message):
        measured(outputs, **more).matched(rig())
    with pytest.raises(mv.ResponseError, match="names has 'other', which the measurement has not"):
        measured(["z"]).matched(rig(), names={"other": "z"})


def test_the_nearest_counts_and_two_as_near_are_refused():
    model = rig()
    model.add_body("cube", 1.0, (0.1, 0.1, 0.1), position=(0.2, 0.1, 0.02))
    model.add_bushing("glue", "plate", "cube", (0.2, 0.1, 0.0), (1e5,) * 6)
    model.add_output("cube", "cube", "z", position=(0.2, 0.1, 0.009))
    model.add_output("double", "plate", (0, 0, 2.0), position=(0.2, 0.1, 0.0))  # a factor of 2 is no place
    at = lambda z, name="": measured(["5Z+"], nodes=[Node(5, name, (0.2, 0.1, z))])  # noqa: E731
    assert at(0.001).matched(model).output_names == ("z",)
    assert at(0.0085).matched(model).output_names == ("cube",)
    with pytest.raises(mv.ResponseError, match=r"'5Z\+' may be each of several. Nearest are 'z' \(4 mm, 0 deg\), 'z.a' "
                                               r"\(4 mm, 0 deg\), 'cube' \(5 mm, 0 deg\). Give a smaller distance="):
        at(0.004).matched(model)
    assert at(0.004, "cube").matched(model).output_names == ("cube",)  # the node has the name of the body
    assert at(0.004).matched(model, distance=4.5e-3).output_names == ("z",)


def test_units_of_other_kinds_stay():
    """Volts per volt: gains that a fit finds; accelerations as other programs write them."""
    match = measured(["z", "z.a"], output_units=["V", "m/s²"], input_units=["V"]).matched(rig())
    assert [(p.unit, p.measured_unit, p.derivatives) for p in (*match.outputs, *match.inputs)] == [
        ("m", "V", 0), ("m/s^2", "m/s^2", 0), ("N", "V", 0)]  # fmt: skip


def test_axes_of_a_node_turn_its_directions():
    axes = ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))  # its x axis is z of the world
    data = measured(["5X-"], nodes=[Node(5, "", (0.2, 0.1, 0.0), axes)], output_units=["m"])
    (partner,) = data.matched(rig()).outputs
    assert (partner.name, partner.sign) == ("z", -1)


def test_shapes_are_matched_as_displacements():
    modes = mv.MeasuredModes([3.0], shapes=[[1.0], [2.0]], outputs=["z.a", "turn"])
    assert [p.derivatives for p in modes.matched(rig()).outputs] == [-2, 0]


@pytest.mark.parametrize("unit", ["m/s^2", "m/s²", "m/s2", "m/s/s", "m/s**2", "m s^-2", "m·s^-2", " m/s^2"])
def test_units_are_read_in_all_spellings(unit):
    """Of responses and of records: an acceleration that is taken for a displacement gives wrong values in silence."""
    data = measured(["z"], output_units=[unit])
    records = mv.Records(0.1, {"F": np.arange(9.0) ** 2}, {"z": np.arange(9.0) ** 3}, output_units=[unit])
    for one in (data, records):
        assert (one.quantity, one.output_units) == (("acceleration",), ("m/s^2",))
        assert one.matched(rig()).outputs[0].derivatives == 2


@pytest.mark.parametrize("unit", ["\u03bcm", "\u00b5m", "mm/s²", "in/s", "ft/s^2", "G", "gn", "kgf", "N·mm", "rpm"])
def test_units_that_need_a_factor_are_refused(unit):
    with pytest.raises(mv.ResponseError, match="Convert the data to SI units"):
        measured(["z"], output_units=[unit]).matched(rig())
