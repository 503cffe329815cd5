"""Loops of 1e-6 m beside ones of 1e3 m, very thin loops, inertia ratios of 1e-12, chains of 300 joints."""

import warnings

import numpy as np
import pytest

import mbsvib as mv
from tests.stress.compare import assert_honest, modes_of, undamped_errors
from tests.support.digits import mp
from tests.support.random_models import rotation
from tests.support.sizes import few


def add_four_bar(model, rng, tag, base, origin, size, spatial):
    """A four-bar of a size on a body; returns its coupler and the corner there."""
    axes = rotation(rng)
    square = ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0))
    corners = [origin + axes @ (size * (np.array(c) + 0.2 * rng.uniform(-1, 1, 3) * [1, 1, spatial])) for c in square]
    names = [base, *(f"{part}{tag}" for part in ("left", "top", "right"))]
    mass, stiffness = size * 10.0 ** rng.uniform(-1, 1), 1e3 * size
    for j in (1, 2, 3):
        x, y, z = mass * (size * rng.uniform(0.1, 0.4, 3)) ** 2 / 3
        middle = (corners[j - 1] + corners[j]) / 2
        model.add_body(names[j], mass, (y + z, x + z, x + y), middle, orientation=rotation(rng))
    for j, kind in enumerate(("universal", "revolute", "spherical", "cylindrical") if spatial else ("revolute",) * 4):
        frame = rotation(rng) if spatial else axes
        first, second = names[j], names[(j + 1) % 4]
        model.add_joint(f"j{tag}{j}", kind, first, second, position=corners[j], orientation=frame)
        k = stiffness * np.array([1, 1, 1, *(size**2 * rng.uniform(0.1, 1, 3))])
        model.add_bushing(f"s{tag}{j}", first, second, corners[j], k, orientation=frame)
    return names[2], corners[2]


def loops_of(seed, sizes, stacked, spatial):
    """Four-bars of several sizes, each on the coupler of the one before or all of them on ground."""
    rng = np.random.default_rng(seed)
    model = mv.Model("mixed")
    base, at = "ground", np.zeros(3)
    for i, size in enumerate(sizes):
        coupler, corner = add_four_bar(model, rng, i, base, at, size, spatial)
        base, at = (coupler, corner) if stacked else (base, at + np.array([1.0, 0, 0]))
    return model


@pytest.mark.few(1)
@pytest.mark.parametrize("sizes", few([(1e-6, 1e3), (1e3, 1.0, 1e-6), (1e3, 1e-6), (1e-6, 1.0, 1e3)], 2))
@pytest.mark.parametrize("stacked", [False, True])
@pytest.mark.parametrize("spatial", [False, True])
def test_micrometres_beside_kilometres(sizes, stacked, spatial):
    """Also a kilometre carried by a micrometre: the rank of every loop is judged by its own size."""
    model = loops_of(1, sizes, stacked, spatial)
    modes = modes_of(model, accurate=False)
    errors = undamped_errors(model, modes, redundant="1e-30")
    assert_honest(errors, modes.errors[0::2])
    # promised no worse than five times that where three orders of size stand on the smallest
    assert modes.errors.max() <= 5e-12


def thin(size, ratio):
    """A four-bar whose height is ``ratio`` of its length ``size``."""
    model = mv.Model("thin")
    points = size * np.array([(0, 0, 0), (0.1 * ratio, ratio, 0), (1, 1.1 * ratio, 0), (1, 0, 0)])
    names = ("ground", "crank", "coupler", "rocker", "ground")
    for i, name in enumerate(names[1:4]):
        model.add_body(name, 1.0, (0.1, 0.12, 0.11), position=(points[i] + points[i + 1]) / 2)
    for i in range(4):
        model.add_joint(f"j{i}", "revolute", names[i], names[i + 1], position=points[i])
        model.add_bushing(f"s{i}", names[i], names[i + 1], points[i], (0, 0, 0, 0, 0, 100.0 * (i + 1)))
    return model


@pytest.mark.few(4)
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("ratio", [1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11])
def test_thin_loops(size, ratio):
    """As many digits are lost as the loop is thin, and that is promised and warned of."""
    model = thin(size, ratio)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        modes = model.linearize().modes(rtol=1e-12)
    errors = undamped_errors(model, modes, redundant="1e-40")
    assert (errors <= modes.errors[0::2] + 4e-16).all()
    assert modes.errors.max() <= 1e-15 + 1e-15 / ratio
    assert bool(caught) == (modes.errors.max() > 1e-12)


