"""The same mechanism from other parts: bodies welded of two, springs in parallel, joints in series, a mirror image."""

from dataclasses import replace

import numpy as np

from tests.hunt.answers import answers, compare_eigenvalues, compare_reactions, compare_responses, response_of
from tests.hunt.restated import DIRECTIONS, IN_WORLD, POINTS, on_sum, six
from tests.hunt.scene import Call
from tests.hunt.skip import Skip

SHARES, SPARSE = (0.3, 0.7), 0.3
# What of a connection is divided between two of them; those with states of their own would have more of these.
DIVISIBLE = {
    "spring": ("stiffness", "damping", "preload"), "bushing": ("stiffness", "damping", "preload"),
    "torsion_spring": ("stiffness", "damping", "preload"), "inerter": ("inertance",),
}  # fmt: skip
ENDS = ("first", "second", "a", "b", "body", "relative_to")
# Joints as two in series: the first on the first body.
SERIES = {
    "cylindrical": ("revolute", "prismatic"), "planar": (("x", "y"), ("rz",)), "universal": (("rx",), ("ry",)),
    "spherical": (("rx", "ry"), ("rz",)), "point_on_line": ("prismatic", "spherical"),
    "point_on_plane": (("x", "y"), "spherical"),
}  # fmt: skip
COUPLED = {"gear": ("first", "second"), "worm": ("worm", "wheel"), "rack": ("pinion", "rack")}


def named(scene):
    """Elements that force outputs or couplers refer to."""
    calls = [*scene.of("force_output", "strain_output"), *scene.of("coupler", "gear", "worm", "rack")]
    return set().union(*(call.references for call in calls))


def in_parallel(scene):
    """Each connection as two with shares of its coefficients."""
    calls, kept = [], named(scene)
    for call in scene.calls:
        if call.kind not in DIVISIBLE or call.name in kept or "dynamic" in call.arguments:
            calls.append(call)
            continue
        for share, name in zip(SHARES, (call.name, f"{call.name} too"), strict=True):
            divided = {key: share * np.array(call.arguments[key]) if np.ndim(call.arguments[key]) else
                       share * call.arguments[key]
                       for key in DIVISIBLE[call.kind] if call.arguments.get(key) is not None}  # fmt: skip
            calls.append(replace(call.but(**divided), name=name))
    return scene.with_calls(calls)


def tensor(call):
    """The tensor of a body about its centre of mass, world axes."""
    value = np.array(call.arguments["inertia"], dtype=float)
    axes = call.arguments.get("orientation")
    axes = np.eye(3) if axes is None else np.array(axes, dtype=float)
    if value.shape == (6,):
        xx, yy, zz, xy, xz, yz = value
        value = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return axes @ (np.diag(value) if value.ndim == 1 else value) @ axes.T


def welded(scene, rng):
    """Bodies as two halves, apart from each other, that a fixed joint holds; what is on them is on either."""
    kept = named(scene) | {call.arguments["body"] for call in scene.of("rotor")}
    halves = {}
    calls = []
    for call in scene.of("body"):
        mass = call.arguments["mass"]
        moments = tensor(call)
        if call.name in kept or not np.linalg.eigvalsh(moments).min() > 0.0:
            continue
        # the halves are apart by little, so that a body can have what is left of the tensor
        apart = 0.2 * np.sqrt(np.linalg.eigvalsh(moments).min() / mass) * rng.normal(size=3)
        of_halves = moments - SHARES[0] * SHARES[1] * mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
        at = np.array(call.arguments["position"])
        offsets = SHARES[1] * apart, -SHARES[0] * apart
        halves[call.name] = (call, [(share * mass, share * of_halves, at + offset)
                                    for share, offset in zip(SHARES, offsets, strict=True)])  # fmt: skip

    def either(call):
        a = dict(call.arguments)
        if call.kind in ("input", "output", "load") and a["body"] in halves and a.get("position") is None:
            a["position"] = halves[a["body"]][0].arguments["position"]
        for end in ENDS:
            if isinstance(a.get(end), str) and a[end] in halves and rng.random() < 0.5:
                a[end] = f"{a[end]} half"
        return replace(call, arguments=a)

    for call in scene.calls:
        if call.kind != "body" or call.name not in halves:
            calls.append(either(call))
            continue
        for name, (mass, moments, at) in zip((call.name, f"{call.name} half"), halves[call.name][1], strict=True):
            calls.append(Call("body", name, {"mass": mass, "inertia": moments, "position": at}))
        calls.append(Call("joint", f"weld {call.name}", {"kind": "fixed", "first": call.name,
                                                         "second": f"{call.name} half"}))  # fmt: skip
    if not halves:
        raise Skip("no body to divide")
    return scene.with_calls(calls)


def in_series(scene, rng):
    """Joints as two in series with a massless body between them, or with one that a fixed joint holds."""
    calls, kept, spinning = [], named(scene), {call.arguments["body"] for call in scene.of("rotor")}
    for call in scene.calls:
        a = call.arguments
        if call.kind != "joint" or call.name in kept or {a["first"], a["second"]} & spinning or rng.random() < 0.5:
            calls.append(call)
            continue
        at = a.get("position")
        node, other = f"{call.name} node", f"{call.name} too"
        calls.append(Call("body", node, {"mass": 0.0, "inertia": np.zeros(3),
                                         "position": np.zeros(3) if at is None else at}))  # fmt: skip
        if a["kind"] in SERIES and "axis" not in a:
            for name, first, second, kind in ((call.name, a["first"], node, 0), (other, node, a["second"], 1)):
                of_kind = SERIES[a["kind"]][kind]
                words = {"kind": of_kind} if isinstance(of_kind, str) else {"kind": None, "free": of_kind}
                calls.append(Call("joint", name, {**words, "first": first, "second": second, "position": at,
                                                  "orientation": a.get("orientation")}))  # fmt: skip
        elif rng.random() < 0.5:
            calls.append(call.but(second=node))
            calls.append(Call("joint", other, {"kind": "fixed", "first": node, "second": a["second"]}))
        else:
            calls.append(Call("joint", other, {"kind": "fixed", "first": a["first"], "second": node}))
            calls.append(call.but(first=node))
    return scene.with_calls(calls)


