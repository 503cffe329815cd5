"""Modes: eigenvalues, damping, shapes, exact zeros, and error estimates that hold."""


from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.modes import damped, modes
from mbsvib.modes.pairs import pair_numbers
from tests.support.chains import stiff_chain
from tests.support.compare import assert_same_eigenvalues, linearized, nearest_pairs
from tests.support.digits import mp
from tests.support.exact import Exact
from tests.support.random_models import closed_loops, open_trees, planar_loops, rebuilt, rotation, spatial
from tests.support.sizes import examples
from tests.support.unsymmetric import chain

SMALL = st.one_of(
    open_trees(ports=st.just(False), kinds=st.just(("revolute", "universal", "spherical", "screw", "custom"))),
    closed_loops(ports=st.just(False)), planar_loops(ports=st.just(False)),
)  # fmt: skip
FLOATING = open_trees(ports=st.just(False), floating=st.just(True), damped=st.booleans())
UNSTABLE = open_trees(ports=st.just(False), negative=st.just(True), damped=st.booleans())


def modes_of(model, limit=9):
    system = linearized(model)
    assume(0 < system.dof <= limit)
    return system, system.modes()


@pytest.mark.slow
@examples(15, slow=25)
@given(SMALL)
def test_damped_eigenvalues(model):
    _, modes = modes_of(model)
    reference = Exact(model)
    assert_same_eigenvalues(modes.eigenvalues, reference.eigenvalues)


@pytest.mark.slow
@examples(15, slow=25)
@given(st.one_of(open_trees(ports=st.just(False), damped=st.just(False)), planar_loops(damped=st.just(False))))
def test_undamped_frequencies(model):
    _, modes = modes_of(model, limit=30)
    reference = Exact(model)
    assert_allclose(modes.frequencies, np.sqrt(reference.squares) / (2 * np.pi), rtol=1e-10)
    assert not modes.eigenvalues.real.any()
    assert not modes.damping_ratios.any()


@pytest.mark.slow
@examples(12, slow=28)
@given(FLOATING)
def test_rigid_body_modes_are_exact_zeros(model):
    _, modes = modes_of(model)
    reference = Exact(model)
    zeros = reference.zeros
    assert modes.rigid == zeros >= 5  # a lone body hangs on one spring
    assert (modes.frequencies[:zeros] == 0.0).all()
    assert (modes.frequencies[zeros:] > 0.0).all()
    assert np.count_nonzero(modes.eigenvalues == 0) == np.count_nonzero(reference.eigenvalues == 0)
    assert_same_eigenvalues(modes.eigenvalues, reference.eigenvalues)


@pytest.mark.slow
@examples(15, slow=25)
@given(UNSTABLE)
def test_negative_stiffness(model):
    _, modes = modes_of(model)
    reference = Exact(model)
    assert_same_eigenvalues(modes.eigenvalues, reference.eigenvalues, rtol=1e-8)
    assert modes.stable == bool((reference.eigenvalues.real <= 0).all())


@pytest.mark.slow
@examples(16, slow=24)
@given(st.one_of(SMALL, FLOATING, UNSTABLE))
def test_error_estimates_hold(model):
    """The true error is never far above the promised one."""
    _, modes = modes_of(model)
    reference = Exact(model)
    promised = dict(zip(modes.eigenvalues.tolist(), modes.errors, strict=True))
    for result, expected in zip(*nearest_pairs(modes.eigenvalues, reference.eigenvalues), strict=True):
        if expected:
            assert abs(result - expected) <= (10 * promised[complex(result)] + 4e-16) * abs(expected)


@pytest.mark.slow
@given(st.one_of(SMALL, FLOATING, UNSTABLE), st.integers(0, 2**31))
def test_error_estimates_hold_at_length(model, seed):
    """With more bodies, and as many coordinates as the reference can bear."""
    for item in (model, spatial(seed, bodies=6, ports=False, kinds=("revolute", "universal", "screw", "planar"))):
        _, modes = modes_of(item, limit=14)
        reference = Exact(item)
        promised = dict(zip(modes.eigenvalues.tolist(), modes.errors, strict=True))
        for result, expected in zip(*nearest_pairs(modes.eigenvalues, reference.eigenvalues), strict=True):
            if expected:
                assert abs(result - expected) <= (10 * promised[complex(result)] + 4e-16) * abs(expected)


