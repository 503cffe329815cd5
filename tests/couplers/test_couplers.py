"""Couplers: closed forms of gears and racks, loops and cut joints against 50 digits, ranks, and what is refused."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import mbsvib as mv
from tests.support.compare import assert_same_eigenvalues, assert_same_matrices, linearized
from tests.support.exact import Exact
from tests.support.random_models import planar, seeds, spatial
from tests.support.sizes import examples


def shafts(count, slide=False):
    """Shafts along z beside one another, the last one a sledge along x if asked for, each on a spring to ground."""
    model = mv.Model("shafts")
    for i in range(count):
        name, last = f"s{i}", slide and i == count - 1
        model.add_body(name, 2.0 + i, (0.1, 0.1, 0.03 + 0.01 * i), (0.3 * i, 0, 0))
        kind, axis, k = ("prismatic", (1, 0, 0), (50.0, 0, 0, 0, 0, 0)) if last else ("revolute", (0, 0, 1), None)
        model.add_joint(f"{name}.j", kind, "ground", name, (0.3 * i, 0, 0), axis=axis)
        model.add_bushing(f"{name}.k", "ground", name, (0.3 * i, 0, 0), k or (0, 0, 0, 0, 0, 3.0 + i))
    return model


@pytest.mark.parametrize("ratio", [-0.4, 1.0, 25.0, -1e-6, 1e6])
@pytest.mark.parametrize("swap", [False, True])
def test_gears_reflect_inertia_by_the_square_of_their_ratio(ratio, swap):
    model = shafts(2)
    first, second = ("s1.j", "s0.j") if swap else ("s0.j", "s1.j")
    model.add_gear("mesh", first, second, ratio)
    j, k = ((0.04, 0.03), (4.0, 3.0)) if swap else ((0.03, 0.04), (3.0, 4.0))
    (omega,) = 2 * np.pi * model.linearize().modes().frequencies
    assert_allclose(omega**2, (k[0] + ratio**2 * k[1]) / (j[0] + ratio**2 * j[1]), rtol=1e-14)


def test_the_sign_of_a_ratio():
    """Outside meshing turns the gears against each other, where both axes point the same way."""
    model = shafts(2)
    model.add_gear("mesh", "s0.j", "s1.j", -0.5)
    for pinned in ("s0.j.rz", "s1.j.rz"):
        system = model.linearize(independent=[pinned])
        assert system.coordinates == (pinned,)
        moved = system.displacements([1.0])
        assert_allclose(moved["s1"][5] / moved["s0"][5], -0.5, rtol=1e-15)
    reversed_shaft = model.replace("s1.j", first="s1", second="ground").linearize().displacements([1.0])
    assert_allclose(reversed_shaft["s1"][5] / reversed_shaft["s0"][5], 0.5, rtol=1e-15)


def test_a_worm_is_a_gear_across_axes():
    model = mv.Model("worm")
    model.add_body("worm", 0.2, (1e-4, 1e-4, 1e-4), (0, 0, 0.05))
    model.add_body("wheel", 1.0, (0.02, 0.02, 0.03), (0, 0, 0))
    model.add_joint("screw", "revolute", "ground", "worm", (0, 0, 0.05), axis=(1, 0, 0))
    model.add_joint("shaft", "revolute", "ground", "wheel", (0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("k", "ground", "wheel", (0, 0, 0), (0, 0, 0, 0, 8.0, 0))
    model.add_worm("drive", "screw", "shaft", 1 / 40)
    system = model.linearize(independent=["shaft.rz"])
    assert_allclose(system.M, [[0.02 + 1600 * 1e-4]], rtol=1e-14)
    assert_allclose(system.displacements([1.0])["worm"][3], 40.0, rtol=1e-14)


def test_a_rack_moves_by_its_pitch_radius():
    model = shafts(2, slide=True)
    model.add_rack("rack", "s0.j", "s1.j", -0.05)
    system = model.linearize(independent=["s0.j.rz"])
    assert_allclose(system.M, [[0.03 + 3.0 * 0.05**2]], rtol=1e-14)
    assert_allclose(system.K, [[3.0 + 50.0 * 0.05**2]], rtol=1e-14)
    assert_allclose(system.displacements([1.0])["s1"][0], -0.05, rtol=1e-14)


def test_a_differential():
    """sun + 3 ring - 4 carrier = 0: two freedoms of three shafts, in whichever coordinates."""
    model = shafts(3)
    model.add_coupler("differential", {"s0.j": 1.0, "s1.j": 3.0, "s2.j.rz": -4.0})
    system = model.linearize()
    assert system.dof == 2
    row = np.array([[1.0, 3.0, -4.0]])
    null = np.linalg.svd(row)[2][1:].T
    squares = np.linalg.eigvals(np.linalg.solve(null.T @ np.diag([0.03, 0.04, 0.05]) @ null,
                                                null.T @ np.diag([3.0, 4.0, 5.0]) @ null))  # fmt: skip
    assert_allclose(2 * np.pi * system.modes().frequencies, np.sqrt(np.sort(squares)), rtol=1e-13)


@pytest.mark.parametrize("last", [-2.0 * -3.0, 5.0])
def test_a_train_that_closes_is_redundant_where_its_ratios_agree(last):
    model = shafts(3)
    model.add_gear("ab", "s0.j", "s1.j", -2.0)
    model.add_gear("bc", "s1.j", "s2.j", -3.0)
    model.add_gear("ac", "s0.j", "s2.j", last)
    system = model.linearize()
    agree = last == 6.0
    assert system.dof == (1 if agree else 0)
    assert len(system.redundant) == (1 if agree else 0)
    assert set(system.redundant) <= {"ab", "bc", "ac"}


def test_gears_that_share_nothing_are_decided_apart():
    model = shafts(4)
    model.add_gear("ab", "s0.j", "s1.j", -2.0)
    model.add_gear("cd", "s2.j", "s3.j", 1.5)
    assert [group.joints for group in model.linearize().provenance.reduction.groups] == [("ab",), ("cd",)]
    model.add_coupler("all", {"s0.j": 1.0, "s3.j": 1.0})
    (group,) = model.linearize().provenance.reduction.groups
    assert sorted(group.joints) == ["ab", "all", "cd"]


def four_bar(points):
    model = mv.Model("four-bar")
    names = ("ground", "crank", "coupler", "rocker", "ground")
    points = np.array(points, dtype=float)
    for i, name in enumerate(names[1:4]):
        model.add_body(name, 1.0 + i, (0.1, 0.12, 0.11), position=(points[i] + points[i + 1]) / 2)
    for i in range(4):
        model.add_joint(f"j{i}", "revolute", names[i], names[i + 1], position=points[i])
        model.add_bushing(f"s{i}", names[i], names[i + 1], points[i], (0, 0, 0, 0, 0, 100.0 * (i + 1)))
    return model


PARALLEL, TRAPEZOID = ((0, 0, 0), (0.3, 1, 0), (2.3, 1, 0), (2, 0, 0)), ((0, 0, 0), (0.3, 1, 0), (1.7, 1, 0), (2, 0, 0))


def test_a_gear_that_a_parallelogram_implies_is_redundant_in_all_its_poses():
    model = four_bar(PARALLEL)
    single = model.linearize()
    model.add_gear("equal", "j0", "j3", -1.0)  # the rocker is the first body of j3
    system = model.linearize()
    assert system.dof == 1
    assert len(system.redundant) == len(single.redundant) + 1
    assert_allclose(system.modes().frequencies, single.modes().frequencies, rtol=1e-12)
    assert model.replace("equal", ratio=-1.5).linearize().dof == 0


def test_a_gear_that_a_loop_implies_in_one_pose_only_is_refused():
    """In a symmetric trapezoid both cranks turn at one rate, but only while it is symmetric."""
    model = four_bar(TRAPEZOID)
    model.add_gear("equal", "j0", "j3", -1.0)
    for cut in ("j0", "j1", "j2", "j3"):
        with pytest.raises(mv.SingularPoseError, match=r"closed by .*equal.*: singular pose"):
            model.linearize(cut=[cut])


@pytest.mark.slow
@examples(10, slow=40)
@given(seeds(), st.integers(3, 5), st.integers(1, 2))
def test_cut_where_one_likes(seed, bodies, loops):
    """Coordinates of cut joints are coupled as those of the tree: every cut gives the same eigenvalues."""
    model = planar(seed, bodies=bodies, loops=loops)
    names = list(model.joints)
    rng = np.random.default_rng(seed)
    a, b = rng.choice(len(names), 2, replace=False)
    model.add_coupler("c", {names[a]: 1.0, names[b]: rng.normal()})
    system = linearized(model)
    assume(system.dof)
    for cut in system.tree[-2:] + system.cut_joints:
        try:
            other = linearized(model, cut=[cut])
        except mv.ModelError:  # not a joint of a loop
            continue
        assert_same_eigenvalues(other.modes().eigenvalues, system.modes().eigenvalues, 1e-9)


@pytest.mark.slow
@examples(12, slow=60)
@given(seeds(), st.integers(2, 4), st.integers(0, 2), st.integers(1, 2))
def test_same_matrices_as_in_fifty_digits(seed, bodies, loops, couplers):
    kinds = ("cylindrical", "universal", "spherical", "planar", "screw", "revolute", "free", "point_on_line")
    model = spatial(seed, bodies=bodies, loops=loops, kinds=kinds)
    rng = np.random.default_rng(seed)
    coordinates = [f"{joint.name}.{d}" for joint in model.joints.values() for d, _ in joint.freedom]
    for i in range(couplers):
        count = min(len(coordinates), int(rng.integers(2, 4)))
        assume(count > 1)
        selected = rng.choice(coordinates, count, replace=False)
        model.add_coupler(f"c{i}", {str(name): float(rng.normal() * 10 ** rng.uniform(-1, 1)) for name in selected})
    reference = Exact(model)
    system = linearized(model)
    assert system.dof == reference.dof
    assume(system.dof and min((g.retained for g in system.provenance.reduction.groups), default=1.0) > 1e-3)
    assert_same_matrices(system, reference, 1e-10)


@pytest.mark.parametrize("cut", [False, True])
def test_geared_pendulums(cut):
    """(J1 + r^2 J2) w^2 = m1 g d1 + r^2 m2 g d2, each J about its own hinge; also where a loop cuts one hinge."""
    model = mv.Model("pendulums", gravity=(0, 0, -9.81))
    for name, x, mass, d in (("a", 0.0, 2.0, 0.5), ("b", 1.0, 3.0, 0.8)):
        model.add_body(name, mass, (0.1, 0.1, 0.1), (x, 0, -d))
        model.add_joint(f"{name}.hinge", "revolute", "ground", name, (x, 0, 0), axis=(0, 1, 0))
    if cut:
        model.add_joint("a.guide", "planar", "ground", "a", (0, 0, -0.5), axis=(0, 1, 0))
    model.add_gear("mesh", "a.hinge", "b.hinge", -0.7)
    system = model.linearize(cut=["a.hinge"] if cut else None)
    square = 9.81 * (2.0 * 0.5 + 0.49 * 3.0 * 0.8) / (0.1 + 2.0 * 0.25 + 0.49 * (0.1 + 3.0 * 0.64))
    assert_allclose(2 * np.pi * system.modes().frequencies, np.sqrt(square), rtol=1e-13)


def test_explained():
    model = shafts(3)
    model.add_gear("mesh", "s0.j", "s1.j", -0.5)
    text = model.linearize().explain()
    assert "none but those of couplers" in text
    assert "mesh: 1 of 1 constraint rows independent" in text
    assert "dependent: s1.j.rz" in text or "dependent: s0.j.rz" in text


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_ranks_know_no_units(scale):
    """The same train of gears and a rack, in sizes from a watch to a ship lift."""
    model = mv.Model("lift")
    for name, kind, at in (("pinion", "revolute", 0.0), ("sledge", "prismatic", 1.0)):
        model.add_body(name, 1.0, np.array((1.0, 1.0, 1.0)) * scale**2, (at * scale, 0, 0))
        model.add_joint(f"{name}.j", kind, "ground", name, (at * scale, 0, 0))
    model.add_bushing("k", "ground", "sledge", (0, 0, 0), (0, 0, 7.0, 0, 0, 0))
    model.add_rack("drive", "pinion.j", "sledge.j", 0.2 * scale)
    model.add_coupler("again", {"pinion.j.rz": -3.0 * 0.2 * scale, "sledge.j.z": 3.0})
    system = model.linearize()
    assert (system.dof, len(system.redundant)) == (1, 1)
    assert_allclose(2 * np.pi * system.modes().frequencies, np.sqrt(7.0 / (1.0 + 25.0)), rtol=1e-13)


@pytest.mark.parametrize("at", [0.0, 0.3])
def test_minimal_coordinates_at_one_point_know_no_units(at):
    """Nothing but the couplers has a length where all joints are at one point."""
    chosen = []
    for unit in (1.0, 1e-3, 1e3):
        model, point = mv.Model("one point"), (at * unit, 0, 0)
        for name, kind in (("a", "revolute"), ("b", "prismatic"), ("c", "prismatic"), ("d", "revolute")):
            model.add_body(name, 1.0, np.ones(3) * unit**2, point)
            model.add_joint(f"{name}.j", kind, "ground", name, point)
        model.add_coupler("rack", {"a.j.rz": 0.02 * unit, "b.j.z": -1.0})
        model.add_coupler("screw", {"d.j.rz": 1.0, "c.j.z": -4.0 / unit})
        chosen.append(model.linearize().coordinates)
    assert chosen[0] == chosen[1] == chosen[2]


def test_parameters_and_variants():
    model = shafts(3, slide=True)
    model.add_gear("mesh", "s0.j", "s1.j", -0.5)
    model.add_rack("rack", "s1.j", "s2.j", 0.1)
    model.add_coupler("same", {"s1.j.rz": -0.2, "s2.j": 2.0})
    assert {"mesh.ratio": -0.5, "rack.radius": 0.1, "same.coefficient.1": -0.2}.items() <= model.parameters.items()
    assert model.parameters.units["rack.radius"] == "m"
    assert model.parameters.units["mesh.ratio"] == "-"
    assert model.linearize().parameters["same.coefficient.2"] == 2.0
    values = {"mesh.ratio": np.array([0.5, 2.0, -3.0]), "rack.radius": np.array([0.1, 0.2, 0.3]),
              "same.coefficient.1": np.array([-0.2, -0.4, -0.6])}  # fmt: skip
    batch = model.linearize(values=values)
    for i in range(3):
        single = model.with_values({name: array[i] for name, array in values.items()}).linearize(
            independent=batch.coordinates)  # fmt: skip
        for key in ("M", "K", "B", "Cq"):
            assert_allclose(getattr(batch, key)[i], getattr(single, key), rtol=1e-13, atol=1e-15)
    with pytest.raises(mv.SingularPoseError, match="variant 1"):
        model.linearize(values={"rack.radius": np.array([0.1, 0.2])})
    with pytest.raises(mv.ModelError, match=r"variant 1: values\['mesh.ratio'\]\[1\] = 0\. gear 'mesh': ratio"):
        model.linearize(values={"mesh.ratio": np.array([0.1, 0.0])})


def test_variants_of_a_cut_joint():
    model = four_bar(((0, 0, 0), (0.3, 1, 0), (1.5, 1.2, 0), (2, 0, 0)))
    model.add_body("arm", 0.5, (0.02, 0.02, 0.03), (0.5, -0.5, 0))
    model.add_joint("arm.j", "revolute", "ground", "arm", (0, -0.5, 0))
    model.add_bushing("arm.k", "ground", "arm", (0, -0.5, 0), (0, 0, 0, 0, 0, 9.0))
    model.add_gear("mesh", "arm.j", "j2", 0.7)
    assert "j2" in model.linearize(cut=["j2"]).cut_joints
    values = {"j2.position.x": np.array([1.5, 1.6, 1.4]), "j2.position.y": np.array([1.2, 1.25, 1.1])}
    batch = model.linearize(values=values, cut=["j2"])
    for i in range(3):
        single = model.with_values({name: array[i] for name, array in values.items()}).linearize(
            cut=["j2"], independent=batch.coordinates)  # fmt: skip
        assert_allclose(batch.M[i], single.M, rtol=1e-12)
        assert_allclose(batch.K[i], single.K, rtol=1e-12)


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_files_give_the_same_couplers_back(tmp_path, suffix):
    model = shafts(4, slide=True)
    model.add_gear("mesh", "s0.j", "s1.j", -0.5)
    model.add_worm("worm", "s0.j.rz", "s2.j", 0.025)
    model.add_rack("rack", "s1.j", "s3.j", 0.1)
    model.add_coupler("sum", {"s0.j": 1.0, "s1.j": 1.0, "s2.j": -1.0})
    path = mv.save(model, tmp_path / f"shafts{suffix}")
    assert dict(mv.load(path).couplers) == dict(model.couplers)
    assert mv.load(path).linearize().dof == model.linearize().dof


CALLS = [
    (("gear", "g", "s0.j", "s0.j", 1.0), r"gear 'g': couples 's0.j.rz' with itself; name two different"),
    (("gear", "g", "s0.j", "s9.j", 1.0), r"gear 'g': second = 's9.j'; expected a rotation of a joint.*Did you mean"),
    (("gear", "g", "s0.j", "nothing like it", 1.0), r"expected a rotation of a joint.*Add joints before"),
    (("gear", "g", "s0.j", "s2.j", 1.0), r"second = 's2.j'; .* The prismatic joint 's2.j' has the coordinates z\."),
    (("gear", "g", "s0.j.rx", "s1.j", 1.0), r"first = 's0.j.rx'; .* The revolute joint 's0.j' has the coordinates rz"),
    (("gear", "g", "s0.j", "s1.j", 0.0), r"gear 'g': ratio = 0.0; expected turns of second per turn.*not zero"),
    (("gear", "g", "s0.j", "s1.j", "2"), r"ratio = '2'; expected turns"),
    (("gear", "g", "s0.j", "s1.j", np.nan), "NaN"),
    (("gear", "g", 3, "s1.j", 1.0), "first = 3; expected a rotation of a joint"),
    (("gear", "s0", "s0.j", "s1.j", 1.0), "gear 's0': the name is taken by a body"),
    (("worm", "s0", "s0.j", "s1.j", 1.0), "worm 's0': the name is taken by a body"),
    (("rack", "s0", "s0.j", "s2.j", 1.0), "rack 's0': the name is taken by a body"),
    (("coupler", "s0", {"s0.j": 1.0, "s1.j": 1.0}), "coupler 's0': the name is taken by a body"),
    (("worm", "w", "s0.j", "s1.j", np.inf), r"worm 'w': ratio = inf; expected turns of the wheel per turn"),
    (("rack", "r", "s2.j", "s0.j", 1.0), r"rack 'r': pinion = 's2.j'; expected a rotation"),
    (("rack", "r", "s0.j", "s1.j", 1.0), r"rack 'r': rack = 's1.j'; expected a translation of a joint"),
    (("rack", "r", "s0.j", "s2.j", 0), r"radius = 0; expected the pitch radius \[m\]"),
    (("coupler", "c", {"s0.j": 1.0}), r"coupler 'c': coefficients = .*two or more.* take a joint that does not have"),
    (("coupler", "c", {}), r"expected a coefficient for each of two or more"),
    (("coupler", "c", [1.0, 2.0]), r"coefficients = \[1.0, 2.0\]; expected a coefficient for each"),
    (("coupler", "c", {"s0.j": 1.0, "s1.j": 0.0}), r"coefficients = 0.0; expected a finite number for 's1.j.rz', not"),
    (("coupler", "c", {"s0.j": 1.0, "s0.j.rz": 2.0}), r"'s0.j.rz' is given twice"),
    (("coupler", "c", {"s0.j": 1.0, "knee.rz": 2.0}), r"coefficients = 'knee.rz'; expected a coordinate of a joint"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), CALLS)
def test_what_is_wrong_is_named(call, message):
    model = shafts(3, slide=True)
    kind, *given_words = call
    with pytest.raises(mv.ModelError, match=message) as caught:
        getattr(model, f"add_{kind}")(*given_words)
    assert caught.value.element
    assert caught.value.field
    assert not model.couplers


def test_joints_by_object_and_names_in_use():
    model = shafts(2)
    joints = list(model.joints.values())
    part = model.add_gear("mesh", joints[0], joints[1], 2)
    assert part.constructor_kwargs() == {"name": "mesh", "first": "s0.j.rz", "second": "s1.j.rz", "ratio": 2.0}
    with pytest.raises(mv.ModelError, match="the name is taken by a gear"):
        model.add_body("mesh", 1.0, (1, 1, 1))


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("scale", [1.0, 1e14, 1e-14])
def test_a_coupler_and_its_multiples_are_the_same(scale, method):
    """Two wheels and a rack: a = -2 b, b = -100 z, and a = 200 z, which the others imply."""
    model = mv.Model("rack")
    for name, x in (("a", 0.0), ("b", 1.0)):
        model.add_body(name, 1.0, (1, 1, 1), (x, 0, 0))
        model.add_joint(f"j{name}", "revolute", "ground", name, (x, 0, 0), axis=(0, 0, 1))
    model.add_body("rack", 4.0, (1, 1, 1), (0, 0, 1))
    model.add_joint("rail", "prismatic", "ground", "rack", axis=(0, 0, 1))
    model.add_bushing("k", "ground", "a", (0, 0, 0), (0, 0, 0, 0, 0, 5.0))
    model.add_coupler("wheels", {"ja.rz": scale, "jb.rz": 2 * scale})
    model.add_coupler("pinion", {"jb.rz": scale, "rail.z": 100 * scale})
    model.add_coupler("again", {"ja.rz": 1.0, "rail.z": -200.0})
    system = model.linearize(method=method)
    assert (system.dof, system.redundant) == (1, ("again",))
    frequency = system.modes(1).frequencies if method == "sparse" else system.modes().frequencies
    np.testing.assert_allclose(frequency, np.sqrt(5.0 / (1 + 0.5**2 + 4.0 / 200**2)) / (2 * np.pi), rtol=1e-12)
