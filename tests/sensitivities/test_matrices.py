"""Derivatives of the matrices: closed forms, differences of the whole computation, factors of low rank."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import mbsvib as mv
from mbsvib.equations.matrices import MATRICES
from tests.sensitivities.differences import difference
from tests.support.random_models import planar, seeds, spatial
from tests.support.sizes import examples


def pendulum():
    model = mv.Model("pendulum")
    model.add_body("bob", 3.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("spiral", "ground", "bob", (0, 0, 0), (0, 0, 0, 0, 40.0, 0), damping=(0, 0, 0, 0, 2.0, 0))
    model.add_input("push", "bob", "z")
    model.add_base_motion("floor", "z")
    model.add_output("way", "bob", "z")
    model.add_output("felt", "bob", "z", quantity="acceleration")
    return model


def test_pendulum_in_closed_form():
    """M = I + m r^2, and ports at the centre of mass see -r of the rotation about y."""
    result = pendulum().linearize().matrix_derivatives(["bob.mass", "bob.position.x", "spiral.stiffness.ry",
                                                       "spiral.damping.ry"])  # fmt: skip
    assert result.M[:, 0, 0] == pytest.approx([0.25, 3.0, 0, 0], rel=1e-15, abs=1e-15)
    assert result.C[:, 0, 0] == pytest.approx([0, 0, 0, 1.0], abs=1e-15)
    assert result.K[:, 0, 0] == pytest.approx([0, 0, 1.0, 0], abs=1e-15)
    assert result.B[:, 0] == pytest.approx(np.array([[0, 0.5], [-1.0, 3.0], [0, 0], [0, 0]]), rel=1e-15)
    assert result.Cq[:, 0, 0] == pytest.approx([0, -1.0, 0, 0], abs=1e-15)
    assert result.Ca[:, 1, 0] == pytest.approx([0, -1.0, 0, 0], abs=1e-15)
    assert not result.D.any()


def test_ranks_are_those_of_the_change():
    system = mv.library.stewart().linearize()
    result = system.matrix_derivatives(["leg1.k.stiffness", "platform.mass", "leg2.head.position.x"])
    ranks = [result.factors(name, key)[0].shape[1] for name, key in
             (("leg1.k.stiffness", "K"), ("platform.mass", "M"), ("leg1.k.stiffness", "M"))]  # fmt: skip
    assert ranks == [1, 3, 0]
    for row, name in enumerate(result.variables):
        for key in "MCK":
            p, q = result.factors(name, key)
            full = getattr(result, key)[row]
            assert np.abs(p @ q.T + q @ p.T - full).max() <= 1e-12 * np.abs(full).max(initial=1e-300)


def test_ties_add_up():
    system = mv.library.stewart().linearize()
    single = system.matrix_derivatives(["leg1.k.stiffness", "leg2.k.stiffness", "platform.mass"])
    tied = system.matrix_derivatives({"design": {"leg[12].k.stiffness": 3.0, "platform.mass": -0.5}})
    rates = np.array([3.0, 3.0, -0.5])
    for key in "MK":
        assert np.allclose(getattr(tied, key)[0], np.tensordot(rates, getattr(single, key), axes=1), rtol=1e-13)
        p, q = tied.factors("design", key)
        assert np.allclose(p @ q.T + q @ p.T, getattr(tied, key)[0], rtol=1e-12, atol=1e-12)


def test_unknown_names_are_refused_with_the_nearest():
    system = pendulum().linearize()
    with pytest.raises(mv.ModelError, match=r"Did you mean 'bob\.mass'"):
        system.matrix_derivatives("bob.masss")
    result = system.matrix_derivatives("bob.mass")
    with pytest.raises(mv.ModelError, match=r"no 'bob\.mas'.*Did you mean 'bob\.mass'"):
        result.factors("bob.mas", "M")
    with pytest.raises(mv.ModelError, match="no 'B'"):
        result.factors("bob.mass", "B")


@pytest.mark.slow
@examples(4, slow=12)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(st.one_of(seeds().map(lambda seed: spatial(seed, bodies=3, loops=seed % 3)),
                 seeds().map(lambda seed: planar(seed, bodies=3, loops=1))), seeds())  # fmt: skip
def test_differences_of_random_mechanisms(model, seed):
    try:
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    retained = [group.retained for group in system.provenance.reduction.groups]
    assume(min(retained, default=1.0) > 0.05)
    result = system.matrix_derivatives()
    names = list(system.parameters)
    for k in np.random.default_rng(seed).choice(len(names), size=6, replace=False):
        if np.isnan(result.M[k]).any():
            continue
        expected = difference(model, system, names[k], lambda s: [getattr(s, key) for key in MATRICES])
        for key, matrix in zip(MATRICES, expected, strict=True):
            size = np.abs(getattr(system, key)).max(initial=0.0)
            limit = 1e-7 * np.abs(matrix).max(initial=0.0) + 1e-9 * size
            assert np.abs(getattr(result, key)[k] - matrix).max(initial=0.0) <= limit, (names[k], key)


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(seeds(), st.integers(0, 2))
def test_coordinates_of_bodies_that_float_go_with_their_centres_of_mass(seed, loops):
    """Mass does not couple them with rotations, wherever the centre is; what hangs on the body follows."""
    try:
        model = spatial(seed, 3, loops, floating=True)
        system = model.linearize()
    except mv.SingularPoseError:
        assume(False)
    topology = system.provenance.topology
    roots = [topology.bodies[k] for k in topology.floating]
    assume(roots)
    names = [f"{roots[0]}.position.{axis}" for axis in "xyz"]
    result = system.matrix_derivatives(names)
    for k, name in enumerate(names):
        expected = difference(model, system, name, lambda s: [getattr(s, key) for key in MATRICES])
        for key, at in zip(MATRICES, expected, strict=True):
            size = np.abs(getattr(system, key)).max(initial=0.0)
            error = np.abs(getattr(result, key)[k] - at).max(initial=0.0)
            assert error <= 1e-7 * max(np.abs(at).max(initial=0.0), size)
