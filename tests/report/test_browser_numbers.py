"""What the page computes in a real browser, against the core."""

import numpy as np
import pytest

import mbsvib as mv

pytest.importorskip("plotly", reason="plotly is not installed (extra 'report')")
pytestmark = pytest.mark.slow

RESPONSES = """(count) => {
  const all = responses, [low, high] = all.span, out = [];
  const omega = Array.from({length: count}, (_, k) => 2 * Math.PI * low * (high / low) ** ((k + 0.37) / count));
  all.outputs.forEach(([output], j) => all.inputs.forEach(([input], i) => {
    const pair = pairOf(all.form, j, i), negligible = all.negligible[i * all.outputs.length + j];
    out.push([output, input, negligible, omega.map((w) => responseAt(pair, w))]);
  }));
  return [omega, out];
}"""
STEPS = """(times) => responses.outputs.flatMap(([output], j) => responses.inputs.map(([input], i) => {
  const pair = pairOf(responses.form, j, i), negligible = responses.negligible[i * responses.outputs.length + j];
  const n = times.length, evenly = () => triangularSteps(pair, 0, times[n - 1], n).map((point) => point.y);
  return [output, input, negligible, pair.form.triangular ? evenly() : times.map((t) => stepAt(pair, t))];
}))"""


def critical():
    """A mass with critical damping, whose poles coincide, and a ground that moves."""
    model = mv.Model("critical")
    model.add_body("b", 2.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(1, 0, 0))
    model.add_spring("k", "ground", "b", (-1, 0, 0), (0, 0, 0), stiffness=200.0, damping=40.0)
    model.add_input("F", "b", "x")
    model.add_base_motion("ax", "x")
    for quantity in ("displacement", "velocity", "acceleration"):
        model.add_output(quantity, "b", "x", quantity=quantity)
    return model.linearize()


def defective():
    return mv.StateSpace.from_arrays([[-2, 1, 0], [0, -2, 1], [0, 0, -2]], [[0], [0], [1]], [[1, 0, 0]], 0)


def regulated():
    """A loop whose controller has a state."""
    plant = mv.library.quarter_car().linearize()
    law = mv.StateSpace.from_arrays([[-5.0]], [[1.0]], [[20.0]], 0)
    return plant.feedback(law, sensors=["body.z"], actuators=["actuator"])


SYSTEMS = {
    "stewart": lambda: mv.library.stewart(ports=("platform", "base")).linearize(),
    "isolator": lambda: mv.library.stewart_isolator().linearize(),
    "wafer stage": lambda: mv.library.wafer_stage().linearize(),
    "engine": lambda: mv.library.engine_on_mounts().linearize(),
    "critical": critical,
    "state space": lambda: mv.library.quarter_car().linearize().state_space(),
    "defective": defective,
    "loop": regulated,
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_page_computes_what_the_core_computes(look, name):
    """All pairs, between the frequencies of any grid, and their step responses: to 1e-9 of the largest value.

    Step responses within some cycles sum modes that cancel: to 1e-8 of their largest value there.
    """
    system = SYSTEMS[name]()
    page = look(system)
    omega, pairs = page.evaluate(RESPONSES, 97)
    G = system.frequency_response(np.array(omega))
    compared = 0
    for output, source, negligible, values in pairs:
        if negligible:
            continue
        expected = G[system.outputs.index(output), system.inputs.index(source)]
        values = np.array(values) @ (1.0, 1.0j)
        np.testing.assert_allclose(values, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
        compared += 1
    assert compared
    times = np.linspace(0.0, 3.0 / min(abs(system.poles()[0]), 1e4), 40)
    for output, source, negligible, values in page.evaluate(STEPS, times.tolist()):
        if negligible:
            continue
        expected = system.time_response(times, np.ones_like(times), "zero", outputs=output, inputs=source)[0]
        np.testing.assert_allclose(values, expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())
    assert page.trouble == []
