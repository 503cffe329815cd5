"""Beams on hubs against published frequencies, closed forms of rigid rotation and other elements."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.linalg.rotations import skew

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


@pytest.mark.slow
@pytest.mark.parametrize("speed", FLAPPING)
def test_rotating_cantilever_flaps_as_published_and_lags(speed):
    """In the plane of rotation the same mode has w^2 - W^2, but for the Coriolis coupling with stretch."""
    lag, flap = lowest(blade(speed).linearize())
    assert flap == pytest.approx(FLAPPING[speed], abs=1e-4)
    assert lag == pytest.approx(np.sqrt(flap**2 - speed**2), rel=3e-4)
    sparse = blade(speed).linearize(method="sparse").modes(2)
    np.testing.assert_allclose(np.sort(2 * np.pi * np.array(sparse.frequencies) / UNIT), [lag, flap], rtol=1e-8)


@pytest.mark.slow
def test_flapping_converges_by_the_fourth_power():
    errors = [lowest(blade(12.0, n).linearize())[1] - lowest(blade(12.0, 40).linearize())[1] for n in (5, 10, 20)]
    assert errors[0] / errors[1] > 10
    assert errors[1] / errors[2] > 10


def test_nothing_depends_on_the_axes_of_the_world():
    reference = np.array(blade(6.0, 5).linearize().modes().eigenvalues)
    turned = blade(6.0, 5, (1.0, 2.0, 2.0), (-2.0, -1.0, 2.0), y_axis=(2.0, -2.0, 1.0)).linearize()
    np.testing.assert_allclose(np.sort(np.abs(turned.modes().eigenvalues)), np.sort(np.abs(reference)), rtol=1e-8)


@pytest.mark.parametrize(("speed", "elements", "error"), [(6.0, 1, 0.015), (12.0, 2, 0.008)])
def test_tension_falls_along_each_element(speed, elements, error):
    """With the same tension all along an element errors are 4.2 % and 1.0 %."""
    assert lowest(blade(speed, elements).linearize())[1] == pytest.approx(FLAPPING[speed], rel=error)


@pytest.mark.parametrize("turned", [False, True])
def test_a_mass_on_a_light_blade_is_on_the_hub(turned):
    """A point mass at the end of a beam under the tension T = m W^2 (R + L): k = T / (L (1 - tanh(u) / u)),
    u^2 = T L^2 / E I; flap k / m, lag k' / m - W^2 with the beam's stiffness across.
    """
    speed, mass, radius = 30.0, 0.4, 0.3
    model = mv.Model("light")
    model.add_hub("hub", speed, (0, 0, 1))
    model.add_body("tip", mass, (1e-6, 1e-6, 1e-6), (radius + LENGTH, 0, 0))
    ends = ("tip", "hub") if turned else ("hub", "tip")
    points = [(radius + LENGTH, 0, 0), (radius, 0, 0)][:: 1 if turned else -1]
    model.add_beam("blade", *ends, {"type": "rectangle", "width": 2 * SIDE, "height": SIDE},
                   {"E": E, "nu": 0.3, "rho": 1.0}, *points, elements=10, y_axis=(0, 1, 0))  # fmt: skip
    tension = mass * speed**2 * (radius + LENGTH)
    expected = []
    for bending, drop in ((E * SIDE**4 / 6.0, 0.0), (E * SIDE**4 * 2.0 / 3.0, speed**2)):
        u = LENGTH * np.sqrt(tension / bending)
        expected.append(np.sqrt(tension / (LENGTH * (1.0 - np.tanh(u) / u)) / mass - drop))
    got = np.sort(2.0 * np.pi * np.array(model.linearize().modes().frequencies))[:2]
    np.testing.assert_allclose(got, np.sort(expected), rtol=2e-4)


@pytest.mark.parametrize("shear", [False, True])
def test_stiff_beam_turns_as_the_rigid_body_that_it_is(shear):
    """A thick stiff beam on a free joint and the rigid body of its mass: terms along rigid motions are the same.

    Its inertia is that of its consistent mass. Sections of an Euler-Bernoulli beam turn about its axis only: with the
    projection P = x x^T on it they have the torque -P (W x J W), the stiffness P ([W]x J [W]x - [W]x [J W]x) P and
    the Coriolis terms P (tr(J) [W]x - 2 [J W]x) P, beside a line of mass.
    """
    section = {"type": "rectangle", "width": 0.2, "height": 0.1}
    area, iy, iz = 0.02, 0.2 * 0.1**3 / 12, 0.1 * 0.2**3 / 12
    direction, axis, at = np.array([1.0, 0.5, 0.2]), (0.3, -0.2, 1.0), (0.1, -0.2, 0.05)
    direction /= np.linalg.norm(direction)
    start = np.array([0.2, 0.1, -0.3])
    model = mv.Model("stiff")
    model.add_hub("hub", 5.0, axis, at)
    model.add_body("root", 0.0, (0, 0, 0), start)
    model.add_joint("joint", "free", "hub", "root", start)
    model.add_beam("beam", "root", None, section, {"E": 2e11, "nu": 0.3, "rho": RHO}, start, start + direction,
                   elements=6, shear=shear)  # fmt: skip
    frame = np.array(model.beams["beam"].frames()[0][1])
    sections = frame @ (RHO * np.diag([iy + iz, iy, iz])) @ frame.T
    line = RHO * area / 12.0 * frame @ np.diag([0.0, 1.0, 1.0]) @ frame.T
    rigid = mv.Model("rigid")
    rigid.add_hub("hub", 5.0, axis, at)
    rigid.add_body("root", RHO * area, line + sections, start + 0.5 * direction)
    rigid.add_joint("joint", "free", "hub", "root", start)
    flexible, solid = mv_linearized(model), mv_linearized(rigid)
    rows = [flexible.coordinates.index(f"joint.{d}") for d in ("x", "y", "z", "rx", "ry", "rz")]
    force, stiffness, damping = (np.array(part) for part in (solid.provenance.statics.residual, solid.K, solid.C))
    if not shear:
        w, along = 5.0 * np.array(axis) / np.linalg.norm(axis), np.outer(direction, direction)
        spin, momentum = skew(w), sections @ w
        sign = np.sign(force[:3] @ (start + 0.5 * direction - at))  # of forces in the residual: outwards
        gradient = spin @ sections @ spin - spin @ skew(momentum)
        for change, part in ((force, -sign * np.cross(w, momentum)), (stiffness, 0.5 * (gradient + gradient.T)),
                             (damping, np.trace(sections) * spin - 2.0 * skew(momentum))):  # fmt: skip
            change[(slice(3, None),) * part.ndim] += (along @ part @ along if part.ndim == 2 else along @ part) - part
    for got, expected in ((flexible.provenance.statics.residual[rows], force),
                          (np.array(flexible.K)[np.ix_(rows, rows)], stiffness),
                          (np.array(flexible.C)[np.ix_(rows, rows)], damping)):  # fmt: skip
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def mv_linearized(model):
    """Equations of a pose that nothing holds in balance."""
    from mbsvib.equations.assembly import assembled
    from mbsvib.equations.expansion import expanded
    from mbsvib.equations.scene import scene

    plain = expanded(model)
    return assembled(plain, scene(plain), checked=False)


@pytest.mark.slow
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


@pytest.mark.parametrize("flange", [False, True])
def test_rotors_on_nodes_turn_along(flange):
    """Also on a node, or a flange, without inertia of its own: as on a flange of nearly none."""
    def modes(carrier):
        model = mv.Model("shaft")
        model.add_hub("hub", 5.0, (0, 0, 1))
        if carrier:
            model.add_body("flange", *carrier, position=(0, 0, 1))
        model.add_beam("shaft", "hub", "flange" if carrier else None, {"type": "circle", "radius": 0.01},
                       {"E": 2e11, "nu": 0.3, "rho": 7800}, (0, 0, 0), (0, 0, 1), elements=2)  # fmt: skip
        model.add_rotor("spin", "flange" if carrier else "shaft.2", 300.0, (0, 0, 1), 0.02)
        return model.linearize().modes().frequencies[:4]

    massless = modes((0.0, (0, 0, 0)) if flange else None)
    np.testing.assert_allclose(massless, modes((1e-9, (1e-12, 1e-12, 1e-12))), rtol=1e-8)


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
