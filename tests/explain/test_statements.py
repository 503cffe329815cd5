"""What explanations say of small models, word by word; stiffnesses are closed forms."""

import pytest

import mbsvib as mv


def sections(text):
    """Lines of an explanation by heading; the first line has the heading ''."""
    result, heading = {}, ""
    for line in text.splitlines():
        if line.startswith("  ") or not result:
            result.setdefault(heading, []).append(line.strip())
        else:
            heading = line
    return result


def post():
    """An upright post on a hinge, m g l = 10 N m, with a follower and a dead load at its top and a stay in tension."""
    model = mv.Model("post", gravity=(0, 0, -10.0))
    model.add_body("b", 2.0, (0.1, 0.2, 0.3), (0, 0, 0.5))
    model.add_joint("j", "revolute", "ground", "b", (0, 0, 0), axis=(0, 1, 0))
    model.add_torsion_spring("k", "ground", "b", (0, 1, 0), 100.0, 0.5)
    model.add_load("push", "b", (0, 0, -30.0), position=(0, 0, 1.0), follower=True)
    model.add_load("pull", "b", (0, 0, 7.0), position=(0, 0, 1.0))
    model.add_spring("stay", "ground", "b", (0, 0, 3.0), (0, 0, 1.0), 5.0, preload=4.0)
    model.add_spring("idle", "ground", "b", (0, 1, 0.5), (0, 0, 0.5), 5.0)
    return model


def ziegler():
    """Two bars of 1 m on springs under a follower force of 4 N, which makes K unsymmetric."""
    model = mv.Model("ziegler")
    for i, before in enumerate(("ground", "b0")):
        model.add_body(f"b{i}", 2.0, (0.1, 0.1, 0.1), (0, 0, i + 1.0))
        model.add_joint(f"j{i}", "revolute", before, f"b{i}", (0, 0, i), axis=(0, 1, 0))
        model.add_torsion_spring(f"k{i}", before, f"b{i}", (0, 1, 0), 30.0)
    model.add_load("F", "b1", (0, 0, -4.0), follower=True)
    return model


def relaxing():
    """A mass on two springs in series twice, with a damper at one of the points between, which have no mass."""
    model = mv.Model("relaxing")
    model.add_body("b", 2.0, (0.1, 0.1, 0.1))
    model.add_joint("j", "prismatic", "ground", "b", (0, 0, 0), axis=(1, 0, 0))
    for name, damping in (("damped", 0.5), ("free", 0.0)):
        model.add_body(name, 0.0, (0, 0, 0))
        model.add_joint(f"j.{name}", "prismatic", "ground", name, (0, 0, 0), axis=(1, 0, 0))
        model.add_spring(f"a.{name}", "ground", name, (-1, 0, 0), (0, 0, 0), 10.0, damping)
        model.add_spring(f"b.{name}", name, "b", (0, 0, 0), (1, 0, 0), 20.0)
    return model


def spinning():
    model = mv.Model("spinning")
    model.add_body("b", 2.0, (0.1, 0.1, 0.1))
    model.add_rotor("r", "b", 50.0, (0, 0, 1), 0.01)
    model.add_bushing("k", "ground", "b", (0, 0, 0), (1e3,) * 6)
    return model


OPEN = "no closed loops: the cut-joint matrix B'' was not needed"
CONNECTED = "joints connect every body to ground: no free joint was added"
UNASKED = "no mode and no response was requested yet: no eigenvalue was computed"
UNLOADED = "no gravity, load or preload: no statics, no geometric stiffness"
STEADY = "nothing spins: no gyroscopic terms"
UNSYMMETRIC = "no damper acts: C has no symmetric part"
MASSLESS = ["motions without mass: 2; of the mass rows, smallest pivot kept 1.0e+00, largest dropped 0.0e+00",
            "condensed statically, as no damper acts on them: j.free.z",
            "without mass but damped, one first-order state each: j.damped.z; 3 states in all"]  # fmt: skip
