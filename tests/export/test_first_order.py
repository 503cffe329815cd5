"""First-order equations alone, as of loops with dynamic controllers: in every format that can hold them, and back."""

import json

import control
import jsonschema
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib_export.op4_ import read_op4
from tests.export.plants import same_bits

READERS = {"json": mx.from_json, "npz": mx.from_npz, "h5": mx.from_hdf5, "mat": mx.from_mat}
WRITERS = {"json": mx.to_json, "npz": mx.to_npz, "h5": mx.to_hdf5, "mat": mx.to_mat, "op4": mx.to_op4}


def car():
    return library.quarter_car(suspension_damping=900.0).linearize()


def skyhook():
    return control.ss([[-0.5]], [[1.0]], [[-3000.0]], [[0.0]], name="skyhook", inputs=["body:az"], outputs=["actuator"])


SOURCES = {
    "dynamic loop": lambda: car().feedback(skyhook()),
    "part of a loop": lambda: car().feedback(skyhook())[["travel", "body.z"], "road"],
    "gain of accelerations": lambda: car().feedback([[-30.0]], "body.az", "actuator"),
    "controller": lambda: car().feedback(skyhook()).law,
    "given": lambda: mv.StateSpace.from_arrays([[0, 1], [-100, -2]], [[0], [1]], [[1, 0]], 0, inputs=["ü"], name="m"),
    "reduced": lambda: car().reduced(3),
    "python-control": skyhook,
    "gain alone": lambda: mv.StateSpace.from_arrays(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[2.0]]),
}


def expected(source):
    if not hasattr(source, "state_space"):
        return mv.StateSpace.from_control(source)
    return source.state_space("physical") if type(source).__name__ == "ClosedLoop" else source.state_space()


@pytest.mark.few(4)
@pytest.mark.parametrize("case", SOURCES)
@pytest.mark.parametrize("suffix", READERS)
def test_there_and_back(case, suffix, tmp_path):
    source = SOURCES[case]()
    space = expected(source)
    path = tmp_path / f"loop.{suffix}"
    WRITERS[suffix](source, path)
    back = READERS[suffix](path)
    assert isinstance(back, mv.StateSpace)
    assert all(same_bits(getattr(back, key), getattr(space, key)) for key in "ABCD")
    for what in ("inputs", "outputs", "states"):
        assert getattr(back, what) == tuple(name.replace(":", ".") for name in getattr(space, what))
    for what in ("input_units", "output_units", "state_units", "realization", "error_bound"):
        assert getattr(back, what) == getattr(space, what)
    assert mx.check_export(path, source).passed
    with pytest.raises(mv.ExportError, match="nothing to compare it with"):
        mx.check_export(path)


@pytest.mark.few(2)
@pytest.mark.parametrize("realization", ["modal", "balanced"])
@pytest.mark.parametrize("suffix", READERS)
def test_loops_in_other_states(suffix, realization, tmp_path):
    loop = car().feedback(skyhook())
    path = tmp_path / f"loop.{suffix}"
    WRITERS[suffix](loop, path, realization)
    back, space = READERS[suffix](path), loop.state_space(realization)
    assert back.states == space.states
    assert all(same_bits(getattr(back, key), getattr(space, key)) for key in "ABCD")
    assert mx.check_export(path, loop).passed


def test_what_was_read_has_all_methods_of_a_state_space(tmp_path):
    loop = car().feedback(skyhook())
    mx.to_json(loop, tmp_path / "loop.json")
    back = mx.from_json(tmp_path / "loop.json")
    w = np.geomspace(1.0, 1e3, 50)
    truth = loop.frequency_response(w)
    np.testing.assert_allclose(back.frequency_response(w), truth, rtol=1e-9, atol=1e-9 * np.abs(truth).max())
    np.testing.assert_allclose(np.sort_complex(back.poles()), np.sort_complex(loop.poles()), rtol=1e-9)
    assert mx.to_control(back).state_labels[-1] == "controller1"


def test_the_schema_holds():
    document = json.loads(mx.to_json(car().feedback(skyhook())))
    validator = jsonschema.Draft202012Validator(mx.json_schema())
    validator.validate(document)
    assert document["format"] == "mbsvib-state-space"
    for broken in (document | {"format": "mbsvib-system"}, {k: v for k, v in document.items() if k != "state_space"}):
        assert not validator.is_valid(broken)


@pytest.mark.parametrize("case", SOURCES)
@pytest.mark.parametrize("binary", [False, True])
def test_op4_holds_a_b_c_d(case, binary, tmp_path):
    source = SOURCES[case]()
    space = expected(source)
    path = mx.to_op4(source, tmp_path / "loop.op4", binary)
    arrays = read_op4(path)
    assert set(arrays) == {key for key in "ABCD" if getattr(space, key).size}
    assert all(np.array_equal(array, getattr(space, key)) for key, array in arrays.items())
    assert mx.check_export(path, source).passed


