"""Points on lines and planes, and rods: closed forms, ranks of loops, poses where the count of freedoms jumps."""

from itertools import combinations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv

INERTIA = (0.02, 0.03, 0.04)


def two_pendulums(stiffness=(7.0, 13.0)):
    """Two upright levers of 0.5 and 0.8 m on torsion springs, their tips joined by a rod along x."""
    model = mv.Model("pendulums")
    for name, x, height, mass, k in (("a", 0.0, 0.5, 2.0, stiffness[0]), ("b", 1.0, 0.8, 3.0, stiffness[1])):
        model.add_body(name, mass, INERTIA, (x, 0, height / 2))
        model.add_joint(f"{name}.hinge", "revolute", "ground", name, (x, 0, 0), axis=(0, 1, 0))
        model.add_bushing(f"{name}.k", "ground", name, (x, 0, 0), (0, 0, 0, 0, k, 0))
    return model


def test_pendulums_coupled_by_a_rod():
    """J = J_a + J_b (h_a/h_b)^2 and likewise the stiffness, where the rod is level with the lower tip."""
    model = two_pendulums()
    h = 0.5
    model.add_joint("rod", "distance", "a", "b", (0, 0, h), end=(1, 0, h))
    (omega,) = 2 * np.pi * model.linearize().modes().frequencies
    inertia = [INERTIA[1] + 2.0 * 0.25**2, INERTIA[1] + 3.0 * 0.4**2]
    assert_allclose(omega**2, (7.0 + 13.0) / sum(inertia), rtol=1e-14)


def test_an_inclined_rod_takes_its_cosines():
    """The rod from (0, 0, 0.5) to (1, 0, 0.8): its line's distance from each hinge is the lever."""
    model = two_pendulums()
    model.add_joint("rod", "distance", "a", "b", (0, 0, 0.5), end=(1, 0, 0.8))
    line = np.array((1.0, 0.3)) / np.hypot(1.0, 0.3)  # x and z
    lever = np.array([0.5 * line[0], 0.8 * line[0]])  # arms (0, h) of both hinges
    ratio = lever[0] / lever[1]
    inertia = [INERTIA[1] + 2.0 * 0.25**2, INERTIA[1] + 3.0 * 0.4**2]
    (omega,) = 2 * np.pi * model.linearize().modes().frequencies
    assert_allclose(omega**2, (7.0 + 13.0 * ratio**2) / (inertia[0] + inertia[1] * ratio**2), rtol=1e-14)


@pytest.mark.parametrize("first", ["ground", "bead"])
def test_a_bead_on_a_line(first):
    """Sliding along the inclined line against a spring to ground; its three rotations are free and rigid."""
    axis = np.array((1.0, 2.0, 2.0)) / 3
    model = mv.Model("bead")
    model.add_body("bead", 0.7, INERTIA, (0.1, 0.2, 0.3))
    second = "bead" if first == "ground" else "ground"
    model.add_joint("wire", "point_on_line", first, second, (0.1, 0.2, 0.3), axis=axis)
    model.add_bushing("k", "ground", "bead", (0.1, 0.2, 0.3), (90.0, 90.0, 90.0, 0, 0, 0))
    system = model.linearize()
    assert system.coordinates == ("wire.z", "wire.rx", "wire.ry", "wire.rz")
    modes = system.modes()
    assert (modes.frequencies[:3] == 0).all()
    assert_allclose(2 * np.pi * modes.frequencies[3], np.sqrt(90.0 / 0.7), rtol=1e-14)
    assert_allclose(abs(modes.body_shapes["bead"][:3, 3]) / np.linalg.norm(modes.body_shapes["bead"][:3, 3]), axis,
                    rtol=1e-13)  # fmt: skip


def test_a_plate_on_three_points():
    """Three points on a plane make a planar joint; the plate slides and turns on springs in that plane."""
    model = mv.Model("plate")
    model.add_body("plate", 2.0, INERTIA, (0, 0, 0.1))
    feet = [(1, 0, 0), (-0.5, 0.8, 0), (-0.5, -0.8, 0)]
    for i, foot in enumerate(feet):
        model.add_joint(f"foot{i}", "point_on_plane", "ground", "plate", foot)
    model.add_bushing("k", "ground", "plate", (0, 0, 0), (50.0, 70.0, 0, 0, 0, 11.0))
    system = model.linearize()
    assert system.dof == 3
    assert not system.redundant
    expected = np.sqrt(np.sort([50.0 / 2, 70.0 / 2, 11.0 / 0.04]))
    assert_allclose(2 * np.pi * system.modes().frequencies, expected, rtol=1e-13)


def test_a_fourth_foot_is_redundant_and_named():
    model = mv.Model("plate")
    model.add_body("plate", 2.0, INERTIA, (0, 0, 0.1))
    for i, foot in enumerate([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0.0)]):
        model.add_joint(f"foot{i}", "point_on_plane", "ground", "plate", foot)
    model.add_bushing("k", "ground", "plate", (0, 0, 0), (50.0, 70.0, 0, 0, 0, 11.0))
    system = model.linearize()
    assert system.dof == 3
    assert system.redundant == ("foot3.z",)
    assert "foot3.z" in system.explain()


