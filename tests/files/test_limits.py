"""Models from files of unknown origin: nothing that multiplies, unfolds or never ends is read."""

import pytest

import mbsvib as mv

BOMB = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 30))  # fmt: skip
ENTITIES = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'


@pytest.mark.few(1)
@pytest.mark.parametrize(("text", "message"), [
    (BOMB, "line 6: the aliases up to here stand for more than 1000000 values"),
    ("bodies: " + "[" * 100_000, "nested more than 40 deep"),
    ('name: "\\UFFFFFFFF"', "line 1: this is no YAML from here on"),
    ("bodies:\n  a: {mass: 1, mass: 2}", "line 2, bodies.a.mass: 'mass' is already there on line 2"),
])  # fmt: skip
def test_yaml(text, message, tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(text)
    with pytest.raises(mv.ModelError, match=rf"model\.yaml, {message}|model\.yaml, .*{message}"):
        mv.load(path)


def test_keys_twice_in_objects_of_lists(tmp_path):
    path = tmp_path / "model.json"
    path.write_text('{"bodies": [{"mass": 1.0,\n "mass": 2.0}]}')
    with pytest.raises(mv.ModelError, match="line 2, mass: 'mass' is already there on line 1"):
        mv.load(path)


@pytest.mark.parametrize(("read", "root"), [(mv.load_urdf, "robot"), (mv.load_mjcf, "mujoco")])
def test_xml_that_unfolds(read, root, tmp_path):
    if root == "mujoco":
        pytest.importorskip("mujoco")
    path = tmp_path / "model.xml"
    for text, message in (
        (f"{ENTITIES}<{root}>&b;</{root}>", r"line 1: a document type .* is not read"),
        (f'<!DOCTYPE r SYSTEM "/etc/passwd"><{root}/>', r"a document type .* is not read"),
        (f"<{root}>" + "<body>" * 600, "nested more than 500 deep"),
        (f'<?xml version="1.0" encoding="no-such-code"?><{root}/>', "unknown encoding"),
        ("", "no element found"),
    ):
        path.write_text(text)
        with pytest.raises(mv.ModelError, match=rf"model\.xml: no XML that is read: .*{message}"):
            read(path)


@pytest.mark.parametrize(("words", "message"), [
    ('<worldbody><replicate count="100000"><body/></replicate></worldbody>', "100000 copies; expected 10000"),
    ('<worldbody><replicate count="1000"><replicate count="1000"><body/></replicate></replicate></worldbody>',
     "1000000 copies"),
    ('<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>', "'h'.*10000000000 points"),
    ('<size memory="100G"/>', "memory = '100G'"),
    ('<size nconmax="1e12"/>', "nconmax = '1e12'"),
])  # fmt: skip
def test_mjcf_that_asks_for_gigabytes(words, message, tmp_path):
    pytest.importorskip("mujoco")
    path = tmp_path / "model.xml"
    path.write_text(f"<mujoco>{words}</mujoco>")
    with pytest.raises(mv.ModelError, match=rf"model\.xml: <.*{message}"):
        mv.load_mjcf(path)
