"""Derivatives along motions of the pose, by complex steps: against models that are described in other poses."""

import warnings

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements import bushing
from mbsvib.equations.batch_assembly import batch_plan
from mbsvib.equations.batch_values import checked
from mbsvib.equations.beam_prestress import least_energy_forces
from mbsvib.equations.matrices import MATRICES
from mbsvib.equations.plan_tangents import along_poses
from mbsvib.linalg.products import signed_rows
from mbsvib.sensitivities.pose_motion import VariantPoses
from mbsvib.sensitivities.variables import Direction
from mbsvib.sensitivities.variants import Variants
from tests.golden.answers import linearized
from tests.golden.store import scenes

# Rods, screws, universal and homokinetic joints, cut and not; followers, torques, free lengths, moments of bushings,
# couplers, massless motions; and what these have seldom.
NAMES = ("free_wheel", "hunt_25", "hunt_55", "hunt_119", "hunt_124", "hunt_202", "library_four_bar", "loaded_2",
         "loaded_3", "loaded_follower_7", "loaded_loop_12", "loaded_loop_18", "massless_torque")  # fmt: skip
RTOL = 1e-9


def plan_of(system, model):
    name = next(iter(system.parameters))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        values = checked(model.parameters, {name: np.array([system.parameters[name]])})
        return batch_plan(model, values.slots, system.coordinates)


@pytest.mark.few(2)
@pytest.mark.parametrize("name", NAMES)
def test_poses_move_as_those_of_models_described_there(name):
    model = mv.load(scenes()[name])
    system = linearized(model, method="dense")
    poses, variants = VariantPoses.of(model, ()), Variants(system)
    found = along_poses(plan_of(system, model), poses.names)
    for k, length in enumerate(poses.steps):
        step = 1e-4 * length
        moved = [variants._matrices(poses.at(sign * step * np.eye(len(poses.steps))[k]))
                 for sign in (-2.0, -1.0, 1.0, 2.0)]  # fmt: skip
        expected = np.tensordot(np.array([1.0, -8.0, 8.0, -1.0]) / (12.0 * step), moved, axes=1)
        start = 0
        for key in MATRICES:
            size = getattr(system, key).size
            part, of_pose = expected[start : start + size], found[key][k].reshape(-1)
            start += size
            scale = max(np.abs(getattr(system, key)).max(initial=0.0) / length, np.abs(part).max(initial=0.0))
            assert of_pose == pytest.approx(part, rel=0.0, abs=RTOL * scale)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["library_four_bar", "loaded_loop_12", "loaded_follower_7"])
def test_forces_that_are_left_over_change_by_the_stiffness(name):
    model = mv.load(scenes()[name])
    system = linearized(model, method="dense")
    plan = plan_of(system, model)
    expected = VariantPoses.of(model, ()).tangent
    stiffness = -along_poses(plan, plan.names)["residual"].T
    assert stiffness == pytest.approx(expected, rel=0.0, abs=1e-9 * np.abs(expected).max())


