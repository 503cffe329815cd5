"""Content of files: what is no regular file is refused, with one message, whatever the class of the error."""

import os

import pytest

import mbsvib as mv
from mbsvib.common.file_content import content_of


@pytest.mark.parametrize("error", [mv.ModelError, mv.ExportError])
def test_what_is_no_file(error, tmp_path):
    cases = {tmp_path: "it is a folder", tmp_path / "none": "there is no such file"}
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        cases[tmp_path / "pipe"] = "it is no regular file"
    for path, reason in cases.items():
        with pytest.raises(error) as caught:
            content_of(path, error, "a model file")
        assert str(caught.value) == f"{path}: cannot be read: {reason}; expected a model file."
    with pytest.raises(error, match=r"cannot be read: .*null"):
        content_of("a\0b", error, "a model file")


def test_bytes(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"\0\r\n\xff")
    assert content_of(path, mv.ModelError, "a file") == b"\0\r\n\xff"


def test_the_content_of_a_file_in_place_of_its_path_is_told():
    with pytest.raises(mv.ModelError, match=r"^path = '<robot name=\"arm\"> \.\.\.': this is the content of a file"):
        mv.load_urdf('<robot name="arm">\n<link name="base"/>\n</robot>')
