"""JSON: the form its schema lays down, every number to the last bit, and errors that say where."""

import json
from functools import cache

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.neutral import FIRST_ORDER, SECOND_ORDER
from tests.export.plants import same_bits, slider, stewart

SYSTEMS = {
    "stewart": lambda: library.stewart(ports="all").linearize(),
    "chain": lambda: library.chain(4, "spherical", line=(0, 1, 0)).linearize(),
    "quadruped": lambda: library.quadruped().linearize(),
    "no inputs": lambda: slider(inputs=()),
    "no outputs": lambda: slider(outputs=()),
    "no ports": lambda: slider((), ()),
    "locked": lambda: slider(locked=True),
    "names": lambda: slider(['a "b"\\', "ü.ß~😀"], ["-z", "[0]"], name="<&>"),
}
SYSTEMS = {name: cache(make) for name, make in SYSTEMS.items()}


def assert_same(data, system, realization="physical"):
    """``data`` has all that the system has, every bit of it."""
    space = system.state_space(realization)
    ports = ("name", "inputs", "input_units", "outputs", "output_units")
    for key in (*ports, "coordinates", "coordinate_units", "bodies"):
        assert getattr(data, key) == getattr(system, key), key
    for key in (*SECOND_ORDER, "body_motion"):
        assert same_bits(getattr(data, key), getattr(system, key)), key
    for key in FIRST_ORDER:
        assert same_bits(getattr(data.state_space, key), getattr(space, key)), key
    for key in (*ports, "realization", "states", "state_units"):
        assert getattr(data.state_space, key) == getattr(space, key), key


@pytest.mark.few(4)
@pytest.mark.parametrize("case", SYSTEMS)
@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_there_and_back(case, realization, tmp_path):
    system = SYSTEMS[case]()
    path = tmp_path / "system.json"
    text = mx.to_json(system, path, realization)
    assert path.read_text(encoding="utf-8") == text
    for source in (path, str(path), text, json.loads(text)):
        assert_same(mx.from_json(source), system, realization)
    assert mx.to_json(mx.from_json(path)) == text


@pytest.mark.few(2)
@pytest.mark.parametrize("case", SYSTEMS)
def test_the_schema_holds(case):
    schema = mx.json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(json.loads(mx.to_json(SYSTEMS[case]())), schema)


def words():
    return json.loads(mx.to_json(slider(inputs=("F", "G"))))


MISTAKES = {
    "another format": (lambda w: w.update(format="mbsvib-model"), "format = 'mbsvib-model'"),
    "no format": (lambda w: w.pop("format"), "format = None"),
    "a later version": (lambda w: w.update(version=2), "version = 2.*upgrade"),
    "version as a text": (lambda w: w.update(version="1"), "version = '1'"),
    "no name": (lambda w: w.pop("name"), "'name'"),
    "name of another kind": (lambda w: w.update(name=3), "name = 3"),
    "no outputs": (lambda w: w.pop("outputs"), "'outputs'"),
    "outputs of another kind": (lambda w: w.update(outputs="z"), "outputs = z; expected a list"),
    "signal without unit": (lambda w: w["inputs"][0].pop("unit"), "inputs.*'unit'"),
    "signal of another kind": (lambda w: w.update(inputs=["F", "G"]), "inputs is 'F'"),
    "no matrices": (lambda w: w.pop("second_order"), "'second_order'"),
    "no K": (lambda w: w["second_order"].pop("K"), "second_order.*'K'"),
    "number for a matrix": (lambda w: w["second_order"].update(K=1e4), "second_order: K = 10000"),
    "vector for a matrix": (lambda w: w["second_order"].update(K=[1e4]), "K: row 1 has 10000"),
    "short row": (lambda w: w["second_order"]["B"][0].pop(), "B: row 1 has 1 entries; expected 2"),
    "long row": (lambda w: w["state_space"]["A"][1].append(0.0), "A: row 2 has 3 entries; expected 2"),
    "row missing": (lambda w: w["state_space"]["A"].pop(), r"state_space.A has shape \(1, 2\); expected \(2, 2\)"),
    "text in a matrix": (lambda w: w["second_order"]["B"][0].__setitem__(1, "1"), "row 1 holds '1'"),
    "bool in a matrix": (lambda w: w["second_order"]["B"][0].__setitem__(1, True), "row 1 holds True"),
    "null in a matrix": (lambda w: w["second_order"]["B"][0].__setitem__(1, None), "row 1 holds None"),
    "huge integer": (lambda w: w["second_order"]["B"][0].__setitem__(1, 10**400), "B holds an integer past"),
    "body without map": (lambda w: w["bodies"][0].pop("displacement"), "mass.*'displacement'"),
    "map of five rows": (lambda w: w["bodies"][0]["displacement"].pop(), "mass: displacement has 5 rows"),
    "the same name twice": (lambda w: w["inputs"][1].update(name="F"), "'F' among the inputs"),
    "an empty name": (lambda w: w["inputs"][1].update(name=""), "'' among the inputs"),
}
OF_SIZE = {"short row", "long row", "row missing", "the same name twice", "huge integer"}  # beyond what a schema sees


