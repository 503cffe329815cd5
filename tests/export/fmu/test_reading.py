"""FMUs read as data: the same equations as their binaries have, and nothing of the archive is run."""

import hashlib
import re
import shutil
import struct
import subprocess
import zipfile
import zlib
from xml.etree import ElementTree

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


@pytest.mark.few(4)
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


def forged(path, goal, change):
    """The archive with numbers changed as if they had been written so: checksum and token are those of the new ones."""
    with zipfile.ZipFile(path) as archive:
        text, content = archive.read("modelDescription.xml").decode(), archive.read("resources/model.lti")
    sizes, body = change([*struct.unpack("<6q", content[16:64])], content[128:])
    sizes = struct.pack("<6q", *sizes)
    old = re.search(r'instantiationToken="([^"]*)"', text)[1]
    digest = hashlib.sha256(sizes + body + text.replace(f'="{old}"', '=""', 1).encode()).hexdigest()
    new = "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"
    rest = sizes + new.encode().ljust(64, b"\0") + body
    numbers = content[:8] + struct.pack("<Q", zlib.crc32(rest)) + rest
    return rewritten(path, goal, lambda name, old_content: numbers if name.endswith(".lti") else
                     text.replace(old, new).encode() if name.endswith(".xml") else old_content)  # fmt: skip


def changed(place, value, kind="<q"):
    """The change of one number of 8 bytes; a negative place counts from the end."""
    def change(sizes, body):
        at = 8 * place % len(body)
        return sizes, body[:at] + struct.pack(kind, value) + body[at + 8 :]

    return change


# quarter_car with 2 tunable parameters: 4 states, 3 inputs, 6 outputs, 1 block of A; with E and F behind D
FORGERIES = {
    "another number of inputs": (lambda sizes, body: ([4, 4, *sizes[2:]], body), "has 4 inputs, 6 outputs, 4 states"),
    "half a number": (lambda sizes, body: (sizes, body + b"1234"), "sizes in .* do not fit its bytes"),
    "blocks below zero": (lambda sizes, body: ([*sizes[:4], -1, sizes[5]], body), "sizes in .* do not fit its bytes"),
    "entries below zero": (lambda sizes, body: ([*sizes[:5], -2], body), "sizes in .* do not fit its bytes"),
    "more entries than bytes": (lambda sizes, body: ([*sizes[:5], 2**40], body), "sizes in .* do not fit its bytes"),
    "a number more": (lambda sizes, body: (sizes, body + bytes(8)), r"\d+ numbers in .* do not fit its sizes"),
    "a number less": (lambda sizes, body: (sizes, body[:-8]), r"\d+ numbers in .* do not fit its sizes"),
    "no number": (changed(-1, np.nan, "<d"), "holds NaN or infinity"),
    "first row of A": (changed(0, 1), "the blocks of .* do not fit 4 states"),
    "last row of A": (changed(1, 5), "the blocks of .* do not fit 4 states"),
    "first entry": (changed(2, 1), "the parameters of .* do not fit their entries"),
    "last entry": (changed(4, 2), "the parameters of .* do not fit their entries"),
    "entries backwards": (changed(3, 99), "the parameters of .* do not fit their entries"),
    "a place before A": (changed(5, -1), "entries of parameters lie outside"),
    "a place behind F": (changed(5, 16 + 12 + 24 + 18 + 16 + 24), "entries of parameters lie outside"),
}


@pytest.mark.few(3)
@pytest.mark.parametrize("case", FORGERIES)
def test_numbers_that_contradict_each_other(case, tmp_path):
    change, message = FORGERIES[case]
    path = mx.to_fmu(library.quarter_car().linearize(), tmp_path / "x.fmu", platforms=this_platform(),
                     tunable=("suspension.stiffness", "body.mass")).path  # fmt: skip
    same = forged(path, tmp_path / "y.fmu", lambda sizes, body: (sizes, body))
    assert state_space_in(same)[0].B.shape == (4, 3)
    with pytest.raises(mv.ExportError, match=rf"y\.fmu: .*{message}"):
        state_space_in(forged(path, tmp_path / "y.fmu", change))


