"""Springs, dampers, massless bodies, rotors, beams and superelements of random scenes."""

from itertools import pairwise

import numpy as np

from tests.beams.reference import assembled, matrices
from tests.superelements.craig_bampton import on_ends
from tests.support.random_models import rotation


def springs(draft):
    """A bushing between most pairs that a joint of the tree joins, line springs, dampers and Maxwell elements."""
    rng, features = draft.rng, draft.features
    for call in [call for call in draft.calls if call.kind == "joint"]:
        ends = call.arguments["first"], call.arguments["second"]
        if draft.spinning & set(ends) or call.name in draft.loops or not draft.chance(0.85):
            continue
        bushing(draft, *ends, full="bushing 6x6" in features and draft.chance(0.6),
                negative="negative stiffness" in features and draft.chance(0.5))  # fmt: skip
    if not any(call.kind == "bushing" for call in draft.calls):
        bushing(draft, *draft.pair(), full="bushing 6x6" in features, negative="negative stiffness" in features)
    for _ in range(int(rng.integers(0, 2)) + ("line spring" in features)):
        first, second = draft.pair()
        stiffness = float(10 ** rng.uniform(3, 4.5))
        start = draft.near(first, 0.5) if first != "ground" else draft.near(second, 1.0)
        end = draft.near(second, 0.5) if second != "ground" else draft.near(first, 1.0)
        draft.add("spring", "line", first=first, second=second, start=start, end=end, stiffness=stiffness,
                  damping=draft.damping(stiffness))  # fmt: skip
    if "damper alone" in features:
        first, second = draft.pair()
        if draft.chance(0.5):
            draft.add("spring", "damper", first=first, second=second, start=draft.near(first), end=draft.near(second),
                      damping=float(10 ** rng.uniform(0, 2)))  # fmt: skip
        else:
            draft.add("bushing", "damper", first=first, second=second, position=draft.near(second),
                      damping=10 ** rng.uniform(-1, 1.5, size=6))  # fmt: skip
    maxwells = [feature for feature in ("maxwell", "maxwell with static spring") if feature in features]
    for feature in maxwells:
        first, second = draft.pair()
        k = float(10 ** rng.uniform(3, 4.5))
        draft.add("maxwell", "maxwell", first=first, second=second, start=draft.near(first, 0.5),
                  end=draft.near(second), stiffness=k, damping=k * float(10 ** rng.uniform(-3, -1)),
                  static_stiffness=k * float(rng.uniform(0.1, 1)) if "static" in feature else None)  # fmt: skip


def besides(draft):
    """An inerter between two bodies, a torsion spring, and a bushing whose matrices are not symmetric."""
    rng, features = draft.rng, draft.features
    if "inerter" in features:
        first, second = draft.pair()
        draft.add("inerter", "inerter", first=first, second=second, start=draft.near(first), end=draft.near(second),
                  inertance=float(10 ** rng.uniform(-0.5, 1)))  # fmt: skip
    if "torsion spring" in features:
        first, second = draft.pair()
        stiffness = float(10 ** rng.uniform(2, 3.5))
        loaded = "preloaded torsion spring" in features
        draft.add("torsion_spring", "torsion", first=first, second=second, axis=rng.normal(size=3), stiffness=stiffness,
                  damping=draft.damping(stiffness), preload=float(10 * rng.normal()) if loaded else None)  # fmt: skip
    if "cross-coupled bushing" in features:
        first, second = draft.pair()
        name = bushing(draft, first, second, full=True, prefix="seal")
        arguments = next(call for call in draft.calls if call.name == name).arguments
        cross = np.triu(rng.uniform(-0.5, 0.5, (6, 6)), 1)
        for word, share in (("stiffness", 1.0), ("damping", 1e-3)):
            if word == "stiffness" or "no damping" not in features:
                matrix = arguments["stiffness"]
                size = np.sqrt(np.outer(matrix.diagonal(), matrix.diagonal()))
                arguments[word] = share * (matrix + size * (cross - cross.T))
    if "dynamic bushing" in features:
        first, second = draft.pair()
        _rubber(draft, bushing(draft, first, second, full=draft.chance(0.5), prefix="rubber"))
    if "dynamic spring" in features:
        first, second = draft.pair()
        _rubber(draft, draft.add("spring", "strut", first=first, second=second, start=draft.near(first, 0.5),
                                 end=draft.near(second, 0.5), stiffness=float(10 ** rng.uniform(3, 4.5)),
                                 damping=draft.damping(1e3)))  # fmt: skip
    if "dynamic torsion spring" in features:
        first, second = draft.pair()
        _rubber(draft, draft.add("torsion_spring", "coil", first=first, second=second, axis=rng.normal(size=3),
                                 stiffness=float(10 ** rng.uniform(2, 3.5))))  # fmt: skip


