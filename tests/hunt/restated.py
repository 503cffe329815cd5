"""The same mechanism stated in another way: turned, shifted, in other units, in another order, under other names."""

from dataclasses import dataclass, replace

import numpy as np

POINTS = ("position", "start", "end")
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
# kinds of calls whose ``axis``, ``axis2`` and ``y_axis`` are directions in the world
IN_WORLD = ("input", "output", "base_motion")


def six(direction):
    """A direction as a six-vector."""
    if isinstance(direction, str):
        return np.eye(6)[DIRECTIONS.index(direction)]
    return np.concatenate((direction, np.zeros(6 - len(direction))))


def words_of(call):
    """Weights and times of the relaxations of a bushing."""
    dynamic = call.arguments.get("dynamic") or {}
    return dynamic if isinstance(dynamic, dict) else dynamic.words()


def acts_on(call, scene):
    """The kind of the element that a force output refers to."""
    target = call.arguments["element"]
    if target == "ground":
        return "ground"
    head = target.partition(".")[0]
    kind = next(other.kind for other in scene.calls if other.name == head and other.kind not in IN_WORLD)
    if kind in ("beam", "flexure", "superelement"):
        return "beam element" if target.partition(".")[2].startswith("e") and kind != "superelement" else "body"
    return kind


def on_sum(call, scene):
    """Whether a force output is the sum of forces on a body or the ground, in world axes."""
    return call.kind == "force_output" and acts_on(call, scene) in ("ground", "body")


def turned(scene, by):
    """The scene turned about the origin by a rotation matrix."""

    def change(call):
        a = dict(call.arguments)
        for word in (*POINTS, "axis", "axis2", "y_axis", "force", "torque"):
            if a.get(word) is not None:
                a[word] = by @ np.array(a[word], dtype=float)
        if "nodes" in a:
            a["nodes"] = ({name: by @ np.array(p) for name, p in a["nodes"].items()} if isinstance(a["nodes"], dict)
                          else [by @ np.array(p) for p in a["nodes"]])  # fmt: skip
        has_axes = call.kind in ("body", "bushing", "flexure", "superelement") or (
            call.kind == "joint" and a.get("kind") != "distance" and "axis" not in a)  # fmt: skip
        if has_axes:
            a["orientation"] = by @ np.array(a.get("orientation", np.eye(3)), dtype=float)
        if call.kind in IN_WORLD or on_sum(call, scene):
            wrench = six(a["direction"])
            a["direction"] = np.concatenate((by @ wrench[:3], by @ wrench[3:]))
        return replace(call, arguments=a)

    gravity = None if scene.gravity is None else tuple(by @ np.array(scene.gravity))
    return replace(scene, gravity=gravity, calls=tuple(map(change, scene.calls)))


def shifted(scene, by):
    """The scene elsewhere; moments of sums on the ground stay about the point that was the origin."""

    def change(call):
        a = dict(call.arguments)
        if call.kind in ("body", "base_motion"):
            a.setdefault("position", np.zeros(3))
        for word in POINTS:
            if a.get(word) is not None:
                a[word] = np.add(a[word], by)
        if "nodes" in a:
            a["nodes"] = ({name: np.add(p, by) for name, p in a["nodes"].items()} if isinstance(a["nodes"], dict)
                          else [np.add(p, by) for p in a["nodes"]])  # fmt: skip
        if call.kind == "force_output" and a["element"] == "ground":
            wrench = six(a["direction"])
            a["direction"] = np.concatenate((wrench[:3] - np.cross(wrench[3:], by), wrench[3:]))
        return replace(call, arguments=a)

    return replace(scene, calls=tuple(map(change, scene.calls)))


@dataclass(frozen=True)
class Units:
    """Factors by which numbers grow as units change: of lengths, masses and times."""

    length: float
    mass: float
    time: float

    @property
    def force(self):
        return self.mass * self.length / self.time**2

    @property
    def displacement(self):
        """Factors of the six displacements of a body."""
        return np.array([self.length] * 3 + [1.0] * 3)

    @property
    def wrench(self):
        return self.force * self.length / self.displacement

    def matrix(self, value, times):
        """Six coefficients or a 6 x 6 matrix on displacements, times a power of time."""
        value = np.array(value, dtype=float)
        if value.ndim == 1:
            return value * self.wrench / self.displacement * self.time**times
        return self.reduced(value, 1, times)

    def reduced(self, value, nodes, times):
        """A matrix of a superelement on so many nodes; its internal coordinates keep their numbers."""
        value = np.array(value, dtype=float)
        size = np.ones(len(value))
        size[: 6 * nodes] = np.tile(self.displacement, nodes)
        return value * self.force * self.length * self.time**times / np.outer(size, size)


def scalars(u):
    """Factors of arguments that are numbers or vectors of one unit, by kind of call and argument."""
    k, c = u.force / u.length, u.force * u.time / u.length
    line = {"start": u.length, "end": u.length, "stiffness": k, "damping": c}
    return {
        "body": {"mass": u.mass, "inertia": u.mass * u.length**2, "position": u.length},
        "joint": {"position": u.length, "end": u.length, "pitch": u.length},
        "bushing": {"position": u.length},
        "spring": {**line, "preload": u.force, "free_length": u.length},
        "maxwell": {**line, "static_stiffness": k, "preload": u.force},
        "inerter": {"start": u.length, "end": u.length, "inertance": u.mass},
        "torsion_spring": {"stiffness": u.force * u.length, "damping": u.force * u.length * u.time,
                           "preload": u.force * u.length},
        "strain_output": {"distance": u.length},
        "rack": {"radius": u.length},
        "rotor": {"speed": 1 / u.time, "inertia": u.mass * u.length**2},
        "load": {"force": u.force, "torque": u.force * u.length, "position": u.length},
        "beam": {"start": u.length, "end": u.length, "length": u.length, "alpha": 1 / u.time, "beta": u.time},
        "flexure": {"position": u.length, "alpha": 1 / u.time, "beta": u.time},
        "input": {"position": u.length}, "output": {"position": u.length}, "base_motion": {"position": u.length},
    }  # fmt: skip