def test_masses_and_start_values_that_contradict_the_description(tmp_path):
    path = mx.to_fmu(library.quarter_car().linearize(), tmp_path / "x.fmu", platforms=this_platform(),
                     tunable=("suspension.stiffness",)).path  # fmt: skip
    masses = (-30, -29, -26, -25)  # before the 24 numbers of F, in the last two rows of E
    for values, message in (((1.0, 1.0, 1.0, 1.0), "Singular matrix"),
                            ((5e-324, 0.0, 0.0, 1.0), "its mass matrix cannot be inverted")):
        def change(sizes, body, values=values):
            for place, value in zip(masses, values, strict=True):
                sizes, body = changed(place, value, "<d")(sizes, body)
            return sizes, body

        with pytest.raises(mv.ExportError, match=rf"y\.fmu: {message}"):
            state_space_in(forged(path, tmp_path / "y.fmu", change))
    start = 2 + 2 + 1 + 4 + 4 + 3  # edges, first entries, a place, then two numbers of each state and one of each input
    with pytest.raises(mv.ExportError, match="start values of parameters differ"):
        state_space_in(forged(path, tmp_path / "y.fmu", changed(start, 22001.0, "<d")))


def test_blocks_of_modal_states_stand_one_after_the_other(tmp_path):
    """Modes of unlike sizes: two states each of those that oscillate, one each of those that do not."""
    a = np.zeros((5, 5))
    a[:2, :2], a[2, 2], a[3:, 3:] = [[0.0, 1.0], [-4.0, -0.3]], -7.0, [[0.0, 1.0], [-9.0, -0.1]]
    b, c = np.arange(1.0, 11.0).reshape(5, 2), np.arange(3.0, 18.0).reshape(3, 5)
    d = np.arange(6.0).reshape(3, 2)
    space = mv.StateSpace.from_arrays(a, b, c, d)
    found, platforms = state_space_in(mx.to_fmu(space, tmp_path / "x.fmu", platforms=this_platform()).path)
    for key, matrix in zip("ABCD", (a, b, c, d), strict=True):
        np.testing.assert_array_equal(getattr(found, key), matrix)
    assert platforms == (this_platform(),)
    assert found.states == space.states


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_what_the_description_says_of_each_variable(version, tmp_path):
    """Causality, variability, units and start values; of FMI 3, which may change within a step: inputs and outputs."""
    path = mx.to_fmu(slider(inputs=("F", "time")), tmp_path / "x.fmu", version, tunable="k.stiffness",
                     platforms=this_platform()).path  # fmt: skip
    with zipfile.ZipFile(path) as archive:
        top = ElementTree.fromstring(archive.read("modelDescription.xml"))
    result = []
    for item in top.find("ModelVariables"):
        words = {**item.attrib, **(item[0].attrib if version == "2.0" else {})}
        result.append([words.get(key) for key in ("name", "valueReference", "causality", "variability", "initial",
                                                  "unit", "start", "derivative", "intermediateUpdate")])  # fmt: skip
    new = version == "3.0"
    during = "true" if new else None
    clock = [["time_", "0", "independent", "continuous", *[None] * 5]] if new else []
    assert result == [
        *clock,
        ["F", "1", "input", "continuous", None, "N", "0.0", None, during],
        ["time", "2", "input", "continuous", None, "N", "0.0", None, during],
        ["z", "3", "output", "continuous", "calculated", "m", None, None, during],
        ["guide.z", "4", "local", "continuous", "exact", "m", "0.0", None, None],
        ["d(guide.z)/dt", "5", "local", "continuous", "exact", "m/s", "0.0", None, None],
        ["der(guide.z)", "6", "local", "continuous", "calculated", "m/s", None, "4", None],
        ["der(d(guide.z)/dt)", "7", "local", "continuous", "calculated", "m/s^2", None, "5", None],
        ["k.stiffness", "8", "parameter", "tunable", "exact", "N/m", "10000.0", None, None],
    ]
    # z depends on the position alone, the rates on velocity, and on all with the parameter
    word = "valueReference" if new else "index"
    listed = [(item.tag if new else group.tag, item.get(word), item.get("dependencies"))
              for group in top.findall("ModelStructure" if new else "ModelStructure/*") for item in group]  # fmt: skip
    knowns = [("3", "4 8"), ("6", "5 8"), ("7", "1 2 4 5 8")]
    kinds = [("Output", 0), ("ContinuousStateDerivative", 1), ("ContinuousStateDerivative", 2)] if new else [
        ("Outputs", 0), ("Derivatives", 1), ("Derivatives", 2)]  # fmt: skip
    kinds += [("InitialUnknown" if new else "InitialUnknowns", k) for k in range(3)]
    assert listed == [(kind, *knowns[k]) for kind, k in kinds]