@pytest.mark.slow
def test_op4_is_read_by_pyyeti(tmp_path):
    op4 = pytest.importorskip("pyyeti.nastran.op4", reason="pyyeti is not installed: pip install pyyeti")
    loop = car().feedback(skyhook())
    space = loop.state_space("physical")
    for binary in (False, True):
        theirs = op4.load(str(mx.to_op4(loop, tmp_path / "loop.op4", binary)), into="dct")
        assert all(np.array_equal(theirs[key.lower()][0], getattr(space, key)) for key in "ABCD")


@pytest.mark.parametrize("case", SOURCES)
def test_dmig_says_why_it_cannot_hold_them(case, tmp_path):
    with pytest.raises(mv.ExportError, match=r"to_dmig: .*first-order equations only.*Nastran's M, C and K.*to_op4"):
        mx.to_dmig(SOURCES[case](), tmp_path / "loop.pch")
    assert not list(tmp_path.iterdir())


def test_loops_keep_the_nodes_of_their_plant(tmp_path):
    system = car()
    w = 2 * np.pi * np.linspace(0.5, 20.0, 30)
    mx.to_uff(system, tmp_path / "car.uff", w)
    plant = mx.from_uff(tmp_path / "car.uff")
    for key in (slice(None), (["travel", "body.z"], "load")):
        loop = system.feedback(skyhook())
        loop = loop if isinstance(key, slice) else loop[key]
        mx.to_uff(loop, tmp_path / "loop.uff", w)
        back = mx.from_uff(tmp_path / "loop.uff")
        assert back.outputs == loop.outputs
        assert [back.nodes[k] for k in range(2)] == list(plant.nodes[:2])
        for name, point in zip(back.outputs, back.output_points, strict=True):
            if name.startswith(("body", "wheel")):
                assert point == plant.output_points[plant.outputs.index(name)]
        np.testing.assert_allclose(back.responses, loop.frequency_response(back.omega), rtol=1e-12)
        assert mx.check_export(tmp_path / "loop.uff", loop).passed
    for case in ("controller", "reduced", "python-control", "gain alone"):
        mx.to_uff(SOURCES[case](), tmp_path / "space.uff", w)
        assert mx.check_export(tmp_path / "space.uff", SOURCES[case]()).passed
    with pytest.raises(mv.ExportError, match="only a System has modes"):
        mx.to_uff(loop, tmp_path / "loop.uff", w, modes=True)


def test_units_of_loops_are_checked(tmp_path):
    loop = car().feedback(skyhook())
    path = mx.to_fmu(loop, tmp_path / "loop.fmu").path
    assert mx.check_export(path, loop).passed
    with pytest.raises(mv.ExportError, match="the outputs of the file are not those"):
        mx.check_export(path, loop["travel", :])
    other = car().feedback(control.ss(-0.5, 1, -2900.0, 0, inputs=["body:az"], outputs=["actuator"]))
    assert not mx.check_export(path, other).passed


DAMAGE = {
    "no matrix": (lambda d: d["state_space"].pop("A"), "no key 'A'"),
    "a row less": (lambda d: d["state_space"]["B"].pop(), "B has shape"),
    "a name twice": (lambda d: d["inputs"].append(d["inputs"][0]), "row 1 has|more than once"),
    "a text": (lambda d: d["state_space"].update(error_bound="1"), "expected a number"),
    "below zero": (lambda d: d["state_space"].update(error_bound=-1.0), "error_bound = -1"),
    "later": (lambda d: d.update(version=2), "version = 2"),
    "a format": (lambda d: d.update(format="mbsvib-space"), "expected 'mbsvib-system' or 'mbsvib-state-space'"),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_damage_is_refused(case):
    change, words = DAMAGE[case]
    document = json.loads(mx.to_json(car().reduced(3)))
    change(document)
    with pytest.raises(mv.ExportError, match=words):
        mx.from_json(document)


def test_numbers_that_are_not_finite_are_refused(tmp_path):
    space = mv.StateSpace.from_arrays([[-1.0]], [[1.0]], [[1.0]], 0)
    arrays = dict(np.load(mx.to_npz(space, tmp_path / "x.npz")))
    for key, value, words in (("state_space.A", np.array([[np.nan]]), "A holds NaN"),
                              ("state_space.A", np.array([[1]]), "holds int64"), ("states", None, "is missing")):
        broken = {k: v for k, v in arrays.items() if k != key} | ({} if value is None else {key: value})
        np.savez(tmp_path / "y.npz", **broken)
        with pytest.raises(mv.ExportError, match=words):
            mx.from_npz(tmp_path / "y.npz")
