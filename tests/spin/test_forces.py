"""Forces in joints and bushings of spinning systems: what bodies feel is their change of momentum."""

from itertools import product

import numpy as np
import pytest

import mbsvib as mv
from tests.spin.test_rotors import rotor_and_stator, shaft

SIX = ("x", "y", "z", "rx", "ry", "rz")
OMEGA = [0.3, 1.0, 4.0, 20.0]


def responses(model, *elements):
    for element in elements:
        for direction in SIX:
            model.add_force_output(f"{element} {direction}", element, direction)
    system = model.linearize()
    result = system.frequency_response(OMEGA)
    return [result[6 * k : 6 * k + 6] for k in range(len(elements))]


def at(force, point):
    return np.concatenate((force[:3], force[3:] + np.cross(point, force[:3])))


def test_ground_mount_rotor_and_bearing_agree():
    model = rotor_and_stator(5.0)
    acting = np.array([1.0, 0.2, 0.3, 0.4, 0.5, 0.6])
    point = np.array([0.1, 0.2, 1.3])
    model.add_input("F", "rotor", acting, position=point)
    model.add_base_motion("floor", (1, 2, 3))
    ground, mount, rotor, bearing = responses(model, "ground", "mount", "rotor", "bearing")
    size = np.abs(mount).max()
    mount[:, 0] -= at(acting, point)[:, None]  # the ground takes the reaction of the input as well
    np.testing.assert_allclose(ground, mount, rtol=0, atol=1e-13 * size)
    centre = np.array([0.0, 0.0, 0.75])
    carried = np.apply_along_axis(at, 0, -bearing, -centre)
    carried[:, 0] += at(acting, point - centre)[:, None]
    np.testing.assert_allclose(rotor, carried, rtol=0, atol=1e-13 * size)


def test_a_damper_that_turns_along_carries_what_the_disk_feels():
    model = shaft(9.0, external=0.0)
    model.add_input("F", "disk", (1.0, 0.3, 0.1, 0.2, 0.3, 0.0))
    disk, bend, journal, bearing = responses(model, "disk", "bend", "journal", "bearing")
    size = np.abs(bend).max()
    rows = -bend
    rows[:, 0] += np.array([1.0, 0.3, 0.1, 0.2, 0.3, 0.0])[:, None]
    np.testing.assert_allclose(disk, rows, rtol=0, atol=1e-13 * size)
    np.testing.assert_allclose(journal, bend - bearing, rtol=0, atol=1e-13 * size)


def whirling(model, omega, backward=False):
    """Outputs by name for the force (1, -i) exp(i omega t) of the inputs Fx and Fy, which goes round as the rotor."""
    system = model.linearize()
    result = system.frequency_response([omega])[:, :, 0]
    inputs = [system.inputs.index(name) for name in ("Fx", "Fy")]
    return dict(zip(system.outputs, result[:, inputs] @ [1.0, 1.0j if backward else -1.0j], strict=True))


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize(("speed", "omega"), [(5.0, 0.9), (-40.0, 3.0), (0.0, 0.8), (200.0, 31.0)])
def test_force_and_moment_in_the_bearing_of_rotor_and_stator(speed, omega, backward):
    """With z = x + i y = X exp(s t): what the bearing carries is what the stator feels, inertia and mount."""
    model = rotor_and_stator(speed)
    for name, direction in (("Fx", "x"), ("Fy", "y")):
        model.add_input(name, "rotor", direction)
    for direction in SIX:
        model.add_force_output(direction, "bearing", direction)
    s = -1j * omega if backward else 1j * omega
    matrix = [[1500 * s**2 + s + 1000, 975 * s**2],
              [975 * s**2, 1281.25 * s**2 + (10 - 1000j * speed) * s + 1e4]]  # fmt: skip
    shift, tilt = np.linalg.solve(matrix, [1.0, 0.75])
    force, moment = (200 * s**2 + s + 1000) * shift, (50 * s**2 + 10 * s + 1e4) * tilt
    if backward:  # z = (x + i y) of exp(-i omega t): the conjugates go with exp(i omega t)
        force, moment = force.conjugate(), moment.conjugate()
    turn = 1j if backward else -1j
    result, size = whirling(model, omega, backward), abs(force) + abs(moment)
    for name, expected in (("x", force), ("y", turn * force), ("ry", moment), ("rx", -turn * moment), ("z", 0.0),
                           ("rz", 0.0)):  # fmt: skip
        assert abs(result[name] - expected) < 1e-12 * size


@pytest.mark.parametrize(("speed", "omega"), [(300.0, 300.0), (300.0, 90.0), (1200.0, 400.0)])
def test_a_shaft_carried_by_two_bearings(speed, omega):
    """A rigid rotor in two bearings, each in a block on springs: two complex equations for its two journals."""
    a, b, height = 0.3, 0.5, 0.1
    mass, across, axial = 8.0, 0.2, 0.35
    blocks = {"lower": (-a, 1.5, 3e5, 40.0), "upper": (b, 2.5, 5e5, 60.0)}
    model = mv.Model("shaft in bearings")
    model.add_body("shaft", mass, (across, across, axial))
    for name, (z, block, k, c) in blocks.items():
        model.add_body(name, block, (0.01, 0.01, 0.01), position=(0, 0, z))
        model.add_joint(f"{name}.guide", None, "ground", name, position=(0, 0, z), free=("x", "y"))
        model.add_bushing(f"{name}.k", "ground", name, (0, 0, z), (k, k, 0, 0, 0, 0), (c, c, 0, 0, 0, 0))
        kind = "spherical" if name == "lower" else "point_on_line"
        model.add_joint(f"{name}.bearing", kind, name, "shaft", position=(0, 0, z))
    model.add_rotor("spin", "shaft", speed, (0, 0, 1))
    for name, direction in (("Fx", "x"), ("Fy", "y")):
        model.add_input(name, "shaft", direction, position=(0, 0, height))
    for name, direction in product(blocks, ("x", "y", "rx", "ry")):
        model.add_force_output(f"{name} {direction}", f"{name}.bearing", direction)
    s = 1j * omega
    carries = np.array([m * s**2 + c * s + k for _, m, k, c in blocks.values()])
    # journals z1, z2: centre (b z1 + a z2) / (a + b), slope (z2 - z1) / (a + b)
    location, slope = np.array([b, a]) / (a + b), np.array([-1.0, 1.0]) / (a + b)
    matrix = (mass * s**2 * np.outer(location, location) + np.diag(carries)
              + (across * s**2 - 1j * axial * speed * s) * np.outer(slope, slope))  # fmt: skip
    forces = carries * np.linalg.solve(matrix, location + height * slope)
    result = whirling(model, omega)
    for name, force in zip(blocks, forces, strict=True):
        assert abs(result[f"{name} x"] - force) < 1e-11 * abs(forces).max()
        assert abs(result[f"{name} y"] + 1j * force) < 1e-11 * abs(forces).max()
        assert abs(result[f"{name} rx"]) + abs(result[f"{name} ry"]) < 1e-13 * abs(forces).max()
