"""JSON gives the same values and lines as YAML, in any indentation."""

import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import mbsvib as mv
from mbsvib.files.reading import read_json, read_yaml

values = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**16), 10**16) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(categories=("L", "N", "P", "S"), include_characters=' \\"\n\t'), max_size=6),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc<{[:,\"\\", max_size=3), inner, max_size=3),
    max_leaves=12,
)  # fmt: skip
mappings = st.dictionaries(st.text("abc:{", min_size=1, max_size=3), values, max_size=4)


@pytest.mark.slow
@settings(deadline=None)
@given(mappings, st.sampled_from([None, 0, 2, "\t"]))
def test_same_values_and_lines_as_yaml(data, indent):
    text = json.dumps(data, indent=indent, ensure_ascii=False)
    ours, theirs = read_json(text, "f"), read_yaml(text, "f")
    assert ours.data == theirs.data == data
    assert ours.lines == theirs.lines


def test_lines_in_a_file_indented_by_tabs():
    lines = read_json('\n{\n\t"a": {\n\t\t"b":\n\t\t\t[{"c": 1}, {"c": 2}],\n\t\t"d\\u0065": 1}}\n', "f").lines
    assert lines == {(): 2, ("a",): 3, ("a", "b"): 4, ("a", "de"): 6}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"a": 1,\n "b": }', "line 2, column 7: this is not valid JSON: Expecting value."),
        ('{"a": 1}\n{"b": 2}', "line 2, column 1: this is not valid JSON: Extra data."),
        ('{"a": 1\n "b": 2}', "line 2, column 2: this is not valid JSON: Expecting ',' delimiter."),
        ('{"a": {"b": 1,\n\n "b": 2}}', "line 3, a.b: 'b' is already there on line 1, and each key"),
        ("[" * 100_000, "line 1: lists and objects are nested too deep."),
    ],
)
def test_what_is_no_model_text(text, message):
    with pytest.raises(mv.ModelError) as caught:
        read_json(text, "model.json")
    assert str(caught.value).startswith(f"model.json, {message}")


def test_empty_text_and_long_numbers():
    assert read_json(" \n", "f").data is None
    assert read_json('{"a": ' + "1" * 5000 + "}", "f").data == {"a": float("inf")}
