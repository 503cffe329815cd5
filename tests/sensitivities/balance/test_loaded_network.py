"""Loaded scenes in balance: the stiffness of forces, and derivatives through the equilibrium by one pass for all."""

import numpy as np
import pytest
from hypothesis import assume, example, given, settings

import mbsvib as mv
from mbsvib import library
from mbsvib.sensitivities.forces import geometric_wrenches
from mbsvib.sensitivities.variants import Variants
from tests.sensitivities.differences import assert_as_variants, of_variants
from tests.support.loaded_models import loaded, stiffened
from tests.support.random_models import add_random_ports, rotation, seeds
from tests.support.sizes import examples

QUIET = pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
# What differences of whole equations, extrapolated, agree to; and what rounding leaves of them, of the whole matrix.
RTOL, NOISE = 1e-8, 1e-10


def balanced(seed, make=loaded):
    """A random loaded mechanism with its equations."""
    try:
        model = make(seed, 2, seed % 4, torque=seed % 2 == 1, follower=seed % 4 > 1, floating=seed % 3 == 2)
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0)
    return model, system


def turns_against_locked_translations(joint):
    """Two rotations, the first of which turns the axes of some locked translation, but not of all of them."""
    turns = [name for name, _ in joint.freedom if name[0] == "r"]
    locked = {name for name, _ in joint.locked} & {"x", "y", "z"}
    return joint.kind == "custom" and len(turns) == 2 and len(locked - {turns[0][1]}) == 1


def with_ports(model, rng):
    """With inputs, outputs of all kinds, and a ground that is shaken along some direction."""
    add_random_ports(model, rng, {name: np.array(body.position) for name, body in model.bodies.items()}, base=False)
    model.add_base_motion("base", rng.normal(size=3))
    return model


@pytest.mark.slow
@examples(5, slow=28)
@QUIET
@given(seeds())
@example(3086764)
def test_stiffness_of_forces_and_of_what_the_pose_leaves_over(seed):
    """Forces answer motions by the geometric stiffness, and those along coordinates change by -K as the pose moves."""
    model, system = balanced(seed)
    network = system.sensitivity_basis.network
    found = system.sensitivity_basis.loaded
    if any(turns_against_locked_translations(joint) for joint in model.joints.values()):
        assert found is None
        return
    assert found is not None
    motion = network.coordinates.displacements.reshape(len(network.bodies), 6, system.dof)
    geometric = np.einsum("bim,bin->mn", motion, geometric_wrenches(network.forces, motion, side=1))
    springs = system.row_owner < len(system.provenance.springs)
    rows, k = system.elastic_rows[springs], system.row_stiffness[springs]
    size = np.abs(system.K).max() + np.abs(geometric).max()
    assert np.abs((rows.T * k) @ rows + geometric - system.K).max() <= 1e-13 * size
    count = found.changes.count
    left = found.parameter_rates.T @ found.generalized_force_jacobian[:count] + found.generalized_force_jacobian[count:]
    assert np.abs(left + system.K.T).max() <= 1e-13 * size


@pytest.mark.slow
@examples(1, slow=7)
@QUIET
@given(seeds())
def test_differences_of_whole_equations(seed):
    """Every matrix, to parameters of every kind: by the adjoint, and by variants that let the pose give way."""
    model, _ = balanced(seed, stiffened)
    rng = np.random.default_rng(seed)
    system = with_ports(model, rng).linearize()
    assume(np.linalg.cond(system.K) < 1e8)
    every = system.matrix_derivatives()
    for k in rng.choice(len(every.variables), 5, replace=False).tolist():
        name = every.variables[k]
        expected = of_variants(system, name)
        assert_as_variants(every, k, system, expected, system.parameters[name], RTOL, NOISE)


