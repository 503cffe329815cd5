"""Ball screws, belts and gear pairs: closed forms, the parts of which they are made, and refusals."""

import numpy as np
import pytest

import mbsvib as mv

AXIS, LEAD = np.array((0.6, 0.0, 0.8)), 0.01
SCREW, TABLE, MOTOR = 2e-4, 30.0, 1e-3
K, DAMPING = 8e7, 300.0
ORIGIN = (0.1, 0.2, 0.3)
INERTIA = (0.01, 0.02, 0.03)


def slide(stiffness=0.0, damping=0.0):
    """A table on a ball screw; all moments of inertia of the screw are the same."""
    model = mv.Model("slide")
    model.add_body("screw", 2.0, (SCREW,) * 3, position=ORIGIN)
    model.add_body("table", TABLE, INERTIA, position=(0.5, 0.2, 0.3))
    model.add_ball_screw("x", "ground", "screw", "table", ORIGIN, AXIS, LEAD, stiffness, damping)
    model.add_torsion_spring("hold", "ground", "screw", AXIS, 5.0)
    model.add_input("torque", "screw", np.concatenate((np.zeros(3), AXIS)))
    model.add_output("travel", "table", AXIS)
    return model


def test_a_rigid_ball_screw():
    system = slide().linearize()
    h = LEAD / (2 * np.pi)
    assert system.dof == 1
    expected = np.sqrt(5.0 / (SCREW + TABLE * h * h)) / (2 * np.pi)
    np.testing.assert_allclose(system.modes().frequencies, expected, rtol=1e-12)
    np.testing.assert_allclose(system.frequency_response([0.0])[0, 0], h / 5.0, rtol=1e-12)


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_a_compliant_ball_screw(method):
    h = LEAD / (2 * np.pi)
    M = np.diag((SCREW, TABLE))
    stretch = np.array((h, -1.0))
    couple = np.outer(stretch, stretch)
    omega = np.array([10.0, 1500.0, 9e3])
    expected = [np.linalg.solve(np.diag((5.0, 0.0)) + (K + 1j * w * DAMPING) * couple - w * w * M, (1.0, 0.0))[1]
                for w in omega]  # fmt: skip
    system = slide(K, DAMPING).linearize(method=method)
    np.testing.assert_allclose(system.frequency_response(omega)[0, 0], expected, rtol=1e-9)
    if method == "dense":
        assert system.dof == 2


def test_a_ball_screw_in_another_pose_has_moved_its_nut():
    turned = slide(K).moved({"x.bearing.rz": 4 * np.pi}, relaxed=True)
    before = np.array(slide(K).bodies["x.nut"].position)
    np.testing.assert_allclose(turned.bodies["x.nut"].position, before + 2 * LEAD * AXIS, rtol=0, atol=1e-14)


def pulleys(**words):
    model = mv.Model("belt")
    for name, x in (("one", 0.0), ("two", 0.4)):
        model.add_body(name, 1.0, (1e-3, 1e-3, 2e-3), position=(x, 0, 0))
    model.add_belt("b", "ground", "one", "two", (0, 0, 0), (0.4, 0, 0), (0, 0, 1), 0.03, 0.06, **words)
    model.add_torsion_spring("hold", "ground", "one", (0, 0, 1), 5.0)
    model.add_input("torque", "one", "rz")
    model.add_output("turn", "two", "rz")
    return model


@pytest.mark.parametrize(("crossed", "sense"), [(False, 1.0), (True, -1.0)])
def test_belts(crossed, sense):
    omega = np.array([1.0, 40.0, 800.0])
    J, hold = 2e-3 * np.eye(2), np.diag((5.0, 0.0))
    rigid = pulleys(crossed=crossed).linearize()
    expected = 0.5 * sense / (5.0 - omega**2 * 2e-3 * (1.0 + 0.25))
    np.testing.assert_allclose(rigid.frequency_response(omega)[0, 0], expected, rtol=1e-11)
    compliant = pulleys(stiffness=1e5, damping=20.0, crossed=crossed).linearize()
    stretch = np.array((0.03, -sense * 0.06))
    expected = [np.linalg.solve(hold + (1e5 + 20j * w) * np.outer(stretch, stretch) - w * w * J, (1.0, 0.0))[1]
                for w in omega]  # fmt: skip
    assert compliant.dof == 2
    np.testing.assert_allclose(compliant.frequency_response(omega)[0, 0], expected, rtol=1e-9)


