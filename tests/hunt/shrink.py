"""Smaller scenes on which a comparison still fails: elements are taken away as long as the same failure stays."""

import numpy as np

from tests.hunt import forces
from tests.hunt.checks import CHECKS, Subject
from tests.hunt.generate import Example, example, is_clear
from tests.hunt.reference import Reference
from tests.hunt.run import outcome_of

STEPS = {"linearize": lambda s: s.system, "answers": lambda s: s.answers} | CHECKS


def shrunk(failure, rounds=3):
    """The smallest scene that taking away one element after the other leads to, as a model file."""
    scene = example(failure.seed).scene
    for _ in range(rounds):
        before = len(scene.calls)
        for call in reversed(scene.calls):
            smaller = without(scene, call.name)
            if len(smaller.calls) < len(scene.calls) and fails(smaller, failure):
                scene = smaller
        if len(scene.calls) == before:
            break
    return scene


def without(scene, name):
    """The scene without an element and all that refers to it."""
    gone = {name}
    while more := {call.name for call in scene.calls if call.references & gone} - gone:
        gone |= more
    return scene.with_calls([call for call in scene.calls if call.name not in gone])


def fails(scene, failure):
    """Whether the same comparison fails in the same way; forces that held the scene are found anew."""
    if not scene.of("body", "beam", "superelement"):
        return False
    try:
        if scene.loaded and any(call.name.startswith("hold_") for call in scene.calls):
            spinning = {call.arguments["body"] for call in scene.of("rotor") if "inertia" not in call.arguments}
            scene = scene.with_calls([call for call in scene.calls if not call.name.startswith("hold_")])
            scene = forces.held(scene, np.random.default_rng(0), spinning)
        reference = Reference(scene)
    except Exception:  # what is left is no scene
        return False
    if not is_clear(reference):
        return False
    kind, error = outcome_of(STEPS[failure.check], Subject(Example(scene, reference)))
    if kind != "failed" or type(error).__name__ != failure.kind:
        return False
    return str(error)[:12] == failure.message[:12]
