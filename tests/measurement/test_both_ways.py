"""Comparisons in both orders: sides of another kind, places, signs, quantities and numbers of modes."""

from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.linalg.matching import mac
from mbsvib.measurement.comparing import MOST_LINES, Pair
from mbsvib.measurement.data import MeasuredMode
from mbsvib.measurement.points import Node
from tests.measurement.test_comparing import chain, point_mass


def test_measured_modes_at_places_in_both_orders():
    """Three modes of five, at labels of other names, one against the axis of the model, in any order."""
    model = chain(masses=(1.0, 2.0, 1.5))
    system = model.linearize()
    modes = system.modes()
    displacements = modes.shapes  # z0 is a displacement, z1 a velocity, z2 an acceleration of the same coordinates
    nodes = [Node(k + 1, "", (0.0, 0.0, float(k))) for k in range(3)]
    picked = [2, 0]
    measured = mv.MeasuredModes(modes.frequencies[picked] * 1.1, [0.01, 0.02],
                                (displacements[[2, 0, 1]] * [[-1.0], [1.0], [1.0]])[:, picked] * [2.0, 3j],
                                ["3Z-", "1Z+", "2Z+"], nodes=nodes)  # fmt: skip
    exact = mac(measured.shapes, (displacements[[2, 0, 1]] * [[-1.0], [1.0], [1.0]]))
    first, second = mv.compare(measured, system), mv.compare(system, measured)
    np.testing.assert_allclose(first.mac, exact, atol=1e-9)
    np.testing.assert_allclose(second.mac, exact.T, atol=1e-9)
    assert [(p.a, p.b) for p in first.pairs] == [(1, 3), (2, 1)]
    assert sorted((p.b, p.a, p.frequencies[::-1]) for p in second.pairs) == sorted(
        (p.a, p.b, p.frequencies) for p in first.pairs)  # fmt: skip
    assert first.shape_outputs == ("3Z-", "1Z+", "2Z+")
    assert second.shape_outputs == ("z2", "z0", "z1")
    for pair in first.pairs:
        assert pair.difference == pytest.approx(1 / 1.1 - 1.0)
        assert pair.damping_ratios[0] == [0.01, 0.02][pair.a - 1]
        energy = np.abs(displacements[:, pair.b - 1]) ** 2 * [1.0, 2.0, 1.5]
        assert pair.motion == f"m{energy.argmax()} along z"
    assert "1 mode of the second without partner: 2." in str(first)
    assert "1 mode of the first without partner: 2." in str(second)
    with_gap = replace(measured, shapes=np.where(np.arange(3)[:, None] == 1, np.nan, measured.shapes))
    assert mv.compare(with_gap, system).shape_outputs == ("3Z-", "2Z+")
    np.testing.assert_allclose(mv.compare(with_gap, system).mac, mac(with_gap.shapes[[0, 2]], (
        displacements[[2, 1]] * [[-1.0], [1.0]])), atol=1e-9)  # fmt: skip


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_measured_responses_in_both_orders(sign):
    """Accelerations against displacements by place and sign; FRAC of a part of the channels, ratio and its inverse."""
    model = chain(damping=4.0)
    system = model.linearize()
    w = np.linspace(20.0, 200.0, 30)
    exact = system.frequency_response(w)[[2, 0], :1]  # z2 is an acceleration, z0 a displacement
    rng = np.random.default_rng(1)
    noise = 1.0 + 0.3 * rng.standard_normal(exact.shape)
    values = sign * np.stack([exact[0], -(w**2) * exact[1]]) * noise
    data = mv.Measurement(w, values, ["top", "low"], ["F"], quantity="acceleration",
                          output_points=[((0, 0, 2.0), (0, 0, sign)), ((0, 0, 0.0), (0, 0, sign))])  # fmt: skip
    first, second = mv.compare(data, model), mv.compare(system, data)
    assert (first.outputs, first.inputs, second.outputs) == (("top", "low"), ("F",), ("z2", "z0"))
    expected = np.stack([exact[0], -(w**2) * exact[1]])
    frac = np.abs((values * expected.conj()).sum(axis=2)) ** 2 / (
        (np.abs(values) ** 2).sum(axis=2) * (np.abs(expected) ** 2).sum(axis=2))  # fmt: skip
    np.testing.assert_allclose(first.frac, frac, rtol=1e-9)
    np.testing.assert_allclose(second.frac, frac, rtol=1e-9)
    ratio = np.sqrt((np.abs(expected) ** 2).sum(axis=2) / (np.abs(values) ** 2).sum(axis=2))
    np.testing.assert_allclose(first.ratio, ratio, rtol=1e-9)
    np.testing.assert_allclose(second.ratio, 1.0 / ratio, rtol=1e-9)
    np.testing.assert_allclose(first.responses[0], values)
    np.testing.assert_allclose(first.responses[1], sign * expected, rtol=1e-9)
    np.testing.assert_allclose(second.responses[0], sign * expected, rtol=1e-9)
    assert first.mac.shape == (0, 0)


