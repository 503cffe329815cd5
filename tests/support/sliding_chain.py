"""Chains of sliding masses, and their frequency response in as many digits as wanted at the cost of a few products.

In the masses' absolute displacements all three matrices are tridiagonal, so 200 masses take milliseconds.
"""

import numpy as np

import mbsvib as mv
from tests.support.digits import mp


def sliding_chain(mass, stiffness, damping, inputs=(), outputs=(), base=False, free=False):
    """Masses on a rail, each joined to the one before (the first to ground unless ``free``) by a spring-damper.

    ``inputs`` numbers the masses that are pushed, ``outputs`` lists (quantity, mass).
    """
    model = mv.Model("sliding chain")
    below = "ground"
    for i, (m, k, c) in enumerate(zip(mass, stiffness, damping, strict=True)):
        name = f"b{i}"
        model.add_body(name, m, (1, 1, 1), position=(0, 0, i))
        model.add_joint(f"j{i}", "prismatic", below, name, position=(0, 0, i))
        if i or not free:
            model.add_spring(f"s{i}", below, name, (0, 0, i - 1), (0, 0, i), stiffness=k, damping=c)
        below = name
    for i in inputs:
        model.add_input(f"f{i}", f"b{i}", "z")
    if base:
        model.add_base_motion("base", "z")
    for i, (quantity, at) in enumerate(outputs):
        model.add_output(f"y{i}", f"b{at}", "z", quantity=quantity)
    return model


def chain_response(mass, stiffness, damping, s, inputs, outputs, base=False, free=False):
    """Transfer matrix (outputs, inputs) at one point s, by elimination from mass to mass in 50 digits."""
    n, s = len(mass), mp.mpmathify(s)
    link = [mp.mpf(float(k)) + s * mp.mpf(float(c)) for k, c in zip(stiffness, damping, strict=True)]
    if free:
        link[0] = mp.mpf(0)
    inertia = [s * s * mp.mpf(float(m)) for m in mass]
    pivots = []
    for i in range(n):
        pivot = inertia[i] + link[i] + (link[i + 1] if i + 1 < n else 0)
        pivots.append(pivot - link[i] ** 2 / pivots[-1] if i else pivot)
    columns = [[mp.mpf(i == at) for i in range(n)] for at in inputs]
    if base:  # in absolute motion the ground, which moves by 1 / s^2, pulls at the first spring: nothing cancels
        columns.append([link[0] / s**2 if i == 0 else mp.mpf(0) for i in range(n)])
    result = np.zeros((len(outputs), len(columns)), complex)
    for j, right in enumerate(columns):
        for i in range(1, n):
            right[i] += link[i] * right[i - 1] / pivots[i - 1]
        x = [mp.mpf(0)] * n
        for i in reversed(range(n)):
            x[i] = (right[i] + (link[i + 1] * x[i + 1] if i + 1 < n else 0)) / pivots[i]
        for row, (quantity, at) in enumerate(outputs):
            absolute = j < len(inputs) or quantity == "acceleration"
            value = x[at] if absolute else x[at] - 1 / s**2
            result[row, j] = complex(value * s ** ("displacement", "velocity", "acceleration").index(quantity))
    return result
