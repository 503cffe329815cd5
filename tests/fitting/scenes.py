"""Mechanisms and simulated measurements of them, with noise of stated variance."""

import numpy as np

import mbsvib as mv


def chain(stiffness=(1e4, 2e4, 3e4), damping=(2.0, 4.0, 6.0), masses=(1.0, 2.0, 3.0), quantities=("displacement",) * 3):
    """Three masses that move along z, each held to the one before."""
    model, below = mv.Model("chain"), "ground"
    for i, (k, d, m) in enumerate(zip(stiffness, damping, masses, strict=True)):
        model.add_body(f"b{i}", m, (1, 1, 1), position=(0, 0, i + 1.0))
        model.add_joint(f"rail{i}", "prismatic", "ground", f"b{i}", axis=(0, 0, 1))
        model.add_spring(f"k{i}", below, f"b{i}", (0, 0, float(i)), (0, 0, i + 1.0), stiffness=k, damping=d)
        model.add_output(f"z{i}", f"b{i}", "z", quantity=quantities[i])
        below = f"b{i}"
    model.add_input("F", "b2", "z")
    model.add_input("F0", "b0", "z")
    return model


def measured(model, omega, relative, seed, outputs=None, inputs=None, known=True, change=None):
    """Responses of a model with noise in proportion to them, changed by a function of omega if one is given."""
    system = model.linearize()
    outputs, inputs = list(outputs or system.outputs), list(inputs or system.inputs)
    exact = system.frequency_response(omega, outputs, inputs)
    if change is not None:
        exact = exact * change(omega)
    rng = np.random.default_rng(seed)
    variance = (relative * np.abs(exact)) ** 2
    noise = np.sqrt(variance / 2.0) * (rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape))
    if not known:
        size = relative * np.abs(exact).mean(axis=(1, 2), keepdims=True)
        noise = size * noise / np.where(variance > 0.0, np.sqrt(variance), 1.0)
    return mv.Measurement(omega, exact + noise, outputs, inputs, variance=variance if known and relative else None)


def away(model, free, share, seed):
    """The model with parameters up to a share off."""
    rng = np.random.default_rng(seed)
    names = [name for pattern in free for name in model.parameters.matching(pattern)]
    return model.with_values({name: model.parameters[name] * np.exp(np.log1p(-share) * rng.uniform(-1.0, 1.0))
                              for name in names})  # fmt: skip
