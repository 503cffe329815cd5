"""Paths of equilibria against closed forms: snap-through, snap-back, branches, and models held in their poses."""

import numpy as np
import pytest
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib import beams, library
from tests.equilibrium.test_search import pendulum

STIFF = 1000.0


def truss(height, free=("y",), pusher=None):
    """Two springs of a flat arch of half span 1 m carry a body between them; a spring ``pusher`` may lead it."""
    model = mv.Model("truss")
    model.add_body("p", 2.0, (1, 1, 1), position=(0, height, 0))
    model.add_joint("arch", None, "ground", "p", position=(0, height, 0), free=free)
    for side in (-1, 1):
        model.add_spring(f"rod{side}", "ground", "p", start=(side, 0, 0), end=(0, height, 0), stiffness=STIFF)
    if pusher is not None:
        model.add_body("top", 1.0, (1, 1, 1), position=(0, height + 5, 0))
        model.add_joint("lead", "prismatic", "ground", "top", position=(0, height + 5, 0), axis=(0, 1, 0))
        model.add_spring("push", "p", "top", start=(0, height, 0), end=(0, height + 5, 0), stiffness=pusher)
    return model


def force(height, v):
    """The force that holds the arch at a displacement v, and its derivatives to v and across."""
    y, free_length = height + v, np.hypot(1, height)
    length = np.hypot(1, y)
    stretched = 1 - free_length / length
    along = 2 * STIFF * (y**2 / length**2 + stretched / length**2)
    return 2 * STIFF * stretched * y, along, 2 * STIFF * (1 / length**2 + stretched * y**2 / length**2)


@pytest.mark.slow
def test_an_arch_snaps_where_its_force_is_largest():
    values = [-0.1, -0.3, -0.5, -0.7, -1.0, -1.2]
    path = truss(0.5).path("arch.y", values)
    expected = np.array([force(0.5, v) for v in values])
    assert path.forces == pytest.approx(expected[:, 0], rel=1e-12, abs=1e-9)
    with np.errstate(invalid="ignore"):
        frequencies = np.sqrt(expected[:, 1] / 2.0) / (2 * np.pi)
    assert path.frequencies[:, 0] == pytest.approx(frequencies, rel=1e-10, nan_ok=True)
    assert path.stable.tolist() == (expected[:, 1] > 0).tolist()
    assert path.stable_held.all()
    limits = [brentq(lambda v: force(0.5, v)[1], *ends) for ends in ((-0.3, -0.1), (-1.0, -0.7))]
    assert [(point.kind, point.before) for point in path.points] == [("limit", 1), ("limit", 4)]
    assert [point.value for point in path.points] == pytest.approx(limits, rel=1e-8)
    assert [point.force for point in path.points] == pytest.approx([force(0.5, v)[0] for v in limits], rel=1e-12)
    assert path.points[0].direction == {"arch.y": 1.0}


