"""Inertias as values of a fit: entries that the data do not feel, and the limits of what bodies can have."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.api.fitting import _in_words
from mbsvib.fitting.variables import physical, variables

OMEGA = 2 * np.pi * np.linspace(2.0, 40.0, 60)
ENTRIES = ("xx", "yy", "zz", "xy", "xz", "yz")


def plate(inertia):
    """A plate that heaves and tilts on three springs, pushed and seen at two points."""
    model = mv.Model("plate")
    model.add_body("plate", 2.0, inertia)
    model.add_joint("guide", None, "ground", "plate", position=(0, 0, 0), free=("z", "rx", "ry"))
    for k, (x, y) in enumerate([(0.2, 0.0), (-0.1, 0.15), (-0.12, -0.16)]):
        model.add_spring(f"s{k}", "ground", "plate", (x, y, -0.1), (x, y, 0.0), stiffness=4e3 + 500 * k, damping=3.0)
    for k, (x, y) in enumerate([(0.2, 0.05), (-0.1, 0.2)]):
        model.add_input(f"F{k}", "plate", "z", (x, y, 0.0))
        model.add_output(f"z{k}", "plate", "z", (x, y, 0.0))
    return model


@pytest.mark.parametrize(("true", "zz"), [((0.02, 0.03, 0.04, 0.004, 0.0, 0.0), 0.04),
                                          ((0.02, 0.06, 0.045, 0.004, 0.0, 0.0), 0.03)],
                         ids=["unfelt", "beyond the start's zz"])  # fmt: skip
def test_entries_that_nothing_feels_do_not_stop_the_search(true, zz):
    """Heave and tilt do not feel zz, xz and yz; slopes to xz and yz are rounding, and yy may need a larger zz."""
    system = plate(true).linearize()
    data = mv.Measurement(OMEGA, system.frequency_response(OMEGA), system.outputs, system.inputs,
                          variance=np.full((2, 2, len(OMEGA)), 1e-14))  # fmt: skip
    fit = plate((0.035, 0.03, zz)).fit(data, ["plate.mass", "plate.inertia.*"])
    assert fit.values["plate.mass"] == pytest.approx(2.0, rel=1e-6)
    for k in (0, 1, 3):
        assert fit.values[f"plate.inertia.{ENTRIES[k]}"] == pytest.approx(true[k], rel=1e-5)
    untold = " ".join(map(str, fit.unidentified))
    assert all(f"plate.inertia.{entry}" in untold for entry in ("zz", "xz", "yz"))


def test_the_nearest_inertia_that_a_body_can_have():
    rng = np.random.default_rng(3)
    for _ in range(50):
        axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        moments = rng.standard_normal(3) + 0.5
        second = (axes * moments) @ axes.T
        tensor = np.trace(second) * np.eye(3) - second
        found = physical(tensor[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)])
        xx, yy, zz, xy, xz, yz = found
        got = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        back = 0.5 * np.trace(got) * np.eye(3) - got
        np.testing.assert_allclose(back, (axes * np.maximum(moments, 1e-9 * moments.max())) @ axes.T, atol=1e-12)


def turned(product, x=0.0):
    """A body on a bushing, turned about x, of which rotations about x and y are measured."""
    model = mv.Model("turned")
    model.add_body("b", 5.0, [[0.05, product, 0], [product, 0.06, 0], [0, 0, 0.08]], position=(x, 0, 0.1))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (1e5, 1.2e5, 2e5, 3e3, 4e3, 2e3), (20, 20, 40, 1, 1, 1))
    model.add_input("F", "b", "rx", position=(0, 0, 0.1))
    for axis in ("rx", "ry", "z"):
        model.add_output(axis, "b", axis, position=(0, 0, 0.1))
    return model


def measured_turns():
    omega = 2 * np.pi * np.linspace(5.0, 60.0, 40)
    exact = turned(-0.01).linearize().frequency_response(omega)
    variance = np.full(exact.shape, (0.01 * np.abs(exact[:2]).mean()) ** 2)
    noise = np.random.default_rng(3).standard_normal((2, *exact.shape)) * np.sqrt(variance / 2.0)
    return mv.Measurement(omega, exact + noise[0] + 1j * noise[1], ["rx", "ry", "z"], ["F"], variance=variance)


def test_products_of_inertia_change_their_sign():
    fit = turned(0.004).fit(measured_turns(), ["b.inertia.xx", "b.inertia.xy"])
    assert fit.residual_test.passed
    low, high = fit.intervals["b.inertia.xy"]
    assert low < -0.01 < high < -0.0095


def test_changes_of_places_that_are_not_seen_have_units():
    """Masses change by a share, places by a length: a share of a place depends on the origin."""
    model = turned(-0.01)
    chosen = variables(model.parameters, ["b.mass", "b.position.x"], (), None, None)
    assert _in_words({"b.mass": 1.0, "b.position.x": -0.5}, chosen) == \
        "b.mass +1 % and b.position.x -0.0005 m together leave the data as they are"  # fmt: skip


def test_a_place_near_the_origin_is_told_as_well_as_one_at_it():
    data, free = measured_turns(), ["b.inertia.xy", "b.position.x"]
    at, near = (turned(0.0, x).fit(data, free) for x in (0.0, 1e-12))
    assert near.unidentified == ()
    for name in free:
        low, high = at.intervals[name]  # searches end within 1e-3 standard deviations
        np.testing.assert_allclose(near.intervals[name], [low, high], rtol=0.0, atol=1e-3 * (high - low))
