"""Chain, tree and ladder against closed forms and against references of 50 digits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.library import build, chain, ladder, tree
from tests.library import reference

TORSION = 1e4 * 180 / np.pi
X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)


def upper(modes):
    """One eigenvalue of each pair."""
    return modes.eigenvalues[modes.eigenvalues.imag > 0]


def edges_of_tree(layers):
    """Body k of a binary heap carries bodies 2 k and 2 k + 1."""
    return [(k // 2 if k > 1 else "ground", k) for k in range(1, 2**layers)]


def edges_of_ladder(layers):
    edges = []
    for i in range(layers):
        below = 3 * i - 1 if i else "ground"
        for side in (3 * i, 3 * i + 1):
            edges += [(below, side), (side, 3 * i + 2)]
    return edges


@pytest.mark.parametrize("name", reference.NAMES)
def test_eigenvalues_of_fifty_digits(name):
    modes = reference.model(name).linearize().modes()
    expected = reference.eigenvalues(name)
    error = abs(upper(modes) / expected - 1)
    assert error.max() < 1e-11
    # and no worse than what the modes say of themselves
    assert np.all(error <= np.maximum(modes.errors[modes.eigenvalues.imag > 0], 1e-13))
    assert_allclose(modes.damping_ratios, -expected.real / abs(expected), rtol=1e-11)


@pytest.mark.parametrize("n", [1, 3, 40])
def test_prismatic_chain(n):
    modes = chain(n, "prismatic").linearize().modes()
    omega = 1e2 * reference.fixed_free(n)
    assert_allclose(2 * np.pi * modes.frequencies, omega, rtol=1e-13)
    assert_allclose(modes.damping_ratios, 10 * omega / 2e4, rtol=1e-12)


def test_printed_digits_of_the_prismatic_chain():
    modes = chain(3, "P").linearize().modes()
    assert_allclose(modes.frequencies, [7.08306132, 19.84629679, 28.67872978], atol=0.5e-8)
    assert_allclose(modes.damping_ratios, [0.02225209, 0.06234898, 0.09009689], atol=0.5e-8)


def test_revolute_chain_about_its_own_line():
    modes = build("C3RF1").linearize().modes()
    assert_allclose(2 * np.pi * modes.frequencies, np.sqrt(TORSION) * reference.fixed_free(3), rtol=1e-13)
    assert_allclose(modes.frequencies, [53.6145070865, 150.2245105921, 217.0807073923], atol=0.5e-10)


def test_spherical_chain_bends_twice_and_twists_once():
    modes = chain(3, "S").linearize().modes()
    bend = chain(3, "R", axis=X).linearize().modes().frequencies
    twist = chain(3, "R", axis=Z).linearize().modes().frequencies
    assert_allclose(bend, [51.507353, 146.095638, 216.523831], atol=0.5e-6)
    assert_allclose(modes.frequencies, np.sort([*bend, *bend, *twist]), rtol=1e-13)


def test_cylindrical_chain_slides_and_turns_independently():
    both = chain(4, "C").linearize().modes().frequencies
    slide = chain(4, "P").linearize().modes().frequencies
    turn = chain(4, "R").linearize().modes().frequencies
    assert_allclose(both, np.sort([*slide, *turn]), rtol=1e-13)


def test_answers_do_not_depend_on_the_direction_in_space():
    straight = chain(5, "C", line=Y).linearize().modes()
    # axis and line turned together, not along any axis of the world
    turned = chain(5, "C", axis=(2, -1, 2), line=(1, 4, 1)).linearize().modes()
    assert_allclose(turned.frequencies, straight.frequencies, rtol=1e-12)


@pytest.mark.parametrize(("letter", "factor"), [("R", 1), ("P", 1), ("C", 2), ("S", 3)])
def test_degrees_of_freedom_of_open_families(letter, factor):
    assert chain(7, letter).linearize().dof == 7 * factor
    assert tree(4, letter).linearize().dof == 15 * factor


@pytest.mark.parametrize(
    ("joint", "axis", "dof", "redundant"),
    [("revolute", Z, 1, 3), ("revolute", X, 2, 4), ("cylindrical", Z, 4, 2), ("prismatic", Z, 3, 5),
     ("spherical", Z, 6, 0)],
)  # fmt: skip
@pytest.mark.parametrize("layers", [1, 6])
def test_degrees_of_freedom_and_redundant_rows_of_the_ladder(joint, axis, dof, redundant, layers):
    system = ladder(layers, joint, axis=axis).linearize()
    assert (system.dof, len(system.redundant), len(system.cut_joints)) == (dof * layers, redundant * layers, layers)


@pytest.mark.parametrize("layers", [1, 2, 6])
@pytest.mark.parametrize(("make", "edges"), [(tree, edges_of_tree), (ladder, edges_of_ladder)])
def test_prismatic_families_are_springs_on_a_graph(make, edges, layers):
    modes = make(layers, "prismatic").linearize().modes()
    assert_allclose(2 * np.pi * modes.frequencies, 1e2 * reference.graph_frequencies(edges(layers)), rtol=1e-13)


@pytest.mark.parametrize(("make", "size"), [(chain, 4), (tree, 3), (ladder, 2)])
@pytest.mark.parametrize("letter", "RPCS")
def test_bushings_add_up(make, size, letter):
    """Without ``total`` each of them has the full constants."""
    single, three = make(size, letter).linearize(), make(size, letter, springs=3, total=False).linearize()
    assert_allclose(three.K, 3 * single.K, rtol=1e-12, atol=1e-9)
    assert_allclose(three.C, 3 * single.C, rtol=1e-12, atol=1e-12)
    assert_allclose(three.M, single.M, rtol=1e-14, atol=0)


@pytest.mark.parametrize("name", ["C4{}F{}", "T3{}F{}", "L2{}F{}"])
@pytest.mark.parametrize("letter", "RPCS")
def test_frequencies_do_not_depend_on_the_number_of_bushings(name, letter):
    """Table 3 of the chapter divides stiffness and damping by their number."""
    single, three = build(name.format(letter, 1)).linearize(), build(name.format(letter, 3)).linearize()
    assert len(three.parameters) > len(single.parameters)
    for matrix in ("K", "C", "M"):
        assert_allclose(getattr(three, matrix), getattr(single, matrix), rtol=1e-12, atol=1e-9)


def bending_and_twist(n):
    """Frequencies [Hz] of the chapter's spherical chain, from links on transverse springs, written out by hand.

    In joint angles relative to the link before, body i turns by the sum t_i of the first i angles, and its centre
    moves by 0.2 (t_1 + ... + t_(i-1)) + 0.1 t_i.
    """
    turn = np.tril(np.ones((n, n)))
    shift = 0.2 * np.tril(np.ones((n, n)), -1) @ turn + 0.1 * turn
    bend = np.sqrt(np.linalg.eigvals(np.linalg.solve(turn.T @ turn + shift.T @ shift, TORSION * np.eye(n))).real)
    return np.sort([*bend, *bend, *(np.sqrt(TORSION) * reference.fixed_free(n))]) / (2 * np.pi)


def test_two_spring_dampers_at_fifty_joints():
    frequencies = build("C50SF2").linearize().modes().frequencies
    assert_allclose(frequencies, bending_and_twist(50), rtol=1e-9)
    assert_allclose(frequencies[-1], 240.8, atol=0.05)  # with full constants 340.6 Hz


@pytest.mark.parametrize("shape", [(6,), (6, 6)])
def test_bushings_share_whatever_they_are_given(shape):
    given = np.full(6, 8.0) if shape == (6,) else np.diag(np.full(6, 8.0))
    model = chain(1, springs=4, stiffness=given, damping=given.tolist())
    for spring in model.springs.values():
        assert_allclose(spring.stiffness, given / 4, rtol=0)
        assert_allclose(spring.damping, given / 4, rtol=0)


def test_without_bushings_everything_is_free():
    assert not chain(3, springs=0).springs
    assert_allclose(chain(3, springs=0).linearize().modes().frequencies, 0, atol=0)


@pytest.mark.parametrize("letter", "RPCS")
def test_ladder_joints_in_any_order(letter):
    model = ladder(4, letter)
    other = mv.Model("shuffled")
    for body in reversed(model.bodies.values()):
        other.add_body(**body.constructor_kwargs())
    for name in np.random.default_rng(4).permutation(list(model.joints)):
        other.add_joint(**model.joints[str(name)].constructor_kwargs())
    for spring in model.springs.values():
        other.add_bushing(**spring.constructor_kwargs())
    system, usual = other.linearize(), model.linearize()
    assert len(system.redundant) == len(usual.redundant)
    assert_allclose(system.modes().frequencies, usual.modes().frequencies, rtol=1e-12)


def test_geometry():
    c = chain(3)
    assert_allclose(c.bodies["body3"].position, (0, 0, 0.5), rtol=1e-15)
    assert_allclose(c.joints["joint3"].position, (0, 0, 0.4), rtol=1e-15)
    assert_allclose(chain(3, line=Y).bodies["body3"].position, (0, 0.5, 0), rtol=1e-15)
    assert (c.joints["joint3"].first, c.joints["joint3"].second) == ("body2", "body3")
    assert c.joints["joint1"].first == "ground"
    t = tree(3)
    assert t.bodies["body3.4"].position == (4, 3, 0)
    assert (t.joints["joint3.4"].first, t.joints["joint3.4"].position) == ("body2.2", (3, 2.5, 0))
    assert t.joints["joint1.1"].position == (1, 0.5, 0)
    u = ladder(2)
    assert_allclose(u.bodies["left2"].position, (-0.1, 0.3, 0), rtol=1e-15)
    assert_allclose(u.bodies["rung2"].position, (0, 0.4, 0), rtol=1e-15)
    assert (u.joints["right2.foot"].first, u.joints["right2.head"].second) == ("rung1", "rung2")


def test_names_follow_the_chapter():
    assert [chain(10).name, tree(7, "S").name, ladder(20, "C", springs=2).name] == ["C10RF1", "T7SF1", "L20CF2"]
    assert list(chain(1, springs=2).springs) == ["spring1.1", "spring1.2"]
    assert build("T3PF2").name == "T3PF2"


@pytest.mark.parametrize(
    ("model", "ports"),
    [(chain(3), {"rz"}), (chain(3, line=Y), {"x", "rz"}), (chain(3, "P"), {"z"}),
     (chain(3, "C", axis=X), {"x", "y", "rx"}), (chain(2, "S"), {"x", "y", "rx", "ry", "rz"}),
     (chain(2, axis=Y, line=Y), {"ry"}), (tree(1), {"x", "rz"}),
     (tree(3), {"x", "rz", "last.x", "last.y", "last.rz"}), (ladder(2), {"x"}), (ladder(2, "P"), {"z"})],
)  # fmt: skip
def test_ports_are_where_the_tip_can_move(model, ports):
    assert set(model.outputs) == ports
    system = model.linearize()
    assert np.abs(system.Cq).max(axis=1).min() > 0
    assert np.abs(system.B).max(axis=0).min() > 0


def test_the_tree_is_measured_at_both_ends_of_its_last_layer():
    """As in the chapter: force at the first body of a layer, displacement at its last."""
    model = tree(4)
    assert model.outputs["last.y"].body == "body4.8"
    assert model.inputs["Fx"].body == "body4.1"


@pytest.mark.parametrize(
    ("make", "words", "hint"),
    [(chain, {"n": 0}, "a whole number, at least 1"), (chain, {"n": 2.5}, "n = 2.5"),
     (tree, {"layers": True}, "layers"), (ladder, {"layers": -1}, "layers = -1"),
     (chain, {"joint": "Q"}, "R, P, C or S"), (tree, {"joint": "revolut"}, "Did you mean 'revolute'"),
     (chain, {"joint": None}, "joint = None"), (ladder, {"springs": -1}, "at least 0"),
     (chain, {"line": (0, 0, 0)}, "line"), (chain, {"axis": "z"}, "axis"), (chain, {"mass": -1.0}, "mass"),
     (tree, {"stiffness": "soft", "springs": 2}, "tree: stiffness"), (ladder, {"damping": None}, "ladder: damping"),
     (chain, {"spacing": "wide"}, "spacing")],
)  # fmt: skip
def test_bad_arguments(make, words, hint):
    with pytest.raises(mv.ModelError, match=hint):
        make(**words)
