"""Rotors against closed forms: rotor and stator, the free top, a wheel on a body, internal damping."""

import mpmath as mp
import numpy as np
import pytest

import mbsvib as mv


def rotor_and_stator(speed):
    """Negrut & Ortiz, ASME J. Comput. Nonlinear Dynam. 1 (2006): data of their example."""
    model = mv.Model("rotor and stator")
    model.add_body("stator", 200.0, (50.0, 50.0, 10.0))
    model.add_body("rotor", 1300.0, (500.0, 500.0, 1000.0), position=(0, 0, 0.75))
    model.add_joint("bearing", "revolute", "stator", "rotor", position=(0, 0, 0), axis=(0, 0, 1))
    model.add_bushing("mount", "ground", "stator", position=(0, 0, 0), stiffness=(1e3, 1e3, 1e3, 1e4, 1e4, 1e5),
                      damping=(1.0, 1.0, 1.0, 10.0, 10.0, 100.0))  # fmt: skip
    model.add_rotor("spin", "rotor", speed, (0, 0, 2.0))
    return model


def whirl_roots(speed):
    """(1500 s^2 + s + 1000)(1281.25 s^2 + (10 -+ 1000 i W) s + 1e4) - 975^2 s^4 = 0, and what does not whirl."""
    with mp.workdps(40):
        w, result = mp.mpf(speed), []
        for sign in (-1, 1):
            first, second = [1000, 1, 1500], [mp.mpf(10000), mp.mpc(10, sign * 1000 * w), mp.mpf("1281.25")]
            product = [sum(first[i] * second[k - i] for i in range(3) if 0 <= k - i < 3) for k in range(5)]
            product[4] -= 975**2
            result += mp.polyroots(product, asc=True, maxsteps=200, extraprec=200)
        result += mp.polyroots([1000, 1, 1500], asc=True) + mp.polyroots([100000, 100, 10], asc=True)
        return [complex(root) for root in result]


@pytest.mark.parametrize("speed", [0.0, 1e-9, 10.0, -40.0, 1000.0])
def test_rotor_and_stator(speed):
    system = rotor_and_stator(speed).linearize()
    values = system.modes().eigenvalues.tolist()
    assert values[:2] == [0.0, 0.0]
    values = values[2:]
    for root in whirl_roots(speed):
        value = values.pop(min(range(len(values)), key=lambda i: abs(values[i] - root)))
        assert abs(value - root) <= 1e-12 * abs(root)
    assert system.modes().errors.max() <= 1e-12
    assert (system.gyroscopic is None) == (speed == 0.0)


def test_a_body_that_spins_at_speed_zero_is_held_as_any_other():
    """Its bearing is not the same from all sides, which matters only while it spins."""

    def shaft(*speeds):
        model = mv.Model("shaft")
        model.add_body("shaft", 2.0, (0.1, 0.1, 0.2))
        model.add_bushing("bearing", "ground", "shaft", (0.1, 0, 0.3), (1e3, 2e3, 3e3, 10, 20, 30), (1, 2, 3, 0, 0, 0))
        model.add_body("top", 1.0, (0.1, 0.1, 0.2))
        model.add_rotor("other", "top", 5.0, (0, 0, 1))
        for speed in speeds:
            model.add_rotor("spin", "shaft", speed, (0, 0, 1))
        return model.linearize()

    still, plain = shaft(0.0), shaft()
    for key in ("M", "C", "K"):
        np.testing.assert_array_equal(getattr(still, key), getattr(plain, key))
    with pytest.raises(mv.ModelError, match="rotor 'spin': 'bearing'"):
        shaft(1.0)


def test_free_top():
    """A free symmetric body nutates with W Ia / It; everything else drifts: zeros, exactly."""
    model = mv.Model("top")
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    turn = np.linalg.qr(np.column_stack((axis, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0])))[0]
    model.add_body("top", 3.0, (0.3, 0.2, 0.2), orientation=turn * np.sign(np.linalg.det(turn)))
    model.add_rotor("spin", "top", 7.0, axis)
    modes = model.linearize().modes()
    assert np.count_nonzero(modes.eigenvalues == 0.0) == 10
    np.testing.assert_allclose(modes.natural[-1], 7.0 * 0.3 / 0.2, rtol=1e-14)
    assert not modes.eigenvalues.real.any()
    assert modes.rigid == 5


