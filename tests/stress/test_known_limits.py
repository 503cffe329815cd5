"""The limits that the README names: as large as it says, and no larger."""

import numpy as np
import pytest
from mpmath import mp, mpf

import mbsvib as mv
from tests.stress import reference
from tests.stress.families import wide
from tests.support.exact import Exact
from tests.support.random_models import add_random_ports, rotation

EPS = float(np.finfo(float).eps)


def rod(turn, ratio, tensor):
    """A slender rod that spins about its own axis on a spring of 1 N m/rad."""
    moments = np.array([1.0, 1.0 - 0.1 * ratio, ratio])
    model = mv.Model("rod")
    if tensor:
        full = turn @ np.diag(moments) @ turn.T
        model.add_body("rod", 1.0, (full + full.T) / 2)
    else:
        model.add_body("rod", 1.0, moments, orientation=turn)
    model.add_joint("spindle", "revolute", "ground", "rod", (0, 0, 0), axis=turn[:, 2])
    model.add_bushing("k", "ground", "rod", (0, 0, 0), (0, 0, 0, 1.0, 1.0, 1.0))
    return model


@pytest.mark.parametrize("ratio", [1e-2, 1e-4, 1e-6])
def test_the_small_moment_of_a_turned_tensor(ratio):
    rng = np.random.default_rng(1)
    error = {True: [], False: []}
    for _ in range(20):
        turn = rotation(rng)
        for tensor in (True, False):
            model = rod(turn, ratio, tensor)
            result = float(model.linearize().modes().natural[0])
            with mp.workdps(40):
                if tensor:
                    axis = mp.matrix([mpf(float(v)) for v in turn[:, 2]])
                    given = np.asarray(turn @ np.diag([1.0, 1.0 - 0.1 * ratio, ratio]) @ turn.T)
                    given = (given + given.T) / 2
                    moment = (axis.T * mp.matrix(given.tolist()) * axis)[0] / (axis.T * axis)[0]
                else:
                    moment = mpf(ratio)
                error[tensor].append(float(abs(result * mp.sqrt(moment) - 1)))
    assert max(error[True]) <= EPS / ratio
    assert max(error[False]) <= 2e-15


def strongly_damped(seed):
    model = wide(seed, bodies=5, damping=(1e-3, 1e6), stiffness_span=6.0, mass_span=3.0)
    centres = {"ground": np.zeros(3)} | {body.name: np.array(body.position) for body in model.bodies.values()}
    add_random_ports(model, np.random.default_rng(seed), centres, base=False)
    return model


@pytest.mark.slow
def test_tiny_terms_beside_strong_dampers():
    """Displacements have their digits, however little of what each input moves they see."""
    for seed in (2, 5, 8, 110, 114, 409):
        model = strongly_damped(seed)
        system = model.linearize()
        natural = system.modes().natural
        omega = np.array([0.3, 2.0]) * natural[[0, -1]]
        with reference.precision():
            expected = Exact(model).frequency_response(omega)
        rows = [i for i, name in enumerate(system.outputs) if name.startswith("displacement")]
        result, expected = system.frequency_response(omega)[rows], expected[rows]
        stated = np.abs(expected) > 1e-60  # the others are zeros
        assert (np.abs(result - expected)[stated] <= 1e-9 * np.abs(expected)[stated]).all()