def test_six_rods_are_a_hexapod():
    """Six rods in general position hold a body; without one of them it has the one freedom they leave."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(6, 3)), np.add(rng.normal(size=(6, 3)), (0, 0, 4))
    wrench = np.array([[*(e := (b - a) / np.linalg.norm(b - a)), *np.cross(b - (0, 0, 4), e)]
                       for a, b in zip(*points, strict=True)])  # fmt: skip
    for used in [*combinations(range(6), 5), range(6)]:
        model = mv.Model("hexapod")
        model.add_body("plate", 2.0, INERTIA, (0, 0, 4))
        for i in used:
            model.add_joint(f"rod{i}", "distance", "ground", "plate", points[0][i], end=points[1][i])
        model.add_bushing("k", "ground", "plate", (0, 0, 4), (50.0, 60.0, 70.0, 5.0, 6.0, 7.0))
        system = model.linearize()
        rows = wrench[list(used)]
        assert system.dof == 6 - np.linalg.matrix_rank(rows)
        if system.dof:
            (free,) = np.linalg.svd(rows)[2][5:]
            square = (free**2 @ (50.0, 60.0, 70.0, 5.0, 6.0, 7.0)) / (free**2 @ (2.0, 2.0, 2.0, *INERTIA))
            assert_allclose(2 * np.pi * system.modes().frequencies, np.sqrt(square), rtol=1e-12)


def parallelogram(extra, kind="distance"):
    """A bar on two parallel levers in a plane, a third rod ``extra`` m longer than parallel ones would be."""
    model = mv.Model("parallelogram")
    model.add_body("bar", 2.0, INERTIA, (0.5, 0, 1))
    model.add_joint("plane", "planar", "ground", "bar", (0.5, 0, 1), axis=(0, 1, 0))
    for i, x in enumerate((0.0, 0.4, 1.0)):
        model.add_joint(f"rod{i}", kind, "ground", "bar", (x, 0, -extra if i == 2 else 0), end=(x, 0, 1))
    model.add_bushing("k", "ground", "bar", (0.5, 0, 1), (50.0, 0, 0, 0, 0, 0))
    return model


def test_equal_parallel_rods_stay_redundant_where_the_bar_swings():
    """Three equal parallel rods: the third is redundant here and in all poses nearby, which only holds if the rods'
    directions are taken to turn with the rods."""
    system = parallelogram(0.0).linearize()
    assert system.dof == 1
    assert len(system.redundant) == 1
    (omega,) = 2 * np.pi * system.modes().frequencies
    assert_allclose(omega, np.sqrt(50.0 / 2), rtol=1e-14)


def test_parallel_rods_of_different_length_lock_when_the_bar_swings():
    for method in ("dense", "sparse"):
        with pytest.raises(mv.SingularPoseError, match="singular pose"):
            parallelogram(0.3).linearize(method=method)


def test_a_ball_on_a_line_that_slides_keeps_its_redundant_partner():
    """Two points of a bar on the same line, and a third: redundant wherever the bar slides to."""
    model = mv.Model("bar")
    model.add_body("bar", 2.0, INERTIA, (0, 0, 0))
    for i, z in enumerate((-0.5, 0.1, 0.5)):
        model.add_joint(f"eye{i}", "point_on_line", "ground", "bar", (0, 0, z))
    model.add_bushing("k", "ground", "bar", (0, 0, 0), (0, 0, 30.0, 0, 0, 4.0))
    for method in ("dense", "sparse"):
        system = model.linearize(method=method)
        assert (system.dof, len(system.redundant)) == (2, 2)
    expected = np.sort([np.sqrt(30.0 / 2), np.sqrt(4.0 / 0.04)])
    assert_allclose(2 * np.pi * model.linearize().modes().frequencies, expected, rtol=1e-13)


def test_variants_of_a_rod_are_those_of_single_models():
    model = two_pendulums()
    model.add_joint("rod", "distance", "a", "b", (0, 0, 0.5), end=(1, 0, 0.8))
    values = {"rod.position.z": np.array([0.5, 0.4, 0.3]), "rod.end.x": np.array([1.0, 1.02, 0.97])}
    batch = model.linearize(values=values)
    hung = mv.Model("hung")
    hung.add_body("bob", 2.0, INERTIA, (0.1, 0.2, -1))
    hung.add_joint("rod", "distance", "ground", "bob", (0, 0, 0), end=(0.1, 0.2, -0.9))
    hung.add_bushing("k", "ground", "bob", (0.3, 0.2, -1), (50.0, 60.0, 70.0, 5.0, 6.0, 7.0))
    swept = {"rod.position.z": np.array([0.1, -0.2]), "rod.end.y": np.array([0.0, 0.4])}
    for given, full, many in ((values, model, batch), (swept, hung, hung.linearize(values=swept))):
        for i in range(len(many.M)):
            single = full.with_values({name: array[i] for name, array in given.items()}).linearize()
            assert many.coordinates == single.coordinates
            assert_allclose(many.M[i], single.M, rtol=1e-13, atol=1e-14)
            assert_allclose(many.K[i], single.K, rtol=1e-13, atol=1e-12)


def test_variants_of_redundant_rods_are_looked_at_nearby():
    model = parallelogram(0.0)
    lower = np.array([-0.1, 0.0, 0.1])
    ends = {"rod?.position.z": lower}
    assert_allclose(model.linearize(values=ends).K, np.full((3, 1, 1), 50.0), rtol=1e-13)
    with pytest.raises(mv.SingularPoseError, match="variant 0"):
        model.linearize(values={"rod2.position.z": lower})
