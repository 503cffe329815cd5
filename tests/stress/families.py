"""Mechanisms whose stiffness spans 12 and mass 8 decades: chains, trees, loops, floating ones, any damping."""

import numpy as np

import mbsvib as mv
from tests.support.random_models import rotation


def decades(rng, n, span, middle=0.0):
    """n values over ``span`` decades, both ends reached, in random order."""
    return 10.0 ** (middle + rng.permutation(np.linspace(-span / 2, span / 2, n)))


def wide(seed, bodies=8, kinds=("prismatic", "revolute"), branches=False, far=2, floating=False, damping=None,
         stiffness_span=12.0, mass_span=8.0, length=1.0):  # fmt: skip
    """An open chain or tree with bushings in its joints and line springs between bodies far from each other.

    ``damping`` is (lowest, highest) share of critical damping, over which the dampers are spread, or None.
    """
    rng = np.random.default_rng(seed)
    model = mv.Model(f"wide{seed}")
    mass = decades(rng, bodies, mass_span)
    stiffness = decades(rng, bodies + far, stiffness_span, 5.0)
    centre = [length * rng.uniform(-1, 1, 3)]
    parent = [-1]
    for i in range(bodies):
        parent.append(int(rng.integers(-1, i)) if branches and i else i - 1)
        centre.append(centre[parent[-1] + 1] + length * rng.uniform(-1, 1, 3))
        size = length * rng.uniform(0.2, 0.6, 3)
        a, b, c = mass[i] * size**2 / 3
        model.add_body(f"b{i}", mass[i], (b + c, a + c, a + b), centre[-1], orientation=rotation(rng))
    name = ["ground", *(f"b{i}" for i in range(bodies))]
    for i in range(bodies):
        below = name[parent[i + 1] + 1]
        if floating and below == "ground":
            continue
        at = (centre[i + 1] + centre[parent[i + 1] + 1]) / 2
        kind = str(rng.choice(kinds))
        model.add_joint(f"j{i}", kind, below, f"b{i}", position=at, orientation=rotation(rng))
        k = stiffness[i] * np.array([1, 1, 1, *(length**2 * rng.uniform(0.1, 1, 3))])
        c = _damping(rng, damping, k, mass[i])
        model.add_bushing(f"s{i}", below, f"b{i}", at, k, orientation=rotation(rng), **c)
    for i in range(far):
        first, second = rng.choice(np.arange(1 if floating else 0, bodies + 1), 2, replace=False)
        k = stiffness[bodies + i]
        c = _damping(rng, damping, k, mass[max(first, second) - 1])
        model.add_spring(f"f{i}", name[first], name[second], centre[first] + 0.1 * length * rng.normal(size=3),
                         centre[second] + 0.1 * length * rng.normal(size=3), stiffness=k, **c)  # fmt: skip
    return model


def _damping(rng, span, k, mass):
    if span is None:
        return {}
    low, high = span
    share = 0.0 if low == 0.0 and rng.random() < 0.3 else 10.0 ** rng.uniform(*np.log10((low or 1e-6, high)))
    return {"damping": 2 * share * np.sqrt(k * mass)}