def test_a_steep_arch_sways_before_it_snaps():
    """The path of the symmetric arch goes on; the crossing one leaves it sideways. A body beside it takes no part."""
    model = truss(4.0, free=("x", "y"))
    model.add_body("beside", 1.0, (1, 1, 1), position=(3, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "beside", position=(3, 0, 0), axis=(0, 1, 0))
    model.add_spring("holds", "ground", "beside", start=(3, -1, 0), end=(3, 0, 0), stiffness=STIFF)
    path = model.path("arch.y", [-0.5, -1.0, -2.0])
    at = brentq(lambda v: force(4.0, v)[2], -2.0, -0.1)
    branches = [point for point in path.points if point.kind == "branch"]
    assert [point.value for point in branches] == pytest.approx([at], rel=1e-8)
    assert branches[0].direction["arch.x"] == pytest.approx(1.0)
    assert abs(branches[0].direction["arch.y"]) < 1e-9
    assert path.stable_held.tolist() == [force(4.0, v)[2] > 0 for v in path.values]
    assert path.forces == pytest.approx([force(4.0, v)[0] for v in path.values], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("sense", [1, -1])
def test_the_crossing_path_of_a_steep_arch(sense):
    """Sideways one rod has its free length and the other one turns: balance of both forces across vanishes there."""
    path = truss(4.0, free=("x", "y")).path("arch.y", [-0.2, -0.35, -0.6], switch=sense)
    free_length = np.hypot(1, 4.0)
    for there, held, stable in zip(path.models, path.forces, path.stable_held, strict=True):
        x, y, _ = there.bodies["p"].position
        pulls = np.zeros(2)
        for side in (-1, 1):
            rod = np.array([x - side, y])
            length = np.linalg.norm(rod)
            pulls += STIFF * (length - free_length) * rod / length
        assert pulls == pytest.approx([0.0, held], abs=1e-8)
        assert stable
    across = [there.bodies["p"].position[0] for there in path.models]
    assert across[0] == pytest.approx(0.0, abs=1e-12)
    assert 0.2 < sense * across[1] < sense * across[2]


@pytest.mark.slow
def test_the_sense_of_a_crossing_path_is_that_of_its_largest_motion():
    """The arch takes a cart along: whichever way its rail points, the arch goes to +x."""
    for axis in ((1, 0, 0), (-1, 0, 0)):
        model = truss(4.0, free=("x", "y"))
        model.add_body("cart", 1.0, (1, 1, 1), position=(0, 4, 0))
        model.add_joint("rail", "prismatic", "p", "cart", position=(0, 4, 0), axis=axis)
        model.add_bushing("holds", "ground", "cart", (0, 4, 0), (10.0, 0, 0, 0, 0, 0))
        model.add_bushing("takes", "p", "cart", (0, 4, 0), (60.0, 0, 0, 0, 0, 0))
        path = model.path("arch.y", [-0.6], switch=1)
        point = next(point for point in path.points if point.kind == "branch")
        assert point.direction["arch.x"] == 1.0
        assert point.direction["rail.z"] == pytest.approx(-axis[0] / 7.0)  # the cart follows by 60 / (60 + 10)
        assert path.models[0].bodies["p"].position[0] > 0.2


@pytest.mark.slow
def test_a_soft_pusher_snaps_back_though_it_is_held():
    """The pusher moves by w = v + F(v) / k, which has extremes; a value behind one is reached on the way after it."""
    soft = 50.0

    def led(v):
        return v + force(0.5, v)[0] / soft

    def slope(v):
        return 1 + force(0.5, v)[1] / soft

    turns = [brentq(slope, *ends) for ends in ((-0.4, -0.05), (-0.95, -0.6))]
    path = truss(0.5, pusher=soft).path("lead.z", [-0.3, -2.5])
    assert [point.kind for point in path.points if point.kind != "limit"] == ["turning"] * 2
    turning = [point.value for point in path.points if point.kind == "turning"]
    assert turning == pytest.approx([led(v) for v in turns], rel=1e-8)
    assert turning[0] < -0.9 < turning[1] + 1.0
    last = brentq(lambda v: led(v) + 2.5, -3.0, turns[1])
    assert path.forces[-1] == pytest.approx(force(0.5, last)[0], rel=1e-11)
    assert path.models[-1].bodies["p"].position[1] == pytest.approx(0.5 + last, rel=1e-11)


def column(elbow=3.0, length=0.5, pusher=400.0):
    """Two rigid links, one above the other, with a torsion spring at their elbow; a slider pushes them by a spring."""
    model = mv.Model("column")
    for name, x in (("low", 0.25), ("high", 0.75)):
        model.add_body(name, 1.0, (0.02,) * 3, position=(0, 0, x))
    model.add_body("top", 0.5, (0.01,) * 3, position=(0, 0, 1.0))
    model.add_body("press", 1.0, (0.01,) * 3, position=(0, 0, 2.0))
    for name, a, b, x in (("foot", "ground", "low", 0.0), ("elbow", "low", "high", 0.5), ("head", "high", "top", 1.0)):
        model.add_joint(name, "revolute", a, b, position=(0, 0, x), axis=(0, 1, 0))
    for name, body, x in (("guide", "top", 1.0), ("drive", "press", 2.0)):
        model.add_joint(name, "prismatic", "ground", body, position=(0, 0, x), axis=(0, 0, 1))
    model.add_torsion_spring("knee", "low", "high", axis=(0, 1, 0), stiffness=elbow)
    model.add_spring("push", "top", "press", start=(0, 0, 1.0), end=(0, 0, 2.0), stiffness=pusher)
    return model


@pytest.mark.slow
@pytest.mark.parametrize("sense", [1, -1])
def test_a_column_of_two_links_buckles(sense):
    """P = 2 k / l; beyond, each link leans by an angle a with P l sin(a) = 2 k a (dead load of the pusher)."""
    critical = 2 * 3.0 / 0.5
    straight = column().path("drive.z", [-0.02, -0.06])
    branch = [point for point in straight.points if point.kind == "branch"]
    assert [point.value for point in branch] == pytest.approx([-critical / 400.0], rel=1e-8)
    assert [point.force for point in branch] == pytest.approx([-critical], rel=1e-8)
    assert straight.stable_held.tolist() == [True, False]
    assert straight.forces == pytest.approx([-8.0, -24.0], rel=1e-12)
    bent = column().path("drive.z", [-0.02, -0.06, -0.2], switch=sense)
    assert bent.stable_held.all()
    for there, force, value in zip(bent.models[1:], bent.forces[1:], bent.values[1:], strict=True):
        x, _, z = there.bodies["low"].position
        lean = np.arctan2(x, z)
        assert abs(lean) > 0.1
        assert -force * 0.5 * np.sin(lean) == pytest.approx(2 * 3.0 * lean, rel=1e-9)
        shorter = 2 * 0.5 * (1 - np.cos(lean))
        assert -force == pytest.approx(400.0 * (-value - shorter), rel=1e-9)
    leans = [np.sign(there.bodies["low"].position[0]) for there in bent.models[1:]]
    assert leans[0] == leans[1]


@pytest.mark.few(1)
@pytest.mark.parametrize("share", [0.9, 1.2])
def test_a_column_that_one_step_takes_to_its_load_must_be_stable_there(share):
    """The press moves as a linear spring says, in one step; the column takes 2 k / l = 12 N before it buckles."""
    model = column()
    model.add_load("P", "press", (0, 0, -share * 12.0))
    if share < 1.0:
        position = model.equilibrium().bodies["press"].position
        assert position == pytest.approx((0.0, 0.0, 2.0 - share * 12.0 / 400.0), abs=1e-12)
        return
    with pytest.raises(mv.EquilibriumError, match="it would snap through") as caught:
        model.equilibrium()
    reached = float(str(caught.value).split("under ")[1].split("%")[0]) / 100
    assert reached == pytest.approx(1.0 / share, abs=0.003)


def test_a_path_reverses_with_its_values():
    path = truss(0.5).path("arch.y", [0.1, -0.2, 0.1, 0.0])
    assert path.forces == pytest.approx([force(0.5, v)[0] for v in path.values], abs=1e-9)
    assert path.forces[0] == pytest.approx(path.forces[2], rel=1e-12)
    assert path.points == ()


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "coordinate", "words"), [
    ("revolute", "rz", {"axis": (0.3, -0.5, 0.8)}), ("prismatic", "z", {"axis": (0.3, -0.5, 0.8)}),
    ("cylindrical", "rz", {"axis": (0.3, -0.5, 0.8)}), ("cylindrical", "z", {"axis": (0.3, -0.5, 0.8)}),
    ("screw", "rz", {"axis": (0.3, -0.5, 0.8), "pitch": 0.2}), ("planar", "x", {"axis": (0.3, -0.5, 0.8)}),
    ("planar", "rz", {"axis": (0.3, -0.5, 0.8)}),
])  # fmt: skip
@pytest.mark.parametrize("turned", [False, True])
def test_held_models_have_the_stiffness_of_the_energy(kind, coordinate, words, turned):
    """The generalized force of a joint coordinate has no stiffness: K is that of the springs alone.

    Its symmetric differences are those of the holding force along the path.
    """
    model = mv.Model(gravity=(0, 0, -9.81))
    model.add_body("arm", 1.5, (0.02, 0.03, 0.04), position=(0.2, 0.1, 0))
    model.add_body("tip", 0.5, (0.01, 0.01, 0.01), position=(0.5, 0.3, 0.1))
    ends = ("arm", "ground") if turned else ("ground", "arm")
    model.add_joint("base", kind, *ends, position=(0.05, 0, 0.02), **words)
    model.add_joint("elbow", "revolute", "arm", "tip", position=(0.4, 0.2, 0.05), axis=(1, 2, 0.5))
    model.add_spring("s1", "ground", "tip", start=(0.6, -0.4, 0.5), end=(0.5, 0.3, 0.1), stiffness=300.0)
    model.add_bushing("b", "ground", "arm", position=(0.2, 0.1, 0), stiffness=(2000, 900, 700, 20, 30, 40))
    model.add_bushing("e", "arm", "tip", position=(0.4, 0.2, 0.05), stiffness=(0, 0, 0, 8, 9, 10))
    name = f"base.{coordinate}"
    h = 1e-4
    path = model.path(name, [0.1, 0.2 - h, 0.2, 0.2 + h])
    there = path.models[2].linearize(independent=[name, "elbow.rz"])
    i = there.coordinates.index(name)
    others = [k for k in range(there.dof) if k != i]
    follow = -np.linalg.solve(there.K[np.ix_(others, others)], there.K[others, i])
    along = there.K[i, i] + there.K[i, others] @ follow
    assert along == pytest.approx((path.forces[3] - path.forces[1]) / (2 * h), rel=1e-6)
    assert pytest.approx(there.K.T, abs=1e-9 * np.abs(there.K).max()) == there.K