@pytest.mark.few(6)
@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_are_found_where_they_are(mistake, tmp_path):
    change, message = MISTAKES[mistake]
    document = words()
    change(document)
    with pytest.raises(mv.ExportError, match=message):
        mx.from_json(document)
    path = tmp_path / "wrong.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(mv.ExportError, match=rf"wrong\.json: .*{message}"):
        mx.from_json(path)
    if mistake not in OF_SIZE:
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(document, mx.json_schema())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"format": "mbsvib-system",\n "version": }', "line 2, column 13"),
        ("{", "line 1"),
        ('{"format": ' + "[" * 100_000, "no JSON"),
        ('{"version": ' + "1" * 5000 + "}", "no JSON"),
        ('{"version": NaN}', "NaN is not a number"),
    ],
)
def test_damaged_text(text, message, tmp_path):
    with pytest.raises(mv.ExportError, match=message):
        mx.from_json(text)
    path = tmp_path / "damaged.json"
    path.write_text(text)
    with pytest.raises(mv.ExportError, match=rf"damaged\.json: .*{message}"):
        mx.from_json(path)


def test_infinity_is_refused():
    text = mx.to_json(slider()).replace("10000.0", "1e999")
    with pytest.raises(mv.ExportError, match="K holds NaN or infinity"):
        mx.from_json(text)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"[1, 2]", b"PK\x03\x04"])
def test_files_of_another_kind(content, tmp_path):
    path = tmp_path / "other.json"
    path.write_bytes(content)
    with pytest.raises(mv.ExportError, match=r"other\.json: "):
        mx.from_json(path)


def test_a_missing_file_and_a_folder(tmp_path):
    for path in (tmp_path / "none.json", tmp_path):
        with pytest.raises(mv.ExportError, match=rf"{path.name}: cannot be read"):
            mx.from_json(path)


@pytest.mark.slow
@settings(deadline=None)
@given(st.floats(0.0, 1.0, exclude_max=True))
def test_a_cut_text_is_refused(place):
    text = mx.to_json(slider()).rstrip()
    with pytest.raises(mv.ExportError):
        mx.from_json("{" + text[1 : int(place * len(text))])


def test_keys_of_later_releases_are_skipped():
    document = words() | {"loads": []}
    jsonschema.validate(document, mx.json_schema())
    assert_same(mx.from_json(document), slider(inputs=("F", "G")))


def test_a_row_a_line():
    lines = mx.to_json(stewart()).splitlines()
    assert max(line.count("[") for line in lines) == 1
    assert '    {"name": "leg1.force", "unit": "N"},' in lines


def test_what_was_read_goes_on():
    system = stewart()
    data = mx.from_json(mx.to_json(system))
    assert same_bits(mx.to_control(data).A, system.state_space().A)
    assert same_bits(mx.to_scipy(data).A, system.state_space().A)
    assert repr(data) == "SystemData('stewart': 6 DOF, 15 inputs, 24 outputs)"
    for array in (data.M, data.body_motion, data.state_space.A):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0


def test_the_way_back_to_the_bodies():
    system = stewart()
    data = mx.from_json(mx.to_json(system))
    q = np.random.default_rng(3).normal(size=(6, 4))
    for first, second in ((q, q), (q[:, 0], q[:, 0])):
        back, direct = data.displacements(first), system.displacements(second)
        assert list(back) == list(direct)
        assert all(same_bits(back[body], direct[body]) for body in back)
    with pytest.raises(mv.ExportError, match=r"stewart: q has shape \(5,\); expected \(6,\)"):
        data.displacements(np.zeros(5))


def test_what_is_no_system_is_refused():
    with pytest.raises(mv.ExportError, match="to_json: system = NoneType"):
        mx.to_json(None)
    with pytest.raises(mv.ExportError, match="realization = 'modal'"):
        mx.to_json(mx.from_json(mx.to_json(slider())), realization="modal")
    with pytest.raises(mv.ResponseError, match="realization"):
        mx.to_json(slider(), realization="jordan")


@pytest.mark.parametrize(
    ("matrix", "factor"), [("M", 1.1), ("K", 0.99), ("B", 2.0), ("Cq", -1.0), ("A", 1.01), ("C", 3.0)]
)
def test_masses_that_contradict_the_state_space(matrix, factor):
    """One of the two forms was changed: which of them is meant, nobody knows."""
    document = json.loads(mx.to_json(slider()))
    form = document["state_space" if matrix in ("A", "C") else "second_order"]
    form[matrix] = [[factor * number for number in row] for row in form[matrix]]
    with pytest.raises(mv.ExportError, match="expected two forms of one system"):
        mx.from_json(document)
