"""The words of the files cover the calls of the model, and every type that a call asks for is one that is checked."""

import inspect
from dataclasses import fields

import pytest

from mbsvib.api.model import ADDERS, Model
from mbsvib.files.words import ALL_SECTIONS, COMPOUND, SECTIONS, head_words, mandatory, options, unfit, words

KNOWN_TYPES = {"None", "str", "float", "int", "bool", "ArrayLike", "Sequence[str]"}
KNOWN_TYPES |= {"Body", "Bushing", "Spring", "Maxwell", "Joint", "Tube", "Circle", "Rectangle", "Section", "Material"}
KNOWN_TYPES |= {"Mechanism", "Dynamic"}
KNOWN_TYPES |= {f"Mapping[str, {kind}]" for kind in ("Any", "float", "str", "ArrayLike")}


def test_every_call_has_a_section():
    calls = {name.removeprefix("add_") for name, _ in inspect.getmembers(Model, callable) if name.startswith("add_")}
    calls -= {"port"}  # twelve inputs and outputs, which have sections
    kinds = [kind for section in ALL_SECTIONS.values() for kind in section]
    assert sorted(kinds) == sorted(calls)
    several = {kind for section in COMPOUND.values() for kind in section}
    assert {adder.removeprefix("add_") for adder in ADDERS.values()} == calls - several


def test_every_section_is_a_mapping_of_the_model():
    assert all(len(getattr(Model(), section)) == 0 for section in SECTIONS)


@pytest.mark.parametrize("kind", [kind for section in ALL_SECTIONS.values() for kind in section])
def test_types_are_known_and_no_word_is_called_type(kind):
    assert "type" not in words(kind)
    assert all(options(item) <= KNOWN_TYPES for item in words(kind).values())


def test_words_of_parts_are_words_of_their_calls():
    for part, adder in ADDERS.items():
        stated = {field.name for field in fields(part) if not field.metadata.get("derived")}
        assert stated - {"name"} <= set(words(adder.removeprefix("add_")))


def test_words_of_the_model_itself():
    assert "name" in head_words()
    assert not set(head_words()) & {*ALL_SECTIONS, "mbsvib", "$schema"}


def test_mandatory_words():
    assert [word for word, item in words("rotor").items() if mandatory(item)] == ["body", "speed", "axis"]
    assert [word for word, item in words("joint").items() if mandatory(item)] == ["first", "second"]


@pytest.mark.parametrize(
    ("kind", "word", "value", "expected"),
    [
        ("body", "mass", "heavy", None), ("body", "inertia", [[1, 2], 3], None), ("body", "inertia", 3, None),
        ("body", "inertia", [1, None], "a list of numbers"), ("body", "inertia", {}, "a list of numbers"),
        ("body", "orientation", None, None), ("joint", "free", "x", None), ("joint", "free", ["x"], None),
        ("joint", "free", ["x", 1], "a list of texts"), ("joint", "kind", None, None), ("joint", "kind", 1, "a text"),
        ("joint", "first", None, "a text"), ("output", "absolute", True, None),
        ("output", "absolute", 1, "true or false"),
        ("input", "direction", "x", None), ("input", "direction", [1, 2, "x"], "a list of numbers"),
    ],
)  # fmt: skip
def test_what_a_word_admits(kind, word, value, expected):
    assert unfit(words(kind)[word], value) == expected
