"""Which modes of a plant no controller can change, as no actuator reaches or no sensor sees them.

Source: Hautus' test, Zhou, Doyle & Glover, Robust and Optimal Control (1996), theorem 3.1: rank [A - s, B] at poles s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mbsvib.linalg.spectrum import spectrum
from mbsvib.random.mean_squares import first_order

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Complex
    from mbsvib.tuning.scene import Scene

# A singular value of [A - s, B], states scaled, below this share of its largest is none: poles and shapes are known to
# some roundings times the condition of their eigenvectors.
UNREACHED = 1e-9


def unreached(scene: Scene) -> list[str]:
    """Return the modes, in words, that do not decay and that no actuator reaches or no sensor sees."""
    space = first_order(scene.system)
    y = [scene.system.outputs.index(name) for name in scene.sensors]
    u = [scene.system.inputs.index(name) for name in scene.actuators]
    a, b, c = space.A / scene.rate, _unit(space.B[:, u]), _unit(space.C[y].T).T
    of_a = spectrum(a)
    result = {}
    for value in of_a.values[~of_a.decaying]:
        if value.imag < 0.0:
            continue
        words = _words(value * scene.rate)
        if _deficient(a, b, value):
            result[words] = f"no actuator reaches {words}"
        elif _deficient(a.T, c.T, value):
            result[words] = f"no sensor sees {words}"
    return list(result.values())


def _unit(matrix: Array) -> Array:
    """Columns of a matrix of unit size, those of nothing 0."""
    size = np.linalg.norm(matrix, axis=0)
    return np.asarray(matrix / np.where(size > 0.0, size, 1.0))


def _deficient(a: Array, b: Array, value: complex) -> bool:
    matrix: Complex = np.concatenate((a - value * np.eye(len(a)), b), axis=1)
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return bool(sizes[-1] <= UNREACHED * sizes[0])


def _words(pole: complex) -> str:
    hertz = abs(pole.imag) / (2.0 * np.pi)
    return f"the mode at {hertz:.4g} Hz" if hertz > UNREACHED else "a rigid-body mode at 0 Hz"