def test_lines_that_two_measurements_have_in_common():
    """The nearest within 1e-6 of itself, in the order of the first; none: said."""
    def one(w, values):
        return mv.Measurement(w, np.array(values, dtype=complex).reshape(1, 1, -1), ["y"], ["u"], quantity="velocity")

    a = one([1.0, 2.0, 3.0, 5.0], [1.0, 2.0, 4.0, 8.0])
    b = one([0.5, 2.0 * (1 + 5e-7), 3.0 * (1 + 3e-6), 5.0], [7.0, 1.0, 9.0, 3.0])
    for first, second in ((a, b), (b, a)):
        result = mv.compare(first, second)
        np.testing.assert_allclose(result.omega, [2.0, 5.0], rtol=1e-6)
        np.testing.assert_allclose(result.frac, (2 * 1 + 8 * 3) ** 2 / ((4 + 64) * (1 + 9)))
    np.testing.assert_allclose(result.ratio, np.sqrt((4 + 64) / (1 + 9)))
    apart = one([0.7, 0.9], [1.0, 1.0])
    with pytest.raises(mv.ResponseError, match=r"no common lines \(measurement: y; measurement: y\)"):
        mv.compare(a, apart)
    modes = {"nodes": (Node(1, "", (0, 0, 0)),), "modes": (MeasuredMode("a", 10.0, 0.01, (1,), np.ones((1, 6))),)}
    none = mv.compare(replace(a, **modes), replace(apart, **modes))
    assert (none.frac.shape, none.mac.tolist()) == ((0, 0), [[pytest.approx(1.0)]])
    assert "No common lines: responses were not compared." in str(none)


@pytest.mark.parametrize("swap", [False, True])
def test_lines_that_one_side_does_not_know_do_not_count(swap):
    """Not a number in one of both, for each pair by itself."""
    rng = np.random.default_rng(2)
    values = rng.standard_normal((2, 2, 1, 6)) + 1j * rng.standard_normal((2, 2, 1, 6))
    values[0, 0, 0, 1] = values[1, 0, 0, 3] = values[1, 1, 0, 0] = np.nan
    sides = [mv.Measurement(np.arange(1.0, 7.0), one, ["y", "z"], ["u"], quantity="velocity") for one in values]
    result = mv.compare(*(sides[::-1] if swap else sides))
    for k, known in enumerate(([0, 2, 4, 5], [1, 2, 3, 4, 5])):
        a, b = values[:, k, 0][:, known]
        powers = (np.abs(a) ** 2).sum(), (np.abs(b) ** 2).sum()
        assert result.frac[k, 0] == pytest.approx(np.abs((a * b.conj()).sum()) ** 2 / (powers[0] * powers[1]))
        assert result.ratio[k, 0] == pytest.approx(np.sqrt(powers[1] / powers[0]) ** (-1 if swap else 1))


def test_models_are_compared_over_their_resonances():
    a, b = chain(damping=3.0), chain((1e4, 2e4, 4e4), damping=3.0)
    result = mv.compare(a, b)
    assert 10 < len(result.omega) <= MOST_LINES
    values = [model.linearize().frequency_response(result.omega) for model in (a, b)]
    cross = np.abs((values[0] * values[1].conj()).sum(axis=2)) ** 2
    powers = [(np.abs(value) ** 2).sum(axis=2) for value in values]
    np.testing.assert_allclose(result.frac, cross / (powers[0] * powers[1]), rtol=1e-9)
    np.testing.assert_allclose(result.ratio, np.sqrt(powers[1] / powers[0]), rtol=1e-9)
    for pole in np.concatenate((a.linearize().poles(), b.linearize().poles())):
        assert np.abs(result.omega - abs(pole)).min() < 0.01 * abs(pole)


