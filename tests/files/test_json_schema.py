"""The schema says what the loader says: same words, same mandatory ones, same defaults, same choices."""

import json
import re
from inspect import Parameter

import jsonschema
import pytest
from hypothesis import given

import mbsvib as mv
from mbsvib.common.arguments import DIRECTIONS
from mbsvib.elements.joint_kinds import KINDS
from mbsvib.elements.ports import QUANTITIES
from mbsvib.files import load, save, schema
from mbsvib.files.reading import read_yaml
from mbsvib.files.words import ALL_SECTIONS, VERSION, head_words, mandatory, words
from mbsvib.library import models as library_models
from tests.files.models import models
from tests.files.test_saving import READABLE
from tests.support.sizes import examples

KINDS_OF_PARTS = [kind for kinds in ALL_SECTIONS.values() for kind in kinds]
VALID = jsonschema.Draft202012Validator(schema())


def listed(value):
    return list(value) if isinstance(value, tuple) else value


def content(text):
    return read_yaml(text, "text").data


def test_schema_is_one_of_draft_2020_12():
    jsonschema.Draft202012Validator.check_schema(schema())
    assert schema()["properties"]["mbsvib"]["const"] == VERSION


def test_top_level_keys_are_the_sections_and_the_words_of_model():
    top = schema()
    assert set(top["properties"]) == {*ALL_SECTIONS, *head_words(), "mbsvib", "$schema"}
    assert top["additionalProperties"] is False


@pytest.mark.parametrize("kind", KINDS_OF_PARTS)
def test_words_are_those_of_the_call(kind):
    part = schema()["$defs"][kind]
    shared = next(kinds for kinds in ALL_SECTIONS.values() if kind in kinds)
    typed = {"type"} if len(shared) > 1 else set()
    assert set(part["properties"]) == set(words(kind)) | typed
    assert part["additionalProperties"] is False
    needed = {word for word, item in words(kind).items() if mandatory(item)}
    assert set(part["required"]) == (needed if kind == shared[0] else needed | typed)
    for word, item in words(kind).items():
        has_default = item.default is not Parameter.empty
        assert ("default" in part["properties"][word]) == has_default
        if has_default:
            assert part["properties"][word]["default"] == listed(item.default)


def test_every_key_is_described():
    top = schema()
    groups = [top["properties"], *(top["$defs"][kind]["properties"] for kind in KINDS_OF_PARTS)]
    bare = {word for group in groups for word, item in group.items() if "description" not in item}
    assert bare == {"type"}  # where it can only be one word, the part that it names is described
    for word in ("mass", "inertia", "position"):
        assert re.search(r"\[(kg|kg m\^2|m)\]", top["$defs"]["body"]["properties"][word]["description"])


def test_choices_are_those_of_the_parts():
    parts = schema()["$defs"]
    assert parts["joint"]["properties"]["kind"]["enum"] == [*KINDS, "custom", None]
    assert parts["direction"]["anyOf"][0]["enum"] == [*DIRECTIONS]
    assert parts["output"]["properties"]["quantity"]["enum"] == [*QUANTITIES]
    for kinds in ALL_SECTIONS.values():
        if len(kinds) > 1:
            assert parts[kinds[0]]["properties"]["type"]["enum"] == [*kinds]
            assert [parts[kind]["properties"]["type"]["const"] for kind in kinds[1:]] == [*kinds[1:]]


