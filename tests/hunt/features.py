"""What a scene can have, what goes together, and which features a seed asks for."""

from itertools import combinations, product

import numpy as np

KINDS = ("revolute", "prismatic", "cylindrical", "screw", "universal", "spherical", "planar", "fixed", "free", "custom",
         "point_on_line", "point_on_plane", "distance", "homokinetic")  # fmt: skip
TREE = tuple(f"{kind} in tree" for kind in KINDS)
LOOP = tuple(f"{kind} in loop" for kind in KINDS)
REDUNDANT = ("coaxial hinges", "parallel rails", "hinge and ball on one axis", "planar four-bar")
COUPLERS = ("coupler", "gear", "worm", "rack")
ELASTIC = ("bushing 6x6", "line spring", "negative stiffness", "damper alone", "maxwell", "maxwell with static spring")
DAMPING = ("no damping", "proportional damping", "strong damping")
MASSLESS = ("massless node", "massless damped node", "point mass")
SPIN = ("rotor on body", "spinning body", "rotating damper")
BEAMS = ("beam", "timoshenko beam", "beam between bodies", "beam on ground", "rayleigh damping", "modal damping")
SUPERELEMENTS = ("superelement", "grounded superelement")
LOADS = ("gravity", "dead force", "dead torque", "follower force", "follower torque", "bushing preload", "line preload",
         "free length")  # fmt: skip
HOLDS = ("held by bushings", "held by loads", "equilibrium pose", "equilibrium preloads")
BASE = ("base translation", "base rotation")
SIGNALS = ("reaction of input", "velocity", "acceleration", "relative output", "against moving ground")
FORCES = ("joint force", "cut joint force", "spring force", "bushing force", "beam force", "maxwell force",
          "sum on body", "sum on ground")  # fmt: skip
GLOBAL = ("floating", "locked", "far from origin")
LOADING = (*LOADS, "preloaded torsion spring")
# Features that some scenes have besides those that their seed asks for, so that the plans of seeds stay as they are.
BESIDES = ("inerter", "inerter force", "torsion spring", "preloaded torsion spring", "torsion spring moment",
           "beam strain", "cross-coupled bushing", "flexure", "dynamic bushing", "dynamic bushing force",
           "dynamic spring", "dynamic torsion spring", "dynamic spring force")  # fmt: skip
PAIRED = (*TREE, *LOOP, *REDUNDANT, *COUPLERS, *ELASTIC, *DAMPING, *MASSLESS, *SPIN, *BEAMS, *SUPERELEMENTS, *LOADS,
          *HOLDS, *BASE, *SIGNALS, *FORCES, *GLOBAL)  # fmt: skip
ALL = (*PAIRED, *BESIDES)

# what one feature needs besides
NEEDS = {
    "beam force": "beam", "maxwell force": "maxwell", "spring force": "line spring", "rayleigh damping": "beam",
    "modal damping": "beam", "against moving ground": "base translation", "line preload": "line spring",
    "free length": "line spring", "inerter force": "inerter", "preloaded torsion spring": "torsion spring",
    "torsion spring moment": "torsion spring", "beam strain": "beam", "dynamic bushing force": "dynamic bushing",
    "dynamic spring force": "dynamic spring",
}  # fmt: skip


def _excluded():
    """Pairs that no scene can have, or that mbsvib refuses by name on principle."""
    loaded = (*LOADS, *HOLDS)
    yield from product(SUPERELEMENTS, loaded)
    yield from product(["base rotation"], ("gravity", "dead force", "dead torque", "held by loads", "equilibrium pose",
                                           *SPIN))  # fmt: skip
    yield from combinations(HOLDS, 2)
    yield from combinations(DAMPING, 2)
    yield from product(["equilibrium pose"], (*BEAMS, "beam force", "spinning body", "rotating damper"))
    yield from product(["locked"], (*TREE, *LOOP, *REDUNDANT, *COUPLERS, *MASSLESS, *SPIN, *BEAMS, *SUPERELEMENTS,
                                    *HOLDS, "floating", "beam force", "cut joint force", "sum on body"))  # fmt: skip
    yield from product(["floating"], ("beam on ground", "grounded superelement"))
    yield from product(["no damping"], ("damper alone", "massless damped node", "rotating damper", "rayleigh damping",
                                        "modal damping", "maxwell", "maxwell with static spring",
                                        "maxwell force"))  # fmt: skip
    yield from combinations(("beam between bodies", "beam on ground"), 2)
    yield from combinations(SUPERELEMENTS, 2)
    yield from product(["held by loads"], ["base rotation"])
    # each of these brings bodies of its own; more than two of them make scenes long to look at
    yield from combinations(("planar four-bar", "rotating damper"), 2)


