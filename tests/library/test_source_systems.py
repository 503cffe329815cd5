"""Linkages, machines and arms of the sources against closed forms, extended precision and the sources' numbers."""

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.library import (
    _arms,
    carpet_scraper,
    four_bar,
    gripper,
    hoeken,
    puma,
    rssr,
    seven_r,
    six_link,
    stanford,
    toggle,
    two_link,
)
from tests.library.test_dh import PUMA, mass_matrix


def bar_energy(start, end, per_length, at):
    """Twice the kinetic energy of a slender bar for a unit rate of the crank, ends as functions of its angle."""
    (xs, ys), (xe, ye) = ([mp.diff(lambda q, c=c, f=f: f(q)[c], at) for c in (0, 1)] for f in (start, end))
    length = mp.hypot(*(e - s for s, e in zip(start(at), end(at), strict=True)))
    # the mean of the square of a velocity that is linear along the bar
    return per_length * length * (xs**2 + ys**2 + xe**2 + ye**2 + xs * xe + ys * ye) / 3


def meeting(first, second, one, two):
    def point(q):
        (x0, y0), (x1, y1) = first(q), second(q)
        x, y = x1 - x0, y1 - y0
        d = mp.hypot(x, y)
        along = (d**2 + mp.mpf(one) ** 2 - mp.mpf(two) ** 2) / (2 * d)
        across = mp.sqrt(mp.mpf(one) ** 2 - along**2)
        return x0 + (along * x - across * y) / d, y0 + (along * y + across * x) / d
    return point


@pytest.mark.parametrize("angle", [0.0, 0.9, 2.0, 4.1])
def test_crank_inertia_of_hoekens_linkage(angle):
    with mp.workdps(40):
        o, d = (lambda q: (mp.mpf(0), mp.mpf(0))), (lambda q: (mp.mpf("0.2"), mp.mpf(0)))
        a = lambda q: (mp.cos(q) / 10, mp.sin(q) / 10)  # noqa: E731
        b = meeting(a, d, 0.25, 0.25)
        inertia = sum(bar_energy(*ends, 2, mp.mpf(angle)) for ends in ((o, a), (a, b), (d, b)))
    system = hoeken(angle=angle).linearize(independent=["crank.rz"])
    assert_allclose(system.M, [[float(inertia)]], rtol=1e-12)
    assert len(system.redundant) == 3


def test_counterweights_keep_the_centre_of_mass():
    model = hoeken(balance_radius=0.08)
    weights = [model.bodies[f"counterweight{i}"].mass for i in (1, 3)]
    assert_allclose(weights, [0.4375, 1.5625], rtol=1e-15)
    centres = []
    for angle in (0.0, 1.0, 3.0, 5.0):
        bodies = hoeken(balance_radius=0.08, angle=angle).bodies.values()
        total = sum(body.mass for body in bodies)
        centres.append(sum(body.mass * np.array(body.position) for body in bodies) / total)
    assert_allclose(centres, np.tile(centres[0], (4, 1)), atol=1e-16)


def test_carpet_scraper():
    system = carpet_scraper(angle=2.0).linearize(independent=["crank.rz"])
    assert_allclose(system.M, [[0.10258352480]], rtol=1e-10)
    assert (system.dof, len(system.redundant)) == (1, 9)
    # the edges that the source cuts, 5, 6 and 7 of its figure B.2
    assert system.cut_joints == ("pin12", "pin25", "pin27")


def test_the_edge_of_the_scraper_moves_twice_as_far_as_the_tip():
    model = carpet_scraper(angle=1.0)
    model.add_output("tip.x", "link2", "x", model.joints["pin25"].position)
    system = model.linearize()
    moves = dict(zip(system.outputs, system.Cq[:, 0], strict=True))
    assert_allclose(moves["edge.x"], 2 * moves["tip.x"], rtol=1e-12)


@pytest.mark.slow
def test_cumulative_degrees_of_freedom():
    """Appendix B: 2 of the coupler along either path, 1 of its neighbours; the cut joint is one of the coupler's."""
    system = four_bar().linearize()
    assert system.provenance.topology.cumulative == {"ground": 0, "crank": 1, "coupler": 2, "rocker": 1}
    text = system.explain()
    assert "(CDOF) from ground: crank 1, coupler 2, rocker 1" in text
    assert "cut at C (CDOF 2 and 1)" in text
    text = carpet_scraper().linearize().explain()
    assert "from ground: link1 1, link2 2, link3 1, link4 1, link5 2, link6 2, link7 3" in text
    assert "cut at pin12 (CDOF 1 and 2), pin25 (CDOF 2 and 2), pin27 (CDOF 2 and 3)" in text
    loose = mv.Model("loose")
    loose.add_body("a", 1.0, (1, 1, 1))
    loose.add_body("b", 1.0, (1, 1, 1))
    loose.add_joint("pin", "revolute", "a", "b", (0, 0, 0))
    assert "from ground: a 6, b 7" in loose.linearize().explain()