@pytest.mark.slow
def test_a_closed_loop_under_gravity():
    """The holding moment of a four-bar is the derivative of its potential along the crank."""
    model = library.four_bar()
    spring = model.springs["spring"]
    h, before = 1e-4, np.linalg.norm(np.subtract(spring.end, spring.start))

    def potential(there):
        longer = np.linalg.norm(np.subtract(there.springs["spring"].end, spring.start)) - before
        weights = sum(9.81 * body.mass * body.position[2] for body in there.bodies.values())
        return weights + spring.preload * longer + 0.5 * spring.stiffness * longer**2

    path = model.path("A.rz", [0.3 - h, 0.3, 0.3 + h, 0.9 - h, 0.9, 0.9 + h])
    energy = [potential(there) for there in path.models]
    assert path.forces[[1, 4]] == pytest.approx(np.subtract(energy[2::3], energy[::3]) / (2 * h), rel=1e-6)


def test_a_slider_without_a_point():
    model = library.toggle()
    path = model.path("rail.z", [0.0, -0.002])
    assert path.forces == pytest.approx([0.0, -0.002 * model.springs["spring"].stiffness], abs=1e-9)


@pytest.mark.slow
def test_a_beam_bends_along_the_path():
    """A slider pulls the tip of a cantilever by a spring: two springs in series."""
    model = mv.Model()
    model.add_body("tip", 0.1, (1e-4, 1e-4, 1e-4), position=(1, 0, 0))
    model.add_beam("beam", "ground", "tip", beams.Circle(0.02), beams.Material(2e11, 7800.0, 0.3),
                   start=(0, 0, 0), end=(1, 0, 0), elements=4)  # fmt: skip
    model.add_body("slider", 1.0, (1, 1, 1), position=(1, 0, 0.5))
    model.add_joint("lead", "prismatic", "ground", "slider", position=(1, 0, 0.5), axis=(0, 0, 1))
    model.add_spring("pull", "tip", "slider", start=(1, 0, 0), end=(1, 0, 0.5), stiffness=200.0)
    stiff = 3 * 2e11 * np.pi * 0.02**4 / 4
    path = model.path("lead.z", [0.0, 0.001, 0.002])
    assert path.forces == pytest.approx(np.array(path.values) / (1 / stiff + 1 / 200.0), rel=2e-3)
    assert path.stable.all()