def test_wheels_on_a_body():
    """Wheels add their angular momenta; h on a gimballed body of two equal stiffnesses: (k - I w^2)^2 = (h w)^2."""
    model = mv.Model("gyro")
    model.add_body("frame", 2.0, (0.3, 0.3, 0.4))
    model.add_joint("gimbal", None, "ground", "frame", position=(0, 0, 0), free=("rx", "ry"))
    model.add_bushing("k", "ground", "frame", position=(0, 0, 0), stiffness=(0, 0, 0, 12.0, 12.0, 0))
    model.add_rotor("one", "frame", 100.0, (0, 0, 1), inertia=0.01)
    model.add_rotor("two", "frame", 40.0, (0, 0, -1), inertia=0.005)
    system = model.linearize()
    h = 0.01 * 100.0 - 0.005 * 40.0
    np.testing.assert_allclose(system.gyroscopic, [[0.0, h], [-h, 0.0]], rtol=1e-15)
    low = (np.sqrt(h * h + 4.0 * 0.3 * 12.0) - h) / 0.6
    np.testing.assert_allclose(system.modes().natural, [low, low + h / 0.3], rtol=1e-14)
    assert not system.modes().eigenvalues.real.any()


def shaft(speed, internal=2.0, external=1.0):
    """A disk on a massless shaft between journals, seen along its axis: the shaft's dampers turn with it."""
    model = mv.Model("shaft")
    model.add_body("journal", 0.1, (1e-3, 1e-3, 1e-3))
    model.add_body("disk", 4.0, (0.02, 0.02, 0.04))
    model.add_joint("bearing", "revolute", "ground", "journal", position=(0, 0, 0), axis=(0, 0, 1))
    model.add_bushing("bend", "journal", "disk", position=(0, 0, 0), stiffness=(400, 400, 1e4, 50, 50, 90),
                      damping=(internal, internal, 0, 0, 0, 0))  # fmt: skip
    if external:
        model.add_bushing("air", "ground", "disk", position=(0, 0, 0), damping=(external, external, 0, 0, 0, 0))
    model.add_rotor("one", "journal", speed, (0, 0, 1))
    model.add_rotor("two", "disk", speed, (0, 0, 1))
    return model


@pytest.mark.parametrize("speed", [10.0, 14.999, 15.001, 30.0])
def test_internal_damping(speed):
    """m z'' + (ce + ci) z' + (k - i ci W) z = 0: unstable beyond W = sqrt(k/m) (1 + ce/ci) = 15 rad/s."""
    system = shaft(speed).linearize()
    values = system.modes().eigenvalues
    for root in np.roots([4.0, 3.0, 400.0 - 2.0j * speed]):
        assert np.abs(values - root).min() <= 1e-12 * abs(root)
    assert system.modes().stable == (speed < 15.0)
    assert "circulatory" in system.explain()


def test_speed_is_a_parameter(tmp_path):
    model = rotor_and_stator(10.0)
    model.add_rotor("wheel", "stator", 3.0, (1, 0, 0), inertia=2.0)
    assert model.parameters["spin.speed"] == 10.0
    assert model.parameters.units["spin.speed"] == "rad/s"
    assert model.parameters.units["wheel.inertia"] == "kg m^2"
    assert "spin.inertia" not in model.parameters
    faster = model.with_values({"*.speed": 20.0, "wheel.inertia": 0.5})
    assert (faster.rotors["spin"].speed, faster.rotors["wheel"].inertia) == (20.0, 0.5)
    assert model.replace("spin", speed=-1.0).rotors["spin"].speed == -1.0
    for suffix in ("yaml", "json"):
        mv.save(faster, tmp_path / f"model.{suffix}")
        again = mv.load(tmp_path / f"model.{suffix}")
        assert dict(again.rotors) == dict(faster.rotors)
        np.testing.assert_array_equal(again.linearize().C, faster.linearize().C)
    assert model.linearize().parameters["spin.speed"] == 10.0


def test_a_model_at_rest_is_as_without_rotors():
    still, plain = rotor_and_stator(0.0), rotor_and_stator(1.0)
    plain._rotors.clear()
    np.testing.assert_array_equal(still.linearize().modes().eigenvalues, plain.linearize().modes().eigenvalues)


