"""Machines against published figures: a bicycle, a blade that turns, one that turns in gravity, and flexures.

    OPENBLAS_NUM_THREADS=1 python benchmarks/machines.py

``weave``, ``capsize``: speeds [m/s] at which the benchmark bicycle becomes stable and unstable, of Meijaard,
Papadopoulos, Ruina & Schwab (2007). ``flapping``: lowest frequency of a cantilever on a hub, in units of
sqrt(E I / (rho A L^4)), of Wright, Smith, Thresher & Wang (1982). ``cycle``: deflection of the tip of a cantilever that
turns in gravity, without its tension, by 8 elements, over the closed form. ``notch``: bending compliance of circular
notch hinges over that of Paros & Weisbord (1965), cut at 90 degrees. ``leaf``: lateral compliance of a leaf spring over
L^3 / (12 E I).
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


def compliance(shape, direction):
    """Compliance of a flexure along z, of a force or moment at its middle."""
    model = mv.Model("held")
    model.add_body("block", 1.0, (1e-3, 1e-3, 1e-3))
    model.add_flexure("f", "ground", "block", shape, STEEL)
    model.add_input("F", "block", direction)
    model.add_output("d", "block", direction)
    return float(model.linearize().frequency_response([0.0])[0, 0, 0].real)


def notch(ratio, radius=3e-3, width=0.01):
    """Bending compliance over the closed form; ``ratio`` of the thickness to the radius."""
    beta = 0.5 * ratio
    g, s = 1 + beta, 2 * beta + beta**2
    angle = 6 * g / s**1.5 * np.arctan(np.sqrt((2 + beta) / beta))
    known = 3 / (2 * STEEL["E"] * width * radius**2 * s) * (1 / g + (3 + 2 * beta + beta**2) / (g * s) + angle)
    return compliance({"type": "notch", "radius": radius, "thickness": ratio * radius, "width": width}, "ry") / known


def leaf(length=0.05, width=0.02, thickness=5e-4):
    """Lateral compliance over the closed form."""
    shape = {"type": "leaf", "length": length, "width": width, "thickness": thickness}
    return compliance(shape, "x") * STEEL["E"] * width * thickness**3 / length**3


if __name__ == "__main__":
    for name, limits, oscillating, known in (("weave", (4, 5), True, 4.29238253634111),
                                             ("capsize", (5.5, 6.5), False, 6.02426201538837)):  # fmt: skip
        found = brentq(growth, *limits, args=(oscillating,), xtol=1e-14, rtol=1e-14)
        print(f"{name}: {found:.14f}, published {known:.14f}")
    for speed, known in FLAPPING.items():
        print(f"flapping at {speed:g}: {blade(speed):.4f}, published {known:.4f}")
    start = time.process_time()
    print(f"cycle: 1 + {tip(3.0) - 1:.1e}, {time.process_time() - start:.2f} s of CPU")
    for ratio in (0.001, 0.05, 0.4, 3.0):
        print(f"notch, thickness over radius {ratio:g}: 1 + {notch(ratio) - 1:.0e}")
    print(f"leaf: 1 + {leaf() - 1:.0e}")
