"""Models, systems and measurements compared: MAC and FRAC by hand, pairs by shape, differences in words."""

import json
from dataclasses import replace

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx


def chain(stiffness=(1e4, 2e4, 3e4), masses=(1.0, 2.0, 1.5), damping=0.0, name="chain"):
    """Three masses on a line, each held to the one before."""
    model = mv.Model(name)
    below = "ground"
    for i, (k, m) in enumerate(zip(stiffness, masses, strict=True)):
        model.add_body(f"m{i}", m, (1, 1, 1), position=(0, 0, float(i)))
        model.add_joint(f"rail{i}", "prismatic", "ground", f"m{i}", (0, 0, float(i)), axis=(0, 0, 1))
        model.add_spring(f"k{i}", below, f"m{i}", (0, 0, i - 1.0), (0, 0, float(i)), stiffness=k, damping=damping)
        model.add_output(f"z{i}", f"m{i}", "z", quantity=("displacement", "velocity", "acceleration")[i])
        below = f"m{i}"
    model.add_input("F", "m2", "z")
    return model


def by_hand(k, m):
    matrix = np.array([[k[0] + k[1], -k[1], 0], [-k[1], k[1] + k[2], -k[2]], [0, -k[2], k[2]]])
    values, vectors = np.linalg.eigh(matrix / np.sqrt(np.outer(m, m)))
    return np.sqrt(values) / (2 * np.pi), vectors / np.sqrt(m)[:, None]


def test_mac_and_frequencies_are_those_by_hand():
    """Outputs of displacement, velocity and acceleration are compared as displacements."""
    other = {"stiffness": (1.6e4, 2e4, 1e4), "masses": (1.0, 0.5, 1.5)}
    result = mv.compare(chain(), chain(**other).linearize())
    (fa, a), (fb, b) = by_hand((1e4, 2e4, 3e4), (1.0, 2.0, 1.5)), by_hand(*other.values())
    mac = (a.T @ b) ** 2 / np.outer((a**2).sum(0), (b**2).sum(0))
    np.testing.assert_allclose(result.mac, mac, atol=1e-12)
    assert result.shape_outputs == result.outputs == ("z0", "z1", "z2")
    for pair in result.pairs:
        assert pair.frequencies == pytest.approx((fa[pair.a - 1], fb[pair.b - 1]), rel=1e-12)
        assert pair.mac == pytest.approx(mac[pair.a - 1, pair.b - 1], abs=1e-12)
    assert str(result).splitlines()[0].strip() == "chain and chain"
    same = mv.compare(chain(damping=3.0), chain(damping=3.0).linearize().state_space())
    np.testing.assert_allclose([pair.mac for pair in same.pairs], 1.0, rtol=1e-9)
    np.testing.assert_allclose([pair.damping_ratios[0] / pair.damping_ratios[1] for pair in same.pairs], 1, rtol=1e-9)
    np.testing.assert_allclose(same.frac, 1.0, rtol=1e-9)


def point_mass(kx, ky, kz, turn=0.0, name="mass"):
    model = mv.Model(name)
    model.add_body("m", 1.0, (1, 1, 1))
    model.add_joint("guide", None, "ground", "m", position=(0, 0, 0), free=("x", "y", "z"))
    model.add_bushing("k", "ground", "m", (0, 0, 0), (kx, ky, kz, 0, 0, 0), orientation=(0, 0, turn))
    for axis in "xyz":
        model.add_output(axis, "m", axis)
        model.add_input(f"F{axis}", "m", axis)
    return model


def test_modes_are_paired_by_shape_and_named():
    """The order of the frequencies is another one in b."""
    result = mv.compare(point_mass(1e3, 2e3, 3e3), point_mass(4e3, 2e3, 3e3))
    assert [(pair.a, pair.b) for pair in result.pairs] == [(1, 3), (2, 1), (3, 2)]
    assert [pair.motion for pair in result.pairs] == ["m along x", "m along y", "m along z"]
    assert [pair.difference for pair in result.pairs] == pytest.approx([1.0, 0.0, 0.0])
    (difference,) = result.differences
    assert str(difference) == "k: stiffness.x 1000 → 4000 N/m (+300 %)"


