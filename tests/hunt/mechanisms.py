"""Bodies, joints and couplers of random scenes: trees, loops, loops that are redundant, and what couples joints."""

import numpy as np

from tests.hunt.features import KINDS
from tests.hunt.joints import MORE_FREE
from tests.support.exact import FREE
from tests.support.random_models import rotation

LOOSE = ("spherical", "planar", "cylindrical", "point_on_plane", "free", "point_on_line")
FREEDOM = {kind: len((FREE | MORE_FREE)[kind]) for kind in KINDS if kind != "custom"} | {"custom": 3}


def tree(draft):
    """Bodies that hang on earlier ones or on ground, by joints of the kinds that are asked for and others."""
    rng, features = draft.rng, draft.features
    if "far from origin" in features:
        draft.points["ground"] = 30.0 * rng.normal(size=3)
    asked = [kind for kind in KINDS if f"{kind} in tree" in features]
    loops = [kind for kind in KINDS if f"{kind} in loop" in features]
    count = max(len(asked), int(rng.integers(1 + bool(loops), 4)))
    if "locked" in features:
        asked, count = ["fixed"] * count, max(1, count - 1)
    kinds = asked + [str(rng.choice(KINDS)) for _ in range(count - len(asked))]
    if loops:  # enough freedom for what the loops lock
        missing = sum(6 - FREEDOM[kind] for kind in loops) + 1 - sum(FREEDOM[kind] for kind in kinds)
        for i in range(len(asked), count):
            if missing > 0:
                other = str(rng.choice(LOOSE))
                missing -= FREEDOM[other] - FREEDOM[kinds[i]]
                kinds[i] = other
        kinds += [str(rng.choice(LOOSE)) for _ in range(min(2, max(0, -(-missing // 4))))]
    floating = "floating" in features
    for kind in map(str, rng.permutation(kinds)):
        earlier = draft.anchors
        name = draft.body()
        if floating and not draft.joints and len(draft.points) == 2:
            draft.body()
            earlier, name = ["b0"], "b1"
        pair = (draft.pick(earlier), name)
        draft.joint(kind, *(pair if draft.chance(0.6) else pair[::-1]))
    for kind in loops:
        first, second = draft.pair()
        if "ground" in (first, second) and floating:
            second = draft.body()
        name = draft.joint(kind, first, second, free=("x", "ry", "rz") if kind == "custom" else None)
        draft.loops.append(name)


def redundant(draft):
    """Second joints between bodies that one holds already, on the same axis or parallel; a planar four-bar."""
    for feature in ("coaxial hinges", "parallel rails", "hinge and ball on one axis"):
        if feature not in draft.features:
            continue
        base, name = draft.pick(draft.anchors or ["ground"]), draft.body()
        axes = rotation(draft.rng)
        at = draft.near(name)
        kind = "prismatic" if feature == "parallel rails" else "revolute"
        other = {"coaxial hinges": draft.pick(("revolute", "cylindrical")), "parallel rails": "prismatic",
                 "hinge and ball on one axis": "spherical"}[feature]  # fmt: skip
        draft.joint(kind, base, name, at, axes)
        pair = draft.pick(((base, name), (name, base)))
        again = draft.joint(other, *pair, at + draft.rng.uniform(0.2, 0.8) * axes[:, 2],
                            axes if draft.chance(0.5) else axes * np.array([-1, 1, -1]))  # fmt: skip
        draft.loops.append(again)
    if "planar four-bar" in draft.features:
        four_bar(draft)


def four_bar(draft):
    """Four parallel hinges in a plane that lies anywhere."""
    axes, rng = rotation(draft.rng), draft.rng
    base = draft.pick(draft.anchors or draft.bodies)
    corner = [draft.near(base, 0.2) + axes @ (np.array(p) + 0.2 * rng.uniform(-1, 1, 3) * [1, 1, 0])
              for p in ((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0))]  # fmt: skip
    corner = [corner[0] + axes[:, :2] @ (axes[:, :2].T @ (p - corner[0])) for p in corner]
    bars = [draft.body(at=0.5 * (corner[i] + corner[i + 1]) + 0.1 * axes @ rng.normal(size=3)) for i in range(3)]
    chain = [base, *bars, base]
    for i, at in enumerate(corner):
        draft.joint("revolute", chain[i], chain[i + 1], at, axes)
    draft.loops.append(list(draft.joints)[-1])


def couplers(draft):
    """Linear relations between coordinates of joints that have them; none of rods."""
    rng = draft.rng
    for feature in ("coupler", "gear", "worm", "rack"):
        if feature not in draft.features:
            continue
        known = [f"{joint}.{d}" for joint, (kind, free) in draft.joints.items() if kind != "distance" for d in free]
        turns = [name for name in known if name[-2] == "r"]
        slides = [name for name in known if name[-2] != "r"]
        while len(turns) < 2 or len(slides) < 1 or len(known) < 4:
            name = draft.joint("cylindrical", draft.pick(draft.anchors), draft.body())
            known += [f"{name}.z", f"{name}.rz"]
            slides, turns = [*slides, f"{name}.z"], [*turns, f"{name}.rz"]
        if feature == "coupler":
            selected = rng.choice(known, int(rng.integers(2, 4)), replace=False)
            values = rng.normal(size=len(selected)).tolist()
            draft.add("coupler", "coupler", coefficients=dict(zip(map(str, selected), values, strict=True)))
        elif feature == "rack":
            draft.add("rack", "rack", pinion=draft.pick(turns), rack=draft.pick(slides),
                      radius=float(rng.choice([-1, 1]) * rng.uniform(0.05, 0.3)))  # fmt: skip
        else:
            first, second = (str(name) for name in rng.choice(turns, 2, replace=False))
            ends = {"gear": ("first", "second"), "worm": ("worm", "wheel")}[feature]
            ratio = float(rng.choice([-1, 1]) * (rng.uniform(0.3, 3) if feature == "gear" else 0.05))
            draft.add(feature, feature, **dict(zip(ends, (first, second), strict=True)), ratio=ratio)
