"""Exports of systems with massless motions: fewer states, and rates that inputs change at once."""

import json

import jsonschema
import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
import mbsvib_export as mx
from tests.massless.scenes import along_z

S = (0.0, 0.4j, 3j)


def plant():
    """A mass and a node that a damper holds, with a force on the node."""
    springs = {"k": ("ground", "b", 2.0, 0), "k1": ("b", "node", 3.0, 0), "c": ("node", "ground", 0, 5.0)}
    model = along_z({"node": 0.0, "b": 7.0}, springs, relative=True)
    for body in ("node", "b"):
        model.add_input(f"F{body}", body, "z")
        model.add_output(f"v{body}", body, "z", quantity="velocity")
    return model.linearize()


def late():
    """The mass, on a spring whose force follows 0.1 s later, so that stiffness has both signs."""
    model = along_z({"b": 7.0}, {"k": ("ground", "b", 5.0, 6.0)})
    force = mv.Dynamic.delay(0.1).rational((0.05, 0.5))
    model.add_spring("late", "ground", "b", (0, 0, 0), (0, 0, 1), 3.0, dynamic=force)
    model.add_input("F", "b", "z")
    model.add_output("z", "b", "z")
    model.add_output("v", "b", "z", quantity="velocity")
    return model.linearize()


def answer(system, s):
    square = system.K + s * system.C + s * s * system.M
    return (system.Cq + s * system.Cv) @ np.linalg.solve(square, system.B) + system.D


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
@pytest.mark.parametrize("target", ["control", "scipy", "json", "npz"])
@pytest.mark.parametrize("make", [plant, late])
def test_responses_of_the_descriptor_equations(make, target, realization, tmp_path):
    system = make()
    if target in ("control", "scipy"):
        result = getattr(mx, f"to_{target}")(system, realization)
    elif target == "json":
        result = mx.from_json(mx.to_json(system, tmp_path / "s.json", realization)).state_space
    else:
        result = mx.from_npz(mx.to_npz(system, tmp_path / "s.npz", realization)).state_space
    assert result.A.shape == (3, 3)
    for s in S:
        response = result.C @ np.linalg.solve(s * np.eye(3) - result.A, result.B) + result.D
        assert_allclose(response, answer(system, s), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
def test_files_lead_back_to_displacements_and_rates(realization, tmp_path):
    system = plant()
    path = tmp_path / "s.json"
    mx.to_json(system, path, realization)
    jsonschema.validate(json.loads(path.read_text(encoding="utf-8")), mx.json_schema())
    for data in (mx.from_json(path), mx.from_npz(mx.to_npz(system, tmp_path / "s.npz", realization))):
        space, s = data.state_space, 0.7j
        x = np.linalg.solve(s * np.eye(3) - space.A, space.B)
        q = np.linalg.solve(data.K + s * data.C + s * s * data.M, data.B)
        assert space.through.any()
        assert_allclose(space.transform @ x + space.through, np.concatenate((q, s * q)), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("noise", [False, True])
@pytest.mark.parametrize("realization", ["physical", "modal", "balanced"])
@pytest.mark.parametrize("leak", [None, 5.0])
def test_states_of_loops_lead_back_to_rates_that_controllers_change_at_once(leak, realization, noise):
    """q' of the node is an output, (-3 + 2 s/(s + leak)) times which acts on the node."""
    law = [[-3.0]] if leak is None else mv.StateSpace.from_arrays([[-leak]], [[1.0]], [[-2.0 * leak]], [[-1.0]])
    loop = plant().feedback(law, "vnode", "Fnode", noise=noise)
    space, s = loop.state_space(realization), 0.7j
    assert space.through.shape[1] == len(loop.inputs)
    states = np.linalg.solve(s * np.eye(len(space.A)) - space.A, space.B)
    rates = (space.transform @ states + space.through)[len(space.transform) // 2 :]
    expected = loop.frequency_response([0.7])[..., 0]
    assert_allclose(loop.open_loop.Cv[:2] @ rates, expected[:2], rtol=1e-12, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_units_of_a_late_force(version, tmp_path):
    pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbsvib[fmu]'")
    system = late()
    result = mx.check_export(mx.to_fmu(system, tmp_path / "late.fmu", version).path, system, run=True)
    assert all(item.error < 1e-12 for item in result.comparisons), str(result)
    poles = np.polyadd(np.polymul([7.0, 6.0, 5.0], [0.05, 1.0]), 3.0 * np.array([-0.05, 1.0]))
    assert_allclose(np.sort_complex(system.modes().eigenvalues), np.sort_complex(np.roots(poles)), rtol=1e-12)
