"""Which state takes part most in a mode of first-order equations, whatever its units."""

import numpy as np

import mbsvib as mv

NAMES = ("x", "v", "filter")


def space(scale=(1.0, 1.0, 1.0), coupling=5.0):
    """A mass on a spring and damper with a low-pass filter of its velocity, which pushes it."""
    a = np.array([[0.0, 1.0, 0.0], [-400.0, -2.0, -coupling], [0.0, 50.0, -50.0]])
    d = np.array(scale)
    return mv.StateSpace.from_arrays(a * d[:, None] / d, np.eye(3), np.eye(3), np.zeros((3, 3)), states=NAMES)


def test_participation_is_that_of_the_characteristic_polynomial():
    """p_i = d(lambda) / d(a_ii), here the adjugate's diagonal over the polynomial's slope."""
    found = space().modes()
    a = space().A
    for k, value in enumerate((found.eigenvalues[0], found.eigenvalues[-1])):
        slope = np.polyval(np.polyder(np.poly(a)), value)
        minors = [np.linalg.det(np.delete(np.delete(value * np.eye(3) - a, i, 0), i, 1)) for i in range(3)]
        np.testing.assert_allclose(found.participation[:, k], np.abs(minors / slope), rtol=1e-9)


def test_names_do_not_depend_on_the_scale_of_states():
    for scale in ((1.0, 1.0, 1.0), (1e6, 1.0, 1e-6), (1e-6, 1.0, 1e9)):
        modes = space(scale).modes()
        assert modes.strongest() == (("v",), ("filter",))
        np.testing.assert_allclose(modes.participation, space().modes().participation, rtol=1e-8)
        assert modes.nearest(1, 8.0).strongest() == (("filter",),)
    assert "largest participation" in str(space().modes())


def test_a_defective_mode_has_a_name():
    double = mv.StateSpace.from_arrays([[-1.0, 1.0], [0.0, -1.0]], [[0], [1]], [[1, 0]], 0, states=("a", "b"))
    assert {most for most, in double.modes().strongest()} <= {"a", "b"}


def test_a_static_gain_has_no_modes():
    modes = mv.StateSpace.from_arrays(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[3.0]]).modes()
    assert len(modes) == 0
    assert modes.strongest() == ()
    assert "There are no states." in str(modes)


def test_poles_at_zero_are_zero_in_turned_states():
    """G = 1/s + sum of 1/(s + i): rounding of A leaves 1e-15 for the integrator."""
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((8, 8)))[0]
    turned = mv.StateSpace.from_arrays(turn @ np.diag(-np.arange(8.0)) @ turn.T, turn @ np.ones((8, 1)),
                                       np.ones((1, 8)) @ turn.T, 0)  # fmt: skip
    assert turned.poles()[0] == 0.0
    np.testing.assert_allclose(turned.poles(), -np.arange(8.0), rtol=1e-13)
    assert turned.modes().frequencies[0] == 0.0


def test_slow_poles_beside_fast_ones_are_told_from_rigid_modes():
    """-1e-10 beside -1e8 1/s is lost in rounding; integrators in states of their own are not."""
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    lost = mv.StateSpace.from_arrays(turn.T @ np.diag([-1e-10, -1e8]) @ turn, [[1.0], [1.0]], [[1.0, 1.0]], 0.0).modes()
    assert lost.eigenvalues[0] == 0.0
    assert 1e-10 < lost.zero_bound < 1e-6
    told = f"At 0 Hz are eigenvalues up to {lost.zero_bound:.1e} 1/s, which rounding does not tell from 0."
    assert lost.remarks()[0] == told
    exact = mv.StateSpace.from_arrays(np.diag([0.0, -1e8]), [[1.0], [1.0]], [[1.0, 1.0]], 0.0).modes()
    assert exact.zero_bound == 0.0
    assert "At 0 Hz" not in str(exact)