def test_modes_of_one_frequency_are_a_subspace():
    """Axes of a nearly round stiffness are turned by 30 degrees: cos^2 30 = 0.75 of each, 1 of both together."""
    round_, turned = point_mass(1e3, 1e3 * (1 + 1e-6), 3e3), point_mass(1e3, 1e3 * (1 + 1e-6), 3e3, np.pi / 6)
    apart = mv.compare(point_mass(1e3, 1.1e3, 3e3), point_mass(1e3, 1.1e3, 3e3, np.pi / 6))
    assert [pair.mac for pair in apart.pairs] == pytest.approx([0.75, 0.75, 1.0])
    result = mv.compare(round_, turned)
    assert [pair.mac for pair in result.pairs] == pytest.approx([1.0, 1.0, 1.0])
    np.testing.assert_allclose(result.mac[:2, :2], [[0.75, 0.25], [0.25, 0.75]], rtol=1e-9)  # it is that of each pair
    assert "Modes 1, 2 of the first: MAC with all modes of one frequency, as a subspace." in str(result)
    assert str(result.differences[0]) == "k: orientation 0 → 0.523599 rad"


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_units_do_not_change_the_mac(unit):
    """A rigid bar on two springs, lengths in metres or millimetres: displacement and rotation of the centre.

    With k1 at -1 and k2 at 1, m = 2, I = 0.5 (radius of gyration 0.5): K = [[k1 + k2, k2 - k1], [k2 - k1, k1 + k2]].
    """
    shapes, models = [], []
    for k1, k2 in ((1e3, 2e3), (1e3, 5e3)):
        model = mv.Model("bar")
        model.add_body("bar", 2.0, (0.5 * unit**2,) * 3)
        model.add_joint("guide", None, "ground", "bar", position=(0, 0, 0), free=("z", "ry"))
        for name, x, k in (("k1", -1.0, k1), ("k2", 1.0, k2)):
            model.add_spring(name, "ground", "bar", (x * unit, 0, -unit), (x * unit, 0, 0), stiffness=k)
        for axis in ("z", "ry"):
            model.add_output(axis, "bar", axis)
        models.append(model)
        matrix = np.array([[k1 + k2, k1 - k2], [k1 - k2, k1 + k2]])
        shapes.append(np.linalg.eigh(matrix / np.sqrt(np.outer([2, 0.5], [2, 0.5])))[1])  # of z and 0.5 ry
    result = mv.compare(*models)
    np.testing.assert_allclose(result.mac, (shapes[0].T @ shapes[1]) ** 2, atol=1e-9)
    assert f"Rotations are multiplied by {0.5 * unit:.3g} m for the MAC." in str(result)