def test_angles_of_torsion_springs_follow_poses():
    """A lever hangs on its pin: its height z changes the stiffness -m g z, by dz / dq = -x; the spring's stays."""
    model = mv.Model("twisted", gravity=(0, 0, -9.81))
    model.add_body("lever", 2.0, (0.1, 0.2, 0.3), position=(0.3, 0, -0.4))
    model.add_joint("pin", "revolute", "ground", "lever", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_torsion_spring("coil", "ground", "lever", axis=(0, 1, 0), stiffness=50.0, preload=-2.0 * 9.81 * 0.3)
    plan = plan_of(linearized(model, method="dense"), model)
    found = along_poses(plan, plan.names)
    assert found["K"] == pytest.approx(2.0 * 9.81 * 0.3)
    assert found["residual"] == pytest.approx(-50.0 - 2.0 * 9.81 * 0.4)


def test_rows_of_small_imaginary_parts_whose_diagonal_is_partly_zero():
    """They are as large as what is beside the diagonal, on the diagonal they may be anything."""
    rng, step = np.random.default_rng(3), 2.0**-100
    real, imaginary = rng.normal(size=(2, 4, 6, 6))
    real, imaginary = (part + part.swapaxes(-1, -2) for part in (real, imaginary))
    imaginary[0, 3, 3] = imaginary[1, 0, 0] = imaginary[2, [1, 5], [1, 5]] = 0.0
    value, rows = signed_rows(real + 1j * step * imaginary)
    found = np.einsum("nr,nri,nrj->nij", value, rows, rows)
    assert found.real == pytest.approx(real, rel=0.0, abs=1e-13)
    assert found.imag / step == pytest.approx(imaginary, rel=0.0, abs=1e-13)


def test_bushings_about_poses_next_to_their_own():
    rng, step = np.random.default_rng(4), 2.0**-100
    stiffness, damping = (part @ part.swapaxes(-1, -2) for part in rng.normal(size=(2, 1, 6, 6)))
    preload, deflection, turn = rng.normal(size=(1, 6)), rng.normal(size=(1, 3)), rng.normal(size=(1, 3))
    found = bushing.about(stiffness, damping, preload, 1j * step * deflection, 1j * step * turn)
    either = [bushing.about(stiffness, damping, preload, sign * deflection, sign * turn) for sign in (1e-5, -1e-5)]
    for k in range(3):
        expected = (either[0][k] - either[1][k]) / 2e-5
        assert found[k].imag / step == pytest.approx(expected, rel=0.0, abs=1e-8)


def test_forces_of_elements_that_are_zero_keep_their_slopes():
    rows = np.array([[1.0, 1.0], [1.0, -1.0]])
    forces = least_energy_forces(rows[None], rows[None], np.ones((1, 2)), np.array([[1.0 + 1e-30j, 1.0]]))[0]
    assert forces.real.tolist() == pytest.approx([1.0, 0.0], abs=1e-15)
    assert (forces.imag / 1e-30).tolist() == pytest.approx([0.5, 0.5])


def test_steps_that_let_an_element_take_a_force_at_once_have_no_derivative():
    rows, step = np.array([[1.0, 1.0], [1.0, -1.0], [0.0, 0.0]]), np.zeros((3, 2))
    step[2, 0] = 1.0  # along the rows: their number stays
    needed, root = np.ones((1, 2)) + 0j, np.ones((1, 3))
    assert np.isfinite(least_energy_forces((rows + 1e-30j * step)[None], rows[None], root, needed)).all()
    begins = np.c_[rows, 1e-30j * np.array([0.0, 0.0, 1.0])][None]
    forces = least_energy_forces(begins, begins.real, root, np.c_[needed, 0.0])
    assert np.isnan(forces.imag).all()
    assert forces.real[0].tolist() == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)


def suspended(**spin):
    """A shaft on two bushings; it turns against the ground if it spins."""
    model = mv.Model("shaft", gravity=(0, 0, -9.81))
    model.add_body("shaft", 2.0, (0.02, 0.02, 0.01), position=(0, 0, 0))
    for end, z in (("top", 0.3), ("foot", -0.3)):
        model.add_bushing(end, "ground", "shaft", (0, 0, z), stiffness=(1e5, 2e5, 3e5, 40, 50, 0),
                          damping=(20, 30, 40, 0, 0, 0), preload=(0, 0, 9.81, 0, 0, 0))  # fmt: skip
    model.add_rotor("spin", "shaft", 100.0, (0, 0, 1), **spin)
    return model


def test_bearings_of_spinning_bodies_vary_at_once_where_the_spin_does_not_wind_them_up():
    model = suspended()
    names = ["top.stiffness.x", "foot.damping.y", "shaft.mass"]
    plant = model.compile(parameters=names)
    values = np.outer([1.0, 1.1, 0.7], plant.nominal)
    values[:, 2] = plant.nominal[2]  # its weight is balanced
    batch = plant(values)
    assert plant._plan.at_once(batch.values)
    for i, row in enumerate(values):
        single = model.with_values(dict(zip(names, row, strict=True))).linearize()
        for key in ("M", "C", "K"):
            np.testing.assert_allclose(getattr(batch, key)[i], getattr(single, key), rtol=1e-14, atol=1e-9)
    wound = model.compile(parameters=["top.stiffness.rz"])
    with pytest.raises(mv.ModelError, match="wound up"):
        wound([1.0])


def test_differences_are_for_parameters_that_batches_do_not_take(monkeypatch):
    model = suspended(inertia=0.005)
    factor = mv.Dynamic.of_words({"static": 1.0, "viscous": 0.0, "weights": [0.8], "times": [0.02]})
    model.add_spring("strut", "ground", "shaft", (0.5, 0, 0), (0.1, 0, 0), 1e4, dynamic=factor)
    system, differenced = model.linearize(), []
    extrapolated = Variants._extrapolated
    monkeypatch.setattr(Variants, "_extrapolated", lambda self, at, scale, name: (
        differenced.append(name), extrapolated(self, at, scale, name))[1])  # fmt: skip
    names = ["strut.end.x", "shaft.mass", "top.stiffness.x", "strut.stiffness"]
    directions = [Direction(name, ((name, 1.0),)) for name in names]
    stepped = Variants(system, moves=False).slopes(directions)
    assert differenced == ["'strut.end.x'"]
    monkeypatch.setattr(Variants, "_add_tangents", lambda *_: None)
    slopes = Variants(system, moves=False).slopes(directions)
    for key in ("M", "C", "K"):
        np.testing.assert_allclose(stepped[key], slopes[key], rtol=1e-7, atol=1e-7 * np.abs(slopes[key]).max())
