"""Transmission zeros and poles, against closed forms and against determinants in 50 digits."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import eigvalsh
from scipy.spatial.transform import Rotation

import mbsvib as mv
from mbsvib.responses.transmission_zeros import Resolvent
from tests.modes.test_modes import oscillator
from tests.support import fast_digits
from tests.support.compare import assert_same_eigenvalues, linearized
from tests.support.digits import combination, mp
from tests.support.exact import Exact
from tests.support.random_models import open_trees, planar_loops
from tests.support.sizes import examples
from tests.support.sliding_chain import sliding_chain


def held(m, k):
    """Natural frequencies of masses in a row between two walls, one spring more than masses."""
    stiffness = np.diag(np.add(k[:-1], k[1:])) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    return np.sqrt(eigvalsh(stiffness, np.diag(m)))


def above(values):
    """Imaginary parts of the upper ones of conjugate pairs on the imaginary axis."""
    assert not values.real.any()
    assert_allclose(np.sort(values.imag), np.sort(-values.imag), rtol=1e-14)
    return np.sort(values.imag[values.imag > 0])


@pytest.mark.few(2)
@pytest.mark.parametrize("n", [2, 5, 20, 120])
def test_collocated_zeros_are_poles_with_the_driven_point_held(n):
    rng = np.random.default_rng(n)
    m, k = rng.uniform(0.5, 2, n), rng.uniform(1e3, 1e4, n)
    outputs = [("displacement", n - 1), ("velocity", n - 1), ("acceleration", n - 1)]
    system = sliding_chain(m, k, 0 * k, (n - 1,), outputs).linearize()
    expected = held(m[:-1], k)
    zeros = [system.transmission_zeros(outputs=f"y{i}") for i in range(3)]
    assert [len(z) for z in zeros] == [2 * n - 2, 2 * n - 1, 2 * n]
    for order, z in enumerate(zeros):
        assert not z[:order].any()
        assert_allclose(above(z[order:]), expected, rtol=2e-12)
    poles = above(system.poles())
    # of a mode that lives at the other end a pole and a zero are one double
    assert (poles[:-1] <= expected * (1 + 1e-12)).all()
    assert (expected <= poles[1:] * (1 + 1e-12)).all()


def row(stiffness, damping, held=()):
    """Masses of 1, 2, 3 and 4 kg in a row from the ground, some of which are held."""
    model, names = mv.Model("row"), ["ground"]
    for i in range(4):
        names.append("ground" if i in held else f"b{i}")
        if i not in held:
            model.add_body(f"b{i}", 1.0 + i, (1, 1, 1), (0, 0, i))
            model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
    for i, (k, c) in enumerate(zip(stiffness, damping, strict=True)):
        model.add_bushing(f"k{i}", names[i], names[i + 1], (0, 0, i), (k, 0, 0, 0, 0, 0), (c, 0, 0, 0, 0, 0))
    return model


@pytest.mark.parametrize(("stiffness", "damping"), [
    ((1.0, 1e12, 1e3, 1e6), (0.0,) * 4), ((1.0, 1e8, 1e14, 1e2), (0.1, 1e3, 1e6, 1.0))])  # fmt: skip
def test_zeros_over_decades_keep_their_digits(stiffness, damping):
    """Those of a driven point are the poles of what is left where it is held: Newton's steps remove up to 7e-11."""
    model = row(stiffness, damping)
    model.add_input("F", "b1", "x")
    model.add_output("x", "b1", "x")
    zeros = model.linearize().transmission_zeros()
    expected = row(stiffness, damping, held=(1,)).linearize().modes().eigenvalues
    assert len(zeros) == len(expected)
    for value in expected:
        assert_allclose(np.abs(zeros - value).min() / abs(value), 0.0, atol=1e-14)


@pytest.mark.parametrize("n", [2, 5, 14, 20])
def test_from_end_to_end_there_is_no_zero(n):
    """All 2 n of them are at infinity, a single chain as long as the state: none may come back as finite."""
    k = np.linspace(1e3, 2e3, n)
    system = sliding_chain(np.ones(n), k, 0 * k, (0,), [("displacement", n - 1)]).linearize()
    assert len(system.transmission_zeros()) == 0


def test_dampers_give_finite_zeros_from_end_to_end():
    """Each k + c s of a link between is one."""
    k, c = np.array([900.0, 400.0, 500.0, 300.0]), np.array([3.0, 2.0, 1.0, 8.0])
    system = sliding_chain(np.ones(4), k, c, (0,), [("displacement", 3)]).linearize()
    assert_allclose(system.transmission_zeros(), np.sort(-k[1:] / c[1:])[::-1], rtol=1e-9)