def rods(ratio, seed, tensor=False):
    """Rods with an inertia about their line of ``ratio`` times the others, given as moments or as a world tensor."""
    rng = np.random.default_rng(seed)
    model = mv.Model("rods")
    below, at = "ground", np.zeros(3)
    for i, kind in enumerate(("spherical", "universal", "revolute", "spherical")):
        centre, turn = at + rng.uniform(-1, 1, 3), rotation(rng)
        moments = (0.1, 0.1 * (1 + 0.5 * ratio), ratio)
        words = {"inertia": moments, "orientation": turn}
        if tensor:
            full = turn @ np.diag(moments) @ turn.T
            words = {"inertia": (full + full.T) / 2}
        model.add_body(f"b{i}", 1.0, position=centre, **words)
        model.add_joint(f"j{i}", kind, below, f"b{i}", position=at, orientation=turn if i == 3 else rotation(rng))
        model.add_bushing(f"s{i}", below, f"b{i}", at, 1e3 * rng.uniform(0.1, 1, 6), orientation=rotation(rng))
        below, at = f"b{i}", centre + (turn[:, 2] if i == 2 else rng.uniform(-1, 1, 3))
    return model


@pytest.mark.few(3)
@pytest.mark.parametrize("ratio", [1e-6, 1e-9, 1e-12, 1e-14])
@pytest.mark.parametrize("seed", range(3))
def test_inertia_ratios(ratio, seed):
    model = rods(ratio, seed)
    modes = modes_of(model)
    assert_honest(undamped_errors(model, modes), modes.errors[0::2])


@pytest.mark.parametrize("ratio", [1e-3, 1e-6, 1e-9])
def test_inertia_ratios_as_a_tensor(ratio):
    """The small moment is a difference of large entries: its digits are those that the entries still have."""
    model = rods(ratio, 0, tensor=True)
    errors = undamped_errors(model, modes_of(model))
    assert errors.max() <= 1e-15 + 5e-16 / ratio


def spin_chain(kind, n=300):
    """Bodies of 1 kg and 1 kg m^2 in line, that slide along it or turn about it, with equal spring-dampers."""
    model = mv.Model("chain")
    below = "ground"
    along = (0, 0, 1, 0, 0, 0) if kind == "prismatic" else (0, 0, 0, 0, 0, 1)
    for i in range(n):
        model.add_body(f"b{i}", 1.0, (1, 1, 1), position=(0, 0, i + 1))
        model.add_joint(f"j{i}", kind, below, f"b{i}", position=(0, 0, i + 0.5), axis=(0, 0, 1))
        model.add_bushing(f"s{i}", below, f"b{i}", (0, 0, i + 0.5), 1e4 * np.array(along), 10.0 * np.array(along))
        below = f"b{i}"
    return model


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_three_hundred_joints_in_line(kind):
    n = 300
    modes = modes_of(spin_chain(kind), rtol=1e-14, accurate=False)
    omega = 200.0 * np.sin((2 * np.arange(1, n + 1) - 1) * np.pi / (2 * (2 * n + 1)))
    assert np.abs(modes.natural / omega - 1).max() <= 2e-15
    assert np.abs(modes.damping_ratios / (omega * 10.0 / 2e4) - 1).max() <= 1e-14


def arm(stiffness):
    """Links of 1 m and 1 kg that turn about parallel axes, in one line: every lever counts, up to 300 m."""
    model = mv.Model("arm")
    below = "ground"
    for i, k in enumerate(stiffness):
        model.add_body(f"b{i}", 1.0, (0.1, 0.1, 0.1), position=(i + 0.5, 0, 0))
        model.add_joint(f"j{i}", "revolute", below, f"b{i}", position=(i, 0, 0), axis=(0, 0, 1))
        model.add_bushing(f"s{i}", below, f"b{i}", (i, 0, 0), (0, 0, 0, 0, 0, k))
        below = f"b{i}"
    return model


def arm_determinant(square, stiffness):
    """What vanishes at omega^2: deflection and angle at the foot, for both motions of the free tip, link by link."""
    inertia, columns = mp.mpf(0.1), []
    for deflection, angle in ((mp.mpf(1), mp.mpf(0)), (mp.mpf(0), mp.mpf(1))):
        moment = force = mp.mpf(0)
        for k in reversed(stiffness):
            left = -square * (deflection - angle / 2) - force
            rotating = -square * inertia * angle - moment - (force - left) / 2
            deflection, angle, moment, force = deflection - angle, angle + rotating / mp.mpf(float(k)), -rotating, -left
        columns.append((deflection, angle))
    return columns[0][0] * columns[1][1] - columns[1][0] * columns[0][1]


@pytest.mark.slow
@pytest.mark.parametrize("decades", few([6, 2], 1))
def test_three_hundred_links_of_an_arm(decades):
    """Newton's step in 2000 digits tells the error of a frequency."""
    stiffness = 10.0 ** np.random.default_rng(0).uniform(4 - decades / 2, 4 + decades / 2, 300)
    modes = modes_of(arm(stiffness))
    assert modes.natural[-1] > 1e5 * modes.natural[0]
    for j in (0, 1, 7, 50, 150, 250, 298, 299):
        with mp.workdps(2000):
            square = mp.mpf(float(modes.natural[j])) ** 2
            step = square * mp.mpf(10) ** -200
            value = arm_determinant(square, stiffness)
            slope = (arm_determinant(square + step, stiffness) - value) / step
            error = float(abs(value / slope / square / 2))
        assert 1e-19 <= error <= modes.errors[2 * j] + 1e-15
