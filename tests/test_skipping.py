"""What a scene does not need is not computed, and would change nothing if it were."""

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import mbsvib as mv
from mbsvib.equations import assembly, draft
from mbsvib.equations import scene as scenes
from mbsvib.kinematics import loops, mobility
from mbsvib.modes import damped, undamped
from mbsvib.modes import result as modal
from mbsvib.responses import frequency_response
from tests.stress.families import wide
from tests.support import overconstrained
from tests.support.compare import assert_same_eigenvalues
from tests.support.random_models import planar, spatial
from tests.support.sizes import few

MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
OMEGA = np.array([1.0, 30.0, 900.0])


def never(monkeypatch, module, *names):
    """Make a step fail where it is taken."""

    def taken(*_, **__):
        raise AssertionError("a step that this scene does not need was taken")

    for name in names:
        monkeypatch.setattr(module, name, taken)


def counting(monkeypatch, module, name):
    calls, step = [], getattr(module, name)

    def counted(*args, **words):
        calls.append(name)
        return step(*args, **words)

    monkeypatch.setattr(module, name, counted)
    return calls


def assert_same(first, second, rtol=0.0):
    for key in MATRICES:
        a, b = getattr(first, key), getattr(second, key)
        assert_allclose(a, b, rtol=0, atol=rtol * np.abs(b).max(initial=0.0), err_msg=key)


@pytest.mark.slow
def test_no_loop_no_second_transformation(monkeypatch):
    """B'' of an open tree is not formed; formed as the identity it changes no bit."""
    model = spatial(4, bodies=4)
    reduced = scenes.reduce

    def forced(*args):
        result = reduced(*args)
        assert result.matrix is None
        return replace(result, matrix=np.eye(len(result.independent)))

    with monkeypatch.context() as patch:
        never(patch, loops, "_solve", "pivoted_qr")
        plain = model.linearize()
    with monkeypatch.context() as patch:
        patch.setattr(scenes, "reduce", forced)
        full = model.linearize()
    for key in MATRICES:
        assert_array_equal(getattr(plain, key), getattr(full, key), err_msg=key)
    assert "no closed loops: the cut-joint matrix B'' was not needed" in plain.explain()


@pytest.mark.slow
def test_no_redundant_row_no_look_at_the_poses_nearby(monkeypatch):
    """Forced, the look finds the same rank and lets the pose pass."""
    model = mv.library.stewart()
    with monkeypatch.context() as patch:
        never(patch, mobility, "phi_nearby")
        plain = model.linearize()
    assert "neighbouring poses were not checked" in plain.explain()
    check, looked = mobility.check_mobility, counting(monkeypatch, mobility, "phi_nearby")

    def forced(topology, coordinates, cuts, reduction, position):
        groups = tuple(SimpleNamespace(**vars(group), surplus=1) for group in reduction.groups)
        check(topology, coordinates, cuts, replace(reduction, groups=groups), position)

    monkeypatch.setattr(assembly, "check_mobility", forced)
    full = model.linearize()
    assert looked
    for key in MATRICES:
        assert_array_equal(getattr(plain, key), getattr(full, key), err_msg=key)


def test_redundant_rows_get_names_when_these_are_asked_for(monkeypatch):
    """Without loads and outputs of forces in joints, for which they are."""
    model = mv.library.four_bar()
    named = counting(monkeypatch, loops, "redundant_rows")
    system = model.with_parts(springs={}, outputs={}, gravity=None).linearize()
    system.modes()
    assert not named
    assert len(system.redundant) == 3
    assert system.redundant == system.redundant
    assert len(named) == 1


def test_redundant_rows_are_looked_at(monkeypatch):
    looked = counting(monkeypatch, mobility, "phi_nearby")
    system = overconstrained.bennett()[0].linearize()
    assert looked
    assert "were not checked" not in system.explain()


def test_loops_of_fixed_joints_change_nothing():
    """Welds beside welds: every row redundant, the same equations as without them."""

    def welded(spare):
        model = mv.Model("welded")
        for i in range(4):
            model.add_body(f"b{i}", 1.0 + i, (0.1, 0.2, 0.25), (i, 0.1 * i, 0.0))
        model.add_joint("hinge", "revolute", "ground", "b0", (-0.5, 0, 0))
        for i in range(3):
            model.add_joint(f"weld{i}", "fixed", f"b{i}", f"b{i + 1}")
        if spare:
            model.add_joint("spare", "fixed", "b0", "b2")
            model.add_joint("another", "fixed", "b3", "b1")
        model.add_bushing("k", "ground", "b3", (2, 0, 0), (100.0,) * 6, (0.1,) * 6)
        model.add_input("F", "b2", "y")
        model.add_output("y", "b3", "y")
        return model

    plain, full = welded(False).linearize(), welded(True).linearize()
    assert full.redundant == tuple(f"{w}.{d}" for w in full.cut_joints for d in ("x", "y", "z", "rx", "ry", "rz"))
    assert_same(plain, full, 1e-15)