MIRROR = np.diag([1.0, 1.0, -1.0])
SIX = np.diag([1.0, 1.0, -1.0, -1.0, -1.0, 1.0])  # displacements and wrenches of the image, world axes


def mirrored(scene):
    """The image of the scene in the plane z = 0, its axes again right-handed: their z is turned round."""
    # a frame A becomes MIRROR A MIRROR; components along its axes change as SIX does
    signs = dict(zip(DIRECTIONS, np.diag(SIX), strict=True))
    joints = {call.name: call.arguments for call in scene.of("joint")}

    def sign(name):
        joint, _, direction = name.rpartition(".")
        a = joints[joint]
        if "axis2" in a or "axis" in a:  # an axis is mirrored, and rotations about it change their sense
            return -1.0 if direction[0] == "r" else 1.0
        return signs[direction]

    def change(call):
        a = dict(call.arguments)
        for word in (*POINTS, "axis", "axis2", "y_axis", "force"):
            if a.get(word) is not None:
                a[word] = np.array(a[word], dtype=float) @ MIRROR
        if a.get("torque") is not None:
            a["torque"] = -np.array(a["torque"]) @ MIRROR
        if "nodes" in a:
            a["nodes"] = [MIRROR @ np.array(p) for p in a["nodes"]]
        if a.get("orientation") is not None:
            a["orientation"] = MIRROR @ np.array(a["orientation"]) @ MIRROR
        if call.kind == "flexure":  # its x is turned round, as z leads from one body to the other
            a["orientation"] = a["orientation"] @ np.diag([-1.0, 1.0, -1.0])
        if call.kind == "body":
            value = np.array(a["inertia"], dtype=float)
            if value.ndim == 2:
                a["inertia"] = MIRROR @ value @ MIRROR
            elif len(value) == 6:
                a["inertia"] = value * [1, 1, 1, 1, -1, -1]
        if call.kind == "bushing":
            for word in ("stiffness", "damping", "dynamic_stiffness"):
                if np.ndim(a.get(word)) == 2:
                    a[word] = SIX @ np.array(a[word]) @ SIX
            if a.get("preload") is not None:
                a["preload"] = SIX @ np.array(a["preload"])
        if call.kind == "torsion_spring" and a.get("preload") is not None:
            a["preload"] = -a["preload"]
        if a.get("pitch") is not None:
            a["pitch"] = -a["pitch"]
        if call.kind == "rotor":
            a["speed"] = -a["speed"]
        if call.kind == "coupler":
            a["coefficients"] = {name: value * sign(name) for name, value in a["coefficients"].items()}
        if call.kind in ("gear", "worm", "rack"):
            first, second = COUPLED[call.kind]
            word = "radius" if call.kind == "rack" else "ratio"
            a[word] = a[word] * sign(a[first]) * sign(a[second])
        if call.kind in IN_WORLD or on_sum(call, scene):
            a["direction"] = SIX @ six(a["direction"])
        return replace(call, arguments=a)

    gravity = None if scene.gravity is None else tuple(MIRROR @ np.array(scene.gravity))
    return replace(scene, gravity=gravity, calls=tuple(map(change, scene.calls)))


def divided(subject):
    """The scene from other parts, in one of four ways."""
    scene, rng = subject.scene, subject.rng
    way = rng.integers(4)
    if way == 3:
        if scene.of("superelement"):
            raise Skip("no image of matrices")
        # components in axes of elements change their signs
        local = [call.name for call in scene.of("force_output", "strain_output") if not on_sum(call, scene)]
        compare(subject, mirrored(scene), without=local)
    else:
        other = in_parallel(scene) if way == 0 else (welded, in_series)[way - 1](scene, rng)
        # moments in joints without a point are about the centre of a body, which is another one in a part of it
        loose = {call.name for call in scene.of("joint") if call.arguments.get("position") is None}
        compare(subject, other, reactions=True,
                without=[call.name for call in scene.of("force_output") if call.arguments["element"] in loose])


def compare(subject, scene, reactions=False, without=()):
    """A scene from other parts with the scene as it is, dense and sometimes sparse, but for some outputs."""
    q, own = subject.question, subject.answers
    again = answers(scene.model().linearize(method="dense"), q)
    rows = [i for i in np.flatnonzero(q.determined) if q.outputs[i] not in without]
    values = own.eigenvalues
    nearest = np.abs(values[:, None] - q.eigenvalues[None, :]).argmin(axis=1) if len(values) else []
    compare_eigenvalues(again, values, q.eigenvalue_tolerance[nearest] if len(values) else np.zeros(0))
    compare_responses(again.response, own.response, q, rows)
    if reactions:
        known = subject.example.reference.determined_joints
        # moments are about a point of the bodies where a joint has none of its own
        apart = {call.name for call in scene.of("joint") if call.arguments.get("position") is None}
        names = [name for name, fixed in known.items() if fixed and name in again.reactions and name not in apart]
        compare_reactions(again.reactions, own.reactions, names, subject.equations)
    if subject.rng.random() < SPARSE:
        compare_responses(response_of(scene.model().linearize(method="sparse"), q), own.response, q, rows)