def test_rssr_and_its_seven_revolute_joints():
    assert_allclose(rssr().linearize().modes().frequencies, [0.0, 4.10805239], rtol=2e-9)
    for make in (lambda: rssr(rocker_ball="universal"), seven_r):
        system = make().linearize()
        assert_allclose(system.modes().frequencies, [4.10414839], rtol=2e-9)
        assert not system.redundant


def test_toggle_has_its_closed_form():
    for angle, m in ((0.284, 0.05), (0.01, 0.2)):
        system = toggle(angle=angle, arm_mass=m).linearize(independent=["base.rz"])
        lever = 0.2 * np.sin(angle)
        assert_allclose(system.M, [[m * 0.01 * (2 / 3 + 2 * np.sin(angle) ** 2) + lever**2]], rtol=1e-12)
        assert_allclose(system.K, [[1e4 * lever**2]], rtol=1e-12)
        assert_allclose(abs(system.Cq[:1]), [[lever]], rtol=1e-12)


def test_two_link_arm():
    l1, l2, m1, m2, q = 0.4, 0.7, 1.3, 0.8, 1.1
    both = m2 * (l2**2 / 3 + l1 * l2 * np.cos(q) / 2)
    first = (m1 + 3 * m2) * l1**2 / 3 + m2 * l2**2 / 3 + m2 * l1 * l2 * np.cos(q)
    system = two_link(lengths=(l1, l2), masses=(m1, m2), angles=(0.3, q)).linearize()
    assert_allclose(system.M, [[first, both], [both, m2 * l2**2 / 3]], rtol=1e-13)


@pytest.mark.slow
def test_gripper_is_a_tree():
    model = gripper()
    system = model.linearize()
    assert {joint.name: (joint.first, joint.second) for joint in model.joints.values()} == {
        "joint1": ("ground", "palm"), "joint2": ("palm", "finger"), "joint3": ("palm", "knuckle"),
        "joint4": ("knuckle", "tip")}  # fmt: skip
    # finger and the other branch do not couple but by the palm
    assert_allclose(system.M[1, 2:], 0, atol=1e-18)
    slender = lambda a, m, theta: {"a": a, "mass": m, "theta": theta, "cm": (-a / 2, 0, 0),  # noqa: E731
                                   "inertia": (m * a**2 / 1200, m * a**2 / 12, m * a**2 / 12)}  # fmt: skip
    rows = [slender(0.3, 1.0, 0.4), slender(0.1, 0.3, 0.9) | {"parent": "link1", "offset": (0, 0.04, 0)},
            slender(0.1, 0.3, -0.9) | {"parent": "link1", "offset": (0, -0.04, 0)}, slender(0.1, 0.3, 1.2)]  # fmt: skip
    assert_allclose(system.M, mass_matrix(rows), rtol=1e-12, atol=1e-17)


def test_puma():
    assert list(_arms.PUMA) == PUMA
    assert_allclose(puma().linearize().M, mass_matrix(PUMA), rtol=1e-11, atol=1e-15)


def test_stanford_arm():
    rows = []
    for row in _arms.STANFORD:
        c = np.array(row["cm"], dtype=float)
        rows.append(row | {"inertia": np.diag(row["inertia"]) - row["mass"] * (c @ c * np.eye(3) - np.outer(c, c))})
    system = stanford().linearize()
    assert_allclose(system.M, mass_matrix(rows), rtol=1e-11, atol=1e-15)
    # the slide carries the masses from its own link on
    assert_allclose(system.M[2, 2], 4.25 + 1.08 + 0.63 + 0.51, rtol=1e-14)


@pytest.mark.parametrize("joints", ["RRRRRR", "RRPRRP"])
def test_six_equal_links(joints):
    rows = [{"a": 0.3, "b": 0.1, "alpha": np.pi / 2 * (-1) ** i, "theta": 0.3, "joint": letter, "mass": 2.0,
             "cm": (-0.15, 0, 0), "inertia": (1.5e-4, 0.015, 0.015)} for i, letter in enumerate(joints)]  # fmt: skip
    exact = mass_matrix(rows)
    assert_allclose(six_link(joints=joints).linearize().M, exact, rtol=0, atol=1e-13 * exact.max())


@pytest.mark.parametrize(
    ("make", "words", "hint"),
    [(hoeken, {"rocker": 0.05}, "lengths that meet"), (hoeken, {"crank": -1.0}, "crank = -1.0"),
     (carpet_scraper, {"crank": 0.0}, "crank = 0.0"), (toggle, {"angle": 0.0}, "stretched pose"),
     (rssr, {"rocker_ball": "fixed"}, "'spherical' or 'universal'"), (six_link, {"joints": "RRX"}, "six letters"),
     (two_link, {"masses": (1.0,)}, "two numbers"), (gripper, {"lengths": (1, 1, 1, 0)}, "length = 0"),
     (seven_r, {"masses": (1, 2)}, "three masses")],
)  # fmt: skip
def test_bad_arguments(make, words, hint):
    with pytest.raises(mv.ModelError, match=hint):
        make(**words)