def test_transmissibility():
    """(k + c s) of each link; the base's own acceleration cancels, or the degree would be full."""
    k, c = np.array([900.0, 400.0]), np.array([3.0, 2.0])
    system = sliding_chain([2.0, 1.0], k, c, (), [("acceleration", 0), ("acceleration", 1)], base=True).linearize()
    assert_allclose(system.transmission_zeros(outputs="y1"), np.sort(-k / c)[::-1], rtol=1e-11)
    upper = np.roots([1.0, 2.0, 400.0])
    expected = np.array([*upper[np.argsort(-upper.imag)], -300.0])
    assert_allclose(system.transmission_zeros(outputs="y0"), expected, rtol=1e-11)


def test_several_inputs_and_outputs():
    """With both ends driven and seen the zeros are the poles with both ends held."""
    rng = np.random.default_rng(3)
    m, k = rng.uniform(0.5, 2, 7), rng.uniform(1e3, 1e4, 7)
    outputs = [("displacement", 0), ("displacement", 6), ("velocity", 6)]
    system = sliding_chain(m, k, 0 * k, (0, 6), outputs).linearize()
    expected = held(m[1:-1], k[1:])
    assert_allclose(above(system.transmission_zeros(outputs=["y0", "y1"])), expected, rtol=1e-12)
    moving = system.transmission_zeros(outputs=["y0", "y2"])
    assert moving[0] == 0
    assert_allclose(above(moving[1:]), expected, rtol=1e-12)
    # a third output shows only what the second does
    assert_allclose(above(system.transmission_zeros()), expected, rtol=1e-12)
    assert_allclose(above(system.transmission_zeros(["y1", "y2"], "f6")), held(m[:-1], k), rtol=1e-12)
    # two forces on one mass are one
    wide = sliding_chain(m, k, 0 * k, (6,), [("displacement", 6)])
    wide.add_input("again", "b6", "z")
    assert_allclose(above(wide.linearize().transmission_zeros()), held(m[:-1], k), rtol=1e-12)
    assert len(system.transmission_zeros("y0", ["f0", "f6"])) == 0


def test_modes_that_are_not_reached_are_zeros():
    """Two equal masses on a symmetric spring, pushed and seen together: the opposed mode is a zero at its pole."""
    model = sliding_chain([1.0, 1.0], [100.0, 30.0], [0.0, 0.0], (), ())
    model.add_spring("s", "ground", "b1", (1, 0, 0), (1, 0, 1), stiffness=100.0)
    model.add_input("f0", "b0", "z")
    model.add_output("apart", "b1", "z", relative_to="b0")
    model.add_output("x", "b0", "z")
    system = model.linearize()
    together, opposed = 10.0, np.sqrt(160.0)
    assert_allclose(above(system.poles()), [together, opposed], rtol=1e-14)
    assert_allclose(above(system.transmission_zeros("apart", "f0")), [together], rtol=1e-7)


def test_over_many_decades():
    """Collocated in a chain whose stiffness spans ten decades: every zero to its own last digits."""
    n = 8
    rng = np.random.default_rng(0)
    m, k = 10.0 ** rng.permutation(np.linspace(-2, 2, n)), 10.0 ** rng.permutation(np.linspace(0, 10, n))
    model = sliding_chain(m, k, 0 * k, (0,), [("displacement", 0)])
    rest = sliding_chain(m[1:], k[1:], 0 * k[1:])  # the first mass is the ground of the others
    expected = np.sqrt(Exact(rest).squares)
    assert_allclose(above(model.linearize().transmission_zeros()), expected, rtol=1e-11)


