"""Nonlinear runs of small motion compared with the linear model of the same scene."""

import numpy as np

import mbsvib as mv
from tests.hunt.answers import Mismatch
from tests.hunt.features import plan
from tests.hunt.skip import Skip

# What runs refuse, or cannot tell.
REFUSED = frozenset((
    "beam", "timoshenko beam", "beam between bodies", "beam on ground", "rayleigh damping", "modal damping",
    "superelement", "grounded superelement", "rotor on body", "spinning body", "rotating damper", "massless node",
    "massless damped node", "base rotation", "base translation", "against moving ground", "maxwell",
    "maxwell with static spring",
))  # fmt: skip
MOST = 14  # coordinates of a scene; larger ones take long
# Two amplitudes [rad, 0.3 m]: what is left over falls with the square, by 16 but for higher orders and rounding.
AMPLITUDES, FALLS = (1e-3, 2.5e-4), 8.0
RTOL, ATOL = 1e-6, 1e-9


def features(seed):
    """The features of a seed that runs take."""
    return plan(seed) - REFUSED


def runs(subject):
    """Outputs of runs from rest at displacements, at two amplitudes."""
    system, scene = subject.system, subject.scene
    if not 0 < system.dof <= MOST:
        raise Skip("no motion, or too much")
    values = subject.answers.eigenvalues
    speeds = np.sort(np.abs(values[values != 0]))
    if not len(speeds):
        raise Skip("nothing vibrates")
    end = min(4 * np.pi / speeds[len(speeds) // 2], 3.0 / max(1e-9, float(values.real.max())))
    t = np.linspace(0.0, end, 9)
    units = np.array([1.0 if unit == "rad" else 0.3 for unit in system.coordinate_units])
    q = units * subject.rng.normal(size=system.dof)
    off, size = [], []
    for amplitude in AMPLITUDES:
        start = amplitude * q
        try:
            run = scene.model().simulate(t, initial=dict(zip(system.coordinates, start.tolist(), strict=True)),
                                         tolerance=1e-10)  # fmt: skip
        except mv.ModelError as error:
            if "rotation vector" in str(error) or "no coordinate of the spanning tree" in str(error):
                raise Skip("refused") from None
            raise
        linear = system.time_response(t, np.zeros((len(system.inputs), len(t))), initial=(start, 0 * start))
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