def test_measured_responses_and_modes_of_a_universal_file(tmp_path):
    """Modes at nodes are compared with outputs at the same place; a factor does not change FRAC and is told."""
    model = point_mass(1e3, 2e3, 3e3)
    system = model.linearize()
    omega = np.linspace(10.0, 100.0, 50)
    data = mx.from_uff(mx.to_uff(system, tmp_path / "m.uff", omega, modes=True))
    result = mv.compare(model, replace(data, responses=-2.0 * data.responses))
    assert result.shape_outputs == ("x", "y", "z")
    np.testing.assert_allclose(result.mac, np.eye(3), atol=1e-9)
    np.testing.assert_allclose([result.frac[k, k] for k in range(3)], 1.0, rtol=1e-12)
    np.testing.assert_allclose([result.ratio[k, k] for k in range(3)], 2.0, rtol=1e-12)
    back = mv.compare(data, model)
    np.testing.assert_allclose(back.mac, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(back.omega, omega, rtol=1e-12)
    modes = mv.MeasuredModes.from_measurement(data)
    assert modes.outputs[:3] == ("1X+", "1Y+", "1Z+")
    assert mv.compare(modes, system).pairs == back.pairs


def test_frac_is_that_of_the_known_lines_and_one_quantity():
    omega = np.array([1.0, 2.0, 3.0])
    a, b = np.array([1.0, 2.0j, np.nan]), np.array([2.0, 1.0j, 5.0])
    first = mv.Measurement(omega, a.reshape(1, 1, 3), ["y"], ["u"], quantity="displacement", output_units=["m"])
    second = mv.Measurement(omega, (-(omega**2) * b).reshape(1, 1, 3), ["y"], ["u"], output_units=["m/s^2"])
    result = mv.compare(first, second)
    # (1 2 + 2 1)^2 / ((1 + 4) (4 + 1))
    np.testing.assert_allclose(result.frac, 16 / 25, rtol=1e-12)
    np.testing.assert_allclose(result.ratio, 1.0, rtol=1e-12)
    assert "Without shapes of modes of measurement, modes were not compared." in result.remarks


def test_measured_modes_against_measured_modes():
    first = mv.MeasuredModes([1.0, 2.0], [0.01, 0.02], [[1.0, 1.0], [1.0, -1.0]], ["a", "b"])
    second = mv.MeasuredModes([2.1, 1.1], shapes=[[2.0, 1.0], [-1.0, 1.0], [9.0, 9.0]], outputs=["a", "b", "c"])
    result = mv.compare(first, second)
    assert [(pair.a, pair.b) for pair in result.pairs] == [(1, 2), (2, 1)]
    assert [pair.mac for pair in result.pairs] == pytest.approx([1.0, 9 / 10])
    assert result.outputs == ()


def test_a_common_name_of_another_kind_is_told():
    renamed = mv.Model("other")
    renamed.add_body("m", 1.0, (1, 1, 1))
    renamed.add_bushing("k", "ground", "m", (0, 0, 0), (1e3,) * 6)
    renamed.add_output("z0", "m", "z")
    renamed.add_output("z1", "m", "rx")
    renamed.add_input("F", "m", "z")
    result = mv.compare(chain(), renamed)
    assert result.outputs == ("z0",)
    assert "the measured output 'z1' has the unit m/s, and 'z1' of the model rad." in str(result)


def test_differences_are_told_part_by_part():
    changed = chain(masses=(1.0, 2.5, 1.5))
    changed.add_spring("extra", "ground", "m2", (0, 0, 3), (0, 0, 2), stiffness=1.0)
    words = [str(difference) for difference in mv.compare(chain(), changed).differences]
    assert words == ["extra: only in the second", "m1: mass 2 → 2.5 kg (+25 %)"]
    assert mv.compare(chain(), chain()).differences == ()


def test_responses_that_are_zero_by_symmetry():
    """Turned axes couple x and y; z stays apart in both."""
    result = mv.compare(point_mass(1e3, 2e3, 3e3), point_mass(1e3, 2e3, 3e3, 0.3))
    assert result.frac[0, 1] == 0.0
    assert np.isnan(result.frac[0, 2])
    assert "x / Fy: zero in the first" in str(result)


def test_what_cannot_be_compared():
    with pytest.raises(mv.ResponseError, match=r"no common output \(mass: x, y, z; chain: z0, z1, z2\)"):
        mv.compare(point_mass(1.0, 2.0, 3.0), chain())
    data = mv.Measurement([1.0, 2.0], [[[1.0, 2.0]]], ["z0"], ["F"], output_units=["mm"])
    with pytest.raises(mv.ResponseError, match=r"no common output.*The measured output 'z0' has the unit mm"):
        mv.compare(chain(), data)
    with pytest.raises(mv.ResponseError, match="b is an int; expected a Model"):
        mv.compare(chain(), 3)


def test_record_table_and_figure():
    result = mv.compare(chain(), chain((1e4, 2e4, 2e4)))
    record = json.loads(json.dumps(result.record()))
    assert record["pairs"][0]["b"] == 1
    assert record["differences"][0]["values"] == [3e4, 2e4]
    figure = result.plot()
    assert figure.axes[0].get_title(loc="left") == "MAC"
    assert figure.axes[0].get_xlabel() == "mode of chain"
    with pytest.raises(mv.ResponseError, match="no modes were compared"):
        replace(result, pairs=()).plot()


def test_the_model_is_drawn_over_the_data():
    system = chain(damping=5.0).linearize()
    omega = np.linspace(1.0, 300.0, 40)
    data = mv.Measurement(omega, -(omega**2) * system.frequency_response(omega)[:1], ["z0"], ["F"],
                          quantity="acceleration", variance=np.ones((1, 1, 40)))  # fmt: skip
    figure = data.plot(system)
    measured, model, deviation = figure.axes[0].get_lines()
    np.testing.assert_allclose(model.get_ydata(), measured.get_ydata(), rtol=1e-12)
    assert deviation.get_ydata().tolist() == [1.0] * 40
    with pytest.raises(mv.ResponseError, match="0 measured pairs; expected 1 to 12"):
        replace(data, responses=np.full((1, 1, 40), np.nan), variance=None).plot()


def test_modes_that_no_output_shows_have_no_partner():
    """The legs of a hexapod spin about their own axes at frequencies within 1e-5, three of six modes unseen."""
    system = mv.library.stewart_isolator().linearize()
    result = mv.compare(system, system)
    assert [(pair.a, pair.b) for pair in result.pairs] == [(k, k) for k in (1, 2, 3, 4, 5, 6, 10, 11, 12)]
    assert "3 modes of the first without partner: 7, 8, 9." in str(result)


@pytest.mark.parametrize("words", [{"quantity": "displacement"}, {"output_units": ["m"]}])
@pytest.mark.parametrize("others", [{"quantity": "acceleration"}, {"output_units": ["m/s²"]}])
def test_measurements_of_different_quantities_are_compared_as_the_first(words, others):
    omega = np.array([1.0, 3.0, 7.0])
    g = np.array([[[1.0, 2.0j, -0.5]]])
    one, other = (mv.Measurement(omega, values, ["z"], ["F"], **named)
                  for values, named in ((g, words), (-2.0 * omega**2 * g, others)))  # fmt: skip
    for a, b, ratio in ((one, other, 2.0), (other, one, 0.5)):
        result = mv.compare(a, b)
        np.testing.assert_allclose([result.frac[0, 0], result.ratio[0, 0]], [1.0, ratio], rtol=1e-14)
