"""Six decentral controllers of the Stewart platform, 30 values, against the least H-infinity norm of any controller.

python benchmarks/tuned.py [starts [seed]]: forces and displacements along the axes, each of unit static gain; cost of
commands 0.3, noise of sensors 0.05, where no controller reaches less than 0.392709. Beside it the norm of a controller
of full order, within 1 % of the least (SLICOT, in ctrlsys).
"""

from __future__ import annotations

import sys
import time

import numpy as np

import mbsvib as mv

COST, NOISE = 0.3, 0.05
AXES = range(1, 7)


def plant() -> mv.StateSpace:
    """Displacements and costs of commands by forces, noise and commands."""
    space = mv.library.stewart().linearize().state_space("modal")
    static = -space.C @ np.linalg.solve(space.A, space.B)
    unit = 1.0 / np.sqrt(np.diag(static))
    b, c, n = space.B * unit, unit[:, None] * space.C, len(space.A)
    one, none = np.eye(6), np.zeros((6, 6))
    d = np.block([[none, none, none], [none, none, COST * one], [none, NOISE * one, none]])
    outputs, inputs = ([f"{kind}{k}" for kind in kinds for k in AXES]
                       for kinds in (("y", "cost", "seen"), ("force", "noise", "u")))  # fmt: skip
    return mv.StateSpace.from_arrays(space.A, np.concatenate((b, np.zeros((n, 6)), b), axis=1),
                                     np.concatenate((c, np.zeros((6, n)), c)), d, outputs=outputs, inputs=inputs)


def tuned(starts: int = 1, seed: int = 0) -> mv.tuning.Design:
    """Tune six controllers: oscillators with feedthrough."""
    law = mv.tunable.diagonal([mv.tunable.state_space(2, f"u{k}", f"seen{k}", "modal") for k in AXES])
    return mv.tune(plant(), law, mv.goals.hinf(["y?", "cost?"], ["force?", "noise?"]), starts=starts, seed=seed,
                   workers=1)


if __name__ == "__main__":
    began = time.process_time()
    design = tuned(*map(int, sys.argv[1:]))
    print(design)
    print(f"{len(design.values)} values, norm {design.objective:.6f}, {time.process_time() - began:.0f} s of CPU")
    print("searches end at", ", ".join(f"{history[-1]:.4f}" for history in design.history))
    try:
        from mbsvib.isolation.synthesis import hinf_synthesis

        space = plant()
        print("full order:", hinf_synthesis((space.A, space.B, space.C, space.D), 6, 6, "benchmark").norm)
    except mv.ExportError as error:
        print(error)