@pytest.mark.slow
@examples(20, slow=20)
@given(st.one_of(SMALL, FLOATING, UNSTABLE))
def test_eigenvalues_come_in_pairs_in_ascending_order(model):
    system, modes = modes_of(model, limit=30)
    first, second = modes.eigenvalues[0::2], modes.eigenvalues[1::2]
    turns = first.imag != 0
    assert (first[turns] == second[turns].conj()).all()
    assert (first[turns].imag > 0).all()
    assert (second[~turns].imag == 0).all()
    assert (np.diff(modes.natural) >= 0).all()
    assert len(modes) == system.dof
    assert modes.errors.shape == (2 * system.dof,)


@examples(20, slow=20)
@given(st.one_of(SMALL, FLOATING))
def test_shapes_solve_the_quadratic_problem(model):
    system, modes = modes_of(model, limit=30)
    for k in range(system.dof):
        value, shape = modes.eigenvalues[2 * k], modes.shapes[:, k]
        terms = [value**2 * (system.M @ shape), value * (system.C @ shape), system.K @ shape]
        size = sum(np.linalg.norm(term) for term in terms)
        floor = np.linalg.norm(system.K) * np.linalg.norm(shape)  # of rigid-body modes only rounding is left
        assert np.linalg.norm(sum(terms)) <= 1e-9 * size + 1e-14 * floor


@pytest.mark.slow
@given(open_trees(ports=st.just(False), damped=st.just(False)))
def test_real_shapes_are_normalized_by_mass(model):
    system, modes = modes_of(model, limit=30)
    assert modes.classical
    gram = modes.shapes.T @ system.M @ modes.shapes
    assert_allclose(gram, np.eye(system.dof), atol=1e-8)


@pytest.mark.slow
@examples(12, slow=28)
@given(SMALL)
def test_body_shapes_are_the_displacements_of_the_bodies(model):
    system, modes = modes_of(model, limit=30)
    reference = Exact(model)
    moved = system.displacements(modes.shapes)
    assert list(modes.body_shapes) == list(model.bodies)
    for name, shape in modes.body_shapes.items():
        assert_allclose(shape, moved[name], rtol=1e-12, atol=1e-13)
    for k in range(system.dof):
        column = {name: shape[:, k].real for name, shape in modes.body_shapes.items()}
        assert reference.violation(column) <= 1e-12 * max(1, max(np.abs(x).max() for x in column.values()))


@pytest.mark.slow
@examples(20, slow=20)
@given(SMALL)
def test_frequencies_and_ratios_follow_from_the_eigenvalues(model):
    _, modes = modes_of(model, limit=30)
    first = modes.eigenvalues[0::2]
    turns = first.imag > 0
    assert_allclose(modes.frequencies[turns], np.abs(first[turns]) / (2 * np.pi), rtol=1e-14)
    assert_allclose(modes.damped_frequencies[turns], first[turns].imag / (2 * np.pi), rtol=1e-14)
    assert_allclose(modes.damping_ratios[turns], -first[turns].real / np.abs(first[turns]), rtol=1e-13)
    assert (modes.damped_frequencies[~turns] == 0).all()
    assert (modes.damping_ratios[~turns] >= 1).all()


def oscillator(m=2.0, c=0.0, k=0.0):
    model = mv.Model("oscillator")
    model.add_body("b", m, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(1, 0, 0))
    if c or k:
        model.add_spring("s", "b", "ground", (0, 0, 0), (1, 0, 0), stiffness=k, damping=c)
    model.add_input("f", "b", "x")
    for quantity in ("displacement", "velocity", "acceleration"):
        model.add_output(quantity, "b", "x", quantity=quantity)
    return model