DENSE = {
    post: {
        "": ["post: 1 DOF"], "loops": ["none"], "coordinates": ["minimal: j.rz"],
        "topology": ["1 body, 1 joint, 3 spring-dampers", "spanning tree: j",
                     "cumulative degree of freedom (CDOF) from ground: b 1",
                     "without effect, as no motion of the mechanism strains them: idle"],
        "loads": ["gravity: acts at the centres of mass; its geometric stiffness is in the reactions and preloads",
                  "loads: push, pull", "preloads: stay",
                  "balance: relative residual of the forces 0.0e+00 (allowed 1e-09)",
                  # k - m g l + 7 + 4 (1 + 1 / 2) N m; what acts on the body, 0.5 m above the hinge, and the rest there
                  "stiffness along j.rz: 103 N m/rad = +100 elastic +18.5 load +4 preload -19.5 reaction",
                  "load of 'push': +15 N m/rad along j.rz, its largest contribution",
                  "load of 'pull': +3.5 N m/rad along j.rz, its largest contribution",
                  "preload of 'stay': +4 N m/rad along j.rz, its largest contribution",
                  "reaction of 'j': -19.5 N m/rad along j.rz, its largest contribution"],
        "skipped": [OPEN, CONNECTED, UNASKED, STEADY],
    },
    ziegler: {
        "": ["ziegler: 2 DOF"], "loops": ["none"], "coordinates": ["minimal: j0.rz, j1.rz"],
        "topology": ["2 bodies, 2 joints, 2 spring-dampers", "spanning tree: j0, j1",
                     "cumulative degree of freedom (CDOF) from ground: b0 1, b1 2"],
        "loads": ["loads: F", "balance: relative residual of the forces 0.0e+00 (allowed 1e-09)",
                  "stiffness along j0.rz: 30 N m/rad = +30 elastic +8 load -8 reaction",
                  "stiffness along j1.rz: 30 N m/rad = +30 elastic +4 load -4 reaction",
                  "load of 'F': +8 N m/rad along j0.rz, its largest contribution",
                  "reaction of 'j0': -4 N m/rad along j0.rz, its largest contribution",
                  "reaction of 'j1': -4 N m/rad along j0.rz, its largest contribution",
                  "follower loads, torques or cross-coupled bushings make K unsymmetric"],
        "symmetry": ["K = stiffness + circulatory terms (rotating dampers, follower loads, cross-coupling): flutter is "
                     "possible"],
        "skipped": [OPEN, UNSYMMETRIC, CONNECTED, UNASKED, STEADY],
    },
    relaxing: {
        "": ["relaxing: 2 DOF"], "loops": ["none"],
        "topology": ["3 bodies, 3 joints, 4 spring-dampers", "spanning tree: j, j.damped, j.free",
                     "cumulative degree of freedom (CDOF) from ground: b 1, damped 1, free 1"],
        "coordinates": ["minimal: j.z, j.damped.z", "dependent: j.free.z", *MASSLESS],
        "skipped": [OPEN, CONNECTED, UNASKED, UNLOADED, STEADY],
    },
    spinning: {
        "": ["spinning: 6 DOF"], "loops": ["none"],
        "topology": ["1 body, 0 joints, 1 spring-damper",
                     "body 'b' is floating: no joint reaches it, so a free joint was added"],
        "coordinates": ["minimal: b.x, b.y, b.z, b.rx, b.ry, b.rz"],
        "symmetry": ["rotor 'r': 0.01 kg m^2 on body 'b', 50 rad/s about (0 0 1)",
                     "C = dampers + gyroscopic terms: modes have right and left vectors"],
        "skipped": [OPEN, UNSYMMETRIC, UNASKED, UNLOADED],
    },
}  # fmt: skip
LARGE = "no dense matrix was formed: the number of coordinates is too large for an efficient one"
NO_LOOP = "no loop: no constraint was checked"
SPARSE = {
    post: {
        "topology": ["1 body, 1 joint, 3 spring-dampers", "spanning tree: j",
                     "without effect, as no motion of the mechanism strains them: idle"],
        "loads": ["in balance; 4 rows of geometric stiffness from gravity, loads, preloads and forces in joints"],
        "skipped": [LARGE, "4 of 6 displacements cannot move: they were left out", NO_LOOP],
    },
    ziegler: {
        "topology": ["2 bodies, 2 joints, 2 spring-dampers", "spanning tree: j0, j1"],
        "loads": ["in balance; 4 rows of geometric stiffness from gravity, loads, preloads and forces in joints"],
        "skipped": [LARGE, "8 of 12 displacements cannot move: they were left out", NO_LOOP, UNSYMMETRIC],
    },
    relaxing: {
        "topology": ["3 bodies, 3 joints, 4 spring-dampers", "spanning tree: j, j.damped, j.free"],
        "coordinates": MASSLESS,
        "skipped": [LARGE, "15 of 18 displacements cannot move: they were left out", UNLOADED, NO_LOOP],
    },
    spinning: {
        "topology": ["1 body, 0 joints, 1 spring-damper", "floating, with free joints added: b",
                     "spanning tree: no joint"],
        "skipped": [LARGE, UNLOADED, NO_LOOP, UNSYMMETRIC],
    },
}  # fmt: skip


@pytest.mark.parametrize("make", DENSE)
def test_dense_systems(make):
    assert sections(make().linearize().explain()) == DENSE[make]


@pytest.mark.parametrize("make", SPARSE)
def test_sparse_systems(make):
    found = sections(make().linearize(method="sparse").explain())
    assert found.pop("") == [DENSE[make][""][0] + ", sparse matrices"]
    assert found.pop("loops") == ["none"]
    assert [line.split()[1] for line in found.pop("tableau")] == ["unknowns:", "entries,"]
    assert found == SPARSE[make]


def test_modes_that_were_computed():
    model = mv.Model("slider")
    model.add_body("b", 2.0, (0.1, 0.1, 0.1))
    model.add_joint("j", "prismatic", "ground", "b", (0, 0, 0), axis=(1, 0, 0))
    model.add_spring("k", "ground", "b", (-1, 0, 0), (0, 0, 0), 50.0)
    system = model.linearize()
    system.modes()
    assert sections(system.explain())["skipped"] == [
        OPEN, "no damper acts: C is zero and modes are real", CONNECTED,
        "no damper: modes are real, and no eigenvalue problem of twice the size was solved",
        "eigenvalues of M and K were accurate enough: no singular values of the factors, no Jacobi rotations",
        UNLOADED, STEADY]  # fmt: skip


