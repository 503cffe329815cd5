"""A model file reads well, and is written whole or not at all."""

import os
import stat
import subprocess
import sys

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.files import load, save, saving
from mbsvib.files.saving import number
from tests.files.models import AWKWARD

READABLE = """\
# mbsvib model: SI units and radians; positions and axes in world coordinates
mbsvib: 1
name: leg test

bodies:
  platform:
    mass: 12.0
    inertia: [0.3, 0.3, 0.5]
    position: [0.0, 0.0, 0.25]
  "1":
    mass: 1.0e-05
    inertia: [0.3, 0.3, 0.5, 0.01, 0.0, 0.0]
    orientation:
      - [0.0, -1.0, 0.0]
      - [1.0, 0.0, 0.0]
      - [0.0, 0.0, 1.0]

joints:
  hip:
    kind: universal
    first: ground
    second: "1"
    position: [0.1, 0.0, 0.0]
    axis: [3.0, 0.0, 0.0]
    axis2: [0.0, 1.0, 2.0]
  "on":
    kind: custom
    first: "1"
    second: platform
    position: [0.0, 0.0, 0.0]
    free: [x, rz]

springs:
  mount:
    type: bushing
    first: ground
    second: platform
    position: [0.0, 0.0, 0.0]
    stiffness: [2.0e+7, 1.5e+5, 123456.789, 1.0e+16, -2.25e+6, 0.0]
  leg 1.k:
    first: ground
    second: platform
    start: [0.0, 0.0, 0.0]
    end: [0.0, 0.0, 0.2]
    damping: 20.0

inputs:
  shaker:
    type: base_motion
    direction: x
  y:
    body: platform
    direction: y

outputs:
  y:
    body: platform
    direction: [1.0, 2.0, 3.0]
    quantity: velocity
    absolute: false
  force:
    type: force_output
    element: leg 1.k
"""


@pytest.fixture
def model():
    model = mv.Model("leg test")
    model.add_body("platform", 12, (0.3, 0.3, 0.5), (0, 0, 0.25))
    model.add_body("1", 1e-5, (0.3, 0.3, 0.5, 0.01, 0, 0), orientation=[[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    model.add_joint("hip", "universal", "ground", "1", (0.1, 0, 0), axis=(3, 0, 0), axis2=(0, 1, 2))
    model.add_joint("on", None, "1", "platform", (0, 0, 0), free=("rz", "x"))
    model.add_bushing("mount", "ground", "platform", (0, 0, 0), (2e7, 1.5e5, 123456.789, 1e16, -2.25e6, 0))
    model.add_spring("leg 1.k", "ground", "platform", (0, 0, 0), (0, 0, 0.2), damping=20)
    model.add_base_motion("shaker", "x")
    model.add_input("y", "platform", "y")
    model.add_output("y", "platform", (1, 2, 3), quantity="velocity", absolute=False)
    model.add_force_output("force", "leg 1.k", "z")
    return model


def test_text_for_a_person(model, tmp_path):
    assert save(model, tmp_path / "model.yaml").read_text("utf-8") == READABLE


def test_matrix_has_a_line_a_row_and_json_the_same_content(model, tmp_path):
    model.add_bushing("full", "ground", "1", (0, 0, 0), damping=np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    yaml = save(model, tmp_path / "model.yaml").read_text("utf-8")
    assert "    damping:\n      - [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n      - [0.0, 2.0, 0.0" in yaml
    json = save(model, tmp_path / "model.json").read_text("utf-8")
    assert '      "damping": [\n        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],\n        [0.0, 2.0, 0.0' in json
    assert '    "1": {\n      "mass": 1.0e-05,\n      "inertia": [0.3, 0.3, 0.5, 0.01, 0.0, 0.0],' in json
    assert saving.described(load(tmp_path / "model.json")) == saving.described(load(tmp_path / "model.yaml"))


@pytest.mark.parametrize("suffix", ["yaml", "json"])
def test_awkward_names(tmp_path, suffix):
    names = [*AWKWARD, "n" * 3000]
    model = mv.Model("true")
    for name in names:
        model.add_body(name, 1.0, (1, 1, 1))
        model.add_input(name, name, "y")
    again = load(save(model, tmp_path / f"names.{suffix}"))
    assert again.name == "true"
    assert [*again.bodies] == [*again.inputs] == names


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (2e7, "2.0e+7"), (-2e7, "-2.0e+7"), (1234000.0, "1.234e+6"), (100000.0, "1.0e+5"), (12000.0, "12000.0"),
        (123456.0, "123456.0"), (1e16, "1.0e+16"), (1.5e-7, "1.5e-07"), (5e-324, "5.0e-324"), (0.1, "0.1"),
        (1.7976931348623157e308, "1.7976931348623157e+308"), (-0.0, "-0.0"), (0.1 + 0.2, "0.30000000000000004"),
    ],
)  # fmt: skip
def test_numbers_are_short_and_exact(value, text):
    assert number(value) == text
    assert float(text) == value


def test_failure_leaves_the_old_file_and_nothing_else(model, tmp_path, monkeypatch):
    path = save(model, tmp_path / "model.yaml")
    old = path.read_bytes()

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    model.add_body("more", 1.0, (1, 1, 1))
    with pytest.raises(mv.ModelError, match=r"model\.yaml: cannot be written: No space left on device\."):
        save(model, path)
    assert path.read_bytes() == old
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.yaml"]


def test_file_is_complete_before_it_takes_the_name(model, tmp_path, monkeypatch):
    seen = []
    replace = os.replace

    def watched(draft, target):
        seen.append((os.path.dirname(draft), load_text(draft), os.path.exists(target)))
        replace(draft, target)

    def load_text(path):
        with open(path, encoding="utf-8") as stream:
            return stream.read()

    monkeypatch.setattr(os, "replace", watched)
    save(model, tmp_path / "model.yaml")
    assert seen == [(str(tmp_path), READABLE, False)]


@pytest.mark.skipif(os.name == "nt", reason="permission bits and links are those of POSIX")
def test_permissions_and_links_stay(model, tmp_path):
    mask = os.umask(0o022)
    try:
        path = save(model, tmp_path / "model.yaml")
    finally:
        os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644
    path.chmod(0o664)
    link = tmp_path / "link.yaml"
    link.symlink_to(path)
    model.add_body("more", 1.0, (1, 1, 1))
    save(model, link)
    assert link.is_symlink()
    assert stat.S_IMODE(path.stat().st_mode) == 0o664
    assert "more" in load(path).bodies


def test_places_that_cannot_be_written(model, tmp_path):
    with pytest.raises(mv.ModelError, match=r"model\.txt: the suffix is '\.txt'; expected \.yaml, \.yml or \.json"):
        save(model, tmp_path / "model.txt")
    with pytest.raises(mv.ModelError, match=r"model\.yaml: cannot be written: No such file or directory"):
        save(model, tmp_path / "nowhere" / "model.yaml")
    assert [*tmp_path.iterdir()] == []


@pytest.mark.slow
def test_yaml_parser_is_imported_only_when_yaml_is_read():
    code = (
        "import sys, mbsvib.files as f, tempfile, pathlib\n"
        "import mbsvib as mv\n"
        "path = pathlib.Path(tempfile.mkdtemp()) / 'm.json'\n"
        "f.load(f.save(mv.Model('m'), path))\n"
        "f.save(mv.Model('m'), path.with_suffix('.yaml'))\n"
        "assert not [name for name in sys.modules if name.startswith('ruamel')]\n"
        "f.load(path.with_suffix('.yaml'))\n"
        "assert 'ruamel.yaml' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
