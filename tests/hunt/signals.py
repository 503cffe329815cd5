"""Inputs and outputs of random scenes."""

import numpy as np

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


def signals(draft):
    """Two forces and some motions and forces, those that the features ask for among them."""
    features = draft.features
    for i in range(2):
        draft.add("input", "in", **_port(draft, relative="reaction of input" in features and i == 0))
    for feature in ("base translation", "base rotation"):
        if feature in features:
            vector = draft.rng.normal(size=6)
            vector[: 3 if "rotation" in feature and draft.chance(0.5) else 0] = 0.0
            direction = vector if "rotation" in feature else draft.pick(("x", "z", vector[:3]))
            draft.add("base_motion", "base", direction=direction, position=draft.near("ground", 0.5))
    quantities = ["displacement", "displacement", draft.pick(("velocity", "acceleration"))]
    quantities += [name for name in ("velocity", "acceleration") if name in features]
    for i, quantity in enumerate(quantities):
        draft.add("output", "out", quantity=quantity, **_port(draft, relative="relative output" in features and i != 1))
    if "against moving ground" in features:
        draft.add("output", "out", quantity="acceleration", absolute=False, **_port(draft))
    forces(draft)
    strains(draft)


def _port(draft, relative=False):
    """Body, direction, point, and with ``relative`` a second body."""
    rng = draft.rng
    nodes = {**{name: draft.points[name] for name in draft.points if name != "ground"}, **draft.nodes}
    body = draft.pick(nodes)
    others = [name for name in nodes if name != body]
    return {
        "body": body, "direction": draft.pick((draft.pick(DIRECTIONS), rng.normal(size=3), rng.normal(size=6))),
        "position": nodes[body] + rng.uniform(-0.3, 0.3, 3) if draft.chance(0.6) else None,
        "relative_to": draft.pick(others) if relative and others else None,
    }  # fmt: skip


def forces(draft):
    """Forces in joints, springs and beams, and sums."""
    kinds = {call.name: call for call in draft.calls}
    tree = [name for name in draft.joints if name not in draft.loops]
    wanted = {
        "joint force": tree, "cut joint force": draft.loops or list(draft.joints)[-1:],
        "spring force": [name for name, call in kinds.items() if call.kind == "spring"],
        "bushing force": [name for name, call in kinds.items() if call.kind == "bushing"],
        "maxwell force": [name for name, call in kinds.items() if call.kind == "maxwell"],
        "beam force": [f"{name}.e1" for name, call in kinds.items() if call.kind == "beam"],
        "sum on body": draft.heavy, "sum on ground": ["ground"],
    }  # fmt: skip
    wanted |= {
        "inerter force": [name for name, call in kinds.items() if call.kind == "inerter"],
        "torsion spring moment": [name for name, call in kinds.items() if call.kind == "torsion_spring"],
        "dynamic bushing force": [name for name, call in kinds.items() if "dynamic" in call.arguments
                                  and call.kind == "bushing"],
        "dynamic spring force": [name for name, call in kinds.items() if "dynamic" in call.arguments
                                 and call.kind != "bushing"],
    }
    for feature, elements in wanted.items():
        if feature not in draft.features or not elements:
            continue
        element = draft.pick(elements)
        draft.add("force_output", "force", element=element, direction=_direction(draft, kinds.get(element)))


def strains(draft):
    """The strain of an element of a beam; of a section by its properties at a distance from the centre line."""
    beams = [call for call in draft.calls if call.kind == "beam"]
    if "beam strain" in draft.features and beams:
        call = draft.pick(beams)
        asked = "A" in call.arguments["section"] or draft.chance(0.3)
        distance = float(draft.rng.uniform(0.01, 0.05)) if asked else None
        draft.add("strain_output", "strain", element=f"{call.name}.e1", at=draft.pick(("start", "middle", "end")),
                  side=draft.pick(("y", "-y", "z", "-z")), distance=distance)  # fmt: skip


def _direction(draft, call):
    """Any direction but where only that along the axis is meant by the scene."""
    if call is not None and call.kind in ("spring", "maxwell", "inerter"):
        return "z"
    if call is not None and call.kind == "torsion_spring":
        return "rz"
    if call is not None and call.kind == "joint" and call.arguments.get("kind") == "distance":
        return "z"
    if call is not None and call.kind == "joint" and "axis" in call.arguments and "axis2" not in call.arguments:
        return draft.pick(("z", "rz"))
    return draft.pick(
        (draft.pick(DIRECTIONS), draft.rng.normal(size=6), np.array([*draft.rng.normal(size=3), 0, 0, 0]))
    )