def test_the_force_of_a_belt_is_an_output():
    model = pulleys(stiffness=1e5)
    model.add_force_output("pull", "b.belt", "z")
    model.add_torsion_spring("brake", "ground", "two", (0, 0, 1), 7.0)
    response = model.linearize().frequency_response([0.0])
    turn = response[0, 0, 0].real  # the torque of the brake, k turn, is that of the belt on the second pulley
    np.testing.assert_allclose(abs(response[1, 0, 0].real) * 0.06, 7.0 * turn, rtol=1e-9)


def test_a_planet_on_a_carrier():
    """Gears turn relative to what carries them: Willis' equation."""
    model = mv.Model("planet")
    for name, x in (("carrier", 0.0), ("sun", 0.0), ("planet", 0.1)):
        model.add_body(name, 1.0, INERTIA, position=(x, 0, 0))
    model.add_joint("main", "revolute", "ground", "carrier", (0, 0, 0), axis=(0, 0, 1))
    model.add_gear_pair("g", "carrier", "sun", "planet", (0, 0, 0), (0.1, 0, 0), (0, 0, 1), -1.5)
    for name in ("carrier", "sun", "planet"):
        model.add_output(name, name, "rz")
    system = model.linearize()
    carrier, sun, planet = system.Cq
    np.testing.assert_allclose(planet - carrier, -1.5 * (sun - carrier), rtol=0, atol=1e-14)


@pytest.mark.parametrize("stiffness", [0.0, 1e5])
@pytest.mark.parametrize("kind", ["ball_screw", "belt", "gear_pair"])
def test_all_parts_are_returned_and_none_is_added_where_any_name_is_taken(kind, stiffness):
    def bodies():
        model = mv.Model("bodies")
        for name, x in (("one", 0.0), ("two", 0.4)):
            model.add_body(name, 1.0, INERTIA, position=(x, 0, 0))
        return model

    words = {"ball_screw": ((0, 0, 0), (0, 0, 1), LEAD), "belt": ((0, 0, 0), (0.4, 0, 0), (0, 0, 1), 0.03, 0.06),
             "gear_pair": ((0, 0, 0), (0.4, 0, 0), (0, 0, 1), -2.0)}[kind]  # fmt: skip
    more = {} if kind == "gear_pair" else {"stiffness": stiffness}
    model = bodies()
    names = getattr(model, f"add_{kind}")("d", "ground", "one", "two", *words, **more)
    assert {*names} == {name for group in model.groups().values() for name in group} - {"one", "two"}
    assert len(names) == len(set(names))
    for name in names:
        other = bodies()
        other.add_load(name, "one", (1, 0, 0))
        with pytest.raises(mv.ModelError, match=f"'{name}'.*the name is taken"):
            getattr(other, f"add_{kind}")("d", "ground", "one", "two", *words, **more)
        assert not other.joints
        assert len(other.bodies) == 2


def test_parts_have_names_and_parameters():
    model = slide(K, DAMPING)
    assert model.parameters["x.axial.stiffness.z"] == K
    assert model.parameters["x.thread.radius"] == LEAD / (2 * np.pi)


def test_a_mirrored_screw_takes_its_table_along():
    """The copy moves as in the mirror: the same torque about the mirrored axis, the same travel."""
    whole = mv.Model("two")
    whole.add_model("m", slide(K), mirror="x")
    omega = [10.0, 1500.0]
    responses = [model.linearize().frequency_response(omega) for model in (whole, slide(K))]
    np.testing.assert_allclose(*responses, rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lead": 0.0}, "ball screw 'y': lead = 0.0; expected the advance per turn"),
        ({"screw": "ground"}, "ball screw 'y': screw = 'ground'; expected another body"),
        ({"nut": "tabel"}, "nut = 'tabel' is not a body.*Did you mean 'table'"),
        ({"stiffness": -1.0}, "stiffness = -1.0; expected a number that is not negative"),
        ({"damping": 1.0}, "damping = 1.0; expected a stiffness with it"),
        ({"axis": (0, 0, 0)}, "axis = "),
        ({"name": "x"}, "'x.bearing'.*the name is taken"),
    ],
)  # fmt: skip
def test_refused_ball_screws_add_nothing(change, message):
    model = slide()
    words = {"name": "y", "base": "ground", "screw": "screw", "nut": "table", "position": ORIGIN, "axis": AXIS,
             "lead": LEAD}  # fmt: skip
    with pytest.raises(mv.ModelError, match=message):
        model.add_ball_screw(**words | change)
    assert list(model.joints) == ["x.bearing", "x.guide"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"first_radius": 0.0}, "belt 'c': first_radius = 0.0; expected a pitch radius"),
        ({"end": (0, 0, 1)}, "belt 'c': end = .* a point off the axis"),
        ({"crossed": 1}, "crossed = 1; expected True or False"),
        ({"second": "one"}, "second = 'one'; expected another body"),
    ],
)  # fmt: skip
def test_refused_belts_add_nothing(change, message):
    model = pulleys()
    words = {"base": "ground", "first": "one", "second": "two", "start": (0, 0, 0), "end": (0.4, 0, 0),
             "axis": (0, 0, 1), "first_radius": 0.03, "second_radius": 0.06}  # fmt: skip
    with pytest.raises(mv.ModelError, match=message):
        model.add_belt("c", **words | change)
    assert len(model.joints) == 2


