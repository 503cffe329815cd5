"""Small random mechanisms, and the same mechanism said in another way (order, sign, place, direction)."""

import numpy as np
from hypothesis import strategies as st

import mbsvib as mv
from mbsvib.api.model import ADDERS
from tests.support.exact import FREE

KINDS = (
    "revolute", "prismatic", "cylindrical", "screw", "universal", "spherical", "planar", "fixed", "free", "custom",
    "point_on_line", "point_on_plane", "distance", "homokinetic",
)  # fmt: skip
MIXED = KINDS[:-1]  # what mechanisms are made of where nothing else is said
VECTORS = ("position", "start", "end")


def rotation(rng):
    """A rotation matrix, uniform over all of them."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def add_random_body(model, rng, name, centre):
    mass = 10 ** rng.uniform(-0.5, 1)
    a, b, c = rng.uniform(0.1, 0.6, size=3) ** 2 * mass / 3
    principal, turn = np.array([b + c, a + c, a + b]), rotation(rng)
    tensor = turn @ np.diag(principal) @ turn.T
    tensor = (tensor + tensor.T) / 2
    six = (*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2])
    inertia = (principal, tensor, six)[rng.integers(3)]
    return model.add_body(name, mass, inertia, centre, orientation=rotation(rng) if rng.random() < 0.7 else None)


def add_random_joint(model, rng, name, kind, first, second, centre):
    words = {"position": centre + rng.uniform(-0.3, 0.3, size=3)}
    if kind == "distance":
        words["end"] = centre + rng.uniform(-0.3, 0.3, size=3)
    elif kind == "universal" and rng.random() < 0.6:
        words["axis"], words["axis2"] = rng.normal(size=(2, 3)) * rng.choice([1.0, 20.0])
    elif rng.random() < 0.5 and kind != "universal":
        words["axis"] = rng.normal(size=3)
    else:
        words["orientation"] = rotation(rng)
    if kind == "screw":
        words["pitch"] = rng.choice([-1, 1]) * 10 ** rng.uniform(-2.5, -0.5)
    if kind == "custom":
        selected = rng.random(6) < 0.5
        words["free"] = tuple(d for d, yes in zip(FREE["free"], selected, strict=True) if yes)
        kind = None
    elif " " in kind:  # names of free directions
        words["free"], kind = tuple(kind.split()), None
    if kind in ("prismatic", "fixed") and rng.random() < 0.5:
        del words["position"]
    pair = (first, second) if rng.random() < 0.6 else (second, first)
    return model.add_joint(name, kind, *pair, **words)


def coefficients(rng, size, full, sign=1.0):
    """Six values or a full symmetric matrix (positive unless ``sign`` makes some values negative)."""
    values = size * 10 ** rng.uniform(-1, 1, size=6) * np.array([1, 1, 1, 0.05, 0.05, 0.05])
    if sign < 0:
        values[rng.integers(6)] *= -0.3
    if not full:
        return values
    scale = np.sqrt(abs(values))
    turn = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    middle = turn @ np.diag(np.sign(values) * rng.uniform(0.2, 1, size=6)) @ turn.T
    matrix = scale[:, None] * middle * scale
    return (matrix + matrix.T) / 2


def add_random_spring(model, rng, name, first, second, centre, damped, negative, line):
    stiffness = 10 ** rng.uniform(3, 4.5)
    damping = stiffness * 10 ** rng.uniform(-4, -2) if damped and rng.random() < 0.8 else 0.0
    if line:
        start, end = centre + rng.uniform(-0.5, 0.5, size=(2, 3))
        model.add_spring(name, first, second, start, end, stiffness, damping)
        return
    sign = -1 if negative and rng.random() < 0.4 else 1
    words = {"stiffness": coefficients(rng, stiffness, rng.random() < 0.4, sign)}
    if damping:
        words["damping"] = coefficients(rng, damping, rng.random() < 0.4)
    if rng.random() < 0.7:
        words["orientation"] = rotation(rng)
    model.add_bushing(name, first, second, centre + rng.uniform(-0.3, 0.3, size=3), **words)


def add_random_ports(model, rng, centres, base=True):
    """Force inputs, a base motion, and outputs of all kinds."""
    bodies = list(model.bodies)

    def port():
        body = bodies[rng.integers(len(bodies))]
        others = [b for b in ("ground", *bodies) if b != body]
        direction = (
            ("x", "y", "z", "rx", "ry", "rz")[rng.integers(6)], rng.normal(size=3), rng.normal(size=6),
        )[rng.integers(3)]  # fmt: skip
        words = {"body": body, "direction": direction}
        if rng.random() < 0.6:
            words["position"] = centres[body] + rng.uniform(-0.4, 0.4, size=3)
        if rng.random() < 0.4:
            words["relative_to"] = others[rng.integers(len(others))]
        return words

    for i in range(2):
        model.add_input(f"in{i}", **port())
    if base:
        direction = ("x", "ry", rng.normal(size=3), rng.normal(size=6))[rng.integers(4)]
        model.add_base_motion("base", direction, centres[bodies[0]] + rng.normal(size=3))
    for quantity in ("displacement", "velocity", "acceleration"):
        for i in range(2):
            model.add_output(f"{quantity}{i}", quantity=quantity, **port())
    model.add_output("on.ground", **port() | {"relative_to": "ground"}, quantity="acceleration", absolute=False)
    for spring in model.springs.values():
        direction = "z" if hasattr(spring, "line") else ("x", "rz", rng.normal(size=6))[rng.integers(3)]
        model.add_force_output(f"{spring.name}.f", spring.name, direction)


def spatial(seed, bodies=3, loops=0, kinds=MIXED, *, damped=True, negative=False, floating=False, offset=0.0,
            ports=True, closing_kinds=None):  # fmt: skip
    """A random tree of bodies in a generic pose, with random further joints, of ``kinds`` or ``closing_kinds``, that
    close loops.
    """
    rng = np.random.default_rng(seed)
    model = mv.Model(f"spatial{seed}")
    names = [f"b{i}" for i in range(bodies)]
    shift = offset * rng.uniform(-1, 1, size=3)
    centres = {"ground": shift} | {name: shift + rng.uniform(-1, 1, size=3) for name in names}
    for name in rng.permutation(names):
        add_random_body(model, rng, str(name), centres[name])
    pairs = []
    for i, name in enumerate(names):
        earlier = names[:i] + ([] if floating else ["ground"])
        if earlier:
            pairs.append((earlier[rng.integers(len(earlier))], name))
    closing = []
    while len(closing) < loops:
        first, second = rng.permutation(["ground", *names])[:2]
        closing.append((str(first), str(second)))
    joints = pairs + closing
    for k in rng.permutation(len(joints)):
        first, second = joints[k]
        kind = str(rng.choice(closing_kinds if closing_kinds and k >= len(pairs) else kinds))
        add_random_joint(model, rng, f"j{k}", kind, first, second, centres[second])
    for k, (first, second) in enumerate(pairs):
        add_random_spring(model, rng, f"s{k}", first, second, centres[second], damped, negative, False)
    first, second = rng.permutation(names + ([] if floating and bodies > 1 else ["ground"]))[:2]
    add_random_spring(model, rng, "line", str(first), str(second), centres[str(second)], damped, negative, True)
    if ports:
        add_random_ports(model, rng, centres, base=not floating or rng.random() < 0.5)
    return model


def planar(seed, bodies=3, loops=1, *, damped=True, offset=0.0, ports=True):
    """A random mechanism in a plane that lies anywhere in space: every loop has three redundant rows."""
    rng = np.random.default_rng(seed)
    model = mv.Model(f"planar{seed}")
    axes, shift = rotation(rng), offset * rng.uniform(-1, 1, size=3)
    location = lambda: shift + axes @ np.array([*rng.uniform(-1, 1, size=2), rng.uniform(-0.1, 0.1)])  # noqa: E731
    names = [f"b{i}" for i in range(bodies)]
    centres = {name: location() for name in ("ground", *names)}
    for name in names:
        add_random_body(model, rng, name, centres[name])
    chain = list(zip(["ground", *names[:-1]], names, strict=True))
    closing = [(names[-1], "ground")] + [tuple(map(str, rng.permutation(["ground", *names])[:2]))
                                         for _ in range(loops - 1)]  # fmt: skip
    pairs = chain + closing
    for k in rng.permutation(len(pairs)):
        pair = pairs[k] if rng.random() < 0.5 else pairs[k][::-1]
        if rng.random() < 0.8:
            model.add_joint(f"j{k}", "revolute", *pair, position=location(), axis=axes[:, 2])
        else:
            slide = axes @ np.array([*rng.normal(size=2), 0.0])
            model.add_joint(f"j{k}", "prismatic", *pair, position=location(), axis=slide)
    for k, (first, second) in enumerate(chain):
        add_random_spring(model, rng, f"s{k}", first, second, centres[second], damped, False, k % 2 == 1)
    if ports:
        add_random_ports(model, rng, centres)
    return model


def seeds():
    return st.integers(0, 2**31)


def open_trees(**words):
    return st.builds(spatial, seeds(), bodies=st.integers(1, 4), **words)


def closed_loops(**words):
    """Spatial loops whose joints are free enough that something moves, most of the time."""
    kinds = ("cylindrical", "universal", "spherical", "planar", "custom", "free", "screw", "revolute",
             "point_on_line", "point_on_plane", "distance")  # fmt: skip
    return st.builds(spatial, seeds(), bodies=st.integers(2, 4), loops=st.integers(1, 2), kinds=st.just(kinds),
                     **words)  # fmt: skip


def planar_loops(**words):
    return st.builds(planar, seeds(), bodies=st.integers(3, 5), loops=st.integers(1, 2), **words)


def rebuilt(model, change=lambda part, words: words, order=None):
    """The same model through its words, each changed by ``change(part, constructor_kwargs)``.

    ``order`` seeds a permutation of the bodies, joints and springs.
    """
    rng = None if order is None else np.random.default_rng(order)
    result = mv.Model(model.name)
    parts = []
    for group in (model.bodies, model.joints, model.springs):
        values = list(group.values())
        parts += values if rng is None else [values[i] for i in rng.permutation(len(values))]
    for part in (*parts, *model.inputs.values(), *model.outputs.values()):
        getattr(result, ADDERS[type(part)])(**change(part, part.constructor_kwargs()))
    return result


def moved(model, shift):
    """The whole scene somewhere else."""

    def change(part, words):
        if ADDERS[type(part)] == "add_body":
            words.setdefault("position", (0.0, 0.0, 0.0))
        if ADDERS[type(part)] == "add_base_motion":
            words.setdefault("position", (0.0, 0.0, 0.0))
        return words | {key: np.add(words[key], shift) for key in VECTORS if key in words}

    return rebuilt(model, change)


def turned(model, by):
    """The whole scene turned about the origin; directions of ports become vectors."""

    def change(part, words):
        for key in (*VECTORS, "axis", "axis2"):
            if key in words:
                words[key] = by @ np.array(words[key])
        adder = ADDERS[type(part)]
        if adder == "add_joint" and part.kind == "distance":
            return words
        if adder == "add_joint" and "axis2" not in words:  # the axis leaves the frame about it open: say all of it
            words.pop("axis", None)
            words["orientation"] = by @ np.array(part.axes)
        elif adder in ("add_body", "add_bushing"):
            words["orientation"] = by @ np.array(part.orientation)
        if adder in ("add_input", "add_output", "add_base_motion"):
            words["direction"] = np.concatenate([by @ part.wrench[:3], by @ part.wrench[3:]])
        return words

    return rebuilt(model, change)


def swapped(model):
    """First and second of every joint, spring and bushing exchanged; the force outputs keep their sign."""

    def change(part, words):
        adder = ADDERS[type(part)]
        if adder in ("add_joint", "add_bushing", "add_spring"):
            words["first"], words["second"] = words["second"], words["first"]
        if adder == "add_spring":
            words["start"], words["end"] = words["end"], words["start"]
        if adder == "add_joint" and part.kind == "distance":
            words["position"], words["end"] = words["end"], words["position"]
        if adder == "add_joint" and part.kind == "universal":
            x, y = np.array(part.axes)[:, :2].T
            first, second = (part.axis, part.axis2) if part.axis is not None else (x, y)
            words.pop("orientation", None)
            words["axis"], words["axis2"] = second, first
        if adder == "add_force_output" and not hasattr(model.springs[part.element], "line"):
            words["direction"] = tuple(-w for w in part.wrench)
        return words

    return rebuilt(model, change)
