"""Random mechanisms under load, each held in balance in the pose in which it is described."""

import numpy as np

from mbsvib.api.model import ADDERS
from tests.support.lagrangian import Lagrangian
from tests.support.random_models import rotation, spatial


def wrench_needed(model):
    """Wrenches about the centres of mass, of least norm, that bring a loaded model into balance (bodies, 6)."""
    free = spatial_twin(model).linearize()
    basis = np.asarray(free.body_motion).reshape(6 * len(model.bodies), free.dof)
    gradient, _, _ = Lagrangian(model).forces()
    return (basis @ np.linalg.lstsq(basis, gradient, rcond=None)[0]).reshape(-1, 6)


def spatial_twin(model):
    """The same mechanism without its loads."""
    twin = type(model)(model.name)
    for key, group in model.groups().items():
        for part in group.values() if key != "loads" else ():
            kwargs = part.constructor_kwargs()
            kept = kwargs.keys() - {"preload", "free_length"}
            getattr(twin, ADDERS[type(part)])(**{key: kwargs[key] for key in kept})
    return twin


def loaded(seed, bodies=3, loops=0, kinds=None, *, hold="bushings", follower=False, torque=False, floating=False,
           offset=0.0, lines=True, couplers=0, closing_kinds=None):  # fmt: skip
    """A random mechanism under gravity, loads and preloads; ``hold`` says what balances it: bushings or loads."""
    words = {} if kinds is None else {"kinds": kinds}
    model = spatial(seed, bodies, loops, ports=False, floating=floating, offset=offset,
                    closing_kinds=closing_kinds, **words)  # fmt: skip
    rng = np.random.default_rng(seed + 1)
    free = [f"{joint.name}.{way}" for joint in model.joints.values() if joint.kind != "distance"
            for way, _ in joint.freedom]  # fmt: skip
    if closing_kinds:  # couplers on the joints that close loops, and one of the tree
        closing = [name for name in free if name.partition(".")[0] in {f"j{k}" for k in range(bodies, bodies + loops)}]
        free = [*closing, next(name for name in free if name not in closing)]
    for k in range(min(couplers, len(free) // 2)):
        count = int(rng.integers(2, min(4, len(free)) + 1))
        model.add_coupler(f"coupler{k}", dict(zip(rng.choice(free, count, replace=False), rng.normal(size=count),
                                                  strict=True)))  # fmt: skip
    model.gravity = (1.0, -2.0, -9.81)
    names = list(model.bodies)
    for k, body in enumerate(names):
        at = np.array(model.bodies[body].position)
        model.add_load(f"load{k}", body, 1e3 * rng.normal(size=3), 1e3 * rng.normal(size=3) if torque else (0, 0, 0),
                       position=at + rng.normal(size=3), follower=follower and bool(rng.random() < 0.6))  # fmt: skip
        other = ["ground", *names][int(rng.integers(k + 1))]
        pair = (body, other) if rng.random() < 0.5 else (other, body)
        start, end = at + rng.normal(size=(2, 3))
        if lines:
            model.add_spring(f"line{k}", *pair, start, end, 100 * rng.random(), preload=2e3 * rng.normal())
            start, end = at + rng.normal(size=(2, 3))
            model.add_spring(f"free{k}", *pair, start, end, 1e3 * rng.random(), free_length=rng.random())
        model.add_bushing(f"bush{k}", *pair, at + rng.normal(size=3), 100 * rng.random(size=6),
                          orientation=rotation(rng), preload=1e3 * rng.normal(size=6))  # fmt: skip
    for body, wrench in zip(names, wrench_needed(model), strict=True):
        at, axes = np.array(model.bodies[body].position), rotation(rng)
        if not wrench.any():
            continue
        if hold == "bushings":
            model.add_bushing(f"{body}.hold", "ground", body, at, orientation=axes,
                              preload=(*(axes.T @ wrench[:3]), *(axes.T @ wrench[3:])))  # fmt: skip
        else:
            model.add_load(f"{body}.hold", body, wrench[:3], wrench[3:])
    return model


def stiffened(seed, bodies=3, loops=0, **words):
    """The same in a balance that is stable: its bushings are far stiffer than its forces."""
    model = loaded(seed, bodies, loops, **words)
    return model.with_values({name: 1e6 * (1 + k % 7) for k, name in enumerate(model.parameters)
                              if name.startswith("bush") and ".stiffness." in name})  # fmt: skip


def held(model, seed=0):
    """A mechanism as it is, under gravity and loads, which preloads of bushings bring into balance."""
    rng = np.random.default_rng(seed)
    model.gravity = (1.0, -2.0, -9.81)
    for k, (name, body) in enumerate(model.bodies.items()):
        at = np.array(body.position)
        model.add_load(f"load{k}", name, 100 * rng.normal(size=3), position=at + rng.normal(size=3))
        model.add_bushing(f"bush{k}", "ground", name, at, 1e5 * rng.random(6), orientation=rotation(rng))
    for name, wrench in zip(list(model.bodies), wrench_needed(model), strict=True):
        if wrench.any():
            model.add_bushing(f"{name}.hold", "ground", name, model.bodies[name].position, preload=wrench)
    return model
