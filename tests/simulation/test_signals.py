"""Functions of time as inputs: pulses between samples, what cannot be resolved, and what is no number."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.simulation import signals


def slider():
    model = mv.Model("slider")
    model.add_body("b", 2.0, (0, 0, 0))
    model.add_joint("j", "prismatic", "ground", "b", axis=(1, 0, 0))
    model.add_input("F", "b", "x")
    model.add_output("v", "b", "x", quantity="velocity")
    return model


@pytest.mark.parametrize(("step", "start"), [(0.1, 0.50311), (0.01, 0.503)])
def test_the_blow_of_a_hammer_between_samples_gives_its_momentum(step, start):
    """1 ms of 1 kN makes 1 N s, wherever the samples are."""
    t = np.arange(0.0, 1.0 + step / 2, step)
    run = slider().simulate(t, {"F": lambda time: 1000.0 if start <= time < start + 1e-3 else 0.0})
    assert 2.0 * run["v"][-1] == pytest.approx(1.0, rel=2e-5)


def test_an_input_that_no_polynomials_resolve_is_warned_of(monkeypatch):
    monkeypatch.setattr(signals, "HALVINGS", 4)
    rng = np.random.default_rng(1)
    with pytest.warns(mv.errors.AccuracyWarning, match="input 'F' changes too fast to be resolved") as caught:
        slider().simulate([0.0, 0.01], {"F": lambda _: rng.normal()})
    assert caught[0].filename == __file__


def test_functions_and_values_that_are_no_numbers_are_named():
    with pytest.raises(mv.ModelError, match=r"input 'F' is a function .* whose value is no number"):
        slider().simulate([0.0, 0.01], {"F": lambda time: np.array([time, 1.0])})
    with pytest.raises(mv.errors.ResponseError, match="crossings: value = nan"):
        slider().simulate([0.0, 0.01]).crossings("v", np.nan)