def ladder(seed, loops=1, spatial=False, bodies=None, damping=None, stiffness_span=12.0, mass_span=8.0, size=1.0):
    """Four-bars on top of each other, in a plane that lies anywhere or with joints that make them spatial loops."""
    rng = np.random.default_rng(seed)
    model = mv.Model(f"ladder{seed}")
    axes = rotation(rng)
    count = 3 * loops
    mass, stiffness = decades(rng, count, mass_span), decades(rng, 4 * loops, stiffness_span, 5.0)
    corner = lambda i, side: axes @ (size * np.array([side + 0.2 * rng.uniform(), i + 0.2 * rng.uniform(), 0.0]))  # noqa: E731
    left, right = corner(0, 0), corner(0, 1)
    lower = ("ground", "ground")
    number = 0

    def body(name, a, b, body_size=0.3):
        nonlocal number
        half = size * rng.uniform(0.1, body_size, 3)
        x, y, z = mass[number] * half**2 / 3
        at = (a + b) / 2 + 0.05 * size * rng.normal(size=3)
        model.add_body(name, mass[number], (y + z, x + z, x + y), at, orientation=axes)
        number += 1

    for i in range(loops):
        top_left, top_right = corner(i + 1, 0), corner(i + 1, 1)
        names = (f"l{i}", f"r{i}", f"t{i}")
        body(names[0], left, top_left)
        body(names[1], right, top_right)
        body(names[2], top_left, top_right)
        ends = [(lower[0], names[0], left), (lower[1], names[1], right), (names[0], names[2], top_left),
                (names[1], names[2], top_right)]  # fmt: skip
        kinds = ("universal", "revolute", "spherical", "cylindrical") if spatial else ("revolute",) * 4
        for j, ((first, second, at), kind) in enumerate(zip(ends, kinds, strict=True)):
            frame = rotation(rng) if spatial else axes
            model.add_joint(f"j{i}{j}", kind, first, second, position=at, orientation=frame)
            k = stiffness[4 * i + j] * np.array([1, 1, 1, *(size**2 * rng.uniform(0.1, 1, 3))])
            c = _damping(rng, damping, k, mass[3 * i + j % 3])
            model.add_bushing(f"s{i}{j}", first, second, at, k, orientation=rotation(rng) if spatial else axes, **c)
        left, right, lower = top_left, top_right, (names[2], names[2])
    return model


def linkage(seed, loops=4, spatial=False, damping=None, stiffness_span=12.0, mass_span=8.0, floating=False):
    """Four-bars in a row, each hinged to the coupler of the one before: stiffness and mass differ from loop to loop."""
    rng = np.random.default_rng(seed)
    model = mv.Model(f"linkage{seed}")
    axes = rotation(rng)
    mass, stiffness = decades(rng, loops, mass_span - 0.5), decades(rng, loops, stiffness_span - 0.5, 5.0)
    base, foot = "ground", np.zeros(3)
    for i in range(loops):
        location = lambda x, y: foot + axes @ (np.array([x, y, 0.0]) + 0.2 * rng.uniform(-1, 1, 3) * [1, 1, spatial])  # noqa: B023, E731
        corners = [location(0, 0), location(0, 1), location(1, 1), location(1, 0)]
        centre = axes @ np.array([0.4, 0.5, 0.1]) + foot
        names = [base] + [f"{part}{i}" for part in ("left", "top", "right")]
        if i or floating:
            names[0] = f"foot{i}"
            _body(rng, model, names[0], mass[i], foot - axes[:, 1] * 0.2)
            if i:
                turn = rotation(rng)
                model.add_joint(f"hinge{i}", "revolute", base, names[0], position=foot, orientation=turn)
                k = stiffness[i] * 10.0 ** rng.uniform(-0.5, 0.5)
                model.add_bushing(f"spring{i}", base, names[0], foot, (0, 0, 0, 0, 0, k), orientation=turn,
                                  **_damping(rng, damping, np.array((0, 0, 0, 0, 0, k)), mass[i]))  # fmt: skip
        for j in (1, 2, 3):
            middle = (corners[j - 1] + corners[j % 4]) / 2 if j != 2 else centre
            _body(rng, model, names[j], mass[i] * 10.0 ** rng.uniform(-0.25, 0.25), middle)
        kinds = ("universal", "revolute", "spherical", "cylindrical") if spatial else ("revolute",) * 4
        for j, kind in enumerate(kinds):
            frame = rotation(rng) if spatial else axes
            first, second = names[j], names[(j + 1) % 4]
            model.add_joint(f"j{i}{j}", kind, first, second, position=corners[j], orientation=frame)
            k = stiffness[i] * np.array([1, 1, 1, *rng.uniform(0.1, 1, 3)]) * 10.0 ** rng.uniform(-0.25, 0.25)
            model.add_bushing(f"s{i}{j}", first, second, corners[j], k, orientation=frame,
                              **_damping(rng, damping, k, mass[i]))  # fmt: skip
        base, foot = names[2], corners[2] + axes @ np.array([0.5, 0.1, 0])
    return model


def _body(rng, model, name, mass, at):
    x, y, z = mass * rng.uniform(0.1, 0.4, 3) ** 2 / 3
    model.add_body(name, mass, (y + z, x + z, x + y), at, orientation=rotation(rng))