def test_rotations_of_a_measurement_get_the_radius_of_the_model():
    """In both orders; rotations alone get none."""
    model = mv.Model("bar")
    model.add_body("bar", 2.0, (0.5, 0.5, 0.5))
    model.add_joint("guide", None, "ground", "bar", position=(0, 0, 0), free=("z", "ry"))
    for name, x, k in (("k1", -1.0, 1e3), ("k2", 1.0, 2e3)):
        model.add_spring(name, "ground", "bar", (x, 0, -1), (x, 0, 0), stiffness=k)
    for axis in ("z", "ry"):
        model.add_output(axis, "bar", axis)
    shapes = np.array([[1.0, 0.3], [0.2, -1.0]])
    modes = model.linearize().modes()
    own = np.array([[1.0], [0.5]]) * modes.shapes.real
    measured = mv.MeasuredModes([5.0, 8.0], shapes=shapes, outputs=["z", "ry"])
    expected = mac(np.array([[1.0], [0.5]]) * shapes, own)
    for first, second, table in ((measured, model, expected), (model, measured, expected.T)):
        result = mv.compare(first, second)
        np.testing.assert_allclose(result.mac, table, rtol=1e-9)
        assert "Rotations are multiplied by 0.5 m for the MAC." in str(result)
    alone = mv.compare(mv.MeasuredModes([5.0, 8.0], shapes=shapes[1:], outputs=["ry"]), model)
    assert "Rotations are multiplied" not in str(alone)


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_rotations_of_two_measurements_have_no_unit(unit):
    """In rad or mrad in both: the MAC with the radius at which they are as large as translations of the second."""
    shapes = [np.array([[1.0, 0.3], [0.2 * unit, -1.0 * unit]]), np.array([[0.9, 0.5], [0.1 * unit, -0.8 * unit]])]
    sides = [mv.MeasuredModes([5.0, 8.0], shapes=shape, outputs=["1Z+", "1RY+"]) for shape in shapes]
    radius = np.linalg.norm(shapes[1][0]) / np.linalg.norm(shapes[1][1])
    result = mv.compare(*sides)
    scale = np.array([[1.0], [radius]])
    np.testing.assert_allclose(result.mac, mac(scale * shapes[0], scale * shapes[1]), rtol=1e-12)
    assert f"Rotations are multiplied by {radius:.3g} m for the MAC." in str(result)


def test_modes_that_no_output_shows_have_no_partner_by_shape():
    """Outputs along x alone: the mode along y is not compared; more modes than outputs are told."""
    a, b = point_mass(1e3, 2e3, 3e3).linearize()["x", "Fx"], point_mass(1.1e3, 2e3, 3e3).linearize()["x", "Fx"]
    result = mv.compare(a, b)
    assert [(p.a, p.b, p.mac) for p in result.pairs] == [(1, 1, pytest.approx(1.0))]
    np.testing.assert_array_equal(result.mac[1:], 0.0)
    np.testing.assert_array_equal(result.mac[:, 1:], 0.0)
    assert "3 modes over 1 common output: shapes do not tell all modes apart" in str(result)
    assert "2 modes of the first without partner: 2, 3." in str(result)
    np.testing.assert_allclose(result.pairs[0].difference, np.sqrt(1.1) - 1.0, rtol=1e-9)


def test_pairs_of_equal_shapes_are_those_of_near_frequencies():
    shapes = np.ones((1, 3))
    first = mv.MeasuredModes([1.0, 4.0, 30.0], shapes=shapes, outputs=["a"])
    second = mv.MeasuredModes([33.0, 3.6, 1.1], shapes=shapes, outputs=["a"])
    assert [(p.a, p.b) for p in mv.compare(first, second).pairs] == [(1, 3), (2, 2), (3, 1)]


@pytest.mark.parametrize(("frequencies", "difference"), [((2.0, 3.0), 0.5), ((2.0, 1.0), -0.5), ((0.0, 0.0), 0.0),
                                                         ((0.0, 1.0), np.inf), ((1.0, 0.0), -1.0)])  # fmt: skip
def test_difference_of_frequencies(frequencies, difference):
    assert Pair(1, 1, 1.0, frequencies, (0.0, 0.0), "").difference == difference


def test_columns_are_the_pairs():
    result = mv.compare(chain(damping=3.0), chain((1e4, 2e4, 2e4), damping=3.0))
    columns = result.columns()
    for k, pair in enumerate(result.pairs):
        assert (columns["mode_a"][k], columns["mode_b"][k], columns["mac"][k]) == (pair.a, pair.b, pair.mac)
        assert (columns["frequency_a_hz"][k], columns["frequency_b_hz"][k]) == pair.frequencies
        assert (columns["damping_ratio_a"][k], columns["damping_ratio_b"][k]) == pair.damping_ratios
        assert columns["largest_motion"][k] == pair.motion
    record = result.record()
    assert record["mac"] == result.mac.tolist()
    assert record["frac"] == result.frac.tolist()
    assert [tuple(one["frequencies"]) for one in record["pairs"]] == [pair.frequencies for pair in result.pairs]


