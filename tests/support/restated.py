"""The same loaded mechanism said in another way: turned, shifted, with its parts in another order and renamed."""

import numpy as np

import mbsvib as mv
from mbsvib.api.model import ADDERS

AS_IS = np.eye(3)
POINTS, VECTORS, BODIES = ("position", "start", "end"), ("force", "torque"), ("body", "first", "second", "relative_to")


def restated(model, by=AS_IS, shift=(0.0, 0.0, 0.0), order=None, rename=str):
    """The model turned about the origin and then shifted; ``order`` seeds a permutation of its parts. Outputs keep
    their names; inputs push in the same direction of the mechanism.
    """
    gravity = None if model.gravity is None else by @ np.array(model.gravity)
    result = mv.Model(model.name, gravity=gravity)
    rng = np.random.default_rng(order)
    for group in model.groups().values():
        parts = list(group.values())
        for k in range(len(parts)) if order is None else rng.permutation(len(parts)):
            adder = ADDERS[type(parts[k])]
            words = _turned(adder, parts[k], by, shift)
            for key in BODIES:
                if words.get(key, "ground") != "ground":
                    words[key] = rename(words[key])
            if adder == "add_force_output" and words["element"] != "ground":
                words["element"] = rename(words["element"])
            if adder == "add_coupler":
                words["coefficients"] = {rename(name): value for name, value in dict(words["coefficients"]).items()}
            if adder not in ("add_input", "add_output", "add_force_output"):
                words["name"] = rename(words["name"])
            getattr(result, adder)(**words)
    return result


def _turned(adder, part, by, shift):
    words = dict(part.constructor_kwargs())
    if adder == "add_body":
        words.setdefault("position", (0.0, 0.0, 0.0))
    for key in POINTS:
        if words.get(key) is not None:
            words[key] = by @ np.array(words[key]) + shift
    for key in VECTORS:
        if key in words:
            words[key] = by @ np.array(words[key])
    if adder in ("add_body", "add_bushing"):
        words["orientation"] = by @ np.array(part.orientation)
    elif adder == "add_joint" and part.axis2 is not None:
        words["axis"], words["axis2"] = by @ np.array(part.axis), by @ np.array(part.axis2)
    elif adder == "add_joint" and part.kind != "distance":
        words.pop("axis", None)  # an axis leaves the frame about it open
        words["orientation"] = by @ np.array(part.axes)
    elif adder == "add_input":
        words["direction"] = np.concatenate([by @ part.wrench[:3], by @ part.wrench[3:]])
    return words