@pytest.mark.parametrize(("kind", "coordinate", "unit", "force"), [
    ("prismatic", "slide.z", "m", "N"), ("revolute", "slide.rz", "rad", "N m"),
])  # fmt: skip
def test_units_of_what_is_led_and_of_its_force(kind, coordinate, unit, force):
    model = mv.Model()
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_joint("slide", kind, "ground", "b", (0, 0, 0))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (0, 0, 5.0, 0, 0, 5.0))
    path = model.path(coordinate, [0.2])
    assert path.unit == unit
    assert path.forces == pytest.approx([1.0])
    assert f"{coordinate} [{unit}]" in str(path)
    assert f"force [{force}]" in str(path)


def test_messages():
    model = truss(0.5)
    with pytest.raises(mv.ModelError, match=r"'arch\.z' is not a joint coordinate .* Did you mean 'arch\.y'"):
        model.path("arch.z", [0.1])
    with pytest.raises(mv.ModelError, match="values"):
        model.path("arch.y", [np.nan])
    ball = mv.Model()
    ball.add_body("b", 1.0, (1, 1, 1))
    ball.add_joint("j", "spherical", "ground", "b", position=(0, 0, 1))
    with pytest.raises(mv.ModelError, match="3 free rotations"):
        ball.path("j.rx", [0.1])
    assert "limit point" in str(model.path("arch.y", [-0.3]))


