"""Machines against published figures: a bicycle, a blade that turns, and a blade that turns in gravity.

    OPENBLAS_NUM_THREADS=1 python benchmarks/machines.py

``weave``, ``capsize``: speeds [m/s] at which the benchmark bicycle becomes stable and unstable, of Meijaard,
Papadopoulos, Ruina & Schwab (2007). ``flapping``: lowest frequency of a cantilever on a hub, in units of
sqrt(E I / (rho A L^4)), of Wright, Smith, Thresher & Wang (1982). ``cycle``: deflection of the tip of a cantilever that
turns in gravity, without its tension, by 8 elements, over the closed form.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time

import numpy as np
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib import library

STEEL = {"E": 2e11, "nu": 0.3, "rho": 7800.0}
SQUARE = {"type": "rectangle", "width": 0.005, "height": 0.005}
UNIT = 0.005 * np.sqrt(2e11 / (12 * 7800.0))
FLAPPING = {1.0: 3.6817, 2.0: 4.1373, 6.0: 7.3604, 12.0: 13.1702}


def growth(speed, oscillating):
    """The largest real part of eigenvalues of the bicycle that oscillate, or of those that do not."""
    poles = library.bicycle(speed=speed).linearize().poles()
    return max(pole.real for pole in sorted(poles, key=abs)[6:] if (abs(pole.imag) > 1e-6) == oscillating)


def blade(speed):
    model = mv.Model("blade")
    model.add_hub("hub", speed * UNIT, (0, 0, 1))
    model.add_beam("wing", "hub", None, SQUARE, STEEL, (0, 0, 0), (1, 0, 0), elements=20)
    return max(2 * np.pi * model.linearize().modes().frequencies[:2]) / UNIT


def tip(speed, samples=12):
    """Deflection of the tip over the closed form of EI w'''' - 2 W^2 rho A w = -rho A g cos W t."""
    model = mv.Model("blade", gravity=(0, -9.81, 0))
    model.add_body("hub", mass=1.0, inertia=(1e-3,) * 3)
    model.add_joint("pivot", "revolute", "ground", "hub", (0, 0, 0), axis=(0, 0, 1))
    model.add_beam("wing", "hub", None, SQUARE, STEEL, (0, 0, 0), (1, 0, 0), elements=8, second_order=False)
    cycle = model.cycle("pivot.rz", 2 * np.pi * np.arange(samples) / samples, speed=speed)
    at, angle = cycle.positions["wing.8"], cycle.angles
    sag = np.fft.rfft(np.cos(angle) * at[:, 1] - np.sin(angle) * at[:, 0])[1].real * 2 / samples
    k, mean = np.sqrt(np.sqrt(2.0) * speed / UNIT), 9.81 / (2 * speed**2)
    ends = [[1, 0, 1, 0], [0, 1, 0, 1], [-np.cos(k), -np.sin(k), np.cosh(k), np.sinh(k)],
            [np.sin(k), -np.cos(k), np.sinh(k), np.cosh(k)]]  # fmt: skip
    shape = np.linalg.solve(ends, [-mean, 0, 0, 0])
    return sag / (mean + shape @ [np.cos(k), np.sin(k), np.cosh(k), np.sinh(k)])


if __name__ == "__main__":
    for name, limits, oscillating, known in (("weave", (4, 5), True, 4.29238253634111),
                                             ("capsize", (5.5, 6.5), False, 6.02426201538837)):  # fmt: skip
        found = brentq(growth, *limits, args=(oscillating,), xtol=1e-14, rtol=1e-14)
        print(f"{name}: {found:.14f}, published {known:.14f}")
    for speed, known in FLAPPING.items():
        print(f"flapping at {speed:g}: {blade(speed):.4f}, published {known:.4f}")
    start = time.process_time()
    print(f"cycle: 1 + {tip(3.0) - 1:.1e}, {time.process_time() - start:.2f} s of CPU")
