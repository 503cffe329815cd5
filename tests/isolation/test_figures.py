"""Figures of isolation against closed forms."""

import csv
import math

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from tests.isolation.scenes import FREQUENCY, MASS, OMEGA, RATIO, one_axis, two_masses


def test_one_axis_transmissibility_and_its_figures():
    f = np.concatenate(([0.0], np.geomspace(0.05, 5e3, 2000)))
    result = isolation.study(one_axis(), "payload", directions="z", frequencies=f)
    r, twice = f / FREQUENCY, 2 * RATIO * f / FREQUENCY
    exact = np.sqrt((1 + twice**2) / ((1 - r**2) ** 2 + twice**2))
    assert np.allclose(np.abs(result.transmissibility[2, 0]), exact, rtol=1e-13, atol=0)
    assert np.allclose(result.index, exact, rtol=1e-13, atol=0)
    assert result.crossover == pytest.approx(FREQUENCY * math.sqrt(2), rel=1e-12)
    peak = (math.sqrt(math.sqrt(1 + 8 * RATIO**2) - 1)) / (2 * RATIO)
    assert result.resonance == pytest.approx(FREQUENCY * peak, rel=1e-11)
    r2 = (2 * RATIO * peak) ** 2
    assert result.amplification == pytest.approx(math.sqrt((1 + r2) / ((1 - peak**2) ** 2 + r2)), rel=1e-13)
    assert result.compliance[2, 2, 0] == pytest.approx(1 / (MASS * OMEGA**2), rel=1e-13)


def test_undamped_resonance_is_infinite():
    result = isolation.study(one_axis(0.0), "payload", directions="z", frequencies=[1.0, 4.0, 20.0])
    assert result.amplification == math.inf
    assert result.resonance == pytest.approx(FREQUENCY, rel=1e-12)
    assert "undamped" in str(result)


def test_six_directions_move_as_the_base_at_rest():
    for model in (library.stewart(), library.cubic_hexapod(), library.stewart_isolator()):
        result = isolation.study(model, "platform", frequencies=[0.0, 1.0])
        assert result.index[0] == pytest.approx(1.0, abs=1e-12)
        assert np.allclose(result.singular_values[:, 0], 1.0, rtol=0, atol=1e-12)
    assert model.inputs  # the ports of the model itself stay as they are
    assert np.allclose(np.diagonal(result.transmissibility[:, :, 0]), 1.0, rtol=0, atol=1e-12)


def test_static_compliance_of_the_stewart_platform():
    c = isolation.study(library.stewart(), "platform", frequencies=[0.0]).compliance[:, :, 0]
    expected = (2.8371955207e-8, 2.8371955207e-8, 2.0990463026e-8, 5.1862720981e-6, 5.1862720981e-6, 1.7072960141e-6)
    assert np.allclose(c.diagonal(), expected, rtol=1e-10, atol=0)
    assert abs(c[0, 4]) == pytest.approx(6.1619349384e-8, rel=1e-10)


def test_cubic_hexapod_is_six_isolators():
    edge, k, m = 0.2, 1e6, 10.0
    inertia = (0.05, 0.05, 0.08)
    model = library.cubic_hexapod(edge=edge, stiffness=k, damping=50.0, mass=m, inertia=inertia)
    f = np.geomspace(1.0, 1e3, 60)
    result = isolation.study(model, "platform", frequencies=f)
    stiffness = k * np.array([2, 2, 2, edge**2 / 2, edge**2 / 2, 2 * edge**2])
    s = 2j * np.pi * f
    spring = stiffness[:, None] * (1 + s * 50.0 / k)
    exact = spring / (spring + np.array([m, m, m, *inertia])[:, None] * s**2)
    assert np.allclose(np.diagonal(result.transmissibility).T, exact, rtol=1e-11, atol=0)
    assert np.allclose(result.index, np.sqrt((np.abs(exact) ** 2).sum(axis=0) / 6), rtol=1e-12, atol=0)
    assert result.scene.length == pytest.approx(math.sqrt(sum(inertia) / (2 * m)), rel=1e-15)


def test_length_changes_only_what_mixes_rotations_and_translations():
    model = library.stewart()
    first, second = (isolation.study(model, "platform", length=x, frequencies=[500.0, 900.0]) for x in (0.05, 0.5))
    assert np.array_equal(first.transmissibility, second.transmissibility)
    assert np.allclose(first.scaled[:3, 3:] * 0.05, second.scaled[:3, 3:] * 0.5, rtol=1e-14)
    assert not np.allclose(first.index, second.index)


def test_two_masses_and_a_stage_as_the_base():
    m1, m2, k1, k2, c1, c2 = 4.0, 9.0, 3e4, 1e4, 20.0, 35.0
    f = np.geomspace(0.5, 200.0, 50)
    s = 2j * np.pi * f
    first, second = k1 + c1 * s, k2 + c2 * s
    full = first * second / ((m1 * s**2 + first + second) * (m2 * s**2 + second) - second**2)
    result = isolation.study(two_masses(), "payload", directions="z", frequencies=f)
    assert np.allclose(result.transmissibility[2, 0], full, rtol=1e-12, atol=0)
    result = isolation.study(two_masses(), "payload", base="stage", directions="z", frequencies=f)
    assert np.allclose(result.transmissibility[2, 0], second / (m2 * s**2 + second), rtol=1e-12, atol=0)
    assert [leg.name for leg in result.scene.legs] == ["upper"]