@pytest.mark.slow
@examples(3, slow=6)
@QUIET
@given(seeds())
def test_every_answer_agrees_with_the_matrices(seed):
    """Eigenvalues and responses ask other pairs of motions than the matrices do."""
    model, _ = balanced(seed, stiffened)
    rng = np.random.default_rng(seed)
    system = with_ports(model, rng).linearize()
    names = [str(name) for name in rng.choice(list(system.parameters), 6, replace=False)]
    change, omega = system.matrix_derivatives(names), np.array([3.0, 40.0])
    found = system.frequency_response_sensitivities(omega, names)
    for i, w in enumerate(omega):
        s = 1j * w
        t = np.linalg.inv(system.K + s * system.C + s * s * system.M)
        seen, right = system.Cq + s * system.Cv + s * s * system.Ca, t @ system.B
        for k in range(len(names)):
            moved = change.Cq[k] + s * change.Cv[k] + s * s * change.Ca[k]
            inner = change.B[k] - (change.K[k] + s * change.C[k] + s * s * change.M[k]) @ right
            expected = change.D[k] + moved @ right + seen @ t @ inner
            size = np.abs(expected).max() + np.abs(seen) @ np.abs(t) @ np.abs(inner)
            noise = 1e-12 * np.abs(seen @ right).max() / max(abs(system.parameters[names[k]]), 1.0)
            assert (np.abs(found[k, :, :, i] - expected) <= 1e-9 * size + noise).all()
    values = system.modes().eigenvalues
    apart = np.abs(values[:, None] - values) + np.eye(len(values)) * np.abs(values).max()
    assume(apart.min() > 1e-4 * np.abs(values).max())
    slopes = system.eigenvalue_sensitivities(names)
    for i, value in enumerate(values):
        t = system.K + value * system.C + value**2 * system.M
        left, _, right = np.linalg.svd(t)
        x, y = right[-1].conj(), left[:, -1].conj()
        norm = y @ (2 * value * system.M + system.C) @ x
        for k in range(len(names)):
            work = (change.K[k] + value * change.C[k] + value**2 * change.M[k]) @ x
            assert abs(slopes[k, i] + y @ work / norm) <= 1e-6 * np.abs(y) @ np.abs(work) / abs(norm) + 1e-12


@pytest.mark.slow
def test_no_variant_is_made(monkeypatch):
    """Loads, preloads, free lengths, gravity, geometry: all 334 numbers of the platform, and its responses."""
    model = library.stewart()
    model.gravity = (0, 0, -9.81)
    system = model.equilibrium().linearize()
    monkeypatch.setattr(Variants, "slopes", lambda *_: pytest.fail("a variant was asked for"))
    assert np.isfinite(system.eigenvalue_sensitivities()).all()
    assert np.isfinite(system.frequency_response_sensitivities([10.0, 300.0], "leg*.k.stiffness")).all()
    assert np.isfinite(system.mode_sensitivities("platform.mass").shapes).all()
    assert system.h2_norm(parameters="platform.position.z").slopes.shape == (1,)


def test_variables_that_tie_parameters():
    """A tie moves the pose by the sum of what its parameters do."""
    model = library.stewart()
    model.gravity = (0, 0, -9.81)
    system = model.equilibrium().linearize()
    legs = [name for name in system.parameters if name.endswith(".upper.mass")]
    each, tied = system.eigenvalue_sensitivities(legs), system.eigenvalue_sensitivities("*.upper.mass")
    mapped = system.eigenvalue_sensitivities({"heavier": dict.fromkeys(legs, 2.0), "stiff": {"leg1.k.stiffness": 1.0}})
    size = np.abs(each).max()
    groups = _groups(system.modes().eigenvalues)
    for group in groups:  # branches of repeated eigenvalues are sorted anew, their sums are not
        assert np.abs((tied[0] - each.sum(axis=0))[group].sum()) <= 1e-12 * size
        assert np.abs((mapped[0] - 2 * tied[0])[group].sum()) <= 1e-12 * size