def determinant_zeros(reference, inputs, outputs):
    """Roots of det [[K + s C + s^2 M, -B], [Cq + s Cv + s^2 Ca, D]], its coefficients by interpolation in 50 digits."""
    m, n = reference.dof, len(inputs)
    degree = 2 * m + 2 * n
    size = float(np.sqrt(np.abs(reference.squares)).max()) or 1.0
    points = [size * mp.expjpi(mp.mpf(2 * k) / (degree + 1)) for k in range(degree + 1)]
    values = []
    for s in points:
        dynamic = combination((reference.M, s * s), (reference.C, s), (reference.K, 1))
        shown = combination((reference.Cq, 1), (reference.Cv, s), (reference.Ca, s * s))
        rows = [[*row, *(-reference.B[i][j] for j in inputs)] for i, row in enumerate(dynamic)]
        rows += [[*shown[i], *(reference.D[i][j] for j in inputs)] for i in outputs]
        values.append(fast_digits.determinant(mp.matrix(rows)))
    power = [sum(v * mp.expjpi(-mp.mpf(2 * k * j) / (degree + 1)) for k, v in enumerate(values)) / (degree + 1)
             for j in range(degree + 1)]  # fmt: skip
    largest = max(abs(v) for v in power)
    power = [mp.re(v) if abs(v) > largest * mp.mpf("1e-35") else mp.mpf(0) for v in power]
    while not power[-1]:
        power.pop()
    at_zero = next(i for i, v in enumerate(power) if v)
    power = power[at_zero:]
    companion = [[mp.mpf(i == j + 1) for j in range(len(power) - 2)] + [-v / power[-1]]
                 for i, v in enumerate(power[:-1])]  # fmt: skip
    roots = fast_digits.eigenvalues(mp.matrix(companion)) if companion else []
    return np.array([0.0] * at_zero + [complex(r) * size for r in roots])


def acting(system, inputs, outputs):
    """Every input and output does something, and they are not the same ones twice."""
    g = system.frequency_response([0.7, 31.0])
    values = np.linalg.svd(g[np.ix_(outputs, inputs)].transpose(2, 0, 1), compute_uv=False)
    return (values[:, -1] > 1e-10 * values[:, 0]).all() and values.min() > 1e-13 * np.abs(g[:6]).max()


SMALL = st.one_of(
    open_trees(kinds=st.just(("revolute", "universal", "prismatic", "screw")), damped=st.booleans()), planar_loops(),
)  # fmt: skip


@pytest.mark.slow
@examples(12, slow=25)
@given(SMALL, st.integers(0, 2), st.integers(0, 5))
def test_single_pairs_against_determinants(model, source, result):
    """Forces and base motion to displacements, velocities and accelerations, absolute and relative."""
    system, reference = linearized(model), Exact(model)
    assume(0 < system.dof <= 4 and acting(system, [source], [result]))
    expected = determinant_zeros(reference, [source], [result])
    actual = system.transmission_zeros(system.outputs[result], system.inputs[source])
    highest = np.abs(reference.eigenvalues).max()
    # what lies far above all poles is decided by feedthroughs that are all but zero
    actual, expected = (zeros[np.abs(zeros) < 1e4 * highest] for zeros in (actual, expected))
    assert_same_eigenvalues(actual, expected, rtol=1e-8)


@pytest.mark.slow
@examples(8, slow=15)
@given(SMALL)
def test_two_by_two_against_determinants(model):
    system, reference = linearized(model), Exact(model)
    assume(1 < system.dof <= 4 and acting(system, [0, 1], [0, 1]))
    expected = determinant_zeros(reference, [0, 1], [0, 1])
    result = system.transmission_zeros(system.outputs[:2], system.inputs[:2])
    assert_same_eigenvalues(result, expected, rtol=1e-7)


def test_poles_are_the_eigenvalues():
    model = oscillator(m=2.0, c=3.0, k=50.0)
    system = model.linearize()
    assert_same_eigenvalues(system.poles(), Exact(model).eigenvalues, rtol=1e-14)
    assert len(system.poles()) == 2
    system.poles()[:] = 0  # a copy
    assert system.poles().all()


def test_nothing_to_look_at():
    locked = mv.Model("locked")
    locked.add_body("b", 1.0, (1, 1, 1))
    locked.add_joint("j", "fixed", "ground", "b")
    locked.add_input("f", "b", "x")
    locked.add_output("x", "b", "x")
    system = locked.linearize()
    assert len(system.transmission_zeros()) == len(system.poles()) == 0
    assert len(oscillator(k=1.0).linearize().transmission_zeros(inputs=[])) == 0


def test_unknown_names():
    system = oscillator(k=1.0).linearize()
    with pytest.raises(mv.ResponseError, match=r"output 'displacment'.*no such output. Did you mean 'displacement'"):
        system.transmission_zeros(outputs="displacment")
    with pytest.raises(mv.ResponseError, match=r"input 'g': system 'oscillator' has no such input.*It has f"):
        system.transmission_zeros(inputs=["g"])