def section_factors(u):
    return {"radius": u.length, "wall": u.length, "width": u.length, "height": u.length, "A": u.length**2,
            "Iy": u.length**4, "Iz": u.length**4, "J": u.length**4}  # fmt: skip


def rescaled(scene, u):
    """The scene in other units; inputs and outputs keep their numbers, eigenvalues are divided by the unit of time."""
    table = scalars(u)
    pressure = u.force / u.length**2
    material = {"E": pressure, "G": pressure, "rho": u.mass / u.length**3}
    section = section_factors(u)
    slides = {f"{joint.name}.{d}" for joint in scene.of("joint") for d in DIRECTIONS[:3]}

    def change(call):
        a = dict(call.arguments)
        for word, factor in table.get(call.kind, {}).items():
            if a.get(word) is not None:
                a[word] = factor * np.array(a[word], dtype=float) if np.ndim(a[word]) else factor * a[word]
        if call.kind == "bushing":
            for word, times in (("stiffness", 0), ("damping", 1)):
                if word in a:
                    a[word] = u.matrix(a[word], times)
            if a.get("preload") is not None:
                a["preload"] = u.wrench * np.array(a["preload"])
            if "dynamic_stiffness" in a:
                a["dynamic_stiffness"] = u.matrix(a["dynamic_stiffness"], 0)
        if "dynamic" in a:
            a["dynamic"] = {word: np.array(value) * (u.time if word in ("viscous", "times") else 1.0)
                            for word, value in words_of(call).items()}  # fmt: skip
        if call.kind == "coupler":
            a["coefficients"] = {name: value / (u.length if name in slides else 1.0)
                                 for name, value in a["coefficients"].items()}  # fmt: skip
        if call.kind == "beam":
            if "nodes" in a:
                a["nodes"] = [u.length * np.array(p) for p in a["nodes"]]
            a["section"] = {k: v * section.get(k, 1.0) if k != "type" else v for k, v in a["section"].items()}
            a["material"] = {k: v * material.get(k, 1.0) for k, v in a["material"].items()}
        if call.kind == "flexure":
            a["shape"] = {k: v if k == "type" else u.length * v for k, v in a["shape"].items()}
            a["material"] = {k: v * material.get(k, 1.0) for k, v in a["material"].items()}
        if call.kind == "superelement":
            for word, times in (("M", 2), ("C", 1), ("K", 0)):
                if a.get(word) is not None:
                    a[word] = u.reduced(a[word], len(a["nodes"]), times)
            a["nodes"] = {name: u.length * np.array(p) for name, p in a["nodes"].items()}
        if call.kind in (*IN_WORLD, "force_output"):
            a["direction"] = port_direction(call, u)
        return replace(call, arguments=a)

    gravity = None if scene.gravity is None else tuple(u.length / u.time**2 * np.array(scene.gravity))
    return replace(scene, gravity=gravity, calls=tuple(map(change, scene.calls)))


def port_direction(call, u):
    """The direction of a port in other units, such that the signal keeps its number."""
    wrench = six(call.arguments["direction"])
    if call.kind == "input":
        return wrench * u.wrench
    if call.kind == "base_motion":
        return wrench * u.displacement / u.time**2
    if call.kind == "force_output":
        return wrench / u.wrench
    order = ("displacement", "velocity", "acceleration").index(call.arguments.get("quantity", "displacement"))
    return wrench / u.displacement * u.time**order


def shuffled(scene, rng):
    """The calls in another order; what refers to an element stays behind it."""
    left, known, calls = list(scene.calls), set(), []
    while left:
        ready = [i for i, call in enumerate(left) if call.references <= known]
        call = left.pop(ready[rng.integers(len(ready))])
        known.add(call.name)
        calls.append(call)
    return scene.with_calls(calls)


def renamed(scene, rng):
    """The scene under other names, and the new name of each element; inputs and outputs keep theirs."""
    own = [call.name for call in scene.calls if call.kind not in (*IN_WORLD, "force_output", "strain_output")]
    numbers = rng.permutation(len(own))
    new = {name: f"{'Z part' if number % 2 else 'a'}_{number}" for name, number in zip(own, numbers, strict=True)}

    def name_of(text):
        head, dot, tail = text.partition(".")
        return new.get(head, head) + dot + tail

    def change(call):
        a = dict(call.arguments)
        for word in ("first", "second", "a", "b", "body", "relative_to", "element", "worm", "wheel", "pinion", "rack"):
            if isinstance(a.get(word), str):
                a[word] = name_of(a[word])
        if "coefficients" in a:
            a["coefficients"] = {name_of(name): value for name, value in a["coefficients"].items()}
        if "bodies" in a:
            a["bodies"] = {node: name_of(body) for node, body in a["bodies"].items()}
        return replace(call, name=new.get(call.name, call.name), arguments=a)

    return replace(scene, calls=tuple(map(change, scene.calls))), new