def test_shares_of_stiffness():
    """Each is its part of 103 N m/rad."""
    shares = post().linearize().stiffness_shares()
    assert repr(shares) == "StiffnessShares('post': 5 elements, 1 modes)"
    parts = {"elastic": 100.0, "load": 18.5, "preload": 4.0, "reaction": -19.5}
    found = shares.by_kind()
    assert list(found) == list(parts)
    for kind, part in parts.items():
        assert found[kind] == pytest.approx([part / 103.0], rel=1e-12)
    assert str(shares).splitlines()[0] == "Strain energy by element: post"


@pytest.mark.parametrize(("count", "more"), [(8, []), (9, ["and 1 more group of loops"]),
                                             (10, ["and 2 more groups of loops"])])  # fmt: skip
def test_many_loops_are_counted(count, more):
    """Doors on two hinges: each is a loop that locks nothing."""
    model = mv.Model("doors")
    for i in range(count):
        model.add_body(f"d{i}", 2.0, (0.1, 0.1, 0.1), (0.5, i, 0.2))
        for name, z in (("low", 0.0), ("high", 1.0)):
            model.add_joint(f"{name}{i}", "revolute", "ground", f"d{i}", (0, i, z), axis=(0, 0, 1))
    found = sections(model.linearize(method="sparse").explain())
    assert len([line for line in found["loops"] if "constraint rows independent" in line]) == 8
    assert [line for line in found["loops"] if line.startswith("and")] == more
    assert NO_LOOP not in found["skipped"]


def test_the_loop_of_a_planar_linkage():
    """Three of the five constraints of its last joint say again that it is planar."""
    cut, rank, *rest = sections(mv.library.four_bar().linearize().explain())["loops"]
    assert cut == "cut at C (CDOF 2 and 1)"
    assert rank.startswith("C: 2 of 5 constraint rows independent; smallest pivot kept 5.1e-01, largest dropped ")
    assert rest == ["redundant: C.z, C.rx, C.ry"]


def closed(kind, axis=(0, 0, 1)):
    """A bar between two posts, closed by a joint of some kind, and a joint beside it that closes a loop freely."""
    model = mv.Model("closed")
    for name, first, at in (("a", "ground", 0.0), ("b", "a", 1.0)):
        model.add_body(name, 1.0, (1, 1, 1), position=(at + 0.5, 0.2, 0.1))
        model.add_joint(f"{name}.pin", "universal", first, name, (at, 0, 0), axis=(0, 0, 1), axis2=(0, 1, 0))
    model.add_joint("end", kind, "b", "ground", (1.7, 0.9, 0.3), axis=axis)
    model.add_joint("beside", "free", "b", "ground", (2.0, 0.0, 0.0))
    return model


def test_loops_without_redundant_constraints_and_joints_without_any():
    found = sections(closed("point_on_plane").linearize().explain())
    assert "without constraint: beside" in found["loops"]
    assert "no redundant constraint: neighbouring poses were not checked" in found["skipped"]
    planar = sections(mv.library.four_bar().linearize().explain())
    assert not any(line.startswith("without constraint") for line in planar["loops"])
    assert any(line.startswith("planar loops") for line in planar["skipped"])
    assert not any("no redundant" in line for line in planar["skipped"])


def test_shares_of_a_motion_without_stiffness_are_0():
    """A post whose spring holds just its weight, k = m g L: two energies of 20 J/rad^2 that cancel."""
    model = mv.Model("neutral", gravity=(0, 0, -10.0))
    model.add_body("mass", 2.0, (1, 1, 1), position=(0, 0, 1.0))
    model.add_joint("hinge", "revolute", "ground", "mass", (0, 0, 0), axis=(1, 0, 0))
    model.add_bushing("spring", "ground", "mass", (0, 0, 0), (0, 0, 0, 20.0, 0, 0))
    shares = model.linearize().stiffness_shares()
    assert shares.frequencies[0] == 0.0
    assert not shares.shares.any()


def test_a_spring_that_holds_a_motion_without_mass_is_not_without_effect():
    """The output follows the input by this spring; it was listed as without effect, and the mechanism as locked."""
    model = mv.Model()
    model.add_body("a", 0.0, (0, 0, 0))
    model.add_joint("rail", "prismatic", "ground", "a", axis=(0, 0, 1))
    model.add_spring("s", "ground", "a", (0, 0, -1), (0, 0, 0), 10.0)
    model.add_input("F", "a", "z")
    model.add_output("z", "a", "z")
    system = model.linearize()
    assert system.D[0, 0] == pytest.approx(0.1)
    assert "without effect on modes, as at most motions without mass strain them: s" in system.explain()
    why = "No motion has mass or damping: outputs follow inputs without dynamics."
    assert system.modes().remarks() == (f"No modes. {why}",)
    with pytest.raises(mv.ResponseError, match=f"has no modes to draw. {why}"):
        mv.plots.modes(system)
