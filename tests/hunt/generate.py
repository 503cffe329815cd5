"""Random scenes over all features at once; the seed decides which of them a scene has."""

from dataclasses import dataclass

import numpy as np

from tests.hunt import elements, forces, mechanisms, signals
from tests.hunt.draft import Draft
from tests.hunt.features import plan
from tests.hunt.reference import Reference
from tests.hunt.scene import Scene

# Scenes whose constraints are this near to losing or gaining rank are left out, and made again with other numbers.
CLEAR = 1e-4
LEAST_NOISE = 1e-11
MOST_COORDINATES = 45
ATTEMPTS = 12


@dataclass(frozen=True)
class Example:
    """A scene and the answers of the absolute equations; ``error`` is that of a failed search for its balance."""

    scene: Scene
    reference: Reference
    error: Exception | None = None


def draft_of(seed, attempt, features=None):
    """A scene as its seed says, before it is balanced; with some features, or those that the seed asks for."""
    draft = Draft(np.random.default_rng((seed, 2, attempt)), plan(seed) if features is None else features)
    mechanisms.tree(draft)
    mechanisms.redundant(draft)
    mechanisms.couplers(draft)
    elements.massless(draft)
    elements.rotors(draft)
    elements.beams(draft)
    elements.flexures(draft)
    elements.superelements(draft)
    elements.springs(draft)
    elements.besides(draft)
    forces.loads(draft)
    signals.signals(draft)
    return draft


def example(seed, features=None):
    """The scene of a seed, with some features or those that it asks for; poses that are nearly singular are none."""
    for attempt in range(ATTEMPTS):
        draft = draft_of(seed, attempt, features)
        scene = Scene(seed, tuple(draft.calls), draft.gravity, draft.features)
        scene, error = forces.balanced(scene, np.random.default_rng((seed, 3)), draft.spinning)
        reference = Reference(scene)
        if is_clear(reference) or error is not None:
            return Example(scene, reference, error)
    return None


def is_clear(reference):
    """Whether the rank of the constraints is beyond doubt, the scene in balance and small."""
    e = reference.equations
    return e.retained > CLEAR and e.dropped < LEAST_NOISE and reference.balanced and e.dof <= MOST_COORDINATES
