"""Models of every kind of part, drawn at random, with awkward names and floats of any size."""

import numpy as np
from hypothesis import strategies as st

import mbsvib as mv
from mbsvib.elements.joint_kinds import KINDS
from mbsvib.files.words import SECTIONS
from mbsvib.mechanism.mechanism import GROUND

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
AWKWARD = (
    "yes", "No", "null", "~", "1", "1e6", ".inf", "0x1F", "-", "- a", "a: b", "a #b", "#", "'", '"', "\\", "<<", "*a",
    "&a", "!a", "%a", "@", "[x]", "{x}", "a,b", "?", "a  b", "leg 1", "hip1.rx", "é", "質量", "x/y", "mbsvib",
    "...", "---",
)  # fmt: skip

any_float = st.floats(-1e30, 1e30, allow_subnormal=True)
positive = st.floats(1e-30, 1e30)
names = st.sampled_from(AWKWARD) | st.text(
    st.characters(categories=("L", "N", "P", "S"), include_characters=" "), min_size=1, max_size=12
).map(str.strip).filter(lambda text: text and text != GROUND and text.isprintable())
vectors = st.tuples(any_float, any_float, any_float)
axes = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: max(map(abs, v)) > 1e-3)
rotation_vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
directions = st.sampled_from(DIRECTIONS) | axes | st.tuples(*[any_float] * 6).filter(any)
quantities = st.sampled_from(("displacement", "velocity", "acceleration"))


def sections(model):
    """Everything that a model file must bring back, order included."""
    return {section: list(getattr(model, section).items()) for section in SECTIONS}


@st.composite
def inertias(draw):
    # principal moments that a body can have, and the tensor in turned axes
    a, b, c = (draw(st.floats(0.1, 3.0)) for _ in range(3))
    principal = (b + c, a + c, a + b)
    if draw(st.booleans()):
        return principal
    q, _ = np.linalg.qr(np.array(draw(st.tuples(*[axes] * 3))) + 2.0 * np.eye(3))
    tensor = q @ np.diag(principal) @ q.T
    return 0.5 * (tensor + tensor.T)


@st.composite
def coefficients(draw):
    if draw(st.booleans()):
        return draw(st.tuples(*[positive] * 6))
    matrix = np.array(draw(st.lists(st.tuples(*[any_float] * 6), min_size=6, max_size=6)))
    return 0.5 * (matrix + matrix.T) + np.eye(6)


@st.composite
def joint_words(draw):
    kind = draw(st.sampled_from([*KINDS, None]))
    words = {"kind": kind}
    if kind not in ("prismatic", "fixed") or draw(st.booleans()):
        words["position"] = draw(vectors)
    if kind is None:
        words["free"] = draw(st.lists(st.sampled_from(DIRECTIONS), unique=True))
    if kind == "screw":
        words["pitch"] = draw(any_float)
    if kind == "distance":
        x, y, z = words["position"]
        words["end"] = (x, y, 2.0 * z + 1.0)
        return words
    if kind == "universal" and draw(st.booleans()):
        x, y, z = words["axis"] = draw(axes)
        words["axis2"] = (y - z + 1.0, -x, x - 1.0) if abs(x) < 0.5 else (-y, x, z)
    else:
        turned = draw(st.sampled_from(["axis", "orientation", None]))
        if turned == "orientation" or (turned == "axis" and kind == "universal"):
            words["orientation"] = draw(rotation_vectors)
        elif turned == "axis":
            words["axis"] = draw(axes)
    return words


@st.composite
def models(draw):
    model = mv.Model(draw(names), gravity=draw(vectors) if draw(st.booleans()) else None)
    taken = iter(draw(st.lists(names, min_size=16, max_size=16, unique=True)))
    for _ in range(3):
        words = {"position": draw(vectors)} if draw(st.booleans()) else {}
        if draw(st.booleans()):
            words["orientation"] = draw(rotation_vectors)
        model.add_body(next(taken), draw(positive), draw(inertias()), **words)
    bodies = [*model.bodies, GROUND]
    pairs = st.lists(st.sampled_from(bodies), min_size=2, max_size=2, unique=True)
    for _ in range(draw(st.integers(0, 3))):
        first, second = draw(pairs)
        model.add_joint(next(taken), first=first, second=second, **draw(joint_words()))
    for _ in range(draw(st.integers(0, 4))):
        if draw(st.booleans()):
            turn = {"orientation": draw(rotation_vectors)} if draw(st.booleans()) else {}
            arguments = {draw(st.sampled_from(["stiffness", "damping"])): draw(coefficients())}
            arguments |= {"preload": draw(st.tuples(*[any_float] * 6))} if draw(st.booleans()) else {}
            model.add_bushing(next(taken), *draw(pairs), draw(vectors), **turn, **arguments)
        else:
            ends = {"start": draw(vectors), "end": draw(vectors)}
            if np.linalg.norm(np.subtract(*ends.values())) > 0.0:
                if draw(st.booleans()):
                    values = {"stiffness": draw(positive), "damping": draw(any_float)}
                    force = draw(st.sampled_from(["none", "preload", "free_length"]))
                    values |= {} if force == "none" else {force: draw(positive)}
                    model.add_spring(next(taken), *draw(pairs), **ends, **values)
                else:
                    values = {"stiffness": draw(positive), "damping": draw(positive)}
                    model.add_maxwell(next(taken), *draw(pairs), **ends, **values, static_stiffness=draw(any_float))
    for _ in range(draw(st.integers(0, 2))):
        words = {"position": draw(vectors)} if draw(st.booleans()) else {}
        model.add_load(next(taken), draw(st.sampled_from(list(model.bodies))), draw(axes), draw(vectors), **words,
                       follower=draw(st.booleans()))  # fmt: skip
    _add_ports(draw, model, pairs)
    return model


def _add_ports(draw, model, pairs):
    for name in draw(st.lists(names, max_size=4, unique=True)):
        if draw(st.booleans()):
            model.add_base_motion(name, draw(directions), draw(vectors))
        else:
            body, other = draw(pairs)
            model.add_input(name, body, draw(directions), draw(st.none() | vectors), relative_to=other)
    for name in draw(st.lists(names, max_size=4, unique=True)):
        if model.springs and draw(st.booleans()):
            model.add_force_output(name, draw(st.sampled_from([*model.springs])), "z")
        else:
            body, other = draw(pairs)
            absolute = draw(st.sampled_from([None, False]))
            words = {"quantity": draw(quantities), "absolute": absolute}
            model.add_output(name, body, draw(directions), draw(st.none() | vectors), other, **words)
