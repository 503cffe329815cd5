"""The same mechanism in another pose, by the values of joint coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.expected import names
from mbsvib.equilibrium.articulation import stiffened
from mbsvib.equilibrium.bending import alone, bent
from mbsvib.equilibrium.linear_range import warn_beyond
from mbsvib.equilibrium.motion import close, same_side, smallest, stance
from mbsvib.equilibrium.moved_parts import carried
from mbsvib.equilibrium.pose import start
from mbsvib.errors import ModelError, nearest
from mbsvib.kinematics.loops import reduce
from mbsvib.kinematics.relative_motion import arm
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import span

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from mbsvib.common.arrays import Array
    from mbsvib.equilibrium.motion import Stance
    from mbsvib.equilibrium.pose import Pose

M = TypeVar("M", bound=Mechanism)

# The longest step [rad, mechanism sizes] along which loops are followed, and the shortest that is still tried.
LONGEST, SHORTEST = 0.2, 1e-5
# Loops count as closed in the end when they are open by less than this share of the mechanism's size, or by rounding.
TOLERANCE = 1e-12


def moved(
    model: M, values: Mapping[str, float], relaxed: bool = False, cut: Sequence[str] | None = None
) -> M:
    """Return the model in another pose; see ``Model.moved``.

    Parameters
    ----------
    model : Mechanism
        The model as described.
    values : mapping of str to float
        How far joint coordinates move [m, rad].
    relaxed : bool
        Whether springs keep the forces that they have as described.
    cut : sequence of str, optional
        Joints at which loops are to be cut.

    Returns
    -------
    Mechanism
        The model there.

    Raises
    ------
    ModelError
        If a coordinate is unknown or tied to the others, or loops cannot be closed there.
    """
    if not isinstance(values, Mapping):
        raise check.refuse("moved", "values", values, "a mapping of joint coordinates to values, {'hinge.rz': 0.1}")
    given = {str(name): check.number(value, "moved", str(name)) for name, value in values.items()}
    stiff = stiffened(model)
    asked = None if cut is None else tuple(names(cut, "moved", "cut", ModelError))
    try:
        return carried(model, _rigidly(stiff, given, asked), relaxed)
    except ModelError:
        if relaxed or not model.composed or not set(given) <= _all_coordinates(stiff):
            raise
        there = _bending(model, given, asked)
        if there is None:
            raise
        return there


def _rigidly(stiff: Mechanism, given: Mapping[str, float], cut: tuple[str, ...] | None) -> Pose:
    """The pose that a mechanism reaches without bending."""
    here = stance(stiff, start(stiff), _cut_elsewhere(stiff, given) if cut is None else cut)
    target = np.zeros(len(here.coordinates.names))
    for name, value in given.items():
        if name not in here.coordinates.names:
            known = here.coordinates.names
            raise ModelError(f"moved: '{name}' is no joint coordinate of model '{stiff.name}'.{nearest(name, known)} "
                             f"It has {', '.join(known[:8])}{', ...' if len(known) > 8 else ''}.",
                             element=name, field="values")  # fmt: skip
        target[here.coordinates.names.index(name)] = value
    return here.moved(target).pose if here.cuts is None else _follow(here, target, list(given)).pose


def _all_coordinates(model: Mechanism) -> set[str]:
    return {f"{joint.name}.{name}" for joint in model.joints.values() for name, _ in joint.freedom}


def _bending(model: M, given: Mapping[str, float], cut: tuple[str, ...] | None) -> M | None:
    """The model where its beams and superelements bend, or None if that does not lead to the pose either."""
    mechanism = alone(model)
    found = bent(mechanism, given, _cut_elsewhere(mechanism, given) if cut is None else cut)
    if found is None:
        return None
    there = carried(model, found[0].pose)
    warn_beyond(there, found[0], found[1].reduction)
    return there


def coordinates_of(model: Mechanism, cut: Sequence[str]) -> tuple[float, dict[str, bool]]:
    """Return the size of a mechanism, and which joint coordinates it can be moved by.

    Parameters
    ----------
    model : Mechanism
        The model as described.
    cut : sequence of str
        Joints at which loops are to be cut.

    Returns
    -------
    float
        Size [m].
    dict of str to bool
        Coordinates by name; whether each is a rotation.
    """
    stiff = stiffened(model)
    here = stance(stiff, start(stiff), cut)
    return here.size, dict(zip(here.coordinates.names, here.coordinates.turns.tolist(), strict=True))


def _follow(here: Stance, target: Array, names: list[str]) -> Stance:
    """Take the independent coordinates to their values in steps along which the loops stay closed."""
    assert here.cuts is not None
    phi = here.closure / here.cuts.row_scale(here.size)[:, None]
    arms = partial(arm, here.kinematics.topology, here.pose.centre[:-1])
    reduction = reduce(here.coordinates, here.cuts, phi, names, arms)
    depends = np.ones(len(target), dtype=bool)
    depends[reduction.independent] = False
    longest = float(np.abs(target / here.scale).max(initial=0.0))
    done, step = 0.0, min(1.0, LONGEST / max(longest, LONGEST))
    here, left = close(here, depends)
    while done < 1.0:
        share = min(step, 1.0 - done)
        independent = share * target[~depends]
        q = np.zeros(len(target))
        q[~depends] = independent
        q[depends] = _dependent(here, depends, independent)
        # a motion of the others that is many times the one asked for is a jump, or a dead point
        small = np.abs(q / here.scale).max(initial=0.0) <= 10.0 * LONGEST
        there, left = close(here.moved(q), depends) if small else (here, np.inf)
        if left <= max(TOLERANCE, there.rounding) and _near(here, there) and same_side(here, there, depends):
            here, done, step = there, done + share, min(2.0 * step, LONGEST / max(longest, LONGEST))
            continue
        step = 0.5 * share
        if step * longest < SHORTEST:
            raise _unreachable(here, target, names, done, left)
    return here


def _dependent(here: Stance, depends: NDArray[np.bool_], independent: Array) -> Array:
    """First guess of the dependent coordinates for a step of the independent ones."""
    phi = here.closure * here.scale
    right = phi[:, ~depends] @ (independent / here.scale[~depends])
    return smallest(phi[:, depends], -right) * here.scale[depends]


def _near(here: Stance, there: Stance) -> bool:
    """Tell whether no body went or turned so far in one step that it may have jumped to another way of closing."""
    turned = np.einsum("kij,kij->k", here.pose.turn, there.pose.turn)
    went = np.abs(there.pose.centre - here.pose.centre).max()
    return bool(turned.min() > 1.0 + 2.0 * np.cos(5.0 * LONGEST) and went < 5.0 * LONGEST * here.size)


def _unreachable(here: Stance, target: Array, names: list[str], done: float, left: float) -> ModelError:
    reached = ", ".join(f"{name} = {done * target[here.coordinates.names.index(name)]:.6g}" for name in names)
    loops = ", ".join(here.cuts.joints if here.cuts else ())
    open_by = f" beyond it they stay open by {left:.1e} of the mechanism's size" if np.isfinite(left) else \
        " there the other joints would have to jump"  # fmt: skip
    return ModelError(
        f"moved: the loops closed by {loops} can be followed up to {reached} and no further;{open_by}. Ask for a pose "
        f"short of it, or name another coordinate.", element=names[0] if names else None, field="values",
    )  # fmt: skip


def _cut_elsewhere(model: Mechanism, given: Mapping[str, float]) -> tuple[str, ...]:
    """Return joints to cut so that the joints of the coordinates asked for are part of the tree."""
    wanted = {name.rsplit(".", 1)[0] for name in given} & set(model.joints)
    cut: list[str] = []
    for _ in range(len(model.joints)):
        topology = span(model, cut)
        missing = [topology.joints[k] for k in topology.cut if topology.joints[k].name in wanted]
        if not missing:
            break
        up = {topology.bodies[b.body]: b for b in topology.branches}
        sides: list[list[str]] = []
        for body in (missing[0].first, missing[0].second):
            way: list[str] = []
            while body in up:
                branch = up[body]
                way.append(topology.joints[branch.joint].name if branch.joint >= 0 else "")
                body = topology.bodies[branch.parent] if branch.parent < len(topology.bodies) else "ground"
            sides.append(way)
        loop = [name for name in sides[0] + sides[1] if name and (name in sides[0]) != (name in sides[1])]
        other = [name for name in loop if name not in wanted]
        if not other:
            name = missing[0].name
            raise ModelError(f"moved: all joints of the loop that '{name}' closes have a value; leave one of them to "
                             f"follow from the others.", element=name, field="values")  # fmt: skip
        cut.append(max(other, key=lambda name: len(model.joints[name].freedom)))
    return tuple(cut)