@pytest.mark.few(2)
@pytest.mark.parametrize("unit", [1.0, 3.0, 1e3, 1e-15])
def test_rigid_body_modes_that_a_pair_does_not_meet_are_two_zeros_at_0_each(unit):
    """A rotor that spins freely while it whirls: none, one or both came out, as rounding would have it."""
    model = mv.library.rotor_stator()
    names = [name for name in model.parameters if ".position" not in name and name != "spin.speed"]
    values = model.parameters
    system = model.with_values({name: unit * values[name] for name in names if values[name]}).linearize()
    zeros = [system.transmission_zeros(output, "unbalance") for output in system.outputs]
    assert [(len(z), np.count_nonzero(z == 0.0)) for z in zeros] == [(12, 2), (11, 3), (12, 2), (14, 2)]


@pytest.mark.parametrize("unit", [1.0, 3.0, 1e-15])
def test_a_body_beside_that_nothing_holds_is_two_zeros_at_0(unit):
    model = mv.Model("beside")
    for name, y in (("held", 0.0), ("beside", 1.0)):
        model.add_body(name, 1.3 * unit, (unit, unit, unit), position=(0.1, y, 0.2))
        model.add_joint(f"{name}.j", "prismatic", "ground", name, axis=(0.6, 0.8, 0))
    model.add_bushing("k", "ground", "held", (0, 0, 0), stiffness=(30 * unit,) * 3 + (0,) * 3)
    for name in ("held", "beside"):
        model.add_input(f"f.{name}", name, "x")
        model.add_output(f"x.{name}", name, "x")
    system = model.linearize()
    assert system.transmission_zeros("x.held", "f.held").tolist() == [0.0, 0.0]
    assert np.abs(system.transmission_zeros("x.beside", "f.beside")) == pytest.approx([np.sqrt(30 / 1.3)] * 2)
    assert len(system.transmission_zeros()) == 0


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_rigid_body_modes_of_which_a_pair_meets_some(quantity):
    """Two plates that float in a plane on springs between them, pushed and seen obliquely: of three rigid-body modes,
    with six poles at 0, a single double pole is met, and the others are zeros at 0.
    """
    model = mv.Model("plates")
    for name, at in (("a", (0.1, 0.2, 0.0)), ("b", (0.9, -0.3, 0.0))):
        model.add_body(name, 1.7, (0.1, 0.2, 0.25), position=at)
        model.add_joint(f"{name}.j", "planar", "ground", name, position=at)
    model.add_bushing("k", "a", "b", (0.4, 0.1, 0.0), stiffness=(300.0, 500.0, 0, 0, 0, 20.0))
    model.add_input("f", "a", (1.0, 0.4, 0.0), position=(0.3, -0.2, 0.0))
    model.add_output("y", "b", (0.2, -1.0, 0.0), position=(0.5, 0.6, 0.0), quantity=quantity)
    expected = determinant_zeros(Exact(model), [0], [0])
    assert_same_eigenvalues(model.linearize().transmission_zeros(), expected, rtol=1e-9)
    assert np.count_nonzero(expected == 0) == 4 + ("displacement", "velocity", "acceleration").index(quantity)


def coupled_by_inerters(count, ratio, beside):
    """Masses on springs in a row of inerters, the last with stiff springs on it; one more that nothing holds."""
    model = mv.Model("inerters")

    def mass(name, y):
        model.add_body(name, 1.0, (1, 1, 1), (0, y, 0))
        model.add_joint(f"{name}.j", "prismatic", "ground", name, axis=(1, 0, 0))

    for i in range(count):
        mass(f"m{i}", i)
        model.add_spring(f"k{i}", "ground", f"m{i}", (-1, i, 0), (0, i, 0), 30.0 + 7.0 * i)
        if i:
            model.add_inerter(f"b{i}", f"m{i - 1}", f"m{i}", (0, i, 0), (1, i, 0), 0.5)
    for i, (first, second) in enumerate(((f"m{count - 1}", "s0"), ("s0", "s1"))):
        mass(second, 10 + i)
        model.add_spring(f"r{i}", first, second, (0, 10 + i, 0), (1, 10 + i, 0), ratio)
    if beside:
        mass("beside", 20)
    model.add_input("F", "m0", "x", relative_to="beside" if beside else "ground")
    model.add_output("x", f"m{count - 1}", "x")
    return model.linearize()