def _rubber(draft, name):
    """Two relaxations and a damper that go with the stiffness of an element."""
    arguments = next(call for call in draft.calls if call.name == name).arguments
    arguments["dynamic"] = {"viscous": float(10 ** draft.rng.uniform(-4, -3)),
                            "weights": draft.rng.uniform(0.2, 1.0, 2), "times": 10 ** draft.rng.uniform(-2.5, -1, 2)}


def bushing(draft, first, second, full=False, negative=False, at=None, prefix="bush"):
    k = draft.stiffness(full, negative)
    at = draft.near(second if second != "ground" else first) if at is None else at
    return draft.add("bushing", prefix, first=first, second=second, position=at, stiffness=k, damping=draft.damping(k),
                     orientation=rotation(draft.rng) if draft.chance(0.7) else None)  # fmt: skip


def massless(draft):
    """Nodes without mass between two bodies, and points that have mass and no inertia."""
    rng = draft.rng
    for feature in ("massless node", "massless damped node"):
        if feature not in draft.features:
            continue
        first, second = draft.pick(draft.heavy), draft.pick(draft.anchors)
        name = draft.add("body", "node", mass=0.0, inertia=np.zeros(3), position=draft.near(first))
        draft.points[name] = np.array(draft.calls[-1].arguments["position"])
        draft.light.add(name)
        for end in (first, second):
            k = draft.stiffness()
            damped = 1e-2 * k if "damped" in feature else None
            draft.add("bushing", "tie", first=end, second=name, position=draft.near(name, 0.1), stiffness=k,
                      damping=damped, orientation=rotation(rng))  # fmt: skip
    if "point mass" in draft.features:
        base = draft.pick(draft.anchors)
        name = draft.add(
            "body", "point", mass=float(rng.uniform(0.3, 3)), inertia=np.zeros(3), position=draft.near(base)
        )
        draft.points[name] = np.array(draft.calls[-1].arguments["position"])
        draft.light.add(name)
        draft.joint("custom", base, name, draft.points[name], free=("x", "y", "z"))
        bushing(draft, base, name)


def rotors(draft):
    """What spins on bodies, bodies that spin themselves in round bearings, and shafts with dampers of their own."""
    rng, features = draft.rng, draft.features
    speed = lambda: float(rng.choice([-1, 1]) * 10 ** rng.uniform(0.5, 2.3))  # noqa: E731
    if "rotor on body" in features:
        body = draft.pick(draft.heavy)
        draft.add(
            "rotor", "rotor", body=body, speed=speed(), axis=rng.normal(size=3), inertia=float(rng.uniform(0.005, 0.05))
        )
    if "spinning body" in features:
        axes, base = rotation(rng), draft.pick(draft.anchors)
        name = draft.body("disk", symmetric=axes)
        draft.joint(draft.pick(("revolute", "cylindrical")), *draft.pick(((base, name), (name, base))),
                    draft.points[name] + rng.uniform(-0.3, 0.3) * axes[:, 2], axes)  # fmt: skip
        round_bushing(draft, base, name, axes, free=True)
        draft.spinning.add(name)
        draft.add("rotor", "rotor", body=name, speed=speed(), axis=axes[:, 2])
    if "rotating damper" in features:
        axes, base, omega = rotation(rng), draft.pick(draft.anchors), speed()
        first = draft.body("shaft", symmetric=axes)
        second = draft.body("shaft", at=draft.points[first] + 0.5 * axes[:, 2], symmetric=axes)
        draft.joint(draft.pick(("revolute", "spherical")), base, first, draft.points[first], axes)
        round_bushing(draft, base, first, axes, free=True)
        round_bushing(draft, first, second, axes, free=False)
        draft.spinning |= {first, second}
        for name in (first, second):
            draft.add("rotor", "rotor", body=name, speed=omega, axis=axes[:, 2])


