"""Controllers, norms, Hankel and structured singular values by SLICOT, against closed forms and our own."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from mbsvib.isolation import synthesis
from mbsvib.isolation.synthesis import closed_loop, h2_synthesis, hinf_synthesis
from tests.isolation.test_riccati import INTEGRATOR
from tests.isolation.test_synthesis import plant as strut
from tests.reduction.test_balanced import benchmark

ctrlsys = pytest.importorskip("ctrlsys", reason="ctrlsys is not installed: pip install 'mbsvib[ctrlsys]'")


def test_the_least_norm_in_closed_form():
    made = hinf_synthesis(INTEGRATOR, 1, 1, "test")
    assert np.sqrt(2) <= made.norm < 1.01 * np.sqrt(2)
    loop = closed_loop(INTEGRATOR, (made.A, made.B, made.C, made.D), 1, 1)
    assert mv.StateSpace.from_arrays(*loop).hinf_norm().value == pytest.approx(made.norm, rel=1e-6)


@pytest.mark.parametrize("size", [1e-9, 1e9])
@pytest.mark.parametrize("rate", [1e-3, 1e5])
def test_units_do_not_matter(size, rate):
    """SLICOT's own bisection ends at an absolute tolerance: at 600 times the least norm where numbers are small."""
    a, b, c, d = INTEGRATOR
    sizes = np.array([[size], [size], [1.0]])
    # in another unit of time x has another one too
    made = hinf_synthesis((a * rate, b * rate, c * sizes, d * sizes), 1, 1, "test")
    assert np.sqrt(2) <= made.norm / size < 1.01 * np.sqrt(2)


def test_a_larger_norm_that_is_allowed_slows_the_controller():
    tight, relaxed = (hinf_synthesis(INTEGRATOR, 1, 1, "test", factor) for factor in (1.0, 1.5))
    assert tight.norm < relaxed.norm <= 1.5 * tight.norm
    assert np.abs(np.linalg.eigvals(relaxed.A)).max() < 0.2 * np.abs(np.linalg.eigvals(tight.A)).max()
    p = isolation.actuated(library.cubic_hexapod(damping=2.0), "platform")
    loops = [p.with_gains(isolation.hinf(p, p.names("acceleration"), 1.0, 0.1, relaxation=factor)[0])
             for factor in (1.0, 1.2)]  # fmt: skip
    assert loops[1].margins().all_phases > 1.5 * loops[0].margins().all_phases
    with pytest.raises(mv.ResponseError, match=r"relaxation = 0\.5; expected a number from 1 on"):
        isolation.hinf(p, p.names("acceleration"), 1.0, 0.1, relaxation=0.5)


@pytest.mark.parametrize("synthesis", [hinf_synthesis, h2_synthesis])
def test_a_plant_without_states_is_refused(synthesis):
    """SLICOT returns at once, with a controller that is none: a norm of 2.97 where 0.24 can be reached."""
    static = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((3, 0)), np.array([[0.0, 2.0], [0.0, 0.5], [1.0, 0.0]])
    with pytest.raises(mv.ResponseError, match="test: the plant has no states"):
        synthesis(static, 1, 1, "test")


@pytest.mark.parametrize("synthesis", [hinf_synthesis, h2_synthesis])
def test_an_unstable_mode_out_of_reach_of_the_control_is_refused(synthesis):
    def made(reach):
        b, c = np.array([[1.0, 0, reach], [0, 0, 1]]), np.array([[1.0, 0.5], [0, 0], [1, 1]])
        plant = np.diag([1.0, -1.0]), b, c, np.array([[0.0, 0, 0], [0, 0, 1], [0, 1, 0]])
        result = synthesis(plant, 1, 1, "test")
        return closed_loop(plant, (result.A, result.B, result.C, result.D), 1, 1)[0]

    assert np.linalg.eigvals(made(1.0)).real.max() < 0.0
    with pytest.raises(mv.ResponseError, match=r"test: no (stabilising )?controller was found"):
        made(0.0)


