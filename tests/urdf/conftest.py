"""Files of robots."""

import pytest


@pytest.fixture
def robot(tmp_path):
    """A function that writes elements of a URDF into a file."""

    def write(words, name="robot"):
        path = tmp_path / "robot.urdf"
        path.write_text(f'<robot name="{name}">{words}</robot>', encoding="utf-8")
        return path

    return write
