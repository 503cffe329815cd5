"""What a model file says is what the calls would say, and what is wrong with it is told with file, line and key."""

import inspect
import json
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mbsvib as mv
import mbsvib.files
from mbsvib.files import load
from mbsvib.files.words import ALL_SECTIONS
from tests.files.models import sections
from tests.support.sizes import examples

BODY = "bodies:\n  p: {mass: 1, inertia: [1, 1, 1]}\n"


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Write a file into an empty folder that is the current one, so that messages hold its bare name."""
    monkeypatch.chdir(tmp_path)

    def write(text, name="isolator.yaml"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return name

    return write


def refused(path):
    with pytest.raises(mv.ModelError) as caught:
        load(path)
    return caught.value


def test_documented_layout_is_read(written):
    text = inspect.cleandoc(mbsvib.files.__doc__).split("::\n\n")[1].split("\n\nA joint of")[0]
    model = load(written(inspect.cleandoc(text)))
    same = mv.Model("isolator")
    same.add_body("platform", mass=12, inertia=(0.3, 0.3, 0.5), position=(0, 0, 0.25))
    tube, steel = {"type": "tube", "radius": 0.02, "wall": 0.002}, {"E": 2.1e11, "nu": 0.3, "rho": 7800}
    same.add_beam("mast", "platform", None, tube, steel, start=(0, 0, 0.3), end=(0, 0, 1.3), elements=6)
    same.add_joint("guide", "prismatic", "ground", "platform", axis=(0, 0, 1))
    same.add_spring("leg", "ground", "platform", (0, 0, 0), (0, 0, 0.2), stiffness=2e7, damping=20)
    same.add_bushing("mount", "ground", "platform", (0, 0, 0), (1e6, 0, 0, 0, 0, 0))
    same.add_maxwell("relief", "ground", "platform", (0, 0, 0), (0, 0, 0.2), stiffness=1e6, damping=100)
    same.add_input("Fz", "platform", "z")
    same.add_base_motion("shaker", "z")
    same.add_output("z", "platform", "z", quantity="acceleration")
    same.add_force_output("leg.force", "leg")
    assert model.name == "isolator"
    assert sections(model) == sections(same)


def test_sections_in_any_order_and_empty_ones(written):
    model = load(written("outputs:\n  x: {body: p, direction: x}\njoints:\nsprings: {}\n" + BODY))
    assert [*model.bodies] == ["p"]
    assert [*model.outputs] == ["x"]
    assert not model.joints


def test_name_is_the_files_where_it_is_left_out(written):
    assert load(written(BODY, "quarter car.yml")).name == "quarter car"
    assert load(written("{}", "empty.json")).name == "empty"


def test_joint_of_free_directions_needs_no_kind(written):
    joint = "joints:\n  j: {first: ground, second: p, free: [rz, x], position: [0, 0, 0]}\n"
    assert load(written(BODY + joint)).joints["j"].free == ("x", "rz")


def test_anchors_and_merge_keys_share_words(written):
    text = """\
bodies:
  a: &leg
    mass: 2
    inertia: [1, 1, 1]
  b:
    <<: *leg
    mass: 3
  c:
    position: [0, 0, 1]
    <<: [{mass: 5}, *leg]