@pytest.mark.parametrize("ratio", [0.0, 1e-12, 1e-6, 0.02, 0.9, 1 - 1e-12, 1.0, 1 + 1e-9, 1.5, 1e3, 1e8])
def test_one_degree_of_freedom(ratio):
    """Two roots of a quadratic, to the last digits also where the formula of school cancels."""
    m, omega = 2.0, 10.0
    model = oscillator(m, 2 * ratio * m * omega, m * omega**2)
    spring = model.springs["s"]
    half = mp.mpf(spring.damping) / (2 * m)
    root = mp.sqrt(half**2 - mp.mpf(spring.stiffness) / m)
    modes = model.linearize().modes()
    assert modes.frequencies[0] == pytest.approx(omega / (2 * np.pi), rel=1e-14)
    assert modes.damping_ratios[0] == pytest.approx(ratio, rel=1e-14, abs=1e-16)
    expected = sorted((-half + root, -half - root), key=abs)
    near_critical = 1e-8 if abs(ratio - 1) < 1e-6 else 0  # the roots move with the square root of rounding
    result = sorted(modes.eigenvalues, key=abs)
    for a, b in zip(result if ratio > 1 else modes.eigenvalues, expected if ratio > 1 else (-half + root, -half - root),
                    strict=True):  # fmt: skip
        assert abs(a - complex(b)) <= (1e-14 + near_critical) * abs(complex(b))


@pytest.mark.parametrize("ratio", [-1e-3, -1.0, -3.0])
def test_negative_damping_grows(ratio):
    model = oscillator(2.0, 2 * ratio * 2.0 * 10.0, 200.0)
    modes = model.linearize().modes()
    assert_same_eigenvalues(modes.eigenvalues, Exact(model).eigenvalues, rtol=1e-7 if ratio == -1 else 1e-14)
    assert modes.damping_ratios[0] == pytest.approx(ratio, rel=1e-13)
    assert not modes.stable


@pytest.mark.parametrize("seed", range(6))
def test_damping_in_proportion_to_stiffness(seed):
    """Classical: real shapes, and zeta = beta omega / 2 for every mode."""
    beta = 1e-3
    model = spatial(seed, bodies=3, ports=False, damped=False)
    model = rebuilt(model, lambda part, words: words | {"damping": beta * np.array(words["stiffness"])}
                    if "stiffness" in words else words)  # fmt: skip
    system, omega = model.linearize(), np.sqrt(Exact(model).squares)
    modes = system.modes()
    assert_allclose(modes.frequencies, omega / (2 * np.pi), rtol=1e-10)
    assert_allclose(modes.damping_ratios, beta * omega / 2, rtol=1e-10)
    assert not np.iscomplexobj(modes.shapes)


def test_damping_in_proportion_to_mass():
    """Equal masses, each with the same damper to ground: zeta = c / (2 m omega)."""
    model = mv.Model("chain")
    below = "ground"
    for i in range(4):
        model.add_body(f"b{i}", 2.0, (1, 1, 1), position=(0, 0, i + 1))
        model.add_joint(f"j{i}", "prismatic", below, f"b{i}")
        model.add_spring(f"k{i}", below, f"b{i}", (0, 0, i), (0, 0, i + 1), stiffness=200.0)
        model.add_spring(f"c{i}", "ground", f"b{i}", (0, 0, -1), (0, 0, i + 1), damping=0.6)
        below = f"b{i}"
    modes = model.linearize().modes()
    omega = 2 * np.sqrt(100.0) * np.sin((2 * np.arange(1, 5) - 1) * np.pi / 18)
    assert_allclose(modes.frequencies * 2 * np.pi, omega, rtol=1e-13)
    assert_allclose(modes.damping_ratios, 0.6 / (2 * 2 * omega), rtol=1e-12)
    assert "commutes" in modes.classical
    assert not np.iscomplexobj(modes.shapes)


def test_a_free_and_a_braked_body():
    assert (oscillator().linearize().modes().eigenvalues == 0).all()
    braked = oscillator(m=2.0, c=3.0).linearize().modes()
    assert_same_eigenvalues(braked.eigenvalues, [0, -1.5], rtol=1e-15)
    assert braked.frequencies[0] == 0


def test_a_diverging_body():
    modes = oscillator(m=2.0, k=-8.0).linearize().modes()
    assert_same_eigenvalues(modes.eigenvalues, [2, -2], rtol=1e-14)
    assert not modes.stable
    assert "Unstable: mode" in str(modes)


def test_repeated_frequencies():
    """A ball on equal springs has three equal frequencies, and its shapes are still independent."""
    model = mv.Model("ball")
    model.add_body("ball", 2.0, (0.5, 0.5, 0.5), orientation=rotation(np.random.default_rng(2)))
    model.add_bushing("k", "ground", "ball", (0, 0, 0), (800,) * 3 + (200,) * 3, (0.4,) * 3 + (0.1,) * 3)
    modes = model.linearize().modes()
    assert_allclose(modes.frequencies * 2 * np.pi, 20, rtol=1e-14)
    assert_allclose(modes.damping_ratios, 0.4 / (2 * 2 * 20), rtol=1e-13)
    assert np.linalg.cond(modes.shapes) < 10