def test_springs_that_nothing_moves_are_left_out():
    """A bushing between welded bodies, and rows across a hinge: kept, they are rows of zeros."""
    model = mv.Model("idle")
    model.add_body("a", 1.0, (0.1, 0.1, 0.1), (1, 0, 0))
    model.add_body("b", 1.0, (0.1, 0.1, 0.1), (2, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "a", (0, 0, 0))
    model.add_joint("weld", "fixed", "a", "b")
    model.add_bushing("idle", "a", "b", (1.5, 0, 0), (1e9,) * 6, (1e3,) * 6)
    model.add_bushing("k", "ground", "a", (0, 0, 0), (1e9, 1e9, 1e9, 1e9, 1e9, 50.0))
    system = model.linearize()
    assert len(system.row_stiffness) == 1
    assert "as no motion of the mechanism strains them: idle" in system.explain()
    scene = assembly.scene(model)
    relative = scene.relative()
    reduction = scene.reduced(scene.closure(relative))
    full = draft.matrices(scene, draft.minimal_rows(scene, relative, reduction), closed=reduction.matrix is not None)
    assert len(full.row_stiffness) == 12
    for key in MATRICES:
        assert_array_equal(getattr(system, key), getattr(full, key), err_msg=key)


@pytest.mark.parametrize("kind", ["undamped", "proportional", "commuting"])
def test_classical_damping_takes_no_problem_of_twice_the_size(monkeypatch, kind):
    """The coupled solver, forced on the same scene, gives the same eigenvalues to rounding."""
    words = {"damping": (0,) * 6} if kind == "undamped" else {}
    model = mv.library.chain(8, line=(0, 1, 0), **words)
    if kind == "commuting":  # two equal pendulums: what couples them commutes, though not in proportion to stiffness
        model = mv.Model("twins")
        for i in range(2):
            model.add_body(f"b{i}", 1.0, (0.1, 0.1, 0.1), (i, 0, 0))
            model.add_joint(f"j{i}", "revolute", "ground", f"b{i}", (i, 1, 0))
            model.add_bushing(f"s{i}", "ground", f"b{i}", (i, 1, 0), (0, 0, 0, 0, 0, 90.0), (0, 0, 0, 0, 0, 0.25))
        model.add_bushing("link", "b0", "b1", (0.5, 1, 0), (0, 0, 0, 0, 0, 40.0), (0, 0, 0, 0, 0, 0.5))
    with monkeypatch.context() as patch:
        never(patch, damped, "_coupled")
        plain = model.linearize()
        values = plain.modes(rtol=1e-12).eigenvalues
        response = plain.frequency_response(OMEGA) if plain.inputs else None
    assert "no eigenvalue problem of twice the size was solved" in plain.explain()
    calls = counting(monkeypatch, damped, "_coupled")

    def forced(system, basis, follows_stiffness):
        rows = system.elastic_rows @ basis.shapes
        return "", rows.T @ (system.row_damping[:, None] * rows)

    monkeypatch.setattr(damped, "classical_damping", forced)
    monkeypatch.setattr(modal, "proportional", lambda c, k: False, raising=False)
    full = model.linearize()
    assert_same_eigenvalues(full.modes(rtol=1e-12).eigenvalues, values, rtol=4e-15 if kind != "commuting" else 1e-14)
    assert calls
    if response is not None:
        assert_allclose(full.frequency_response(OMEGA), response, rtol=1e-12)


@pytest.mark.slow
def test_a_damper_that_couples_takes_it(monkeypatch):
    calls = counting(monkeypatch, damped, "_coupled")
    system = spatial(11, bodies=3).linearize()
    assert not system.modes().classical
    assert calls
    assert "twice the size" not in system.explain()


@pytest.mark.few(1)
@pytest.mark.parametrize("name", few(["chain", "stewart", "ladder"], 2))
def test_higher_rungs_of_the_ladder_are_not_climbed(monkeypatch, name):
    """Singular values and Jacobi rotations, forced, give the same frequencies within the errors that are promised."""
    model = getattr(mv.library, name)(**({"line": (0, 1, 0)} if name == "chain" else {}))
    with monkeypatch.context() as patch:
        never(patch, undamped, "by_factors", "by_jacobi")
        plain = model.linearize()
        plain.modes()
    assert "no singular values of the factors, no Jacobi rotations" in plain.explain()
    full = model.linearize()
    calls = counting(monkeypatch, undamped, "by_factors") + counting(monkeypatch, undamped, "by_jacobi")
    climbed = undamped.undamped(full, 0.0)
    del calls
    assert climbed.method in ("products", "factors", "jacobi")
    result = plain.modes()
    assert_allclose(climbed.omega, np.sort(result.natural), rtol=float(result.errors.max() + climbed.errors.max()))


def test_the_ladder_is_climbed_where_it_has_to_be():
    """Stiffness over twelve and mass over eight decades."""
    solvers = {wide(seed, bodies=8).linearize().modes(rtol=1e-13).solver for seed in range(4)}
    assert solvers - {"products"}


@pytest.mark.slow
def test_responses_of_separate_modes_solve_nothing_frequency_by_frequency(monkeypatch):
    never(monkeypatch, frequency_response, "_solved", "direct_solutions")
    system = spatial(11, bodies=3).linearize()
    system.frequency_response(OMEGA)
    assert "responses are sums over modes" in system.explain()


@pytest.mark.slow
def test_modes_are_computed_once(monkeypatch):
    system = mv.library.stewart().linearize()
    assert "no mode and no response was requested yet" in system.explain()
    system.modes()
    system.frequency_response(OMEGA)
    never(monkeypatch, modal, "modes")
    assert system.modes() is system.modes()
    system.frequency_response(2 * OMEGA)
    system.poles()


LEAN = """
import sys
import mbsvib as mv
model = mv.Model("lean")
model.add_body("a", 1.0, (0.1, 0.1, 0.1), (1, 0, 0))
model.add_joint("hinge", "revolute", "ground", "a", (0, 0, 0))
model.add_bushing("k", "ground", "a", (0, 0, 0), (0, 0, 0, 0, 0, 50.0))
system = model.linearize()
print(" ".join(sorted(name for name in sys.modules if name.startswith(("mbsvib", "scipy.sparse")))))
"""


@pytest.mark.slow
def test_parts_of_the_program_that_a_scene_does_not_need_are_not_loaded():
    """Neither batches, sparse factors nor anything of modes and responses."""
    answer = subprocess.run([sys.executable, "-c", LEAN], capture_output=True, text=True, check=True)
    loaded = answer.stdout.split()
    for name in (
            "mbsvib.sparse", "mbsvib.equations.batch_assembly", "mbsvib.modes", "mbsvib.modes.damped",
            "mbsvib.modes.undamped", "mbsvib.modes.general", "mbsvib.responses.frequency_response",
            "mbsvib.responses.time_response", "mbsvib.responses.state_space", "scipy.sparse.linalg"
    ):  # fmt: skip
        assert name not in loaded


@pytest.mark.parametrize("model", [spatial(3, bodies=4), planar(5, bodies=4, loops=1)], ids=["tree", "loop"])
def test_outputs_that_are_not_asked_for_change_nothing(model):
    """Of a model with fewer ports the same rows and columns come out, bit for bit."""
    lean = mv.Model(model.name)
    for part in (*model.bodies.values(), *model.joints.values(), *model.springs.values(), *model.inputs.values()):
        getattr(lean, mv.api.model.ADDERS[type(part)])(**part.constructor_kwargs())
    retained = [name for i, name in enumerate(model.outputs) if i % 3 == 0]
    for name in retained:
        part = model.outputs[name]
        getattr(lean, mv.api.model.ADDERS[type(part)])(**part.constructor_kwargs())
    full, part = model.linearize(), lean.linearize()
    rows = [full.outputs.index(name) for name in retained]
    for key in ("M", "C", "K", "B"):
        assert_array_equal(getattr(part, key), getattr(full, key))
    for key in ("Cq", "Cv", "Ca", "D"):
        assert_array_equal(getattr(part, key), getattr(full, key)[rows])
    assert_allclose(part.frequency_response(OMEGA), full.frequency_response(OMEGA)[rows], rtol=1e-13,
                    atol=1e-15 * np.abs(full.frequency_response(OMEGA)).max())  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_planar_loops_that_lose_all_they_can_are_not_moved(monkeypatch, seed):
    """A pose nearby would say the same: as many constraints are independent there."""
    model = planar(seed, bodies=5, loops=2)
    calls = counting(monkeypatch, mobility, "phi_nearby")
    system = model.linearize()
    assert not calls
    assert "planar loops with the largest possible constraint rank: neighbouring poses" in system.explain()
    monkeypatch.setattr(mobility, "_stays_planar", lambda *_: False)
    forced = model.linearize()
    assert calls
    assert_array_equal(system.K, forced.K)
