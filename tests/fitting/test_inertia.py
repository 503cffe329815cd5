"""Inertias as values of a fit: entries that the data do not feel, and the limits of what bodies can have."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.fitting.variables import physical

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