def test_the_norm_of_a_hexapods_loop():
    """Of z and forces from base and noise, by our own norm: what SLICOT's controller is said to reach, it reaches."""
    p = strut(damping=60.0)
    effort, noise = 1e-2, 1e-3
    law, norm = isolation.hinf(p, ["leg.acceleration"], effort, noise)
    loop = p.with_gains(law)
    w = np.geomspace(1.0, 1e5, 3000)
    part = loop.frequency_response(w, "acceleration.z", "base.z")[0, 0]
    assert np.abs(part).max() <= norm * (1 + 1e-6)


@pytest.mark.parametrize("name", ["stewart_isolator", "cubic_hexapod"])
def test_norms_are_slicots(name):
    words = {"damping": 20.0} if name == "cubic_hexapod" else {}
    space = getattr(library, name)(**words).linearize().state_space("modal")
    part = space.with_ports(space.outputs[:3], space.inputs[:3])
    a, b, c, d = (np.array(m, order="F") for m in (part.A, part.B, part.C, part.D))
    peak, _, failed = ctrlsys.ab13dd("C", "I", "S", "D", len(a), *d.T.shape, np.array([0.0, 1.0]), a,
                                     np.eye(len(a), order="F"), b, c, d, 1e-9)  # fmt: skip
    assert not failed
    assert peak[0] / peak[1] == pytest.approx(part.hinf_norm().value, rel=1e-8)
    matrices = [np.array(m, order="F") for m in (part.A, part.B, part.C, 0 * part.D)]
    value, *_, failed = ctrlsys.ab13bd("C", "H", *matrices, 0.0)
    assert not failed
    assert value == pytest.approx(mv.StateSpace.from_arrays(part.A, part.B, part.C, 0).h2_norm().value, rel=1e-8)


@pytest.mark.parametrize("order", [4, 10, 20])
def test_balanced_truncation_is_slicots(order):
    """AB09AD by the square-root method: the same Hankel singular values and the same reduced model."""
    building = benchmark("build")
    space = mv.StateSpace.from_arrays(building.A, building.B, building.C, 0)
    n = len(space.A)
    matrices = [np.array(m, order="F") for m in (space.A, space.B, space.C)]
    ar, br, cr, hankel, nr, _, failed = ctrlsys.ab09ad("C", "B", "N", "F", n, 1, 1, order, *matrices, 0.0)
    assert (failed, nr) == (0, order)
    ours = space.hankel_singular_values()
    assert ours[:order] == pytest.approx(hankel[:order], rel=1e-8)
    small = space.reduced(order)
    w = np.geomspace(1.0, 200.0, 300)
    theirs = mv.StateSpace.from_arrays(ar[:nr, :nr], br[:nr], cr[:, :nr], 0).frequency_response(w)
    assert np.abs(small.frequency_response(w) - theirs).max() <= 1e-6 * np.abs(theirs).max()
    error = np.abs(small.frequency_response(w) - space.frequency_response(w)).max()
    assert 0.1 * hankel[order] < error <= small.error_bound
    assert small.error_bound == pytest.approx(2 * hankel[order:].sum(), rel=1e-4)
    matrices = [np.array(m, order="F") for m in (space.A, space.B, space.C)]
    assert ctrlsys.ab13ad("C", "N", n, 1, 1, 0.0, *matrices)[0] == pytest.approx(ours[0])