"""
    bodies = load(written(text)).bodies
    assert [body.mass for body in bodies.values()] == [2.0, 3.0, 5.0]
    assert {body.inertia for body in bodies.values()} == {(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)}
    assert bodies["c"].position == (0.0, 0.0, 1.0)


def mistakes():
    """Return every text of mistakes.txt with its message: a line ``=> MESSAGE`` and a blank one end each text."""
    content = Path(__file__).with_name("mistakes.txt").read_text(encoding="utf-8")
    cases = re.findall(r"(.*?\n)=> ([^\n]*)\n\n?", content, re.DOTALL)
    return [pytest.param(text, message, id=message.partition(": ")[0]) for text, message in cases]


@pytest.mark.parametrize(("text", "message"), mistakes())
def test_what_is_wrong_is_told_with_its_line_and_key(written, text, message):
    told = str(refused(written(text)))
    where, stated = message.split(": ", 1)
    assert told.startswith(f"isolator.yaml, {where}: ")
    assert stated in told


@pytest.mark.parametrize("text", ["", "# nothing\n", "~\n"])
def test_empty_file(written, text):
    assert str(refused(written(text))) == (
        f"isolator.yaml, line 1: the file is empty; expected the sections of a model: {', '.join(ALL_SECTIONS)}."
    )


def test_error_keeps_element_and_field(written):
    error = refused(written("bodies:\n  p:\n    mass: -1\n    inertia: [1, 1, 1]\n"))
    assert (error.element, error.field) == ("body 'p'", "mass")
    error = refused(written("bodies:\n  p:\n    mas: 1\n"))
    assert (error.element, error.field) == ("p", "mas")


def test_line_of_an_alias_is_that_of_its_use(written):
    error = refused(written("bodies:\n  p: &p\n    mass: 1\n  q:\n    <<: *p\n    inertia: [1, 1, 1]\n"))
    assert str(error).startswith("isolator.yaml, line 2, bodies.p.inertia: inertia = None; expected 3")
    shared = "bodies:\n  p: &p {mass: 1, inertia: [1, 1, 1]}\n  q: *p\nsprings:\n  s: *p\n"
    message = str(refused(written(shared)))
    assert message.startswith("isolator.yaml, line 5, springs.s.mass: add_spring has no such word")


def test_long_lists_of_names_are_cut(written):
    many = "".join(f"  b{i}: {{mass: 1, inertia: [1, 1, 1]}}\n" for i in range(50))
    message = str(refused(written(f"bodies:\n{many}joints:\n  j:\n    first: quux\n")))
    assert message.endswith("there is no body 'quux'. Known: b0, b1, b2, b3, b4, b5, b6, b7, b8, b9, b10, b11, ...")


def test_files_that_cannot_be_read(written, tmp_path):
    written(BODY)
    assert str(refused("isolater.yaml")) == "isolater.yaml: there is no such file. Did you mean 'isolator.yaml'?"
    assert str(refused("far/model.yaml")) == "far/model.yaml: there is no such file. There is no folder 'far' either."
    assert str(refused("model.toml")).startswith("model.toml: the suffix is '.toml'; expected .yaml, .yml or .json")
    assert str(refused("arm.urdf")).endswith("is written. Robots are read by mbsvib.load_urdf.")
    assert str(refused("arm.XML")).endswith("is written. Robots are read by mbsvib.load_mjcf.")
    assert str(refused("model")).startswith("model: the suffix is ''; expected .yaml, .yml or .json")
    (tmp_path / "folder.yaml").mkdir()
    assert str(refused("folder.yaml")).startswith("folder.yaml: cannot be read: ")


def test_missing_file_in_a_folder_that_cannot_be_listed(written, monkeypatch):
    def closed(self):
        raise PermissionError(13, "Permission denied")

    written(BODY)
    monkeypatch.setattr(Path, "iterdir", closed)
    assert str(refused("isolater.yaml")) == "isolater.yaml: there is no such file."


def test_other_encodings(written, tmp_path):
    (tmp_path / "latin.yaml").write_bytes(b"mbsvib: 1\nname: \xe9\n")
    assert str(refused("latin.yaml")) == (
        "latin.yaml, line 2: the byte 0xe9 is not UTF-8; save the file with this encoding."
    )
    (tmp_path / "mark.yaml").write_bytes(b"\xef\xbb\xbfname: \xc3\xa9\r\nbodies:\r\n")
    assert load("mark.yaml").name == "é"
    (tmp_path / "mark.JSON").write_bytes(b'\xef\xbb\xbf{"name": "\xc3\xa9"}')
    assert load("mark.JSON").name == "é"


def test_schema_key_is_for_editors_only(written):
    assert load(written('{"$schema": "model.schema.json", "name": "a"}', "model.json")).name == "a"


junk = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 10**20) | st.floats(-1e6, 1e6) | st.text(max_size=3)
    | st.sampled_from(["x", "p", "ground", "fixed", "free"]),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)  # fmt: skip
known_words = {
    "bodies": {"mass": 1, "inertia": [1, 1, 1], "position": [0, 0, 0], "orientation": None},
    "joints": {"kind": "planar", "first": "ground", "second": "p", "position": [0, 0, 0], "axis": None, "pitch": None,
               "free": None, "orientation": None},
    "springs": {"type": "bushing", "first": "ground", "second": "p", "position": [0, 0, 0], "stiffness": [1] * 6,
                "orientation": None},
    "inputs": {"type": "input", "body": "p", "direction": "x", "position": None, "relative_to": "ground"},
    "outputs": {"body": "p", "direction": "x", "quantity": "velocity", "relative_to": "ground", "absolute": None},
}  # fmt: skip


@pytest.mark.slow
@examples(100, slow=400)
@given(st.data())
def test_no_value_makes_any_other_error(tmp_path_factory, data):
    section = data.draw(st.sampled_from(sorted(known_words)))
    word = data.draw(st.sampled_from(sorted(known_words[section])))
    content = {"bodies": {"p": known_words["bodies"]}}
    content[section] = (content[section] if section == "bodies" else {}) | {
        "e": known_words[section] | {word: data.draw(junk)}
    }
    path = tmp_path_factory.mktemp("junk") / "model.json"
    path.write_text(json.dumps(content, indent=1), encoding="utf-8")
    message = None
    try:
        names = [*getattr(load(path), section)]
    except mv.ModelError as error:
        message = str(error)
    # either the part is there, or the message names its place; any other error fails the test by itself
    if message is None:
        assert "e" in names
    else:
        assert re.search(rf"model\.json, line \d+, {section}\.e(\.\w+)?: ", message)


@pytest.mark.parametrize("content", [{"A": [[-1.0]], "B": [[1.0]]}, {"format": "x", "state_space": {}}])
def test_a_state_space_is_no_model(tmp_path, content):
    (tmp_path / "law.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(mv.ModelError, match="holds a state space and no model"):
        mv.load(tmp_path / "law.json")