def test_a_defective_pair():
    """Two equal masses with a damper between one and ground, tuned to a double root, are not diagonalizable."""
    model = mv.Model("defective")
    for i in (1, 2):
        model.add_body(f"b{i}", 1.0, (1, 1, 1))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        model.add_spring(f"k{i}", "ground", f"b{i}", (-1, 0, 0), (0, 0, 0), stiffness=100.0)
    model.add_spring("c1", "ground", "b1", (-1, 0, 0), (0, 0, 0), damping=20.0)
    model.add_spring("k", "b1", "b2", (0, 0, 0), (1, 0, 0), stiffness=10.0)
    system, reference = model.linearize(), Exact(model)
    assert_same_eigenvalues(system.modes().eigenvalues, reference.eigenvalues, rtol=1e-7)
    omega = np.array([1.0, 9.0, 10.5, 50.0])
    model.add_input("f", "b1", "x")
    model.add_output("x", "b2", "x")
    assert_allclose(model.linearize().frequency_response(omega), Exact(model).frequency_response(omega), rtol=1e-12)


def test_the_table():
    text = str(oscillator(c=1.0, k=200.0).linearize().modes())
    assert "oscillator" in text
    assert f"{10 / (2 * np.pi):.6f}" in text
    assert "1 DOF" in text


def test_the_largest_entry_of_complex_shapes_is_real_and_positive():
    """Whatever phases a solver gives its vectors: damping that couples modes, in batches too, and spin."""
    model = mv.library.chain(4, line=(0, 1, 0)).with_values({"spring2.damping.rz": 3.0})
    batch = model.linearize(values={"spring1.damping.rz": np.array([0.1, 0.3])})
    system = model.linearize()
    spin = replace(system, gyroscopic=np.triu(np.full((4, 4), 0.3), 1) - np.tril(np.full((4, 4), 0.3), -1))
    for shapes in (modes(system).shapes, *batch.modes().shapes, modes(spin).shapes):
        largest = shapes[np.abs(shapes).argmax(axis=0), np.arange(4)]
        assert np.abs(shapes.imag).max() > 1e-3
        assert_allclose(largest, np.abs(largest), rtol=1e-14)


def test_some_of_the_modes():
    """The lowest, or the nearest to a frequency, in ascending order and with all that belongs to them."""
    system = stiff_chain(8, 2, 1, damped=True).linearize()
    modes = system.modes()
    low = system.modes(3)
    assert_allclose(low.frequencies, modes.frequencies[:3], rtol=0)
    assert_allclose(low.eigenvalues, modes.eigenvalues[:6], rtol=0)
    assert_allclose(low.shapes, modes.shapes[:, :3], rtol=0)
    assert low.body_shapes["b2"].shape == (6, 3)
    near = 1.01 * modes.frequencies[5]
    expected = np.sort(modes.frequencies[np.argsort(abs(modes.frequencies - near))[:2]])
    assert_allclose(system.modes(2, near=near).frequencies, expected, rtol=0)
    assert len(system.modes(100)) == 8
    assert "3 " in str(low)


@pytest.mark.parametrize("count", [0, -1, 2.5, "3", True])
def test_a_number_of_modes_that_is_none(count):
    with pytest.raises(mv.ResponseError, match="count = "):
        stiff_chain(4, 2, 1).linearize().modes(count)


@pytest.mark.slow
@given(SMALL)
def test_kinetic_energy_is_shared_among_the_bodies(model):
    _, modes = modes_of(model, limit=30)
    shares = modes.kinetic_energy
    assert list(shares) == list(model.bodies)
    assert_allclose(sum(shares.values()), 1, rtol=1e-12)
    assert min(share.min() for share in shares.values()) >= 0
    assert "Modes(" in repr(modes)


