"""Sensitivities of eigenvalues: closed forms, differences of the whole computation, repeated eigenvalues."""

import numpy as np
import pytest
from hypothesis import assume, given

import mbsvib as mv
from tests.sensitivities.differences import assert_derivative, difference, eigenvalues, step_of
from tests.support.random_models import planar, seeds, spatial
from tests.support.sizes import examples


def oscillator(mass=2.0, stiffness=800.0, damping=3.0):
    model = mv.Model("oscillator")
    model.add_body("mass", mass, (1.0, 1.0, 1.0))
    model.add_joint("rail", "prismatic", "ground", "mass")
    model.add_spring("spring", "ground", "mass", (0, 0, -1), (0, 0, 0), stiffness, damping)
    return model


def test_oscillator_in_closed_form():
    system = oscillator().linearize()
    value = system.modes().eigenvalues
    result = system.eigenvalue_sensitivities(["mass.mass", "spring.damping", "spring.stiffness"])
    slope = 2 * value * 2.0 + 3.0
    expected = -np.array([value**2, value, np.ones(2)]) / slope
    assert np.abs(result - expected).max() <= 1e-14 * np.abs(expected).max()


def test_two_real_roots_each_have_their_own():
    system = oscillator(damping=500.0).linearize()
    value = system.modes().eigenvalues
    assert (value.imag == 0).all()
    result = system.eigenvalue_sensitivities("spring.stiffness")
    assert np.allclose(result[0], -1 / (2 * value * 2.0 + 500.0), rtol=1e-12)


def test_pendulum_length_and_hinge():
    """omega^2 = kt / (I + m r^2): the hinge and the centre of mass move r, each in its own way."""
    model = mv.Model()
    model.add_body("bob", 3.0, (0.1, 0.1, 0.1), position=(0.5, 0, 0))
    model.add_joint("hinge", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("spiral", "ground", "bob", (0, 0, 0), (0, 0, 0, 0, 40.0, 0))
    system = model.linearize()
    result = system.eigenvalue_sensitivities(["bob.position.x", "hinge.position.x", "hinge.orientation.rx"])
    inertia = 0.1 + 3.0 * 0.5**2
    omega = np.sqrt(40.0 / inertia)
    slope = -0.5 * omega / inertia * 2 * 3.0 * 0.5
    assert result[0] == pytest.approx([1j * slope, -1j * slope], rel=1e-13)
    assert result[1] == pytest.approx([-1j * slope, 1j * slope], rel=1e-13)
    assert result[2] == pytest.approx([0, 0], abs=1e-14)


def test_repeated_pairs_of_the_platform_part_along_their_branches():
    model = mv.library.stewart()
    system = model.linearize()
    names = ["leg1.k.stiffness", "platform.position.x", "leg2.head.position.z", "platform.mass"]
    result = system.eigenvalue_sensitivities(names)
    for row, name in zip(result, names, strict=True):
        expected = difference(model, system, name, eigenvalues)
        for pair in ([0, 2], [6, 8]):  # each of them is there twice; differences sort them by size, not by branch
            ours, theirs = row[pair], expected[pair]
            assert np.abs(ours.sum() - theirs.sum()) <= 1e-6 * np.abs(theirs).max() + 1e-4
        values, step = system.modes().eigenvalues, step_of(system.parameters, name)
        assert_derivative(row[[4, 10]], expected[[4, 10]], values, step)


def test_branches_of_a_repeated_eigenvalue_from_one_side():
    """A square mount of equal stiffness in x and y; a change of one alone leaves the other frequency where it is."""
    model = mv.Model()
    model.add_body("block", 4.0, (1.0, 1.0, 1.0))
    model.add_joint("table", None, "ground", "block", position=(0, 0, 0), free=("x", "y"))
    model.add_bushing("mount", "ground", "block", (0, 0, 0), (900.0, 900.0, 0, 0, 0, 0))
    names = ["mount.stiffness.x", "mount.stiffness.*", "mount.orientation.rz"]
    result = model.linearize().eigenvalue_sensitivities(names)
    slope = 0.5 / np.sqrt(900.0 * 4.0)
    assert np.abs(result[0] - 1j * np.array([0, 0, slope, -slope])).max() <= 1e-15
    assert np.abs(np.abs(result[1].imag) - slope).max() <= 1e-15
    assert np.abs(result[2]).max() <= 1e-12


def test_rigid_body_modes_stay_where_nothing_holds_them():
    model = mv.Model()
    for name, z in (("left", 0.0), ("right", 1.0)):
        model.add_body(name, 1.0, (1, 1, 1), position=(0, 0, z))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name)
    model.add_bushing("between", "left", "right", (0, 0, 0.5), (0, 0, 50.0, 0, 0, 0))
    model.add_bushing("hold", "ground", "left", (0, 0, 0), stiffness=(0, 0, 0, 0, 0, 0), damping=(0, 0, 0, 1, 0, 0))
    system = model.linearize()
    result = system.eigenvalue_sensitivities(["left.mass", "between.stiffness.z", "hold.stiffness.z"])
    assert (system.modes().eigenvalues[:2] == 0).all()
    assert (result[:2, :2] == 0).all()
    assert np.isinf(result[2, :2]).all()


def test_linear_maps_and_patterns_are_sums():
    system = mv.library.stewart().linearize()
    single = system.eigenvalue_sensitivities([f"leg{i}.k.stiffness" for i in range(1, 7)])
    tied = system.eigenvalue_sensitivities({"all": {"leg*.k.stiffness": 1.0},
                                            "odd": {"leg1.k.stiffness": 2.0, "leg3.k.stiffness": -0.5}})  # fmt: skip
    simple = [4, 5, 10, 11]
    assert np.allclose(tied[0, simple], single[:, simple].sum(axis=0), rtol=1e-12)
    assert np.allclose(tied[1, simple], (2 * single[0] - 0.5 * single[2])[simple], rtol=1e-12)


@pytest.mark.filterwarnings("ignore:axes out of line:mbsvib.errors.NearSingularWarning")
def test_tilting_one_pin_of_a_planar_loop_has_no_derivative():
    system = planar(1, bodies=4, loops=1).linearize()
    names = list(system.parameters)
    result = system.eigenvalue_sensitivities()
    broken = {name for name, row in zip(names, result, strict=True) if np.isnan(row).any()}
    assert broken
    assert all(".orientation." in name or ".position." in name for name in broken)
    for name in sorted(broken)[:4]:
        model = planar(1, bodies=4, loops=1).with_values({name: system.parameters[name] + 1e-3})
        assert model.linearize().dof < system.dof


@pytest.mark.slow
@examples(4, slow=12)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
def test_differences_of_random_mechanisms(seed):
    rng = np.random.default_rng(seed)
    model = spatial(seed, bodies=3, loops=int(rng.integers(3)), ports=False)
    try:
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0)
    retained = [group.retained for group in system.provenance.reduction.groups]
    assume(min(retained, default=1.0) > 0.05)
    values = system.modes().eigenvalues
    apart = np.abs(values[:, None] - values)[np.triu_indices(len(values), 1)]
    assume(apart.min() > 1e-2 * np.abs(values).max())
    result = system.eigenvalue_sensitivities()
    names = list(system.parameters)
    for i in rng.choice(len(names), size=6, replace=False):
        if not np.isnan(result[i]).any():
            expected = difference(model, system, names[i], eigenvalues)
            assert_derivative(result[i], expected, values, step_of(system.parameters, names[i]))
