"""Chains of masses whose stiffness and mass span many decades."""

import numpy as np

import mbsvib as mv


def stiff_chain(n, stiffness_decades, mass_decades, seed=0, damped=False):
    """Sliding masses whose stiffness and mass span many decades, in random order."""
    rng = np.random.default_rng(seed)
    model = mv.Model("stress")
    below = "ground"
    k = 10.0 ** rng.permutation(np.linspace(0, stiffness_decades, n))
    m = 10.0 ** rng.permutation(np.linspace(-mass_decades / 2, mass_decades / 2, n))
    for i in range(n):
        model.add_body(f"b{i}", m[i], (m[i],) * 3, position=(0, 0, i))
        model.add_joint(f"j{i}", "prismatic", below, f"b{i}", position=(0, 0, i))
        damping = {"damping": 1e-3 * np.sqrt(k[i] * m[i]) * rng.uniform(0.1, 1)} if damped else {}
        model.add_spring(f"s{i}", below, f"b{i}", (0, 0, i - 1), (0, 0, i), stiffness=k[i], **damping)
        below = f"b{i}"
    return model