FILE = """\
mbsvib: 1
bodies:
  screw: {mass: 2, inertia: [2e-4, 2e-4, 2e-4], position: [0.1, 0.2, 0.3]}
  table: {mass: 30, inertia: [0.01, 0.02, 0.03], position: [0.5, 0.2, 0.3]}
  wheel: {shape: {type: cylinder, radius: 0.05, length: 0.02}, density: 7800}
drives:
  x: {base: ground, screw: screw, nut: table, position: [0.1, 0.2, 0.3], axis: [0.6, 0, 0.8], lead: 0.01,
      stiffness: 8e7}
  b: {type: belt, base: ground, first: x.nut, second: wheel, start: [0, 0, 0], end: [0, 1, 0], axis: [0, 0, 1],
      first_radius: 0.1, second_radius: 0.2}
  g: {type: gear_pair, base: table, first: wheel, second: gear.disk, start: [0, 0, 0], end: [0, 1, 0], axis: [0, 0, 1],
      ratio: -2}
models:
  gear: {other: gear.yaml, position: [0, 1, 0], mirror: y}
  inner:
    ground: gear.disk
    other:
      bodies: {b: {mass: 1, inertia: [1, 1, 1]}}
      joints: {j: {kind: fixed, first: ground, second: b}}
"""
GEAR = "bodies: {disk: {mass: 1, inertia: [1, 1, 1], position: [0, 0.25, 0]}}\n"


def test_files_have_the_same_words(tmp_path):
    (tmp_path / "gear.yaml").write_text(GEAR, encoding="utf-8")
    (tmp_path / "machine.yaml").write_text(FILE, encoding="utf-8")
    model = mv.load(tmp_path / "machine.yaml")
    assert model.bodies["gear.disk"].position == (0.0, 0.75, 0.0)
    assert (model.joints["inner.j"].first, model.couplers["g.mesh"].ratio) == ("gear.disk", -2.0)
    assert model.springs["x.axial"] == slide(K).springs["x.axial"]
    again = mv.load(mv.save(model, tmp_path / "again.yaml"))
    assert all(dict(again.groups()[key]) == dict(group) for key, group in model.groups().items())


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("first: ground, second: b", "first: grund, second: b", r"line 1[0-9], joints.j.first: there is no body"),
        ("other: gear.yaml", "other: none.yaml", r"models.gear.other: .*none\.yaml: there is no such file"),
        ("other: gear.yaml", "other: machine.yaml", "models.gear.other: the file 'machine.yaml' would be a part"),
        ("other: gear.yaml, ", "", "models.gear: missing: other"),
        ("other: gear.yaml", "other: 3", "other = 3; expected a Model"),
        ("lead: 0.01,", "", "drives.x: missing: lead"),
        ("type: belt", "type: belts", "'belts' is not a type of drives"),
        ("mirror: y", "mirror: w", "models.gear.mirror: .*expected 'x', 'y' or 'z'"),
    ],
)  # fmt: skip
def test_mistakes_in_files_are_told_by_line(tmp_path, old, new, message):
    assert old in FILE
    (tmp_path / "gear.yaml").write_text(GEAR, encoding="utf-8")
    (tmp_path / "machine.yaml").write_text(FILE.replace(old, new), encoding="utf-8")
    with pytest.raises(mv.ModelError, match=message):
        mv.load(tmp_path / "machine.yaml")


def test_a_mistake_in_the_file_of_a_part_is_told_with_both_files(tmp_path):
    (tmp_path / "gear.yaml").write_text(GEAR.replace("mass", "mas"), encoding="utf-8")
    (tmp_path / "machine.yaml").write_text(FILE, encoding="utf-8")
    with pytest.raises(mv.ModelError, match=r"machine\.yaml, line 14, models.gear.other: .*gear\.yaml, line 1, bod"):
        mv.load(tmp_path / "machine.yaml")
