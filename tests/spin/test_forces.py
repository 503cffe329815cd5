"""Forces in joints and bushings of spinning systems: what bodies feel is their change of momentum."""

import numpy as np

from tests.spin.test_rotors import rotor_and_stator, shaft

SIX = ("x", "y", "z", "rx", "ry", "rz")
OMEGA = [0.3, 1.0, 4.0, 20.0]


def responses(model, *elements):
    for element in elements:
        for direction in SIX:
            model.add_force_output(f"{element} {direction}", element, direction)
    system = model.linearize()
    found = system.frequency_response(OMEGA)
    return [found[6 * k : 6 * k + 6] for k in range(len(elements))]


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
    felt = -bend
    felt[:, 0] += np.array([1.0, 0.3, 0.1, 0.2, 0.3, 0.0])[:, None]
    np.testing.assert_allclose(disk, felt, rtol=0, atol=1e-13 * size)
    np.testing.assert_allclose(journal, bend - bearing, rtol=0, atol=1e-13 * size)
