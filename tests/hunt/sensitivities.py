"""Derivatives of eigenvalues to one parameter of each kind of element, against differences of linearized variants."""

from functools import partial

import numpy as np

import mbsvib as mv
from mbsvib.linalg.differences import slope
from mbsvib.mechanism.changes import scale_of
from mbsvib.sensitivities.pose_motion import VariantPoses
from tests.hunt.answers import Mismatch
from tests.hunt.skip import Skip

# One scene of so many is tried: differences of variants take longer than all other comparisons together.
ONE_OF = 3
# How many parameters are tried under loads.
UNDER_LOAD = 2
# Elements of which few scenes have any: their parameters are tried first.
RARE = ("inerter", "torsion_spring", "rotor", "beam", "superelement")
# The first step of the differences, as a share of the parameter, and of the distance to the next eigenvalue.
STEP, NEAR = 2.0**-8, 0.02
# Another step, against the first.
OTHER_STEP = 0.7
# Eigenvalues that are nearer to others than this share of their size are left out, and those that are 0 next to others.
APART, REST = 1e-4, 1e-6
# What differences leave, as a share of the slopes and of the largest eigenvalue over the step.
RTOL, ROUNDING = 1e-6, 1e-12
# Lengths, and what has no value, are measured by this.
LENGTH = 0.1
# Forces by this share of the largest loads at least.
FORCE = 1e-3
# Newton's method for variants: its steps, the shares of the forces at which it ends and that may be left then (half of
# what a model in balance may leave), what no stiffness holds, and how far it may go, against the size of the mechanism.
NEWTON, BALANCED, LEFT, HELD, FAR, TINY = 12, 1e-14, 5e-10, 1e-10, 0.5, 1e-300


class Unlike(mv.ModelError):
    """A variant with other degrees of freedom: there is no derivative."""


def sensitivities(subject):
    """Derivatives of eigenvalues to one parameter of each kind of element: those of differences of variants."""
    if subject.scene.seed % ONE_OF:
        raise Skip("not this scene")
    system = subject.system
    values = system.modes().eigenvalues
    gap = (np.abs(values[:, None] - values) + np.diag(np.full(len(values), np.inf))).min(axis=1, initial=np.inf)
    clear = (gap > APART * np.abs(values)) & (np.abs(values) > REST * np.abs(values).max(initial=0.0))
    if not sum(compare(subject, name, values, gap, clear) for name in chosen(subject)):
        raise Skip("no eigenvalue apart from others, or no parameter with a derivative")


def compare(subject, name, values, gap, clear):
    """Compare the derivatives to one parameter; return whether there are any."""
    scene, system = subject.scene, subject.system
    step = STEP * measure(system, name)
    try:
        result = system.mode_sensitivities([name]).eigenvalues[0, clear]
        if not result.size or not np.isfinite(result).all():
            return False
        with np.errstate(divide="ignore"):
            step = min(step, float((NEAR * gap[clear] / np.abs(result)).min()))
        of, size = partial(at, scene, system, values[clear], name), np.abs(values).max()
        expected, error = slope(of, step)
        off = share_of_allowed(result, expected, error, size / step)
        if off.max() > 1.0:  # where rounding tells, differences with another step differ
            again, other = slope(of, OTHER_STEP * step)
            error = np.maximum(error, other) + np.abs(expected - again)
            off = share_of_allowed(result, expected, error, size / step)
    except mv.MbsvibError:
        if has_variants(scene, system, name, step):
            raise
        return False
    if off.max() > 1.0:
        worst = int(np.argmax(off))
        raise Mismatch(f"the derivative of {values[clear][worst]:.6g} to '{name}' is {result[worst]:.9g}, not "
                       f"{expected[worst]:.9g}: {off[worst]:.1e} times what is allowed")  # fmt: skip
    return True


def share_of_allowed(result, expected, error, rounding):
    return np.abs(result - expected) / (2 * RTOL * np.abs(expected) + 20 * error + 2 * ROUNDING * rounding)


def measure(system, name):
    """What the parameter is measured by."""
    if is_place(name):
        return LENGTH
    own, statics = scale_of(system.parameters, name), system.provenance.statics
    return max(own, FORCE * statics.size.max(initial=0.0)) if is_force(name) and statics is not None else own


def chosen(subject):
    """One parameter of each kind of element; of some kinds where each variant has to find its equilibrium."""
    kinds, scene, system, rng = {}, subject.scene, subject.system, subject.rng
    for name in system.parameters:
        part = system.parameters.entry(name).part
        kind = next((call.kind for call in scene.calls if call.name == part), part)
        kinds.setdefault(kind, []).append(name)
    if scene.loaded:
        order = sorted(rng.permutation(list(kinds)).tolist(), key=lambda kind: kind not in RARE)
        kinds = {kind: kinds[kind] for kind in order[:UNDER_LOAD]}
    return [str(rng.choice(names)) for names in kinds.values()]


def is_place(name):
    return any(word in name for word in (".position.", ".start.", ".end.", ".orientation."))


def is_force(name):
    return any(word in name for word in (".force.", ".torque.", ".preload"))


def variant(scene, system, name, change):
    """The eigenvalues of a model with another value, in the equilibrium that it then has."""
    there = scene.model().with_values({name: system.parameters[name] + change})
    if scene.loaded:
        there = balanced(there, VariantPoses.of(scene.model(), system.cut_joints))
    result = there.linearize(method="dense", cut=system.cut_joints)
    if result.dof != system.dof:
        raise Unlike(f"'{name}' changes the degrees of freedom")
    return result.modes().eigenvalues


def balanced(model, poses):
    """A variant in the equilibrium next to the pose of the model, stable or not: Newton's method with the tangent of
    the model. ``equilibrium`` would leave an unstable pose, and bend beams that are described in their loaded shape.
    """
    moves = VariantPoses.of(model, poses.posed_model.cut, poses.names)
    unit = 1.0 / np.sqrt(np.abs(poses.forces.tangent.diagonal()) + poses.forces.balanced_forces / poses.steps + TINY)
    tangent, motion, there = unit[:, None] * poses.forces.tangent * unit, np.zeros(len(unit)), model
    before = np.inf
    for _ in range(NEWTON):
        left = moves.residual(there)
        share = np.abs(left / (poses.forces.size + TINY)).max(initial=0.0)
        if share <= BALANCED or (share <= LEFT and share > 0.5 * before):
            return there
        before = share
        motion += unit * np.linalg.lstsq(tangent, unit * left, rcond=HELD)[0]
        if np.abs(motion / poses.steps).max(initial=0.0) > FAR:
            break
        there = moves.at(motion)
    raise mv.EquilibriumError(f"'{model.name}' has no equilibrium that Newton's method finds")


def at(scene, system, values, name, change):
    """The eigenvalues of a variant that are next to those of the scene."""
    there = variant(scene, system, name, change)
    return there[np.abs(there[:, None] - values).argmin(axis=0)]


def has_variants(scene, system, name, step):
    """Whether variants on both sides can be linearized, so that a derivative is asked for rightly."""
    try:
        for change in (step, -step):
            variant(scene, system, name, change)
    except mv.MbsvibError:
        return False
    return True