def test_a_disk_on_a_flexible_shaft():
    """Overhung disk of a short light shaft: 4 x 4 equations of the tip with the beam's flexibility matrix."""
    length, radius, e = 0.4, 0.015, 2.1e11
    model = mv.Model("fan")
    model.add_body("disk", 12.0, (0.1, 0.1, 0.19), position=(0, 0, length))
    model.add_beam("shaft", "ground", "disk", {"type": "circle", "radius": radius}, {"E": e, "nu": 0.3, "rho": 1e-6},
                   start=(0, 0, 0), end=(0, 0, length), elements=4)  # fmt: skip
    speed = 300.0
    model.add_rotor("wheel", "disk", speed, (0, 0, 1), inertia=0.19)
    bend = e * np.pi * radius**4 / 4.0
    k = np.linalg.inv(np.array([[length**3 / 3.0, length**2 / 2.0], [length**2 / 2.0, length]]) / bend)
    mass, spin = np.diag([12.0, 0.1]), np.diag([0.0, 0.19 * speed])
    # z = x + i y and its slope: M z'' - i G z' + k z = 0 with z = exp(i w t)
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [np.linalg.solve(mass, k), np.linalg.solve(mass, spin)]])
    modes = model.linearize().modes()
    for w in np.linalg.eigvals(a).real:
        assert np.abs(modes.natural - abs(w)).min() <= 1e-6 * abs(w)
    assert "disk" in str(modes)
    np.testing.assert_allclose(sum(modes.kinetic_energy.values()), 1.0, rtol=1e-12)


def test_a_rotor_without_mass_precesses():
    """h^2 s^2 + k1 k2 = 0: angular momentum h on two springs, and no inertia across."""
    model = mv.Model("gyroscope")
    model.add_body("disk", 0.0, (0, 0, 0), (0, 0, 0.3))
    model.add_joint("cross", "universal", "ground", "disk", (0, 0, 0), axis=(1, 0, 0), axis2=(0, 1, 0))
    for name, axis, stiffness in (("k1", (1, 0, 0), 40.0), ("k2", (0, 1, 0), 90.0)):
        model.add_torsion_spring(name, "ground", "disk", axis=axis, stiffness=stiffness)
    model.add_rotor("spin", "disk", 30.0, (0, 0, 1), inertia=0.02)
    values = model.linearize().modes().eigenvalues
    np.testing.assert_allclose(np.sort(values.imag), [-100.0, 100.0], rtol=1e-14)
    assert not values.real.any()


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_a_massless_flange_carries_a_rotor_as_the_node_it_holds(method):
    """A rotor on a flange without mass, at the end of a beam or fixed to a body, is one on that node or body."""
    def modes(flange, beam):
        model = mv.Model("shaft")
        carrier = "shaft.2" if beam else "base"
        if flange:
            model.add_body("flange", 0.0, (0, 0, 0), (1, 0, 0))
        if beam:
            model.add_beam("shaft", "ground", "flange" if flange else None, {"type": "circle", "radius": 0.01},
                           {"E": 2e11, "nu": 0.3, "rho": 7800}, (0, 0, 0), (1, 0, 0), elements=2)  # fmt: skip
        else:
            model.add_body("base", 2.0, (0.1, 0.2, 0.15))
            model.add_bushing("mount", "ground", "base", (0, 0, 0), (1e4, 1e4, 1e4, 100, 200, 300))
            if flange:
                model.add_joint("weld", "fixed", "base", "flange", (1, 0, 0))
        model.add_rotor("spin", "flange" if flange else carrier, 300.0, (1, 0, 0), inertia=0.02)
        system = model.linearize(method=method)
        return (system.modes() if method == "dense" else system.modes(6, near=0.0)).frequencies[:6]

    for beam in (True, False):
        np.testing.assert_allclose(modes(True, beam), modes(False, beam), rtol=1e-12)


def test_rotors_go_along_to_another_pose():
    """A wheel on a hinged arm: its axis turns with the arm."""
    model = mv.Model("arm")
    model.add_body("arm", 1.0, (0.1, 0.2, 0.3), position=(1.0, 0, 0))
    model.add_joint("hinge", "spherical", "ground", "arm", position=(0, 0, 0))
    model.add_rotor("wheel", "arm", 50.0, (0, 0, 1), inertia=0.02)
    moved = model.moved({"hinge.rx": 0.5})
    np.testing.assert_allclose(moved.rotors["wheel"].axis, [0.0, -np.sin(0.5), np.cos(0.5)], atol=1e-14)
    np.testing.assert_allclose(moved.linearize().modes().natural, model.linearize().modes().natural, rtol=1e-12)
