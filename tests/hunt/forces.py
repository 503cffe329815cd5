"""What loads random scenes, and what holds them in balance: preloads, loads, or the pose."""

import warnings
from dataclasses import replace

import numpy as np

import mbsvib as mv
from tests.hunt.equations import Equations
from tests.hunt.scene import Call, read_back
from tests.support.random_models import rotation

# Components of the forces that hold a scene are none below this share of the largest force.
NO_FORCE = 1e-11


def loads(draft):
    """Gravity, forces and torques on bodies, preloads and free lengths."""
    rng, features = draft.rng, draft.features
    if "gravity" in features:
        draft.gravity = tuple(float(v) for v in 9.81 * rotation(rng)[:, 2]) if draft.chance(0.5) else (0.0, 0.0, -9.81)
    bodies = [*draft.heavy, *draft.nodes]
    for feature in ("dead force", "dead torque", "follower force", "follower torque"):
        if feature not in features:
            continue
        body = draft.pick(bodies)
        at = draft.nodes.get(body, draft.points.get(body))
        what = {"force": 30 * rng.normal(size=3)} if "force" in feature else {"torque": 10 * rng.normal(size=3)}
        draft.add("load", "load", body=body, follower=True if "follower" in feature else None,
                  position=at + rng.uniform(-0.3, 0.3, 3) if draft.chance(0.6) else None, **what)  # fmt: skip
    for i, call in enumerate(draft.calls):
        if (call.kind == "bushing" and "bushing preload" in features and draft.chance(0.6)
                and not draft.spinning & {call.arguments["first"], call.arguments["second"]}):  # fmt: skip
            draft.calls[i] = call.but(preload=20 * rng.normal(size=6) * [1, 1, 1, 0.3, 0.3, 0.3])
        if call.kind == "spring" and call.arguments.get("stiffness"):
            if "line preload" in features and draft.chance(0.7):
                draft.calls[i] = call.but(preload=float(40 * rng.normal()))
            elif "free length" in features:
                length = float(np.linalg.norm(np.subtract(call.arguments["end"], call.arguments["start"])))
                draft.calls[i] = call.but(free_length=length * float(rng.uniform(0.95, 1.05)))


def balanced(scene, rng, spinning=()):
    """The scene in balance as its features say, and the error of a search for a balance that failed by accident.

    Where no equilibrium is found, or the search is refused, preloaded bushings hold the scene as it is.
    """
    if not scene.loaded:
        return scene, None
    searches = {"equilibrium pose", "equilibrium preloads"} & scene.features
    error = None
    if searches:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", mv.UndeterminedForceWarning)
                warnings.filterwarnings("ignore", ".*(out of line|nearly redundant)", mv.NearSingularWarning)
                model = scene.model().equilibrium(preload=True if "equilibrium preloads" in searches else None)
                return read_back(model, scene), None
        except mv.MbsvibError:
            pass
        except Exception as other:  # whatever it is, it is no answer
            error = other
        scene = replace(scene, features=scene.features - searches | {"held by bushings"})
    return held(scene, rng, spinning), error


def held(scene, rng, spinning=()):
    """The scene with the forces on its bodies, least in norm, that balance it: preloaded bushings or dead loads."""
    e = Equations(scene)
    names = list(e.origins)
    rows = np.concatenate([e.at(name, e.origins[name])[:, e.moving] @ e.N for name in names])
    unit = np.tile([1.0] * 3 + [1.0 / e.length] * 3, len(names))
    unit *= np.repeat([0.0 if name in spinning else 1.0 for name in names], 6)
    for k in range(len(names)):  # a force through the centre of what spins goes round with nothing
        unit[6 * k : 6 * k + 3] = 1.0
    if not e.dof:
        return scene
    wrench = unit * np.linalg.lstsq((rows * unit[:, None]).T, e.lacking, rcond=1e-9)[0]
    largest = max(np.abs(wrench).max(), e.largest_force)
    wrench[np.abs(wrench) < NO_FORCE * largest] = 0.0
    calls = [call for name, six in zip(names, wrench.reshape(-1, 6), strict=True) if np.abs(six).max() > 0.0
             for call in hold(name, six, e.origins[name], rotation(rng),
                              "held by loads" in scene.features or name in spinning)]  # fmt: skip
    return scene.with_calls([*scene.calls, *calls])


def hold(body, wrench, at, axes, by_load):
    """The call that puts a wrench on a body at its centre."""
    name = "hold_" + body.replace(".", "_")
    if by_load:
        return [Call("load", name, {"body": body, "force": wrench[:3]} | (
            {"torque": wrench[3:]} if wrench[3:].any() else {}))]  # fmt: skip
    preload = np.concatenate((axes.T @ wrench[:3], axes.T @ wrench[3:]))
    return [Call("bushing", name, {"first": "ground", "second": body, "position": at, "orientation": axes,
                                   "preload": preload})]  # fmt: skip