EXCLUDED = frozenset(frozenset(pair) for pair in _excluded())
EXCLUDED -= {frozenset(("locked", "fixed in tree"))}
PAIRS = tuple(pair for pair in combinations(PAIRED, 2) if frozenset(pair) not in EXCLUDED and not any(
    frozenset((NEEDS.get(one, one), other)) in EXCLUDED for one, other in (pair, pair[::-1])))  # fmt: skip
# Each seed asks for so many pairs; consecutive ones are far from each other.
PAIRS_EACH, STRIDE = 2, 1009
# What sparse equations, or modes of them, refuse, and what batches refuse besides. Some scenes are without, beyond the
# pair that their seed asks for, so that these engines see all else often enough.
NOT_SPARSE = frozenset((*MASSLESS, *SPIN, "maxwell", "maxwell with static spring", "maxwell force", "dead torque",
                        "follower force", "follower torque"))  # fmt: skip
NOT_BATCH = NOT_SPARSE | {*BEAMS, *SUPERELEMENTS, "beam force", "joint force", "cut joint force", "sum on body",
                          "sum on ground"}  # fmt: skip
FOR_SPARSE, FOR_BATCH = 0.25, 0.3
OFTEN_BESIDES = 0.1


def with_needs(feature):
    """A feature, what it needs, what that needs, and so on."""
    wanted = [feature]
    while wanted[-1] in NEEDS:
        wanted.append(NEEDS[wanted[-1]])
    return wanted


def fits(feature, selected):
    return all(frozenset((feature, other)) not in EXCLUDED for other in selected)


def plan(seed):
    """The features that a seed asks for: pairs that depend on the seed, what they need, and others at random."""
    selected, avoided = [], frozenset()

    def take(feature):
        wanted = with_needs(feature)
        if all(fits(item, selected) and item not in avoided for item in wanted):
            selected.extend(item for item in wanted if item not in selected)

    for i in range(PAIRS_EACH):
        for feature in PAIRS[(PAIRS_EACH * seed + i) * STRIDE % len(PAIRS)]:
            take(feature)
    rng = np.random.default_rng((seed, 1))
    share = rng.random()
    avoided = NOT_BATCH if share < FOR_BATCH else NOT_SPARSE if share < FOR_BATCH + FOR_SPARSE else avoided
    for group, most in ((LOOP, 1.5), (REDUNDANT, 0.35), (COUPLERS, 0.5), (ELASTIC, 1.2), (DAMPING, 0.9),
                        (MASSLESS, 0.3), (SPIN, 0.35), (BEAMS, 0.5), (SUPERELEMENTS, 0.15), (LOADS, 1.5),
                        (BASE, 0.6), (SIGNALS, 2.0), (FORCES, 2.0), (GLOBAL, 0.25), (TREE, 1.0)):  # fmt: skip
        for _ in range(rng.poisson(most)):
            take(group[rng.integers(len(group))])
    loaded, held = (any(name in selected for name in names) for names in (LOADS, HOLDS))
    if loaded and "locked" not in selected and not held:
        for hold in rng.permutation(HOLDS):
            if fits(hold, selected):
                take(str(hold))
                break
    if any(hold in selected for hold in HOLDS) and not any(load in selected for load in LOADS):
        take("line preload" if "base rotation" in selected else "gravity")
    return frozenset((*selected, *_besides(seed, selected)))


def _besides(seed, selected):
    """Features besides those of a plan that go with it."""
    rng = np.random.default_rng((seed, 4))
    for feature in BESIDES:
        fits_in = "locked" not in selected and ("beam" in selected or feature != "beam strain") and (
            any(hold in selected for hold in HOLDS) or feature != "preloaded torsion spring") and (
            "equilibrium pose" not in selected or feature != "flexure") and (
            "no damping" not in selected or not feature.startswith("dynamic"))  # fmt: skip
        if rng.random() < OFTEN_BESIDES and fits_in:
            yield from with_needs(feature)