@pytest.mark.parametrize(
    ("kind", "word", "good", "bad"),
    [
        ("body", "mass", 0, -1), ("body", "density", 1.0, 0), ("body", "inertia", [1, 2, 3], [1, 2]),
        ("body", "orientation", [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[1, 0, 0]]), ("beam", "elements", 1, 0),
        ("beam", "length", 1.0, 0), ("beam", "nodes", [[0, 0, 0], [1, 0, 0]], [[0, 0, 0]]), ("beam", "beta", 0, -1),
        ("beam", "material", {"E": 1, "rho": 1, "nu": 0.3}, {"E": 1, "rho": 1, "nu": 0.3, "G": 1}),
        ("flexure", "shape", {"type": "leaf", "length": 1}, {"type": "leaf", "length": 0}),
        ("superelement", "M", [[1] * 6] * 6, [[1]]), ("spring", "free_length", 0, -1), ("maxwell", "stiffness", 1, 0),
        ("bushing", "stiffness", [[0] * 6] * 6, [0] * 5), ("bushing", "stiffness", [0] * 6, [[0] * 6] * 5),
        ("spring", "dynamic", {"weights": [1], "times": [1]}, {"weights": [1]}), ("inerter", "inertance", 1, 0),
        ("rotor", "inertia", None, 0), ("rolling", "radius", 1, 0), ("joint", "free", ["x", "rz"], ["x", "x"]),
        ("coupler", "coefficients", {"a": 1, "b": 2}, {"a": 1}), ("coupler", "curvature", None, {}),
        ("strain_output", "distance", 0, -1), ("model", "mirror", None, "w"), ("belt", "first_radius", 1, 0),
        ("output", "absolute", None, 1), ("input", "relative_to", "ground", None),
        ("piezo_stack", "drive", "charge", ""),
    ],
)  # fmt: skip
def test_shapes_and_limits_are_those_of_the_docstrings(kind, word, good, bad):
    document = schema()
    admits = jsonschema.Draft202012Validator(document["$defs"][kind]["properties"][word] | {"$defs": document["$defs"]})
    assert admits.is_valid(good)
    assert not admits.is_valid(bad)


@pytest.mark.few(2)
@pytest.mark.parametrize("name", sorted(library_models()))
def test_library_models_are_valid(name, tmp_path):
    model = library_models()[name][0]()
    VALID.validate(json.loads(save(model, tmp_path / "model.json").read_text("utf-8")))
    VALID.validate(content(save(model, tmp_path / "model.yaml").read_text("utf-8")))


@pytest.mark.slow
@examples(15, slow=40)
@given(model=models())
def test_random_models_are_valid(tmp_path_factory, model):
    path = save(model, tmp_path_factory.mktemp("valid") / "model.json")
    VALID.validate(json.loads(path.read_text("utf-8")))


@pytest.mark.few(5)
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("bodies:", "bodeis:"), ("mass:", "mas:"), ("mass: 12.0", "mass: heavy"), ("mass: 12.0", "mass: -1"),
        ("inertia: [0.3, 0.3, 0.5]", "inertia: [0.3, 0.3]"), ("    inertia: [0.3, 0.3, 0.5]\n", ""),
        ("kind: universal", "kind: univrsal"), ("kind: universal", "kind: screw"), ("    first: ground\n", ""),
        ("type: bushing", "type: bushin"), ("    type: bushing\n", ""), ("    type: base_motion\n", ""),
        ("type: force_output", "type: output"), ("damping: 20.0", "damping: [20.0]"), ("free: [x, rz]", "free: [x, w]"),
        ("quantity: velocity", "quantity: speed"), ("absolute: false", "absolute: no"), ("mbsvib: 1", "mbsvib: 2"),
        ("direction: y", "direction: w"), ("  platform:\n", "  ground:\n"), ("name: leg test", "name: ''"),
    ],
)  # fmt: skip
def test_typos_are_refused_by_schema_and_loader_alike(tmp_path, old, new):
    assert old in READABLE
    path = tmp_path / "model.yaml"
    path.write_text(READABLE, encoding="utf-8")
    assert VALID.is_valid(content(READABLE))
    assert load(path).bodies
    wrong = READABLE.replace(old, new, 1)
    assert not VALID.is_valid(content(wrong))
    path.write_text(wrong, encoding="utf-8")
    with pytest.raises(mv.ModelError):
        load(path)
