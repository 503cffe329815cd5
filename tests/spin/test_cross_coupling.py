"""Cross-coupled bushings, as journal bearings and seals are: unsymmetric stiffness and damping in all engines."""

import mpmath as mp
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.linalg.rotations import exponential

MASS, STIFFNESS, DAMPING = 10.0, 1e5, 200.0
AXES = exponential(np.array((0.4, -0.7, 0.5)))
WAVE = 200.0


def rotor(cross, cross_damping=0.0, axes=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    """A rigid rotor whose disk moves across the third of some axes."""
    model = mv.Model("rotor")
    model.add_body("disk", MASS, (0.05, 0.05, 0.1))
    model.add_joint("plane", "planar", "ground", "disk", position=(0, 0, 0), orientation=axes)
    k, c = np.diag([STIFFNESS, STIFFNESS, 0, 0, 0, 10.0]), np.diag([DAMPING, DAMPING, 0, 0, 0, 0.1])
    k[0, 1], k[1, 0], c[0, 1], c[1, 0] = cross, -cross, cross_damping, -cross_damping
    model.add_bushing("oil", "ground", "disk", (0, 0, 0), k, c, orientation=axes)
    return model


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize(("cross", "cross_damping"), [(3e4, 0.0), (-500.0, 70.0), (0.0, -40.0)])
def test_whirls_are_the_roots_of_the_complex_displacement(method, cross, cross_damping):
    """z = x + i y: m z'' + (c - i g) z' + (k - i q) z = 0."""
    modes = rotor(cross, cross_damping, AXES).linearize(method=method).modes(3)
    with mp.workdps(30):
        roots = mp.polyroots([STIFFNESS - 1j * cross, DAMPING - 1j * cross_damping, MASS], asc=True)
        roots = np.array([complex(root) for root in roots])
    expected = np.concatenate((roots, roots.conj()))
    distance = np.abs(np.subtract.outer(expected, modes.eigenvalues)).min(axis=1)
    np.testing.assert_array_less(distance, 1e-11 * np.abs(expected))


@pytest.mark.parametrize(("share", "stable"), [(1 - 1e-9, True), (1 + 1e-9, False)])
def test_onset_of_whirl(share, stable):
    """k_c = c sqrt(k / m)."""
    modes = rotor(share * DAMPING * np.sqrt(STIFFNESS / MASS)).linearize().modes()
    assert bool((modes.eigenvalues.real < 0.0).all()) == stable


def bearing(gravity=None):
    model = mv.Model("bearing", gravity=gravity)
    model.add_body("shaft", MASS, (0.1, 0.12, 0.2), position=(0, 0, 0.05))
    k, c = np.diag([1e5, 1.2e5, 1e6, 2e3, 2.5e3, 3e3]), np.diag([200.0, 150.0, 100.0, 3.0, 2.0, 3.0])
    k[0, 1], k[1, 0], k[3, 4], k[4, 3], k[0, 4], c[0, 1], c[1, 0] = 3e4, -2e4, 500.0, -700.0, 40.0, 60.0, -20.0
    model.add_bushing("oil", "ground", "shaft", (0, 0, 0), k, c, orientation=AXES)
    model.add_input("F", "shaft", "x", position=(0, 0, 0.1))
    model.add_output("y", "shaft", "y")
    model.add_output("rx", "shaft", "rx")
    model.add_force_output("force", "oil", "x")
    return model, k, c


def test_matrices_turn_into_the_axes_of_the_world():
    """T^T K T with T of the displacement of the point (u + theta x r, theta), in the axes of the bushing."""
    model, k, c = bearing()
    r = np.array([0.0, 0.0, -0.05])
    displacement = np.block([[np.eye(3), np.cross(np.eye(3), r).T], [np.zeros((3, 3)), np.eye(3)]])
    to_axes = np.kron(np.eye(2), AXES.T) @ displacement
    system = model.linearize()
    for result, matrix in ((system.K, k), (system.C, c)):
        np.testing.assert_allclose(result, to_axes.T @ matrix @ to_axes, rtol=1e-12, atol=1e-12 * np.abs(matrix).max())
    force = k @ to_axes
    np.testing.assert_allclose(system.Cq[2], force[0], rtol=1e-12, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("gravity", [None, (0.0, -3.0, 9.81)])
def test_small_finite_motion_is_the_linear_one(gravity):
    model, *_ = bearing(gravity)
    model = model if gravity is None else model.equilibrium()
    t = np.linspace(0.0, 0.03, 40)
    run = model.simulate(t, {"F": 1e-2 * np.sin(WAVE * t)}, tolerance=1e-10)
    linear = model.linearize().time_response(t, 1e-2 * np.sin(WAVE * t))
    for name, expected in zip(model.outputs, np.asarray(linear).reshape(3, -1), strict=True):
        result = run.outputs[name] - run.outputs[name][0]
        np.testing.assert_allclose(result, expected, atol=3e-6 * np.abs(expected).max())


@pytest.mark.slow
def test_energy_of_a_large_motion_is_balanced_by_the_work_of_the_cross_coupling():
    model, *_ = bearing()
    t = np.linspace(0.0, 0.03, 40)
    energy = model.simulate(t, {"F": 2e3 * np.sin(WAVE * t)}).energy
    assert np.abs(energy.balance).max() <= 1e-7 * np.abs(energy.total).max()


def test_weight_on_a_bearing_moves_it_across():
    """x = K^-1 f: the displacement across is k_c / k of that along the force."""
    moved = rotor(3e4).with_parts(gravity=(0.0, -9.81, 0.0)).equilibrium()
    expected = np.linalg.solve([[STIFFNESS, 3e4], [-3e4, STIFFNESS]], [0.0, -9.81 * MASS])
    np.testing.assert_allclose(moved.bodies["disk"].position[:2], expected, rtol=1e-9)


def test_every_entry_is_a_parameter():
    """A symmetric matrix has each pair once, another one all 36, whose derivatives are those of this entry alone."""
    model, k, _ = bearing()
    names = [name for name in model.parameters if name.startswith("oil.stiffness.")]
    assert len(names) == 36
    assert model.parameters["oil.stiffness.x.y"] == k[0, 1]
    assert model.parameters["oil.stiffness.y.x"] == k[1, 0]
    system = model.linearize()
    slopes = system.frequency_response_sensitivities([WAVE], ["oil.stiffness.x.y", "oil.damping.y.x"])
    dynamic = system.K + 1j * WAVE * system.C - WAVE**2 * system.M
    left = np.linalg.solve(dynamic.T, system.Cq[:2].T).T
    right = np.linalg.solve(dynamic, system.B)
    r = np.array([0.0, 0.0, -0.05])
    rows = AXES.T @ np.hstack((np.eye(3), np.cross(np.eye(3), r).T))
    for slope, (i, j), power in zip(np.asarray(slopes), ((0, 1), (1, 0)), (1.0, 1j * WAVE), strict=True):
        expected = -power * (left @ rows[i])[:, None] * (rows[j] @ right)
        np.testing.assert_allclose(slope[:2, :, 0], expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_variants_and_files_keep_both_entries(tmp_path):
    model, *_ = bearing()
    batch = model.linearize(values={"oil.stiffness.x.y": [3e4, 5e4]})
    single = model.with_values({"oil.stiffness.x.y": 5e4}).linearize()
    np.testing.assert_array_equal(batch[1].K, single.K)
    assert single.circulatory is not None
    for suffix in (".yaml", ".json"):
        mv.save(model, tmp_path / f"bearing{suffix}")
        assert mv.load(tmp_path / f"bearing{suffix}").springs["oil"] == model.springs["oil"]


def test_speeds_vary_beside_the_force_of_a_bearing():
    """Moments on the ground change with the speed, forces of bearings do not; a batch ended in an error of numpy."""
    model, *_ = bearing()
    model.add_rotor("spin", "shaft", 100.0, (0, 0, 1), inertia=0.2)
    model.add_force_output("below", "ground", "rx")
    batch = model.linearize(values={"spin.speed": [100.0, 150.0]})
    single = model.with_values({"spin.speed": 150.0}).linearize()
    np.testing.assert_array_equal(batch[1].Cv, single.Cv)
    np.testing.assert_array_equal(batch[1].Cq, single.Cq)
    assert batch[0].Cv[3].any()


def test_matrices_that_are_symmetric_but_for_rounding_have_no_cross_coupling():
    """Also where stiffness in other units is so small that a share of the largest entry would hide it."""
    model = mv.Model("two")
    model.add_body("a", 1.0, (1, 1, 1))
    k = np.diag([1e9, 1e9, 1e9, 1.0, 1.0, 1.0])
    k[0, 1], k[1, 0] = 1e6, 1e6 + 1e-4
    assert model.add_bushing("rounded", "ground", "a", (0, 0, 0), k).cross_coupling is None
    k[3, 4] = 1e-3
    assert model.add_bushing("tilting", "ground", "a", (0, 0, 0), k).cross_coupling[0][3, 4] == 5e-4


def test_cross_coupled_dampers_do_not_turn_along():
    model = mv.Model("shafts")
    for i in range(2):
        model.add_body(f"shaft{i}", 1.0, (0.1, 0.1, 0.2), position=(0, 0, i))
        model.add_rotor(f"spin{i}", f"shaft{i}", 30.0, (0, 0, 1))
    c = np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    c[0, 1], c[1, 0] = 0.5, -0.5
    model.add_bushing("seal", "shaft0", "shaft1", (0, 0, 0.5), damping=c)
    with pytest.raises(mv.ModelError, match=r"'seal'.*damping matrix that is not symmetric"):
        model.linearize()


def test_explain_names_them():
    assert "cross-coupled, with unsymmetric stiffness or damping: oil" in bearing()[0].linearize().explain()
