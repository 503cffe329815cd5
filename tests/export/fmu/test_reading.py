"""FMUs read as data: the same equations as their binaries have, and nothing of the archive is run."""

import shutil
import subprocess
import zipfile

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.fmu_.binaries import this_platform
from mbsvib_export.fmu_.reading import state_space_in
from tests.export.plants import slider, stewart

SYSTEMS = {
    "stewart": (stewart, ()),
    "quarter_car": (lambda: library.quarter_car().linearize(), ("*.stiffness", "*.mass")),
    "one name": (lambda: slider(inputs=("z",), outputs=("z",)), ()),
    "odd names": (lambda: slider(inputs=("a < \"b\" & 'c'",)), ()),
    "locked": (lambda: slider(locked=True), ()),
    "no name": (lambda: mv.System.from_matrices([[2.0]], [[0.3]], [[50.0]], [[1.0]], [[1.0]], name=""), ()),
}


def rewritten(path, goal, change):
    """The same archive with members changed by name; a member for which None is returned is left out."""
    with zipfile.ZipFile(path) as one, zipfile.ZipFile(goal, "w") as two:
        for name in one.namelist():
            if (content := change(name, one.read(name))) is not None:
                two.writestr(name, content)
    return goal


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("case", SYSTEMS)
def test_numbers_in_the_archive_are_those_of_the_binary(case, version, tmp_path):
    pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbsvib[fmu]'")
    from mbsvib_export.cosimulation.unit import state_space_of_unit

    build, tunable = SYSTEMS[case]
    path = mx.to_fmu(build(), tmp_path / "x.fmu", version, tunable=tunable).path
    (result, platforms), truth = state_space_in(path), state_space_of_unit(path)
    assert platforms
    assert result.name == (build().name or "system")
    for key in ("name", "states", "state_units", "inputs", "input_units", "outputs", "output_units"):
        assert getattr(result, key) == getattr(truth, key), key
    for key in "ABCD":
        one, two = getattr(result, key), getattr(truth, key)
        assert one.shape == two.shape
        assert np.abs(one - two).max(initial=0.0) <= 1e-12 * np.abs(two).max(initial=0.0), key


LIBRARY = """
#include <stdio.h>
__attribute__((constructor)) static void loaded(void) { FILE *f = fopen("%s", "w"); if (f) fclose(f); }
"""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc here")
def test_a_library_in_the_archive_is_loaded_only_where_the_caller_says_so(tmp_path):
    pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbsvib[fmu]'")
    mark, source, library_file = (tmp_path / name for name in ("mark", "x.c", "x.so"))
    source.write_text(LIBRARY % mark)
    made = subprocess.run(["gcc", "-shared", "-fPIC", str(source), "-o", str(library_file)], capture_output=True)
    assert made.returncode == 0, made.stderr
    good = mx.to_fmu(slider(), tmp_path / "x.fmu").path
    path = rewritten(good, tmp_path / "hostile.fmu", lambda name, content:
                     library_file.read_bytes() if this_platform() in name else content)  # fmt: skip
    result = mx.check_export(path, slider())
    assert result.passed
    assert "Not run: its binaries for" in str(result)
    assert this_platform() in str(result)
    assert not mark.exists()
    with pytest.raises(mv.ExportError, match=r"cannot be loaded|cannot be instantiated"):
        mx.check_export(path, slider(), run=True)
    assert mark.exists()


def test_archives_that_were_changed(tmp_path):
    path = mx.to_fmu(slider(), tmp_path / "x.fmu").path

    def numbers(change):
        return lambda name, content: change(content) if name.endswith(".lti") else content

    def words(old, new):
        return lambda name, content: content.replace(old, new) if name.endswith(".xml") else content

    entities = b'<!DOCTYPE a [<!ENTITY b "c">]>\n<fmiModelDescription'
    for change, message in (
        (numbers(lambda content: content[:-1] + b"\1"), "checksum of resources/model.lti is wrong"),
        (numbers(lambda content: content[:90]), "no file of to_fmu"),
        (numbers(lambda content: None), "mbsvib has not written it; .* if you trust its origin"),
        (words(b'nominal="', b'nominal="1'), "is not as it was written"),
        (words(b'instantiationToken="{', b'instantiationToken="{0'), "their tokens differ"),
        (words(b'description="state ', b'description="a state '), "is not as it was written"),
        (words(b"<fmiModelDescription", entities), "document type"),
        (words(b"fmiModelDescription", b"other"), "expected <fmiModelDescription>"),
        (words(b'fmiVersion="3.0"', b'fmiVersion="1.0"'), "FMI '1.0'; expected 2.0 or 3.0"),
    ):
        with pytest.raises(mv.ExportError, match=rf"y\.fmu: .*{message}"):
            mx.check_export(rewritten(path, tmp_path / "y.fmu", change), slider())