def test_state_spaces_have_the_modes_of_their_systems():
    """Of outputs of all quantities, in both orders, damped by one damper, with the rotations that a system knows."""
    model = chain((1e4, 2.2e4, 3e4), damping=2.0)
    model.add_spring("d", "ground", "m2", (0, 0, 3.0), (0, 0, 2.0), stiffness=0.0, damping=15.0)
    system = model.linearize()
    for sides in ((system, system.state_space()), (system.state_space(), system)):
        result = mv.compare(*sides)
        assert [(p.a, p.b) for p in result.pairs] == [(1, 1), (2, 2), (3, 3)]
        for pair in result.pairs:
            assert pair.mac == pytest.approx(1.0, abs=1e-9)
            assert pair.frequencies[0] == pytest.approx(pair.frequencies[1], rel=1e-9)
            assert pair.damping_ratios[0] == pytest.approx(pair.damping_ratios[1], rel=1e-7)


def test_parts_that_differ_in_kind_words_and_angles():
    """Another kind of part, another body, another angle; numbers that one has alone."""
    def model(kind="bushing", body="m", turn=0.0, name="one", mass=1.0):
        result = mv.Model(name)
        for one in ("m", "n"):
            result.add_body(one, mass, (1, 1, 1))
            result.add_bushing(f"hold.{one}", "ground", one, (0, 0, 0), (1e3,) * 6)
        if kind == "bushing":
            result.add_bushing("k", "ground", body, (0, 0, 0), (1e3, 2e3, 3e3, 1, 1, 1), orientation=(0, 0, turn))
        else:
            result.add_spring("k", "ground", body, (0, 0, -1), (0, 0, 0), stiffness=1e3)
        result.add_output("x", "m", "x")
        return result

    found = mv.compare(model(), model("spring")).differences
    assert ("k", "", ("Bushing", "Spring")) in [(d.part, d.quantity, d.values) for d in found]
    (body,) = mv.compare(model(), model(body="n")).differences
    assert (body.part, body.values, body.percent) == ("k", ("m", "n"), None)
    for turn in (0.3, -0.3, 2.0, 1e-7):
        found = mv.compare(model(turn=0.2), model(turn=0.2 + turn)).differences
        angles = [d for d in found if d.quantity == "orientation"]
        assert angles[0].values == (0.0, pytest.approx(abs(turn), rel=1e-7))
        assert angles[0].unit == "rad"
    masses = mv.compare(model(), model(mass=1.0 + 1e-9)).differences
    assert [(d.part, d.quantity, d.percent) for d in masses] == [
        (one, "mass", pytest.approx(1e-7, rel=1e-5)) for one in ("m", "n")]  # fmt: skip
    assert mv.compare(model(), model(mass=1.0 + 1e-13)).differences == ()
    assert mv.compare(model().linearize().state_space(), model()).differences == ()
    assert mv.compare(model(), model().linearize()).differences == ()


def test_measured_modes_of_a_file_are_those_of_its_nodes():
    """Two modes at different nodes, one complex: NaN where a mode is not known; shapes are in world axes."""
    axes = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    nodes = (Node(7, "", (0.0, 0.0, 0.0), axes), Node(3, "", (1.0, 0.0, 0.0)))
    one, two = np.full((2, 6), np.nan), np.full((1, 6), np.nan, dtype=complex)
    one[0, :3], one[1, 1], two[0, 2] = (1.0, 2.0, 3.0), 4.0, 5.0 + 1j
    data = mv.Measurement([1.0], np.ones((1, 1, 1)), ["y"], ["u"], nodes=nodes, modes=(
        MeasuredMode("a", 10.0, 0.01, (7, 3), one), MeasuredMode("b", 20.0, 0.02, (3,), two)))  # fmt: skip
    modes = mv.MeasuredModes.from_measurement(data)
    assert modes.outputs == ("3Y+", "3Z+", "7X+", "7Y+", "7Z+")
    nan = np.nan
    np.testing.assert_array_equal(modes.shapes, [[4, nan], [nan, 5 + 1j], [1, nan], [2, nan], [3, nan]])
    assert (modes.frequencies.tolist(), modes.damping_ratios.tolist()) == ([10.0, 20.0], [0.01, 0.02])
    assert all(node.axes is None for node in modes.nodes)
    real = mv.MeasuredModes.from_measurement(replace(data, modes=data.modes[:1]))
    assert real.shapes.dtype == float
    assert real.shapes.ravel().tolist() == [4.0, 1.0, 2.0, 3.0]
    with pytest.raises(mv.ResponseError, match="the measurement has no modes"):
        mv.MeasuredModes.from_measurement(replace(data, modes=()))


