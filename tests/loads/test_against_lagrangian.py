"""K of loaded mechanisms against the Hessian of V + lambda . phi, differentiated by CasADi."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.elements.joint_kinds import KINDS as JOINTS
from tests.support.lagrangian import projected
from tests.support.loaded_models import loaded
from tests.support.random_models import KINDS
from tests.support.sizes import few

SCENES = {
    "trees": {"bodies": 4},
    "floating": {"bodies": 3, "floating": True},
    "loops": {"bodies": 4, "loops": 1},
    "two loops": {"bodies": 5, "loops": 2},
    "dead loads and torques": {"bodies": 4, "loops": 1, "hold": "loads", "torque": True},
    "followers": {"bodies": 4, "loops": 1, "hold": "loads", "torque": True, "follower": True},
    "couplers": {"bodies": 4, "couplers": 2},
    "couplers in loops": {"bodies": 4, "loops": 1, "couplers": 2, "hold": "loads", "torque": True, "follower": True},
    "far from the origin": {"bodies": 3, "loops": 1, "offset": 100.0},
}


def linearized(seed, cut=None, **words):
    model = loaded(seed, **words)
    try:
        return model, model.linearize(cut=cut)
    except mv.SingularPoseError:  # more constraints than the random bodies have freedom
        return model, None


def off(model, system):
    """Largest difference of K and of M, relative to the largest entries."""
    stiffness, mass, residual = projected(model, system)
    assert np.abs(residual).max(initial=0.0) < 1e-6
    return max(np.abs(stiffness - system.K).max() / np.abs(stiffness).max(),
               np.abs(mass - system.M).max() / np.abs(mass).max())  # fmt: skip


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mbsvib.NearSingularWarning")
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("seed", few([1, 0, *range(2, 8)], 1))
def test_stiffness_of_random_mechanisms(scene, seed):
    model, system = linearized(seed, **SCENES[scene])
    if system is None or not system.dof:
        pytest.skip("the random bodies are locked")
    assert off(model, system) < (1e-10 if scene != "far from the origin" else 1e-9)


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", [*JOINTS, "custom"])
@pytest.mark.parametrize("seeds", few([range(1), range(1, 6)], 1))
def test_every_kind_of_joint(kind, seeds):
    compared = 0
    for seed in seeds:
        model, system = linearized(seed, bodies=3, kinds=(kind,))
        if system is not None and system.dof:
            compared += 1
            assert off(model, system) < 1e-10
    assert compared or kind in ("fixed", "custom")


@pytest.mark.few(2)
@pytest.mark.parametrize("kind", few(["x rx rz", "universal", "screw", "distance", "y z ry rx", "custom", *JOINTS], 4))
@pytest.mark.parametrize("seeds", few([range(1), range(1, 6)], 1))
def test_every_kind_of_joint_at_which_a_loop_is_cut(kind, seeds):
    """Joints of several axes have their frame in any order of these: the sign of an opening is that of its row."""
    for seed in seeds:
        model, system = linearized(seed, ["j2"], bodies=2, loops=1, kinds=("free",), closing_kinds=(kind,))
        assert off(model, system) < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind not in ("fixed", "distance")])
def test_couplers_on_every_kind_of_joint(kind):
    model, system = linearized(1, bodies=3, couplers=1, kinds=(kind,))
    assert off(model, system) < 1e-10


@pytest.mark.few(1)
@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind not in ("fixed", "distance")])
@pytest.mark.parametrize("seed", few([1, 0, *range(2, 5)], 1))
def test_couplers_on_joints_at_which_loops_are_cut(kind, seed):
    model, system = linearized(seed, ["j2"], bodies=2, loops=1, couplers=2, kinds=("free",), closing_kinds=(kind,))
    terms = {name.rpartition(".")[0] for coupler in model.couplers.values() for name, _ in coupler.terms}
    assert "j2" in terms
    assert off(model, system) < 1e-10


def test_the_kinds_compared_are_all_there_are():
    assert set(KINDS) >= {*JOINTS, "custom"}


@pytest.mark.few(2)
@pytest.mark.parametrize("seed", range(4))
def test_factors_make_the_matrix(seed):
    _, system = linearized(seed, bodies=4, loops=1, hold="loads", torque=True, follower=True)
    rows, k = system.elastic_rows, system.row_stiffness
    n = 0.0 if system.circulatory is None else system.circulatory
    assert np.abs(rows.T @ (k[:, None] * rows) + n - system.K).max() < 1e-13 * np.abs(system.K).max()
    if system.circulatory is not None:
        assert (system.circulatory == -system.circulatory.T).all()


@pytest.mark.slow
def test_geometric_stiffness_is_not_small_here():
    """A negative control: without K_g the comparison fails by much."""
    model, system = linearized(3, bodies=4)
    elastic = system.row_owner < len(system.provenance.springs)
    rows, k = system.elastic_rows[elastic], system.row_stiffness[elastic]
    stiffness, _, _ = projected(model, system)
    assert np.abs(stiffness - rows.T @ (k[:, None] * rows)).max() > 0.1 * np.abs(stiffness).max()