def test_structured_singular_values_are_no_larger():
    """AB13MD ends up to 1e-3 above the least bound, and on some matrices with real parameters not at all."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        m = rng.normal(size=(5, 5)) + 1j * rng.normal(size=(5, 5))
        bound, *_, failed = ctrlsys.ab13md(np.asfortranarray(m), np.ones(5, dtype=np.int32), np.full(5, 2, np.int32))
        assert not failed
        assert 0.998 * bound <= isolation.structured_singular_values(m) <= bound * (1 + 1e-6)


# units of time, length and force
UNITS = {"ms": (1e-3, 1.0, 1.0), "mm": (1.0, 1e-3, 1.0), "kN": (1.0, 1.0, 1e3), "um, 1/6000 s": (1 / 6000, 1e-6, 1.0)}


def in_units(plant, measurements, controls, units):
    """The same generalized plant with states, measurements and controls in other units of time, length and force."""
    (a, b, c, d), (time, length, force) = (tuple(np.array(m, dtype=float) for m in plant), units)
    o, i = len(c) - measurements, b.shape[1] - controls
    states = np.where(np.arange(len(a)) < len(a) // 2, length, length / time)  # displacements, then velocities
    a, b, c = time * a * states / states[:, None], time * b / states[:, None], c * states
    b[:, i:], d[:, i:] = b[:, i:] * force, d[:, i:] * force
    c[o:], d[o:] = c[o:] / length, d[o:] / length
    return a, b, c, d


@pytest.fixture(scope="module")
def generalized():
    """Base acceleration and sensor noise to the body's acceleration and the effort, of a Stewart isolator."""
    system = library.stewart_isolator().linearize()
    space = system.state_space()
    names = [name for name in system.outputs if name in system.outputs][:3]
    w = [k for k, name in enumerate(space.inputs) if name.startswith("base")][:1] or [0]
    u = [k for k in range(len(space.inputs)) if k not in w][:2]
    y = [space.outputs.index(name) for name in names[:2]]
    n, nu, ny = len(space.A), len(u), len(y)
    b = np.hstack((space.B[:, w], np.zeros((n, ny)), space.B[:, u]))
    c = np.vstack((space.C[y], np.zeros((nu, n)), space.C[y]))
    noise = 1e-4 * float(np.abs(space.C[y] @ np.linalg.solve(space.A, space.B[:, w])).max())
    effort = 0.1 * float(np.abs(space.C[y] @ np.linalg.solve(space.A, space.B[:, u])).max())
    through = np.zeros((len(c), b.shape[1]))
    through[ny : ny + nu, len(w) + ny :] = effort * np.eye(nu)
    through[ny + nu :, len(w) : len(w) + ny] = noise * np.eye(ny)
    return (space.A, b, c, through), ny, nu


@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_controllers_do_not_depend_on_units(generalized, units):
    plant, ny, nu = generalized
    time = units[0]
    plants = plant, in_units(plant, ny, nu, units)
    first, other = (hinf_synthesis(p, ny, nu, "test") for p in plants)
    assert other.norm == pytest.approx(first.norm, rel=1e-9)
    norms = []
    for p, design in zip(plants * 2, (first, other, *(h2_synthesis(p, ny, nu, "test") for p in plants)), strict=True):
        loop = mv.StateSpace.from_arrays(*closed_loop(p, (design.A, design.B, design.C, design.D), ny, nu))
        assert np.linalg.eigvals(loop.A).real.max() < 0.0
        norms.append(loop.h2_norm().value if design.norm is None else loop.hinf_norm().value)
    assert norms[:2] == pytest.approx([first.norm] * 2, rel=1e-6)
    assert norms[3] == pytest.approx(norms[2] * np.sqrt(time), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("relaxation", [1.0, 1.2])
def test_units_that_are_powers_of_two_change_no_bit(relaxation, monkeypatch):
    """Near its least norm a controller has few digits: it is the same one where units round nothing."""
    made, platform = [], isolation.actuated(library.cubic_hexapod(damping=2.0), "platform")
    monkeypatch.setattr(synthesis, "hinf_synthesis", lambda *words: made.append(words) or hinf_synthesis(*words))
    isolation.hinf(platform, platform.names("acceleration"), 1.0, 1e-3, relaxation=relaxation)
    plant, ny, nu, *_ = made[0]
    units = time, length, force = 2.0**-10, 2.0**5, 2.0**12
    first, other = (hinf_synthesis(p, ny, nu, "test", relaxation) for p in (plant, in_units(plant, ny, nu, units)))
    assert other.norm == first.norm
    np.testing.assert_array_equal(other.D * force / length, first.D)
    np.testing.assert_array_equal(np.linalg.eigvals(other.A) / time, np.linalg.eigvals(first.A))