@pytest.mark.parametrize(("tilt", "said"), [(0.0, "in this pose they lock one of these, as at a dead centre"),
                                            (1e-9, r"rail\.z is at a dead centre in the described pose")])
def test_a_slider_at_its_dead_centre_leads_no_path(tilt, said):
    """Exactly in line it does not move to first order, and hardly does next to it."""
    model = mv.Model()
    elbow, end = np.array((np.cos(tilt), np.sin(tilt), 0.0)), np.array((2.0 * np.cos(tilt), 0.0, 0.0))
    for name, at in (("crank", 0.5 * elbow), ("rod", 0.5 * (elbow + end)), ("slider", end)):
        model.add_body(name, 1.0, (0.1, 0.1, 0.1), at)
    model.add_joint("main", "revolute", "ground", "crank", (0, 0, 0))
    model.add_joint("elbow", "revolute", "crank", "rod", elbow)
    model.add_joint("pin", "revolute", "rod", "slider", end)
    model.add_joint("rail", "prismatic", "ground", "slider", axis=(1, 0, 0))
    for lead, who in ((lambda: model.path("rail.z", [-0.1]), "path"), (lambda: model.moved({"rail.z": -0.1}), "moved")):
        with pytest.raises(mv.errors.MbsvibError, match=f"^{who}: .*{said}"):
            lead()


@pytest.mark.parametrize("tilt", [0.19, 0.21, 1.4])
def test_a_path_starts_next_to_the_given_pose_or_not_at_all(tilt):
    """Newton's step of a pendulum is tan(tilt): one of 5.8 rad ends upside down."""
    model = pendulum(tilt)
    model.add_body("slider", 1.0, (1, 1, 1), (1, 0, 0))
    model.add_joint("lead", "prismatic", "ground", "slider", (1, 0, 0), axis=(1, 0, 0))
    model.add_spring("s", "ground", "slider", (0, 0, 0), (1, 0, 0), 100.0)
    if np.tan(tilt) < 0.2:
        assert model.path("lead.z", [0.1]).stable_held.all()
    else:
        with pytest.raises(mv.EquilibriumError, match=r"'lead\.z' is held, .* no equilibrium next"):
            model.path("lead.z", [0.1])