def test_the_body_that_moves_most():
    model = mv.Model()
    for i, k in enumerate((100.0, 400.0)):
        model.add_body(f"b{i}", 1.0, (1, 1, 1), position=(i, 0, 0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=((1, 0, 0), (0, 1, 0))[i])
        model.add_spring(f"k{i}", "ground", f"b{i}", (i - (1 - i), -i, 0), (i, 0, 0), stiffness=k)
    modes = model.linearize().modes()
    assert_allclose(modes.kinetic_energy["b0"], [1, 0], atol=1e-15)
    assert [name for name, _ in modes.strongest()] == ["b0", "b1"]
    assert [direction for _, direction in modes.strongest()] == ["x", "y"]


def test_what_moves_most_where_nothing_has_mass():
    model = mv.Model("relaxing")
    for name, axis in (("lever", (0, 0, 1)), ("slide", (1, 0, 0))):
        model.add_body(name, 0.0, (0, 0, 0))
        kind = "revolute" if name == "lever" else "prismatic"
        model.add_joint(f"{name}.j", kind, "ground", name, position=(0, 0, 0), axis=axis)
        model.add_bushing(f"{name}.k", "ground", name, (0, 0, 0), stiffness=(7, 1, 1, 1, 1, 3), damping=(1,) * 6)
    assert model.linearize().modes().strongest() == (("lever", "rz"), ("slide", "x"))


def test_eigenvalues_pair_with_conjugates_and_with_real_ones_of_their_shape():
    values = np.array([-1.0 + 2.0j, -5.0, -6.0, -50.0, -60.0])
    shapes = np.array([[1.0, 0.0, 0.1, 0.1, 0.0], [0.0, 1.0, 0.0, 0.1, 1.0], [0.0, 0.1, 1.0, 1.0, 0.1]], dtype=complex)
    # the first stands for its conjugate too
    assert pair_numbers(values, shapes, 0, 0).tolist() == [[0, 0], [1, 4], [2, 3]]


def test_the_strongest_coordinate_moves_most_mass():
    """y, 100 times as heavy as x, by a fifth of x has more energy than x, by a twentieth less."""
    mass, shapes = np.diag([1.0, 100.0]), np.array([[1.0, 20.0], [0.2, -1.0]])
    forces = mass @ shapes / np.sqrt([5.0, 500.0])
    stiffness = forces @ np.diag([1.0, 9.0]) @ forces.T
    modes = mv.System.from_matrices(mass, None, stiffness, coordinates=["x", "y"]).modes()
    assert modes.strongest() == (("y",), ("x",))


def test_a_system_without_coordinates_has_no_strongest_motion():
    none = np.zeros((0, 0))
    modes = mv.System.from_matrices(none, none, none, np.zeros((0, 1)), inputs=["F"]).modes()
    assert len(modes) == 0
    assert modes.strongest() == ()


@pytest.mark.parametrize("seed", range(3))
def test_free_chains_need_no_refinement(seed, monkeypatch):
    """What nothing resists is no part of the modes that dampers couple: their first vectors are accurate."""
    monkeypatch.setattr(damped, "_uncertain_refined", lambda *_: pytest.fail("the first vectors were inaccurate"))
    modes = chain(6, seed, damp=1.0, ground=False).modes(rtol=1e-9)
    assert modes.rigid == 1
    assert modes.errors.max() <= 1e-9


def test_shapes_have_unit_mass_where_damping_commutes():
    """A heavy mass that rides on a light one, each with a damper to ground in proportion to its mass: LAPACK's shapes
    of such a mass matrix are 4e-13 off unit length, those of the factors are not.
    """
    model, below = mv.Model("riders"), "ground"
    for name, mass, stiffness in (("light", 1.0, 1e6), ("heavy", 3e3, 3e5), ("load", 30.0, 2e6)):
        model.add_body(name, mass, (1, 1, 1))
        model.add_joint(f"{name}.slide", "prismatic", below, name, axis=(0, 0, 1))
        model.add_bushing(f"{name}.k", below, name, (0, 0, 0), (0, 0, stiffness, 0, 0, 0))
        model.add_bushing(f"{name}.c", "ground", name, (0, 0, 0), (0,) * 6, (0, 0, 2.0 * mass, 0, 0, 0))
        below = name
    system = model.linearize()
    result = modes(system, 1e-12, clean=False)
    assert "commutes" in result.classical
    assert result.mixed > 1e-12
    np.testing.assert_allclose(((system.inertia_factor @ result.shapes) ** 2).sum(axis=0), 1.0, rtol=1e-15)
    np.testing.assert_allclose(-result.eigenvalues.real, 1.0, rtol=1e-15)
    assert result.errors.max() < 5e-15