def test_a_comparison_prints_pairs_differences_and_responses():
    """Numbers as they are, poor pairs marked, what is zero in one of both, and no more lines than are read."""
    base = mv.compare(chain(damping=3.0), chain((1e4, 2e4, 2e4), damping=3.0))
    pairs = (Pair(1, 2, 0.98765, (10.0, 11.0), (0.0123, np.nan), "m along z"),
             Pair(2, 1, 0.4999, (20.0, 19.99999), (0.5, 0.01), ""))  # fmt: skip
    shown = replace(base, names=("a", "b"), pairs=pairs, frac=np.array([[0.9], [np.nan], [0.12345]]),
                    ratio=np.array([[0.0], [np.nan], [2.34567]]), remarks=("first",))  # fmt: skip
    table = shown.table()
    assert table["title"] == "a and b"
    assert table["rows"] == [(1, 2, "0.988", "10", "11", "+10.00", "1.23", "", "m along z"),
                             (2, 1, "0.500", "20", "20", "+0.00", "50", "1", " (poor)")]  # fmt: skip
    assert table["notes"] == ["first", str(base.differences[0]), "z2 / F: FRAC 0.1235, rms ratio 2.346",
                              "z0 / F: zero in the second"]  # fmt: skip
    infinite = replace(shown, ratio=np.array([[np.inf], [1.0], [1.0]]), frac=np.array([[0.0], [0.5], [0.2]]))
    assert infinite.table()["notes"][2:] == ["z0 / F: zero in the first", "z2 / F: FRAC 0.2000, rms ratio 1",
                                             "z1 / F: FRAC 0.5000, rms ratio 1"]  # fmt: skip
    many = replace(shown, differences=base.differences * 15, outputs=tuple(f"y{k}" for k in range(20)),
                   frac=np.linspace(0.1, 0.9, 20)[:, None], ratio=np.ones((20, 1)))  # fmt: skip
    notes = many.table()["notes"]
    assert notes[13] == "and 3 other differences: .differences"
    assert (len(notes), notes[-1]) == (1 + 13 + 13, "and 8 other responses with FRAC as high or higher")
    exact = replace(many, differences=base.differences * 12, outputs=many.outputs[:12], frac=many.frac[:12])
    assert len(exact.table()["notes"]) == 1 + 12 + 12


def test_differences_print_what_changed():
    changed = chain((1e4, 2.5e4, 3e4))
    changed.add_spring("extra", "ground", "m2", (0, 0, 3), (0, 0, 2), stiffness=1.0)
    words = [str(difference) for difference in mv.compare(changed, chain()).differences]
    assert words == ["extra: only in the first", "k1: stiffness 25000 → 20000 N/m (-20 %)"]
    undamped = mv.compare(chain(), chain(damping=2.0)).differences
    assert [(d.part, d.quantity, d.percent) for d in undamped] == [(f"k{k}", "damping", None) for k in range(3)]
    assert str(undamped[0]) == "k0: damping 0 → 2 N s/m"


def test_measured_modes_print_what_is_known():
    modes = mv.MeasuredModes([10.12345678, 20.0], [0.0123, 0.5], sd=[0.0123, 2.0])
    assert modes.table()["rows"] == [(1, "10.1235", "1.23", "0.012"), (2, "20", "50", "2")]
    columns = modes.columns()
    assert [columns[name].tolist() for name in ("mode", "frequency_hz", "damping_ratio", "sd_hz")] == [
        [1, 2], [10.12345678, 20.0], [0.0123, 0.5], [0.0123, 2.0]]  # fmt: skip
    bare = mv.MeasuredModes([10.0])
    assert bare.table()["rows"] == [(1, "10", "", "")]
    assert np.isnan([bare.columns()["damping_ratio"], bare.columns()["sd_hz"]]).all()
    for wrong in ({"frequencies": [[1.0]]}, {"frequencies": [np.inf]}, {"sd": [0.1, 0.0]}, {"sd": [0.1]},
                  {"damping_ratios": [-0.1, 0.0]}, {"damping_ratios": [0.1, np.nan]}, {"damping_ratios": [1.2, 0.5]},
                  {"shapes": [[np.inf, 1.0]]}, {"shapes": [[True, False]]},
                  {"outputs": ["a"], "shapes": None}):  # fmt: skip
        with pytest.raises(mv.ResponseError, match="MeasuredModes: "):
            mv.MeasuredModes(**({"frequencies": [1.0, 2.0], "outputs": ["a"] if "shapes" in wrong else ()} | wrong))
    assert mv.MeasuredModes([1.0, 2.0], 0.0).damping_ratios.tolist() == [0.0, 0.0]
