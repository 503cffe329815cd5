"""Couplers: geometry beside them, their own coefficients, and both under load."""

import numpy as np
import pytest
from hypothesis import assume, given

import mbsvib as mv
from mbsvib.sensitivities.variants import Variants
from tests.sensitivities.differences import assert_as_variants, of_variants
from tests.support.loaded_models import stiffened
from tests.support.random_models import add_random_ports, seeds, spatial
from tests.support.sizes import examples


def coupled(seed, under_load):
    """A random mechanism, some of whose joint coordinates are tied to each other."""
    rng = np.random.default_rng(seed)
    if under_load:
        model = stiffened(seed, 2, seed % 3, couplers=1 + seed % 2, torque=seed % 2 == 1)
        centres = {name: np.array(body.position) for name, body in model.bodies.items()}
        add_random_ports(model, rng, centres, base=False)
        return model
    model = spatial(seed, 3, seed % 3)
    free = [f"{joint.name}.{way}" for joint in model.joints.values() if joint.kind != "distance"
            for way, _ in joint.freedom]  # fmt: skip
    assume(len(free) > 3)
    model.add_coupler("tie", dict(zip(map(str, rng.choice(free, 3, replace=False)), rng.normal(size=3), strict=True)))
    return model


@pytest.mark.slow
@examples(1, slow=6)
@pytest.mark.parametrize("under_load", [False, True])
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seed=seeds())
def test_differences_of_random_mechanisms_with_couplers(seed, under_load):
    try:
        model = coupled(seed, under_load)
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    groups = system.provenance.reduction.groups
    assume(system.dof > 0 and not any(group.surplus for group in groups) and min(g.retained for g in groups) > 0.05)
    names = list(system.parameters)
    own = [name for name in names if "coefficient" in name]
    rng = np.random.default_rng(seed)
    for name in [str(rng.choice(own)), *map(str, rng.choice(names, 3, replace=False))]:
        try:
            expected = of_variants(system, name)
        except mv.ModelError:
            continue
        result = system.matrix_derivatives(name)
        assert_as_variants(result, 0, system, expected, system.parameters[name], 1e-7, 1e-9, lost=False)


def test_gear_under_gravity_in_closed_form(monkeypatch):
    """A weight on an arm, geared by n to a wheel with a spiral spring: (I + n^2 J) a'' + (m g r + n^2 k) a = 0."""
    n, k, m, r, wheel = 3.0, 2.0, 1.5, 0.4, 0.05
    model = mv.Model("winch", gravity=(0, 0, -9.81))
    model.add_body("arm", m, (0.1, 0.1, 0.1), position=(0, 0, -r))
    model.add_body("wheel", 2.0, (wheel, wheel, wheel), position=(1, 0, 0))
    for body, at in (("arm", (0, 0, 0)), ("wheel", (1, 0, 0))):
        model.add_joint(f"{body}.pin", "revolute", "ground", body, position=at, axis=(0, 1, 0))
    model.add_gear("gear", "arm.pin.rz", "wheel.pin.rz", n)
    model.add_bushing("spiral", "ground", "wheel", (1, 0, 0), (0, 0, 0, 0, k, 0))
    system = model.linearize()
    monkeypatch.setattr(Variants, "slopes", lambda *_: pytest.fail("a variant was asked for"))
    inertia, stiffness = 0.1 + m * r * r + n * n * wheel, m * 9.81 * r + n * n * k
    square = stiffness / inertia
    slopes = {"gear.ratio": (2 * n * k - square * 2 * n * wheel) / inertia,
              "arm.mass": (9.81 * r - square * r * r) / inertia,
              "arm.position.z": -(m * 9.81 - square * 2 * m * r) / inertia,
              "spiral.stiffness.ry": n * n / inertia, "gravity.z": -m * r / inertia}  # fmt: skip
    result = 2 * np.sqrt(square) * system.eigenvalue_sensitivities(list(slopes))[:, 0].imag
    assert result == pytest.approx(list(slopes.values()), rel=1e-13)


def test_a_coupler_of_what_other_joints_hold_still():
    """It ties nothing, and is told as redundant."""
    model = mv.Model("held")
    model.add_body("block", 1.0, (0.1, 0.1, 0.1))
    model.add_body("wheel", 1.0, (0.1, 0.1, 0.1), position=(1, 0, 0))
    model.add_joint("bolt", "fixed", "ground", "block")
    model.add_joint("table", "planar", "ground", "block", position=(0, 0, 0))
    model.add_joint("pin", "revolute", "ground", "wheel", position=(1, 0, 0))
    model.add_bushing("spiral", "ground", "wheel", (1, 0, 0), (0, 0, 0, 0, 0, 5.0))
    model.add_coupler("tie", {"table.x": 1.0, "table.rz": 2.0})
    system = model.linearize()
    assert system.coordinates == ("pin.rz",)
    assert any("tie" in group.redundant for group in system.provenance.reduction.groups)