def round_bushing(draft, first, second, axes, free):
    """A bushing that is the same from all sides of the axis; ``free``: it lets the second body spin."""
    a, z, tilt, turn = 10 ** draft.rng.uniform([3, 3, 2, 2], [4.5, 4.5, 3, 3])
    k = np.array([a, a, z, tilt, tilt, 0.0 if free else turn])
    damped = "no damping" not in draft.features and (not free or draft.chance(0.5))
    draft.add("bushing", "bearing", first=first, second=second, position=draft.points[second], stiffness=k,
              damping=1e-3 * k if damped else None, orientation=axes)  # fmt: skip


def beams(draft):
    """A beam of a soft material, so that its frequencies are not far from those of the bodies."""
    features, rng = draft.features, draft.rng
    asked = features & {"beam", "timoshenko beam", "beam between bodies", "beam on ground"}
    if not asked:
        return
    a, b = draft.pick((draft.pick(draft.heavy), None)), None
    if "beam between bodies" in asked:
        a, b = draft.pick(draft.heavy), draft.pick(draft.heavy)
        b = b if b != a else draft.body()
    elif "beam on ground" in asked:
        a, b = "ground", draft.pick((None, draft.pick(draft.heavy)))
        if draft.chance(0.3):
            a, b = b, a
    start = draft.near(a if a not in (None, "ground") else draft.pick(draft.heavy), 0.4)
    section = draft.pick((
        {"type": "tube", "radius": 0.03, "wall": 0.008}, {"type": "circle", "radius": 0.02},
        {"type": "rectangle", "width": 0.03, "height": 0.05},
        {"A": 1.2e-3, "Iy": 2e-7, "Iz": 1e-7, "J": 2.5e-7, "ky": 0.8, "kz": 0.85},
    ))  # fmt: skip
    material = {"E": float(10 ** rng.uniform(8, 9)), "rho": 1500.0} | draft.pick(({"nu": 0.3}, {"G": 1e8}))
    if "G" in material:
        material["G"] = material["E"] / 2.5
    along = rng.normal(size=3)
    along *= rng.uniform(0.5, 1.0) / np.linalg.norm(along)
    line = {"start": start, "end": start + along, "elements": int(rng.integers(1, 4))}
    if draft.chance(0.3):
        line = {"nodes": [start, start + 0.5 * along + rng.uniform(-0.1, 0.1, 3), start + along]}
    count = len(line["nodes"]) - 1 if "nodes" in line else line["elements"]
    name = draft.add(
        "beam", "beam", a=a, b=b, section=section, material=material, **line, y_axis=rng.normal(size=3),
        shear=True if "timoshenko beam" in asked else None,
        alpha=float(rng.uniform(0.1, 1)) if "rayleigh damping" in features else None,
        beta=1e-4 if "rayleigh damping" in features else None,
        damping_ratio=0.02 if "modal damping" in features else None,
    )  # fmt: skip
    draft.calls[-1].arguments.setdefault("a", a)
    draft.calls[-1].arguments.setdefault("b", b)
    for end, i, point in ((a, 0, start), (b, count, start + along)):
        if end is None:
            draft.nodes[f"{name}.{i}"] = point
    _attach(draft)


