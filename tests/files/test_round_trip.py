"""Saved and loaded again, a model is the same: every part, every bit, every place in the order."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mbsvib as mv
from mbsvib.files import load, save
from mbsvib.files.reading import read_json, read_yaml
from mbsvib.files.saving import described, json_text, yaml_text
from mbsvib.library import models as library_models
from tests.files.models import models, sections
from tests.support.sizes import examples, few

SUFFIXES = ("yaml", "yml", "json")
MOST = few(["yaml", "json", "yml"], 2)


def bits(value):
    """The value with every float as its eight bytes, so that nothing is equal that differs in a bit."""
    if isinstance(value, float):
        return struct.pack("<d", value)
    return tuple(map(bits, value)) if isinstance(value, tuple) else value


@pytest.mark.slow
@examples(15, slow=60)
@pytest.mark.parametrize("suffix", MOST)
@given(model=models())
def test_random_model(tmp_path_factory, suffix, model):
    path = tmp_path_factory.mktemp("round") / f"model.{suffix}"
    again = load(save(model, path))
    assert again.name == model.name
    assert sections(again) == sections(model)


@pytest.mark.few(7)
@pytest.mark.parametrize("suffix", MOST)
@pytest.mark.parametrize("name", sorted(library_models()))
def test_library_model(tmp_path, name, suffix):
    model = library_models()[name][0]()
    again = load(save(model, tmp_path / f"model.{suffix}"))
    assert again.name == model.name
    assert sections(again) == sections(model)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", MOST)
def test_axes_of_unit_length_keep_every_bit(tmp_path, suffix):
    """Axes are brought to unit length when they are given: once more must not change a bit."""
    model, rng = mv.Model("axes"), np.random.default_rng(0)
    for i, (axis, y_axis) in enumerate(rng.normal(size=(80, 2, 3))):
        model.add_body(f"b{i}", 1.0, (1, 1, 1))
        model.add_rotor(f"r{i}", f"b{i}", 3.0, axis, inertia=0.1)
        model.add_beam(f"beam{i}", f"b{i}", None, {"type": "circle", "radius": 0.01},
                       {"E": 1e9, "nu": 0.3, "rho": 1e3}, start=(0, 0, 0), end=(0, 0, 1), y_axis=y_axis)  # fmt: skip
    again = load(save(model, tmp_path / f"model.{suffix}"))
    assert [bits(part.axis) for part in again.rotors.values()] == [bits(part.axis) for part in model.rotors.values()]
    assert [bits(part.y_axis) for part in again.beams.values()] == [bits(part.y_axis) for part in model.beams.values()]


@pytest.mark.slow
@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from([yaml_text, json_text]))
@settings(max_examples=500, deadline=None)
def test_every_float_comes_back_to_the_last_bit(value, write):
    read = read_yaml if write is yaml_text else read_json
    again = read(write({"value": value, "list": (value, 1.0)}), "file").data
    assert bits(again["value"]) == bits(value)
    assert bits(tuple(again["list"])) == bits((value, 1.0))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_kinds_that_share_a_section_keep_their_order(tmp_path, suffix):
    model = mv.Model("order")
    model.add_body("b", 1.0, (1, 1, 1))
    model.add_bushing("z", "ground", "b", (0, 0, 0), np.eye(6))
    model.add_spring("a", "ground", "b", (0, 0, 0), (0, 0, 1), 1.0)
    model.add_bushing("m", "ground", "b", (0, 0, 0), damping=(1, 1, 1, 1, 1, 1))
    model.add_base_motion("z", "z")
    model.add_input("a", "b", "x")
    model.add_base_motion("m", "ry", (0, 0, 1))
    model.add_force_output("z", "m", "ry")
    model.add_output("a", "b", "x", absolute=False)
    model.add_force_output("m", "a")
    again = load(save(model, tmp_path / f"order.{suffix}"))
    assert [*again.springs] == [*again.inputs] == [*again.outputs] == ["z", "a", "m"]
    assert sections(again) == sections(model)


def test_rotation_vector_and_tensor_are_kept_as_what_they_became(tmp_path):
    model = mv.Model("turned")
    tensor = [[0.3, 0.01, 0.0], [0.01, 0.4, -0.02], [0.0, -0.02, 0.5]]
    model.add_body("b", 1.0, tensor, orientation=(0.1, -0.2, 0.3))
    part = load(save(model, tmp_path / "turned.yaml")).bodies["b"]
    assert bits(part.orientation) == bits(model.bodies["b"].orientation)
    assert bits(part.inertia) == bits((0.3, 0.4, 0.5, 0.01, 0.0, -0.02))


def test_second_save_writes_the_same_text(tmp_path):
    model = library_models()["stewart"][0]()
    first = save(model, tmp_path / "first.yaml")
    second = save(load(first), tmp_path / "second.yaml")
    assert first.read_text("utf-8") == second.read_text("utf-8")
    assert described(load(second)) == described(model)


def test_top_level_names_do_the_same(tmp_path):
    mv.save(mv.Model("top"), tmp_path / "top.json")
    assert mv.load(tmp_path / "top.json").name == "top"
    assert mv.load(str(tmp_path / "top.json")).name == "top"
