"""Campbell data: frequencies from closed forms, whirl directions, tracks that cross, critical speeds."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ModelError
from mbsvib.plots import campbell as plot
from mbsvib.studies.campbell import campbell
from tests.spin.test_rotors import rotor_and_stator, shaft, whirl_roots

SPEEDS = np.linspace(0.0, 12.0, 7)


@pytest.mark.slow
def test_every_eigenvalue_is_one_of_the_closed_form():
    data = campbell(rotor_and_stator(3.0), SPEEDS)
    for speed, row, errors in zip(SPEEDS, data.eigenvalues, data.errors, strict=True):
        roots = np.append(whirl_roots(speed), 0.0)
        assert (np.abs(row[:, None] - roots).min(axis=1) <= 1e-12 * np.maximum(np.abs(row), 1e-9)).all()
        assert errors.max() <= 1e-12
    assert data.whirl.shape == (7, 7)
    np.testing.assert_allclose(data.damping_ratios[:, -1], 0.05, rtol=1e-12)


@pytest.mark.slow
def test_whirl_of_an_isotropic_rotor_is_round():
    """Spin raises the frequencies of forward whirl and lowers those of backward whirl."""
    data = campbell(rotor_and_stator(3.0), SPEEDS)
    round_ = np.isclose(np.abs(data.whirl[1:]), 1.0, atol=1e-6)
    assert (round_.sum(axis=1) == 4).all()
    assert ((data.directions[1:] == "forward").sum(axis=1) == 2).all()
    for mode in np.nonzero(round_.all(axis=0))[0]:
        sign = np.sign(data.whirl[1, mode])
        assert (np.sign(data.whirl[1:, mode]) == sign).all()
        assert (sign * np.diff(data.frequencies[:, mode]) > 0.0).all()
    back = campbell(rotor_and_stator(3.0), -SPEEDS[::-1])
    np.testing.assert_allclose(np.sort(back.whirl[0]), np.sort(data.whirl[-1]), atol=1e-9)


@pytest.mark.slow
def test_critical_speeds():
    """i W is an eigenvalue but for damping: Im(lambda) = W to the last digits, and none is missing."""
    data = campbell(rotor_and_stator(3.0), SPEEDS, orders=(1.0, 2.0))
    fine = np.linspace(1e-3, 12.0, 61)
    tracks = campbell(rotor_and_stator(3.0), fine).eigenvalues.imag
    for order in (1.0, 2.0):
        result = [point for point in data.critical if point.order == order]
        for point in result:
            roots = np.array(whirl_roots(point.speed))
            assert np.abs(roots.imag - order * point.speed).min() <= 1e-11 * order * point.speed
            assert point.frequency == pytest.approx(order * point.speed / (2.0 * np.pi), rel=1e-11)
        above = np.sign(tracks - order * fine[:, None])
        assert len(result) == np.count_nonzero(np.diff(above, axis=0))
    first = [point for point in data.critical if point.order == 1.0]
    assert [round(point.whirl) for point in first] == [-1, 1, 0, -1]
    assert "Critical speed" in str(data)


def test_jeffcott():
    """A disk amid a light shaft: whirl at sqrt(k/m) at any speed; disk tilt (k - It w^2) = Ip W w."""
    data = campbell(shaft(1.0, internal=0.0, external=0.0), np.linspace(0.0, 100.0, 5))
    for speed, row in zip(data.speeds, data.eigenvalues.imag, strict=True):
        tilt = (np.sqrt((0.04 * speed) ** 2 + 4.0 * 0.02 * 50.0) + 0.04 * speed * np.array([1, -1])) / 0.04
        for exact in (10.0, 10.0, *tilt):
            assert np.abs(row - exact).min() <= 1e-12 * exact
        assert not data.eigenvalues.real.any()
    held = np.nonzero(np.ptp(data.frequencies, axis=0) < 1e-9)[0]
    assert len(held) == 5  # turn, two whirls, along and about the axis
    held = [mode + 1 for mode in held if abs(data.eigenvalues[0, mode].imag - 10.0) > 1e-9]
    critical = [point.speed for point in data.critical if point.mode not in (1, *held)]
    # in translation both whirls have one frequency and no direction of their own; backward tilt: It W^2 = k - Ip W^2;
    # forward: Ip > It has none
    np.testing.assert_allclose(critical, [10.0, 10.0, np.sqrt(50.0 / 0.06)], rtol=1e-11)


def disk_on_two_bearings(polar):
    """A disk off the middle between bearings that are softer along y, and its eigenvalues at a speed by matrices."""
    model = mv.Model("disk")
    model.add_body("disk", 1.0, (0.01, 0.01, polar))
    stiffness, damping = np.zeros((6, 6)), np.zeros((6, 6))
    for name, z, k in (("left", -0.2, 3e3), ("right", 0.1, 5e3)):
        springs = k * np.array([1.0, 0.7, 1.5, 0.0, 0.0, 1e-3])
        model.add_bushing(name, "ground", "disk", (0, 0, z), springs, 2e-3 * springs)
        at = np.eye(6)
        at[0, 4], at[1, 3] = z, -z
        stiffness, damping = (total + at.T @ np.diag(part * springs) @ at for total, part in
                              ((stiffness, 1.0), (damping, 2e-3)))  # fmt: skip
    model.add_rotor("spin", "disk", 0.0, (0, 0, 1), inertia=polar)
    mass, spin = np.diag([1.0, 1.0, 1.0, 0.01, 0.01, polar]), np.zeros((6, 6))
    spin[3, 4], spin[4, 3] = polar, -polar

    def frequencies(speed):
        changes = np.linalg.solve(mass, np.hstack((-stiffness, -damping - speed * spin)))
        values = np.linalg.eigvals(np.vstack((np.eye(6, 12, k=6), changes)))
        return np.sort(values.imag[values.imag > 0.0])

    return model, frequencies


@pytest.mark.slow
@pytest.mark.parametrize("polar", [0.004, 0.0095, 0.019])
@pytest.mark.parametrize("speeds", [(0.0, 400.0), (-150.0, 400.0), (-400.0, 10.0, 390.0)])
def test_critical_speeds_do_not_depend_on_the_steps(polar, speeds):
    """All of them are found between few speeds, also where these lie on both sides of standstill, and none besides."""
    model, frequencies = disk_on_two_bearings(polar)
    data = campbell(model, speeds, orders=(0.5, 1.0, 1.9))
    fine = np.linspace(speeds[0], speeds[-1], 4000)
    table = np.array([frequencies(speed) for speed in fine])
    for order in (0.5, 1.0, 1.9):
        found = sorted(point.speed for point in data.critical if point.order == order)
        where, _ = np.nonzero(np.diff(np.sign(table - order * np.abs(fine)[:, None]), axis=0))
        np.testing.assert_allclose(found, 0.5 * (fine[where] + fine[where + 1]), atol=fine[1] - fine[0])
        assert max(np.abs(frequencies(speed) - order * abs(speed)).min() for speed in found) < 1e-9
    assert {point.mode for point in data.critical} <= set(range(1, 7))


def test_critical_speeds_keep_their_digits_beside_much_stiffer_bushings():
    """Two bodies side by side, whose coordinates count from the ground: a dense solver has no digit of slow modes."""
    stiff, soft, masses, moments = 1e19, (3.1e4, 5.3e4, 107.0), (4.0, 6.0), (0.08, 0.07)
    model = mv.Model("pair")
    for name, mass, moment in zip("ab", masses, moments, strict=True):
        model.add_body(name, mass=mass, inertia=(0.05, 0.05, moment))
        model.add_joint(f"plane {name}", "planar", "ground", name, position=(0, 0, 0), axis=(0, 0, 1))
    model.add_bushing("soft", "ground", "a", (0, 0, 0), stiffness=(*soft[:2], 0, 0, 0, soft[2]))
    model.add_bushing("stiff", "a", "b", (0, 0, 0), stiffness=(stiff, stiff, 0, 0, 0, stiff))
    model.add_rotor("wheel", "b", speed=1.0, axis=(0, 0, 1), inertia=0.07)
    result = [point.speed for point in campbell(model, np.linspace(0.0, 200.0, 11)).critical]
    roots = []
    for k, (a, b) in zip(soft, (masses, masses, moments), strict=True):  # a b L^2 - (b (k + s) + a s) L + k s = 0
        half = b * (k + stiff) + a * stiff
        roots.append(np.sqrt(2.0 * k * stiff / (half + np.sqrt(half**2 - 4.0 * a * b * k * stiff))))
    np.testing.assert_allclose(result, sorted(roots), rtol=1e-15)


@pytest.mark.slow
def test_limits_of_several_modes():
    """Two shafts with other dampers: each has a limit of its own, 10 (1 + d / d_i), between the same two speeds."""
    model = mv.Model("two")
    for name, external in (("first", 0.5), ("second", 1.5)):
        model.add_model(name, shaft(1.0, external=external))
    assert campbell(model, [5.0, 60.0]).limits == pytest.approx([12.5, 17.5], rel=1e-12)


@pytest.mark.slow
def test_rounding_of_undamped_modes_is_no_limit():
    """Bearings damp what bends the shaft; it turns and slides undamped, by real parts that are rounding."""
    fan = mv.Model("fan")
    fan.add_body("disk", 12.0, (0.10, 0.10, 0.19), position=(0, 0, 0.4))
    fan.add_beam("shaft", None, "disk", {"type": "circle", "radius": 0.015}, {"E": 2.1e11, "nu": 0.3, "rho": 7800},
                 start=(0, 0, 0), end=(0, 0, 0.4), elements=4)  # fmt: skip
    for name, node, z in (("bearing1", "shaft.0", 0.0), ("bearing2", "shaft.2", 0.2)):
        fan.add_bushing(name, "ground", node, (0, 0, z), (2e7, 1e7, 2e7, 0, 0, 0), (400, 400, 0, 0, 0, 0))
    fan.add_rotor("wheel", "disk", 300.0, (0, 0, 1), inertia=0.19)
    data = campbell(fan, np.linspace(0.0, 600.0, 7))
    assert data.stable.all()
    assert data.limits == ()


@pytest.mark.slow
def test_internal_damping_shows():
    data = campbell(shaft(1.0), [5.0, 14.9, 15.1, 20.0])
    assert data.stable.tolist() == [True, True, False, False]
    # rotating damping d_i and damping d of the ground at rest: W = w (1 + d / d_i), 10 (1 + 1 / 2)
    assert data.limits == pytest.approx([15.0], rel=1e-12)
    assert "Unstable at 2 of the speeds, first at 15.100000 rad/s; stability changes at 15.000000 rad/s." in str(data)
    assert campbell(shaft(1.0), [1.0, 200.0]).limits == pytest.approx([15.0], rel=1e-12)
    assert campbell(shaft(1.0), [1.0, 2.0]).limits == ()
    grows = np.nonzero((data.eigenvalues.real > 0.0).any(axis=0))[0]
    assert (data.directions[:, grows] == "forward").all()


@pytest.mark.slow
def test_tracks_do_not_depend_on_the_steps():
    """Tracks that cross keep their modes, however far apart the speeds are."""
    model = shaft(1.0)
    coarse, fine = campbell(model, [1.0, 250.0]), campbell(model, np.linspace(1.0, 250.0, 60))
    np.testing.assert_allclose(coarse.eigenvalues[-1], fine.eigenvalues[-1], rtol=1e-10)
    assert not np.array_equal(np.argsort(fine.frequencies[0]), np.argsort(fine.frequencies[-1]))


def test_rotors_at_ratios():
    model = rotor_and_stator(2.0)
    model.add_rotor("wheel", "stator", 6.0, (0, 0, 1), inertia=20.0)
    data = campbell(model, [4.0])
    assert data.ratios == {"spin": 1.0, "wheel": 3.0}
    direct = model.with_values({"spin.speed": 4.0, "wheel.speed": 12.0}).linearize().modes()
    np.testing.assert_allclose(np.sort(data.frequencies[0]), np.sort(direct.damped_frequencies), rtol=1e-13)
    held = campbell(model, [4.0], "wheel")
    direct = model.with_values({"wheel.speed": 4.0}).linearize().modes()
    np.testing.assert_allclose(np.sort(held.frequencies[0]), np.sort(direct.damped_frequencies), rtol=1e-13)
    assert campbell(model, [4.0], {"spin": 2.0}).ratios == {"spin": 2.0}


def test_refusals():
    model = rotor_and_stator(1.0)
    with pytest.raises(ModelError, match="'spin'"):
        campbell(model, [1.0], "spim")
    for speeds in ([2.0, 1.0], [np.nan], []):
        with pytest.raises(ModelError, match="speeds"):
            campbell(model, speeds)
    plain = mv.Model("plain")
    with pytest.raises(ModelError, match="no rotor"):
        campbell(plain, [1.0])


@pytest.mark.slow
def test_plot(tmp_path):
    data = campbell(shaft(1.0), np.linspace(0.0, 60.0, 13))
    figure = plot(data, orders=(1.0, 2.0))
    figure.savefig(tmp_path / "campbell.png")
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("speed [rad/s]", "damped frequency [Hz]")
    circles = [line for line in axes.lines if line.get_marker() == "o"]
    assert len(circles) == len(data.critical)
    assert any(line.get_marker() == "x" for line in axes.lines)
    stated = [text.get_text() for text in figure.legends[0].get_texts()]
    assert stated == ["forward", "backward", "no whirl", "unstable", "1 × speed", "2 × speed", "critical speed"]
    assert repr(data).startswith("Campbell('shaft': 13 speeds, 7 modes")


def test_the_diagram_leaves_out_modes_far_above_all_speeds():
    """A shaft of beams has modes up to 100 kHz, beside which nothing else would be seen."""
    fan = mv.Model("fan")
    fan.add_body("disk", 12.0, (0.1, 0.1, 0.19), position=(0, 0, 0.4))
    fan.add_beam("shaft", "ground", "disk", {"type": "circle", "radius": 0.015}, {"E": 2e11, "nu": 0.3, "rho": 7800},
                 start=(0, 0, 0), end=(0, 0, 0.4), elements=4)  # fmt: skip
    fan.add_rotor("wheel", "disk", 1.0, (0, 0, 1), inertia=0.19)
    data = campbell(fan, np.linspace(0.0, 100.0, 5))
    assert data.frequencies.max() > 2e4
    lowest = plot(data).axes[0]
    assert lowest.get_ylim()[1] == pytest.approx(1.08 * data.frequencies[:, :8].max())
    assert plot(data, modes=24).axes[0].get_ylim()[1] > 2e4
    # lines of high orders bring further modes in
    assert plot(data, orders=(100.0,)).axes[0].get_ylim()[1] > lowest.get_ylim()[1]


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "damping"), [(9, -0.5), (10, -0.5), (8, 1.2), (3, 1.2)])
def test_paths_do_not_depend_on_the_number_of_speeds(seed, damping):
    """Two discs whose modes veer, some of them overdamped: eigenvalues at the last speed have the numbers that eight
    speeds in each of 24 steps give them.
    """
    rng = np.random.default_rng(seed)
    model = mv.Model("discs")
    for k in range(2):
        across = rng.uniform(0.05, 0.2)
        polar = across * rng.uniform(0.5, 1.9)
        model.add_body(f"d{k}", rng.uniform(1, 5), (across, across, polar), position=(0, 0, 0.5 * k))
        stiffness = 10.0 ** rng.uniform(3, 5, 6)
        dampers = np.sqrt(2.0 * stiffness) * 10.0 ** rng.uniform(-1, damping, 6)
        if k == 0:
            model.add_bushing("b0", "ground", "d0", (0, 0, -0.1), stiffness, dampers)
        else:
            model.add_bushing("b1", "d0", "d1", (0, 0, 0.3), stiffness, dampers)
            model.add_bushing("g1", "ground", "d1", (0, 0, 0.6), 0.3 * stiffness[::-1], 0.3 * dampers[::-1])
        model.add_rotor(f"s{k}", f"d{k}", 100.0, (0, 0, 1), inertia=polar)
    fine = campbell(model, np.linspace(0.0, 3000.0, 193)).eigenvalues[-1]
    for count in (2, 3, 4):
        few = campbell(model, np.linspace(0.0, 3000.0, count)).eigenvalues[-1]
        np.testing.assert_allclose(few, fine, rtol=1e-6)