def _groups(values):
    near = np.abs(values[:, None] - values) <= 1e-9 * np.abs(values)
    return [np.flatnonzero(row) for row in np.unique(near, axis=0)]


def test_a_torque_makes_a_symmetric_pair_flutter():
    """K gets t/2 [[0, 1], [-1, 0]]: squares of the frequencies part by +- i t / 2 I."""
    model = mv.Model("top")
    model.add_body("body", 2.0, (0.3, 0.3, 0.2))
    model.add_joint("tip", "spherical", "ground", "body", position=(0, 0, 0))
    model.add_bushing("k", "ground", "body", (0, 0, 0), (0, 0, 0, 50, 50, 70))
    model.add_load("drive", "body", force=(0, 0, 1.0))
    system = model.linearize()
    found = system.eigenvalue_sensitivities("drive.torque.z")[0]
    omega = np.sqrt(50 / 0.3)
    part = 1 / (4 * 0.3 * omega)
    assert np.sort(found.real) == pytest.approx([-part, -part, 0, 0, part, part], rel=1e-13)
    assert np.abs(found.imag).max() <= 1e-14 * part


def test_a_pin_that_a_planar_loop_cannot_tilt():
    """Redundant constraints: tilting one pin of a loop takes its freedom, moving it does not."""
    system = library.four_bar().linearize()
    found = system.eigenvalue_sensitivities(["B.orientation.rx", "B.position.x", "coupler.mass"])
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1:]).all()


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(seeds())
def test_what_loads_a_free_motion_is_told_from_rounding(seed):
    """A gate on an upright hinge turns freely: its weight does not, but tilting the hinge would swing it."""
    rng = np.random.default_rng(seed)
    turn, centre = rotation(rng), 10.0 * rng.normal(size=3)
    model = mv.Model("gate", gravity=9.81 * turn @ (0, 0, -1))
    model.add_body("gate", 30.0, (2.0, 3.0, 4.0), position=centre + turn @ (0.6, 0.1, 0.3))
    model.add_joint("hinge", "revolute", "ground", "gate", position=centre, axis=turn @ (0, 0, 1))
    system = model.linearize()
    still = ["gate.mass", "gate.position.x", "hinge.position.y", "gate.inertia.xx"]
    assert (system.eigenvalue_sensitivities(still) == 0.0).all()
    up = {"up": {f"gravity.{axis}": float(value) for axis, value in zip("xyz", turn @ (0, 0, 1), strict=True)}}
    assert (system.eigenvalue_sensitivities(up) == 0.0).all()
    for other in ("hinge.orientation", "gravity"):
        away = {"away": {f"{other}.{axis}": float(value) for axis, value in zip(
            ("rx", "ry", "rz") if "hinge" in other else "xyz", turn @ (1, 0.5, 0), strict=True)}}  # fmt: skip
        with pytest.raises(mv.ModelError, match="'away' moves the equilibrium of 'gate' along a motion that no"):
            system.eigenvalue_sensitivities(away)


def test_rotations_that_turn_against_locked_translations_are_refused_by_name():
    """No parameter of the joint says what it is in the next pose, so that nothing can follow the equilibrium."""
    model = mv.Model("slide", gravity=(3.0, 0.0, -9.81))
    model.add_body("b", 2.0, (0.1, 0.2, 0.3), (0.1, 0.2, 0.3))
    model.add_joint("table", None, "ground", "b", (0.1, 0.2, 0.3), free=["x", "y", "rx", "ry"])
    model.add_bushing("k", "ground", "b", (0.2, 0.1, 0.4), (400.0, 500.0, 600.0, 30.0, 40.0, 50.0))
    system = model.equilibrium(preload=True).linearize()
    with pytest.raises(mv.ModelError, match=r"joint 'table': its free rotations have turned against its locked"):
        system.eigenvalue_sensitivities(["b.position.x"])
    assert np.isfinite(system.eigenvalue_sensitivities(["k.damping.x"])).all()
