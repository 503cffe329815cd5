"""Nonlinear runs of small motion compared with the linear model of the same scene."""

import re

import numpy as np

import mbsvib as mv
from tests.hunt.answers import Mismatch
from tests.hunt.features import plan
from tests.hunt.skip import Skip

# What runs refuse, or cannot start displaced as the linear model does.
REFUSED = frozenset((
    "rotor on body", "spinning body", "rotating damper", "massless node", "massless damped node", "base rotation",
))  # fmt: skip
DRIVEN = frozenset((
    "beam", "timoshenko beam", "beam between bodies", "beam on ground", "rayleigh damping", "modal damping",
    "superelement", "grounded superelement", "maxwell", "maxwell with static spring", "base translation",
    "dynamic bushing", "dynamic bushing force", "dynamic spring", "dynamic torsion spring", "dynamic spring force",
    "against moving ground",
))  # fmt: skip
NOT_TOLD = re.compile("rotation vector|other joints hold|that a moving body carries|has no inertia|fully locked|"
                      "are coupled|no coordinate of the spanning tree")  # fmt: skip
MOST, FASTEST = 14, 1e3  # coordinates of a scene, and the spread of its eigenvalues; more take long
# Two amplitudes [rad, 0.3 m]: what is left over falls with the square, by 16 but for higher orders and rounding.
AMPLITUDES, FALLS = (1e-3, 2.5e-4), 8.0
RTOL, ATOL = 1e-5, 1e-9


def features(seed, driven=False):
    """The features of a seed that runs take, of scenes that start displaced, or of those that inputs drive."""
    return plan(seed) - REFUSED - (frozenset() if driven else DRIVEN)


def runs(subject):
    """Outputs of runs from rest, displaced or driven by all inputs, at two amplitudes."""
    system, model, rng = subject.system, subject.scene.model(), subject.rng
    if subject.scene.loaded and (model.beams or model.superelements):
        raise Skip("in equilibrium as described for the linear model, without forces for a run")
    if not 0 < system.dof <= MOST:
        raise Skip("no motion, or too much")
    values = subject.answers.eigenvalues
    speeds = np.sort(np.abs(values[values != 0]))
    if not len(speeds) or speeds[-1] > FASTEST * speeds[0]:
        raise Skip("nothing vibrates, or too fast")
    end = min(4 * np.pi / speeds[len(speeds) // 2], 3.0 / max(1e-9, float(values.real.max())))
    t = np.linspace(0.0, end, 9)
    units = np.array([1.0 if unit == "rad" else 0.3 for unit in system.coordinate_units])
    start, forces = units * rng.normal(size=system.dof), np.zeros(len(system.inputs))
    if model.beams or model.superelements or any(
        element.kind == "maxwell" or "dynamic" in element.arguments for element in subject.scene.calls
    ):
        # other coordinates, or states that do not start displaced
        forces, start = rng.normal(size=len(system.inputs)), np.zeros(system.dof)
        moved = np.abs(system.time_response(t, np.outer(forces, np.ones(9)))).max(initial=0.0)
        forces *= 1.0 / max(moved, 1e-9)
    off, size = [], []
    for amplitude in AMPLITUDES:
        q, u = amplitude * start, np.outer(amplitude * forces, np.ones(9))
        initial = dict(zip(system.coordinates, q.tolist(), strict=True)) if q.any() else None
        try:
            run = model.simulate(t, dict(zip(system.inputs, u, strict=True)), initial, tolerance=1e-10)
        except mv.ModelError as error:
            if NOT_TOLD.search(str(error)):
                raise Skip("refused") from None
            raise
        linear = system.time_response(t, u, initial=(q, 0 * q))
        names = [name for name in system.outputs if name in run.outputs]  # without what redundant joints leave open
        linear = linear[[system.outputs.index(name) for name in names]].reshape(len(names), -1)
        told = np.array([run[name] for name in names]).reshape(linear.shape)
        off.append(np.abs(told - linear).max(axis=1))
        size.append(np.abs(linear).max(axis=1))
    worst = off[1] > np.maximum(off[0] / FALLS, RTOL * size[1] + ATOL)
    if worst.any():
        i = int(np.argmax(worst))
        raise Mismatch(f"a run and the linear model differ in '{names[i]}' by {off[0][i]:.2e} of "
                       f"{size[0][i]:.2e}, and at a quarter of the amplitude by {off[1][i]:.2e}")  # fmt: skip
