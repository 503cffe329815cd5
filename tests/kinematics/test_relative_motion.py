"""From coordinates to displacements of bodies, and to what two bodies do relative to each other."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support.compare import linearized
from tests.support.exact import Exact
from tests.support.random_models import closed_loops, open_trees, planar_loops, seeds, spatial
from tests.support.sizes import examples

ANY = st.one_of(open_trees(), open_trees(floating=st.just(True)), closed_loops(), planar_loops())
FAR = st.one_of(open_trees(offset=st.just(1e4)), closed_loops(offset=st.just(1e4)), planar_loops(offset=st.just(1e4)))


@pytest.mark.slow
@examples(15, slow=40)
@given(st.one_of(ANY, FAR))
def test_displacements_of_the_bodies(model):
    """Every body's displacement per unit coordinate, near the origin and 10 km away from it."""
    system, reference = linearized(model), Exact(model)
    assert system.dof == reference.dof
    exact = reference.minimal(system.coordinates)["T"].reshape(len(system.bodies), 6, system.dof)
    moved = system.displacements(np.eye(system.dof))
    assert list(moved) == list(model.bodies)
    for name, expected in zip(system.bodies, exact, strict=True):
        assert_allclose(moved[name], expected, rtol=0, atol=2e-13 * max(1.0, np.abs(exact).max(initial=0)))


@pytest.mark.slow
@examples(20, slow=40)
@given(st.one_of(ANY, FAR), seeds())
def test_displacements_meet_every_constraint(model, seed):
    system, reference = linearized(model), Exact(model)
    q = np.random.default_rng(seed).normal(size=system.dof)
    moved = system.displacements(q)
    size = max((np.abs(x).max() for x in moved.values()), default=1.0)
    assert reference.violation(moved) <= 1e-13 * max(size, 1.0)


@pytest.mark.slow
@given(closed_loops(), seeds())
def test_coordinates_are_relative_displacements_of_their_joints(model, seed):
    """The displacement of a joint's second body against its first one, read at the joint, is the coordinate."""
    system = linearized(model)
    q = np.random.default_rng(seed).normal(size=system.dof)
    moved = {"ground": np.zeros(6)} | system.displacements(q)
    centre = {"ground": np.zeros(3)} | {name: np.array(body.position) for name, body in model.bodies.items()}
    for name, value in zip(system.coordinates, q, strict=True):
        joint, direction = name.rsplit(".", 1)
        if joint not in model.joints or direction in ("x", "y", "z") or model.joints[joint].kind == "universal":
            continue
        part = model.joints[joint]
        turned = moved[part.second][3:] - moved[part.first][3:]
        assert np.dot(np.array(part.axes)[:, "xyz".index(direction[1])], turned) == pytest.approx(value, abs=1e-12)
    assert set(centre) == set(moved)


def chain(n, at=0.0):
    model = mv.Model("chain")
    below = "ground"
    for i in range(n):
        model.add_body(f"b{i}", 1.0, (0.1, 0.1, 0.1), position=(at, 0.3 * i + 0.15, 0.01 * i))
        turn = (0.1 * i, 0.2, 0.3)
        model.add_joint(f"j{i}", "universal", below, f"b{i}", position=(at, 0.3 * i, 0), orientation=turn)
        below = f"b{i}"
    return model


def test_relative_rows_involve_only_the_joints_between():
    """By the path rule: the joints below both bodies leave exact zeros, not differences of rounded numbers."""
    model = chain(30, at=1e4)
    model.add_bushing("k", "b20", "b22", (1e4, 6.3, 0.2), (1e5, 2e5, 3e5, 1e3, 2e3, 3e3))
    model.add_output("gap", "b22", "y", relative_to="b20")
    system = model.linearize()
    between = {name for name in system.coordinates if name.split(".")[0] in ("j21", "j22")}
    row = dict(zip(system.coordinates, system.Cq[0], strict=True))
    assert not [name for name, value in row.items() if value != 0 and name not in between]
    touched = [name for name, column in zip(system.coordinates, system.K.T, strict=True) if column.any()]
    assert set(touched) == between


@pytest.mark.slow
def test_relative_rows_keep_their_digits_on_long_arms():
    """Two bodies a millimetre apart at the end of 10 km: differences of displacements would lose seven digits."""
    model = chain(12, at=1e4)
    model.add_body("probe", 0.1, (1e-6, 1e-6, 1e-6), position=(1e4, 3.45, 0.111))
    model.add_joint("pin", "revolute", "b11", "probe", position=(1e4, 3.4505, 0.111), axis=(0, 0, 1))
    for direction in ("x", "y", "z", "rx"):
        model.add_output(direction, "probe", direction, relative_to="b11")
    system, reference = model.linearize(), Exact(model)
    assert_allclose(system.Cq, reference.minimal(system.coordinates)["Cq"], rtol=1e-15, atol=1e-19)


@pytest.mark.slow
@given(seeds())
def test_displacements_are_linear_and_take_many_columns(seed):
    system = spatial(seed, bodies=3, ports=False).linearize()
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(system.dof, 4)) + 1j * rng.normal(size=(system.dof, 4))
    many = system.displacements(q)
    for k in range(4):
        for name, x in system.displacements(list(q[:, k])).items():
            assert_allclose(many[name][:, k], x, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("q", [np.zeros(3), np.zeros((5, 4)), 1.0, np.zeros((4, 1, 1)), []])
def test_coordinates_of_another_number_are_refused(q):
    with pytest.raises(mv.ResponseError, match=r"q has shape .*expected \(4,\)"):
        chain(2).linearize().displacements(q)
