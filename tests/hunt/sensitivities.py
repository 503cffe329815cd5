"""Derivatives of eigenvalues to one parameter of each kind of element, against differences of linearized variants."""

import numpy as np

import mbsvib as mv
from mbsvib.linalg.differences import slope
from mbsvib.mechanism.changes import scale_of
from tests.hunt.answers import Mismatch
from tests.hunt.skip import Skip

# The first step of the differences, as a share of the parameter, and of the distance to the next eigenvalue.
STEP, NEAR = 2.0**-8, 0.02
# Eigenvalues that are nearer to others than this share of their size are left out, and those that are 0 next to others.
APART, REST = 1e-4, 1e-6
# What differences leave, as a share of the slopes and of the largest eigenvalue over the step.
RTOL, ROUNDING = 1e-6, 1e-12
# Lengths, and what has no value, are measured by this.
LENGTH = 0.1


class Unlike(mv.ModelError):
    """A variant with other degrees of freedom: there is no derivative."""


def sensitivities(subject):
    """Derivatives of eigenvalues to one parameter of each kind of element: those of differences of variants."""
    system = subject.system
    values = system.modes().eigenvalues
    if subject.scene.loaded and np.any(values == 0.0):
        raise Skip("the equilibrium is one of many, and another one after each change")
    gap = (np.abs(values[:, None] - values) + np.diag(np.full(len(values), np.inf))).min(axis=1, initial=np.inf)
    clear = (gap > APART * np.abs(values)) & (np.abs(values) > REST * np.abs(values).max(initial=0.0))
    if not sum(compare(subject, name, values, gap, clear) for name in chosen(subject)):
        raise Skip("no eigenvalue apart from others, or no parameter with a derivative")


def compare(subject, name, values, gap, clear):
    """Compare the derivatives to one parameter; return whether there are any."""
    scene, system = subject.scene, subject.system
    step = STEP * (LENGTH if is_place(name) else scale_of(system.parameters, name))
    try:
        found = system.mode_sensitivities([name]).eigenvalues[0, clear]
        if not found.size or not np.isfinite(found).all():
            return False
        with np.errstate(divide="ignore"):
            step = min(step, float((NEAR * gap[clear] / np.abs(found)).min()))
        expected, error = slope(lambda change: at(scene, system, values[clear], name, change), step)
    except mv.MbsvibError:
        if has_variants(scene, system, name, step):
            raise
        return False
    allowed = 2 * RTOL * np.abs(expected) + 20 * error + 2 * ROUNDING * np.abs(values).max() / step
    off = np.abs(found - expected) / allowed
    if off.max() > 1.0:
        worst = int(np.argmax(off))
        raise Mismatch(f"the derivative of {values[clear][worst]:.6g} to '{name}' is {found[worst]:.9g}, not "
                       f"{expected[worst]:.9g}: {off[worst]:.1e} times what is allowed")  # fmt: skip
    return True


def chosen(subject):
    """One parameter of each kind of element."""
    kinds, scene, system, rng = {}, subject.scene, subject.system, subject.rng
    for name in system.parameters:
        part = system.parameters.entry(name).part
        kind = next((call.kind for call in scene.calls if call.name == part), part)
        kinds.setdefault(kind, []).append(name)
    return [str(rng.choice(names)) for names in kinds.values()]


def is_place(name):
    return any(word in name for word in (".position.", ".start.", ".end.", ".orientation."))


def variant(scene, system, name, change):
    """The eigenvalues of a model with another value, in the equilibrium that it then has; beams that are described in
    their loaded shape would bend anew on the way to it, however small the change.
    """
    there = scene.model().with_values({name: system.parameters[name] + change})
    if scene.loaded and not scene.of("beam"):
        there = there.equilibrium()
    result = there.linearize(method="dense", cut=system.cut_joints)
    if result.dof != system.dof:
        raise Unlike(f"'{name}' changes the degrees of freedom")
    return result.modes().eigenvalues


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