def flexures(draft):
    """A leaf of a soft material between two bodies, or a body and the ground."""
    if "flexure" not in draft.features:
        return
    rng, a = draft.rng, draft.pick(draft.heavy)
    b = "ground" if draft.chance(0.5) and "floating" not in draft.features else draft.body()
    if draft.chance(0.5):
        a, b = b, a
    damping = {} if "no damping" in draft.features else {"alpha": 0.3, "beta": 1e-4, "damping_ratio": 0.02}
    shape = {"type": "leaf", "length": float(rng.uniform(0.3, 0.5)), "width": 0.1, "thickness": 0.03}
    draft.add("flexure", "flexure", a=a, b=b, shape=shape, position=draft.near(draft.pick(draft.heavy), 0.4),
              material={"E": float(10 ** rng.uniform(8, 9)), "nu": 0.3, "rho": 1500.0}, shear=bool(draft.chance(0.5)),
              orientation=rotation(rng), **damping)  # fmt: skip


def _attach(draft):
    """Hold some free ends of flexible parts by a joint or a spring."""
    for node, point in draft.nodes.items():
        others = [name for name in draft.anchors if name not in draft.light]
        if draft.chance(0.35):
            kind = draft.pick(("revolute", "spherical", "fixed", "cylindrical"))
            draft.joint(kind, draft.pick(others), node, point)
        elif draft.chance(0.7):
            bushing(draft, draft.pick(others), node, at=point)


def superelements(draft):
    """A reduced model after Craig and Bampton of a bent beam, between bodies or standing on the ground."""
    rng = draft.rng
    asked = draft.features & {"superelement", "grounded superelement"}
    if not asked:
        return
    grounded = "grounded superelement" in asked
    base = draft.pick(draft.heavy)
    points = [draft.near(base, 0.2)]
    for _ in range(3):
        points.append(points[-1] + rng.uniform(0.1, 0.3, size=3))
    m, k = reduced(points, int(rng.integers(0, 4)), 1e3 if grounded else 0.0)
    axes = rotation(rng) if draft.chance(0.6) else np.eye(3)
    turn = np.eye(len(m))
    turn[:12, :12] = np.kron(np.eye(4), axes)
    m, k = turn.T @ m @ turn, turn.T @ k @ turn
    m, k = 0.5 * (m + m.T), 0.5 * (k + k.T)
    c = None if "no damping" in draft.features or draft.chance(0.4) else 1e-4 * k
    held = {"left": base} if draft.chance(0.7) else {}
    if draft.chance(0.4) and not grounded:
        held["right"] = draft.pick(draft.heavy)
    name = draft.add("superelement", "super", M=m, C=c, K=k, nodes={"left": points[0], "right": points[-1]},
                     bodies=held or None, orientation=axes, grounded=grounded or None)  # fmt: skip
    draft.calls[-1].arguments.setdefault("C", None)
    for node, point in (("left", points[0]), ("right", points[-1])):
        if node not in held:
            draft.nodes[f"{name}.{node}"] = point
    _attach(draft)


def reduced(points, retained, stand):
    """M and K on the ends of a bent beam and its lowest modes held there; ``stand`` [N/m] holds all nodes."""
    area, iy, iz, j, e, g, rho = 8e-4, 6e-8, 4e-8, 1e-7, 3e8, 1.2e8, 1500.0
    lengths = [float(np.linalg.norm(np.subtract(q, p))) for p, q in pairwise(points)]
    frames = []
    for p, q in pairwise(points):
        x = np.subtract(q, p) / np.linalg.norm(np.subtract(q, p))
        z = np.cross(x, (0.3, -0.5, 0.8))
        z /= np.linalg.norm(z)
        frames.append(np.column_stack((x, np.cross(z, x), z)))
    k, m = assembled(points, frames, lambda i: matrices(lengths[i], area, iy, iz, j, e, g, rho))
    k += stand * np.eye(len(k))
    return on_ends(k, m, retained)
