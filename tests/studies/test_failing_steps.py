"""Optimisation that goes on where a step leads to no response, or a method fails."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import studies as st
from tests.support.sizes import few


def frame():
    """A frame whose centre of mass is beside the middle of its four mounts."""
    model = mv.Model("frame")
    model.add_body("frame", 120.0, (4, 6, 8), position=(0.05, 0.02, 0.4))
    for k, (x, y) in enumerate([(0.4, 0.3), (-0.4, 0.3), (-0.4, -0.3), (0.4, -0.3)], 1):
        model.add_bushing(f"m{k}", "ground", "frame", position=(x, y, 0.25), stiffness=(5e4, 5e4, 1e5, 0, 0, 0),
                          damping=(50, 50, 100, 0, 0, 0))
    model.add_input("F", "frame", "z")
    model.add_output("rx", "frame", "rx")
    model.add_output("ry", "frame", "ry")
    return model


PLACES = {f"m{k}.position.{axis}": (-size, size) for k in (1, 2, 3, 4) for axis, size in (("x", 0.5), ("y", 0.35))}


@pytest.mark.slow
def test_steps_to_where_there_is_no_response_are_shortened():
    """The first step leads all mounts into one corner, where the frame is free to turn."""
    best = mv.optimize(frame(), PLACES, st.gain(["rx", "ry"], "F", 0.0) ** 2)
    assert best.success
    for axis, centre in (("x", 0.05), ("y", 0.02)):
        assert np.mean([best.values[f"m{k}.position.{axis}"] for k in (1, 2, 3, 4)]) == pytest.approx(centre, abs=1e-5)


WIDTH = [st.variable(f"m{a}.position.x") - st.variable(f"m{b}.position.x") <= 0.7 for a, b in ((1, 2), (4, 3))]


@pytest.mark.slow
@pytest.mark.parametrize("seed", few([0, 1], 1))
def test_success_at_a_kink_does_not_depend_on_rounding(seed):
    """Two frequencies coincide at the optimum, where their gradients turn; SLSQP itself stops beside it or at it."""
    model = frame()
    factors = 1.0 + 1e-12 * np.random.default_rng(seed).standard_normal(len(PLACES)) * (seed > 0)
    moved = {name: model.parameters[name] * factor for name, factor in zip(PLACES, factors, strict=True)}
    best = mv.optimize(model.with_values(moved), PLACES, -st.smallest(st.frequency()), WIDTH)
    assert best.success
    assert best.optimality < 1e-4
    assert best.objective == pytest.approx(-6.15961, rel=2e-5)
    first, second = best.model.linearize().modes().frequencies[:2]
    assert first == pytest.approx(second, rel=1e-4)


def test_search_that_stops_before_a_kink_is_not_called_optimal():
    best = mv.optimize(frame(), PLACES, -st.smallest(st.frequency()), WIDTH, options={"maxiter": 4})
    assert not best.success
    assert best.optimality > 1e-3
