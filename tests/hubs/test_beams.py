"""Beams on hubs against published frequencies, closed forms of rigid rotation and other elements."""

import numpy as np
import pytest

import mbsvib as mv

E, RHO, SIDE, LENGTH = 2e11, 7800.0, 0.005, 1.0
UNIT = np.sqrt(E * SIDE**2 / 12.0 / (RHO * LENGTH**4))
# Wright, Smith, Thresher and Wang, Journal of Applied Mechanics 49 (1982), 197-202: flapping at speed, hub radius 0.
FLAPPING = {0.0: 3.5160, 1.0: 3.6817, 2.0: 4.1373, 6.0: 7.3604, 12.0: 13.1702}


def blade(speed, elements=20, direction=(1.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), radius=0.0, **kwargs):
    """A slender square cantilever on a hub; ``speed`` in units of sqrt(E I / (rho A L^4))."""
    model = mv.Model("blade")
    model.add_hub("hub", speed * UNIT, axis)
    out = np.array(direction) / np.linalg.norm(direction)
    model.add_beam("blade", "hub", None, {"type": "rectangle", "width": SIDE, "height": SIDE},
                   {"E": E, "nu": 0.3, "rho": RHO}, radius * out, (radius + LENGTH) * out, elements=elements,
                   **kwargs)  # fmt: skip
    return model


def lowest(system, count=2):
    """The lowest frequencies, nondimensional."""
    return np.sort(2.0 * np.pi * np.array(system.modes().frequencies) / UNIT)[:count]


@pytest.mark.parametrize("speed", FLAPPING)
def test_rotating_cantilever_flaps_as_published_and_lags(speed):
    """In the plane of rotation the same mode has w^2 - W^2, but for the Coriolis coupling with stretch."""
    lag, flap = lowest(blade(speed).linearize())
    assert flap == pytest.approx(FLAPPING[speed], abs=1e-4)
    assert lag == pytest.approx(np.sqrt(flap**2 - speed**2), rel=3e-4)
    sparse = blade(speed).linearize(method="sparse").modes(2)
    np.testing.assert_allclose(np.sort(2 * np.pi * np.array(sparse.frequencies) / UNIT), [lag, flap], rtol=1e-8)


def test_flapping_converges_by_the_fourth_power():
    errors = [lowest(blade(12.0, n).linearize())[1] - lowest(blade(12.0, 40).linearize())[1] for n in (5, 10, 20)]
    assert errors[0] / errors[1] > 10
    assert errors[1] / errors[2] > 10


def test_nothing_depends_on_the_axes_of_the_world():
    reference = np.array(blade(6.0, 5).linearize().modes().eigenvalues)
    turned = blade(6.0, 5, (1.0, 2.0, 2.0), (-2.0, -1.0, 2.0), y_axis=(2.0, -2.0, 1.0)).linearize()
    np.testing.assert_allclose(np.sort(np.abs(turned.modes().eigenvalues)), np.sort(np.abs(reference)), rtol=1e-8)


@pytest.mark.parametrize("shear", [False, True])
def test_stiff_beam_turns_as_the_rigid_body_that_it_is(shear):
    """A thick stiff beam on a free joint and the rigid body of its mass: terms along rigid motions are the same.

    Its inertia is that of its consistent mass; for Euler-Bernoulli without that of sections about their diameters.
    """
    section = {"type": "rectangle", "width": 0.2, "height": 0.1}
    area, iy, iz = 0.02, 0.2 * 0.1**3 / 12, 0.1 * 0.2**3 / 12
    direction, axis = np.array([1.0, 0.5, 0.2]), (0.3, -0.2, 1.0)
    direction /= np.linalg.norm(direction)
    start = np.array([0.2, 0.1, -0.3])
    model = mv.Model("stiff")
    model.add_hub("hub", 5.0, axis)
    model.add_body("root", 0.0, (0, 0, 0), start)
    model.add_joint("joint", "free", "hub", "root", start)
    model.add_beam("beam", "root", None, section, {"E": 2e11, "nu": 0.3, "rho": RHO}, start, start + direction,
                   elements=6, shear=shear)  # fmt: skip
    mass = RHO * area
    rotary = RHO * np.diag([iy + iz, iy, iz])
    frame = np.array(model.beams["beam"].frames()[0][1])
    tensor = frame @ (rotary + mass / 12.0 * np.diag([0.0, 1.0, 1.0])) @ frame.T
    rigid = mv.Model("rigid")
    rigid.add_hub("hub", 5.0, axis)
    rigid.add_body("root", mass, tensor, start + 0.5 * direction)
    rigid.add_joint("joint", "free", "hub", "root", start)
    systems = []
    for each in (model, rigid):
        systems.append(mv_linearized(each))
    flexible, solid = systems
    names = [f"joint.{d}" for d in ("x", "y", "z", "rx", "ry", "rz")]
    at = [flexible.coordinates.index(name) for name in names]
    C, expected = np.array(flexible.C)[np.ix_(at, at)], np.array(solid.C)
    allowed = 1e-9 * np.abs(expected).max() if shear else 2.0 * RHO * (iy + iz) * 5.0 * 1.5
    np.testing.assert_allclose(C, expected, rtol=0, atol=allowed)
    np.testing.assert_allclose(C[:3], expected[:3], rtol=0, atol=1e-9 * np.abs(expected).max())
    force = flexible.provenance.statics.residual[at], solid.provenance.statics.residual
    np.testing.assert_allclose(force[0][:3], force[1][:3], rtol=1e-9)


def mv_linearized(model):
    """Equations of a pose that nothing holds in balance."""
    from mbsvib.equations.assembly import assembled
    from mbsvib.equations.expansion import expanded
    from mbsvib.equations.scene import scene

    plain = expanded(model)
    return assembled(plain, scene(plain), checked=False)


def test_batches_and_derivatives_to_the_speed():
    model = blade(6.0, 4)
    values = [0.0, 2.0 * UNIT, 12.0 * UNIT]
    batch = model.linearize(values={"hub.speed": values})
    for i, value in enumerate(values):
        single = model.with_values({"hub.speed": value}).linearize()
        np.testing.assert_allclose(batch.K[i], single.K, rtol=1e-12, atol=1e-12 * np.abs(single.K).max())
    table = model.linearize().mode_sensitivities(["hub.speed"])
    step = 1e-3
    up, down = (lowest(model.with_values({"hub.speed": (6.0 + s) * UNIT}).linearize(), 2) for s in (step, -step))
    slope = (up - down) / (2 * step) / (2 * np.pi)
    np.testing.assert_allclose(table.frequencies[0][:2], slope, rtol=1e-5)


def test_equilibrium_with_beams_and_superelements_are_refused():
    with pytest.raises(mv.ModelError, match="hub 'hub'"):
        blade(2.0, 3).equilibrium()
    model = blade(2.0, 3)
    six = np.eye(6)
    pair = np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), six)
    nodes = {"a": (0, 0, 0), "b": (0, 0, 0)}
    model.add_superelement("reduced", np.eye(12), None, pair, nodes, {"a": "hub"})
    with pytest.raises(mv.ModelError, match="reduced"):
        model.linearize()