def test_relaxation_leg():
    model = mv.Model("relaxing")
    model.add_body("payload", MASS, (0.2, 0.2, 0.2), (0, 0, 0.3))
    model.add_joint("guide", "prismatic", "ground", "payload", axis=(0, 0, 1))
    k0, k1, c = 5e3, 2e4, 300.0
    model.add_maxwell("leg", "ground", "payload", (0, 0, 0), (0, 0, 0.2), k1, c, k0)
    f = np.geomspace(0.1, 1e3, 80)
    s = 2j * np.pi * f
    k = k0 + k1 * c * s / (k1 + c * s)
    result = isolation.study(model, "payload", directions="z", frequencies=f)
    assert np.allclose(result.transmissibility[2, 0], k / (k + MASS * s**2), rtol=1e-11, atol=0)
    assert result.roll_off == -40.0  # the spring k0 + k1 is left
    assert result.plateau == 0.0


def test_weight_leaves_translations_of_the_base():
    model = mv.Model("hanging", gravity=(0, 0, -9.81))
    model.add_body("payload", 2.0, (0.1, 0.1, 0.1), (0, 0, -0.5))
    model.add_joint("pivot", "spherical", "ground", "payload", (0, 0, 0))
    model.add_bushing("damper", "ground", "payload", (0, 0, 0), damping=(0, 0, 0, 0.1, 0.1, 0.1), stiffness=(0,) * 6)
    result = isolation.study(model, "payload", frequencies=[0.1, 1.0, 10.0])
    assert result.scene.base_directions == ("x", "y", "z")
    assert "gravity" in str(result)
    assert result.index.shape == (3,)


def test_csv_holds_every_digit(tmp_path):
    result = isolation.study(library.stewart(), "platform", frequencies=[10.0, 800.0])
    with open(result.to_csv(tmp_path / "figures.csv")) as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["index"]) for row in rows] == result.index.tolist()
    directions = ("x", "y", "z", "rx", "ry", "rz")
    for symbol, table in (("T", result.transmissibility), ("C", result.compliance)):
        read = [[[complex(float(row[f"{symbol}_{i}_{j}_re"]), float(row[f"{symbol}_{i}_{j}_im"])) for row in rows]
                 for j in directions] for i in directions]  # fmt: skip
        np.testing.assert_array_equal(read, table)
    np.testing.assert_array_equal([float(rows[1][f"singular_value_{k}"]) for k in range(1, 7)],
                                  result.singular_values[:, 1])  # fmt: skip


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"body": "platfrom"}, "Did you mean 'platform'"),
        ({"body": "platform", "base": "platform"}, "nothing is isolated"),
        ({"body": "platform", "base": "flor"}, "expected a body of model"),
        ({"body": "platform", "length": 0.0}, "a positive length"),
        ({"body": "platform", "directions": ["q"]}, "x y z rx ry rz"),
        ({"body": "platform", "directions": []}, "x y z rx ry rz"),
        ({"body": "platform", "frequencies": []}, "expected at least one frequency"),
        ({"body": "platform", "frequencies": [3.0, 2.0]}, "each higher"),
        ({"body": "platform", "frequencies": ["a"]}, "expected at least one frequency"),
        ({"body": "platform", "base": "leg1.lower"}, "is tied to 'ground'"),
    ],
)
def test_mistakes_are_told(words, message):
    with pytest.raises(mv.MbsvibError, match=message):
        isolation.study(library.stewart(), **words)


def test_a_response_that_only_falls_has_no_resonance():
    """Force feedback without leak takes the static stiffness away: the index is largest where the band begins."""
    plant = isolation.actuated(one_axis(0.05), "payload", directions="z")
    loop = plant.with_gains(isolation.force_feedback(plant, 400.0))
    rows = dict(loop.isolation().table()["rows"])
    assert rows["resonance"] == "none in this band"
    assert rows["amplification at resonance"].startswith("none: ")
    assert dict(isolation.study(one_axis(0.05), "payload", directions="z").table()["rows"])["resonance"].endswith(" Hz")


def test_a_mount_of_rubber():
    """T = K / (K - m w^2) with the stiffness K(w) of a spring; a force beside it moves it by 1 / (K - m w^2)."""
    mass, k, rubber = 2.0, 3e4, mv.Dynamic.prony([0.3], [0.01])
    model = mv.Model("mount")
    model.add_body("payload", mass, (1, 1, 1), (0, 0, 0))
    model.add_joint("guide", "prismatic", "ground", "payload", (0, 0, 0), axis=(0, 0, 1))
    model.add_spring("rubber", "ground", "payload", (0, 0, -1), (0, 0, 0), k, dynamic=rubber)
    f = np.array([1.0, 15.0, 80.0])
    result = isolation.study(model, "payload", directions="z", frequencies=f)
    omega = 2.0 * np.pi * f
    dynamic = k * rubber.factor(omega)
    np.testing.assert_allclose(result.transmissibility[2, 0], dynamic / (dynamic - mass * omega**2), rtol=1e-9)
    plant = isolation.actuated(model, "payload", directions="z")
    rate = plant.system.frequency_response(omega, "guide.rate", "guide.actuator")[0, 0]
    np.testing.assert_allclose(np.abs(rate), np.abs(omega / (dynamic - mass * omega**2)), rtol=1e-9)


def test_high_frequencies_have_their_units():
    model = mv.Model("chip")
    model.add_body("die", 1e-9, (2e-18, 2e-18, 3e-18))
    for i, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        model.add_bushing(f"leg{i}", "ground", "die", (x * 5e-5, y * 5e-5, 0), (25.0, 25.0, 37.0, 0, 0, 0),
                          (3e-6, 3e-6, 3e-6, 0, 0, 0))  # fmt: skip
    rows = dict(isolation.study(model, "die", frequencies=np.geomspace(5e2, 2e6, 400)).table()["rows"])
    assert {"index at 2 MHz", "compliance at 500 Hz, minimum and maximum"} <= set(rows)
    assert "kHz" in rows["resonance"]