@pytest.mark.parametrize("ratio", [1e2, 1e6, 1e8, 1e10])
@pytest.mark.parametrize(("count", "beside", "at_0"), [(2, False, 2), (3, False, 4), (2, True, 4)])
def test_several_zeros_at_0(count, beside, at_0, ratio):
    """Inerters carry no static force; beside far higher frequencies, rounding spread such zeros, or they were lost."""
    zeros = coupled_by_inerters(count, ratio, beside).transmission_zeros()
    golden = 0.5 * (np.sqrt(5.0) + np.array([-1.0, 1.0]))  # of two masses on springs whose end is held
    assert_allclose(above(zeros), golden * np.sqrt(ratio), rtol=1e-9)
    assert np.count_nonzero(zeros == 0.0) == at_0 == len(zeros) - 4


@pytest.mark.parametrize("seed", [0, 2, 5])
def test_beside_eigenvalues_that_meet(seed):
    """A preloaded node without mass creeps at 1 / 0.01 s in six directions: sums over modes need not be transfer
    functions there. Zeros and poles make the ratio of responses all the same.
    """
    rng = np.random.default_rng(seed)
    model, preload = mv.Model("node"), rng.normal(size=6)
    model.add_body("b", 3.0, (0.2, 0.25, 0.18), position=(0.4, 0, -0.6))
    model.add_body("n", 0.0, (0, 0, 0), position=(0.7, 0.1, -0.5))
    turn, springs = rng.uniform(-1, 1, 3), 10.0 ** rng.uniform(1, 3, 6)
    model.add_bushing("hold", "ground", "b", (0.2, 0.2, -0.8), 1e3 * rng.uniform(1, 2, 6), rng.uniform(1, 2, 6))
    model.add_bushing("tie", "b", "n", (0.6, 0.1, -0.5), springs, 0.01 * springs, orientation=turn, preload=preload)
    model.add_load("t", "b", torque=rng.normal(size=3))
    axes = Rotation.from_rotvec(turn).as_matrix()
    model.add_load("n0", "n", -axes @ preload[:3], position=(0.6, 0.1, -0.5), torque=-axes @ preload[3:])
    model = model.equilibrium(preload="hold")
    model.add_input("f", "n", rng.normal(size=6), relative_to="b")
    model.add_output("y", "b", rng.normal(size=6), relative_to="n")
    system = model.linearize()
    zeros, poles, s = system.transmission_zeros(), system.poles(), np.array([2j, 30j, 200j])
    ratio = np.exp(np.log(s[:, None] - zeros).sum(axis=1) - np.log(s[:, None] - poles).sum(axis=1))
    response = system.frequency_response(s.imag)[0, 0]
    np.testing.assert_allclose(ratio / ratio[0], response / response[0], rtol=1e-8)


def test_zeros_on_poles_that_meet():
    """Solutions are infinite there, without a warning."""
    resolvent = Resolvent.of(-np.eye(3), np.ones((3, 1)), np.ones((1, 3)), np.zeros((1, 1)))
    at = np.array([-1.0, 1.0j, np.nan], dtype=complex)
    assert np.isfinite(resolvent.noise(at)[0, 0]).tolist() == [False, True, False]
    with np.errstate(invalid="ignore"):
        values = resolvent.at(at)[0, 0]
    assert np.isfinite(values).tolist() == [False, True, False]
    assert values[1] == pytest.approx(3.0 / (1.0 + 1.0j))
    assert resolvent.finite_zeros() == 2


@pytest.mark.parametrize(("seed", "below", "above"), [(0, 1, 3), (1, 2, 4), (1, 3, 5)])
def test_a_spring_beyond_the_force_is_not_strained_in_rest(seed, below, above):
    """Masses above it pull by their inertia: s^2, and one power more for its velocity, two for its acceleration."""
    rng = np.random.default_rng(seed)
    model = mv.Model("chain")
    for i in range(6):
        model.add_body(f"b{i}", 10 ** rng.uniform(-1, 1), (1, 1, 1), position=(i + 1.0, 0, 0))
        model.add_joint(f"j{i}", "prismatic", "ground", f"b{i}", axis=(1, 0, 0))
        model.add_spring(f"k{i}", f"b{i - 1}" if i else "ground", f"b{i}", (i, 0, 0), (i + 1.0, 0, 0),
                         stiffness=10 ** rng.uniform(1, 4), damping=0.1 * 10 ** rng.uniform(-1, 1))  # fmt: skip
    model.add_input("force", f"b{below}", "x")
    for quantity in ("displacement", "velocity", "acceleration"):
        model.add_output(quantity, f"b{above}", "x", relative_to=f"b{above - 1}", quantity=quantity)
    system = model.linearize()
    for power, quantity in enumerate(system.outputs, start=2):
        assert np.count_nonzero(system.transmission_zeros(quantity) == 0.0) == power
