"""Scalars mean what YAML 1.2 says, and syntax errors are told with line and column."""

import math

import pytest

import mbsvib as mv
from mbsvib.files.reading import MAX_DEPTH, read_yaml


def value(text):
    return read_yaml(f"a: {text}\n", "model.yaml").data["a"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1e6", 1e6), ("2.5e-3", 2.5e-3), ("1E+3", 1000.0), (".5", 0.5), ("5.", 5.0), ("-0.0", -0.0), ("+1.5", 1.5),
        ("12", 12), ("012", 12), ("0o17", 15), ("0x1F", 31), ("12345678901234567890", 12345678901234567890.0),
        (".inf", math.inf), ("-.INF", -math.inf), ("true", True), ("False", False), ("null", None),
        ("~", None), ("", None),
    ],
)  # fmt: skip
def test_numbers_and_constants(text, expected):
    given = value(text)
    assert given == expected
    assert type(given) is type(expected)
    assert str(given) == str(expected)


@pytest.mark.parametrize(
    "text",
    ["yes", "no", "on", "off", "y", "N", "nan", "inf", "1_000", "1:30", "2024-01-01", "1e", "e5", "-x", "+", ".", "0x",
     "1.2.3", "=", "tRUE", "1,5"],
)  # fmt: skip
def test_text_without_quotes(text):
    assert value(text) == text


@pytest.mark.parametrize(("text", "expected"), [("'1'", "1"), ('"1e6"', "1e6"), ("'true'", "true"), ('"\\u00e9"', "é")])
def test_text_in_quotes(text, expected):
    assert value(text) == expected


def test_not_a_number():
    assert math.isnan(value(".nan"))


def test_lines_of_keys():
    text = "# c\na:\n  b:\n    c: [1,\n      2]\n    'd e': {f: 1,\n     g: 2}\nh: |\n  x\ni: 1\n"
    assert read_yaml(text, "f").lines == {
        (): 2, ("a",): 2, ("a", "b"): 3, ("a", "b", "c"): 4, ("a", "b", "d e"): 6, ("a", "b", "d e", "f"): 6,
        ("a", "b", "d e", "g"): 7, ("h",): 8, ("i",): 10,
    }  # fmt: skip


def test_merge_key_in_quotes_is_a_name():
    assert read_yaml("'<<': 1\n", "f").data == {"<<": 1}


def test_json_with_tabs_is_yaml_too():
    document = read_yaml('{\n\t"a": 1,\n\t"b": [1,\t2]\n}\n', "f")
    assert document.data == {"a": 1, "b": [1, 2]}
    assert document.lines[("b",)] == 3


@pytest.mark.few(4)
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1, 2\nb: 3\n", "line 2, column 2: this is not valid YAML: expected ',' or ']', but got ':', "
                             "while parsing a flow sequence that starts on line 1."),
        ("a:\n\t- 1\n", "line 2, column 1: this is not valid YAML: found character '\\t' that cannot start any token, "
                        "while scanning for the next token; indent with blanks, YAML takes no tabs."),
        ("a: 1\nb: c: d\n", "line 2, column 5: this is not valid YAML: mapping values are not allowed here."),
        ("a: 1\nb: 'x\n", "line 3, column 1: this is not valid YAML: found unexpected end of stream, "
                          "while scanning a quoted scalar that starts on line 2."),
        ("a: 1\nb: \x01\n", "line 2, column 4: the character '\\x01' is not allowed in YAML."),
        ("a: 1\nb: *q\n", "line 2, b: the alias *q stands for nothing; there is no &q that is complete above it."),
        ("a: &x [*x]\n", "line 1: the alias *x stands for nothing; there is no &x that is complete above it."),
        ("a: !!float 3\n", "line 1, a: the tag tag:yaml.org,2002:float has no meaning in a model file; leave it out."),
        ("a:\n  <<: 3\n", "line 2, a: << takes the alias of a mapping, or a list of such aliases."),
        ("a:\n  <<: {}\n  <<: {}\n", "line 3, a.<<: '<<' is already there on line 2, and each key can be there "
                                     "only once; rename or remove one."),
        ("a: [{b: 1, b: 2}]\n", "line 1, b: 'b' is already there on line 1, and each key can be there only once; "
                                "rename or remove one."),
        ("a: " + "[" * 999 + "\n", f"line 1: lists and mappings are nested more than {MAX_DEPTH} deep."),
        ("a: &x &y 1\n", "line 1, column 7: this is not valid YAML: expected <block end>, but found '<anchor>', "
                         "while parsing a block mapping."),
    ],
)  # fmt: skip
def test_what_is_no_model_text(text, message):
    with pytest.raises(mv.ModelError) as caught:
        read_yaml(text, "model.yaml")
    assert str(caught.value) == f"model.yaml, {message}"
