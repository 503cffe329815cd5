"""The command line inside the process, in a folder of its own."""

import pytest

from tests.support.cli import invoke

FAULTY = """\
name: faulty
bodies:
  mass: {mass: 1.0, inertia: [1, 1, 1]}
joints:
  rail: {kind: prismatic, first: ground, second: mas, axis: [1, 0, 0]}
"""

SLIDER = """\
name: slider
bodies:
  mass: {mass: 2.0, inertia: [1, 1, 1]}
joints:
  rail: {kind: prismatic, first: ground, second: mass, axis: [1, 0, 0]}
springs:
  k: {first: ground, second: mass, start: [-1, 0, 0], end: [0, 0, 0], stiffness: 5000, damping: 10}
inputs:
  F: {body: mass, direction: x}
outputs:
  x: {body: mass, direction: x}
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A function that runs ``mbsvib`` with the words of a line in a temporary folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "slider.yaml").write_text(SLIDER, encoding="utf-8")
    (tmp_path / "faulty.yaml").write_text(FAULTY, encoding="utf-8")

    return lambda line: invoke(line.split())
