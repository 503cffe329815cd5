"""Names of states, inputs and outputs through python-control's own operations; its matrices, and the right names."""

from copy import deepcopy

import control
import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib_export import NamedStateSpace
from tests.export.plants import slider


def plant():
    return mx.to_control(library.quarter_car(suspension_damping=900.0).linearize())


def force():
    return plant()["body:z", "actuator"]


def law():
    return control.ss([[-0.5]], [[1.0]], [[-3000.0]], [[0.5]], name="law", inputs=["body:z"], outputs=["actuator"],
                      states=["integral"])  # fmt: skip


def bare(space):
    return control.StateSpace(space.A, space.B, space.C, space.D, space.dt, remove_useless_states=False)


STATES = ["hub:z", "strut:z", "d(hub:z)/dt", "d(strut:z)/dt"]
BOTH = [f"{name}_{state}" for name in ("a", "b") for state in STATES]
# operation, states of its result, inputs, outputs
OPERATIONS = {
    "index": (lambda g, k: g[0, 0], STATES, ["actuator"], ["body:z"]),
    "append": (control.append, [*STATES, "integral"], ["actuator", "body:z"], ["body:z", "actuator"]),
    "feedback": (lambda g, k: control.feedback(g, k, sign=1), [*STATES, "integral"], ["actuator"], ["body:z"]),
    "unit feedback": (lambda g, k: control.feedback(g), STATES, ["actuator"], ["body:z"]),
    "other way round": (lambda g, k: control.feedback(NamedStateSpace.of(k), g), ["integral", *STATES], ["body:z"],
                        ["actuator"]),
    "series": (lambda g, k: control.series(k, g), ["integral", *STATES], ["body:z"], ["body:z"]),
    "product": (lambda g, k: k * g, [*STATES, "integral"], ["actuator"], ["actuator"]),
    "parallel": (control.parallel, [*STATES, "integral"], ["actuator"], ["body:z"]),
    "sum": (lambda g, k: k + g, ["integral", *STATES], ["body:z"], ["actuator"]),
    "difference": (lambda g, k: g - k, [*STATES, "integral"], ["actuator"], ["body:z"]),
    "other difference": (lambda g, k: k - g, ["integral", *STATES], ["body:z"], ["actuator"]),
    "sign": (lambda g, k: control.negate(g), STATES, ["actuator"], ["body:z"]),
    "twice": (lambda g, k: 2 * g, STATES, ["actuator"], ["body:z"]),
    "half": (lambda g, k: g / 2, STATES, ["actuator"], ["body:z"]),
    "lft": (lambda g, k: control.append(g, g).lft(k), None, None, None),
    "sampled": (lambda g, k: control.c2d(g, 1e-3), STATES, ["actuator"], ["body:z"]),
}


@pytest.mark.parametrize("case", OPERATIONS)
def test_names_and_matrices(case):
    operation, states, inputs, outputs = OPERATIONS[case]
    g, k = force(), law()
    made, truth = operation(g, k), operation(bare(g), bare(k))
    s = 7.0j if made.dt == 0 else np.exp(7e-3j)
    np.testing.assert_allclose(made(s, squeeze=False), truth(s, squeeze=False), rtol=1e-12)
    assert made.dt == truth.dt
    if states is not None:
        assert (made.state_labels, made.input_labels, made.output_labels) == (states, inputs, outputs)
        assert isinstance(made, NamedStateSpace)
        assert made[0, 0].state_labels == states


def test_a_name_stands_for_its_own_state():
    """The rate of each position is the row of that name, wherever python-control puts it."""
    g, k = force(), law()
    for made in (g * k, control.series(k, g), control.feedback(g, k), g - k, k - g, g + k, k + g, k * g,
                 control.append(NamedStateSpace.of(k), g)):
        where = made.state_labels.index
        for coordinate in ("hub:z", "strut:z"):
            row = np.zeros(made.nstates)
            row[where(f"d({coordinate})/dt")] = 1.0
            assert np.array_equal(made.A[where(coordinate)], row)
        assert made.A[where("integral"), where("integral")] == -0.5


def test_systems_with_equal_names_of_states():
    one, other = force(), force()
    one.name, other.name = "a", "b"
    assert (one + other).state_labels == BOTH
    beside = control.append(one, other)
    assert (beside.state_labels, beside.name) == (BOTH, "a_b")
    assert beside.input_labels == ["a_actuator", "b_actuator"]
    assert beside.output_labels == ["a_body:z", "b_body:z"]
    other.name = "a"
    twice = one + other
    assert len(set(twice.state_labels)) == 8
    assert twice.state_labels[3:6] == ["d(strut:z)/dt", "hub:z_2", "strut:z_2"]


def test_lower_loops_keep_what_stays_open():
    g = plant()[["travel", "body:z"], ["road", "actuator"]]
    closed = g.lft(law())
    assert (closed.input_labels, closed.output_labels) == (["road"], ["travel"])
    assert closed.state_labels == [*STATES, "integral"]
    system = library.quarter_car(suspension_damping=900.0).linearize()
    w = np.array([1.0, 8.0, 60.0])
    truth = system.feedback(law()).frequency_response(w, "travel", "road")[0, 0]
    np.testing.assert_allclose(closed(1j * w), truth, rtol=1e-9)


def test_products_with_matrices_name_what_they_can():
    g = plant()[["travel", "body:z"], ["road", "actuator"]]
    mixed = np.array([[1.0, 1.0]]) * g
    assert mixed.input_labels == ["road", "actuator"]
    assert mixed.output_labels == ["y[0]"]
    assert mixed.state_labels == STATES
    assert (g * np.array([[1.0], [0.0]])).output_labels == ["travel", "body:z"]


def test_transformed_and_copied():
    g = plant()
    t = np.diag([1.0, 2.0, 4.0, 8.0])
    changed = control.similarity_transform(g, t)
    assert changed.state_labels == g.state_labels  # python-control keeps them, though they are other states
    again = mx.named(changed, g, states=True)
    assert again["travel", "road"].state_labels == STATES
    for same in (deepcopy(g), g.copy()):
        assert (same.state_labels, same.input_labels) == (g.state_labels, g.input_labels)
        assert same["travel", "road"].state_labels == STATES


def test_transfer_functions_and_data_meet_named_plants():
    g, filter = force(), control.tf([1.0], [0.01, 1.0])
    s = 5.0j
    for made in (g * filter, filter * g, control.series(filter, g), g + filter, control.feedback(g, filter)):
        assert np.isfinite(made(s))
    assert (g * filter)(s) == pytest.approx(g(s) / (0.01 * s + 1.0))
    assert (g * filter).output_labels == ["body:z"]
    filter = control.tf([1.0, 2.0], [0.01, 1.0, 3.0], name="filter")
    for made in (g * filter, control.series(filter, g), g + filter, control.feedback(g, filter), g.append(filter)):
        own = [k for k, name in enumerate(made.state_labels) if name.startswith("filter_x")]
        assert [name for name in made.state_labels if not name.startswith("filter_x")] == STATES
        assert np.linalg.eigvals(made.A[np.ix_(own, own)]) == pytest.approx(filter.poles(), rel=1e-9)
    assert g.append(filter).input_labels == ["actuator", *filter.input_labels]
    data = control.FrequencyResponseData([1.0, 2.0], [4.0, 5.0])
    assert (data * g)(5j) == pytest.approx(2.0 * g(5j))


def test_gains_without_states_and_their_time():
    gain = NamedStateSpace.of(control.ss([], [], [], [[2.0]]))
    assert (gain * force()).dt == 0
    assert (gain.nstates, (-gain).D.tolist()) == (0, [[-2.0]])


def test_loops_by_names_still_connect():
    loop = control.interconnect([plant(), law()], inputs=["road"], outputs=["travel"], check_unused=False)
    assert loop.state_labels[-1] == "law_integral"
    assert loop.state_labels[0] == "quarter_car_hub:z"


def test_named_plants_go_on_to_other_exports(tmp_path):
    g = force()
    mx.to_fmu(g, tmp_path / "g.fmu")
    mx.to_npz(control.feedback(g, law(), sign=1), tmp_path / "g.npz")
    assert mx.from_npz(tmp_path / "g.npz").states == ("hub.z", "strut.z", "d(hub.z)/dt", "d(strut.z)/dt", "integral")


def test_names_of_mbsvib_and_patterns_pick_signals():
    """``"body.z"`` is ``"body:z"`` there; python-control knows the latter only."""
    full = plant()
    part = full["body.z", "actuator"]
    assert (part.output_labels, part.input_labels) == (["body:z"], ["actuator"])
    np.testing.assert_array_equal(part.C, full["body:z", "actuator"].C)
    assert full["b*.z", "act*"].output_labels == ["body:z"]
    assert full[["body.z"], 0].output_labels == full[[0], "actuator"].output_labels == ["body:z"]
    assert full[0, :].input_labels == full.input_labels
    with pytest.raises(ValueError, match=r"output 'body.x': system .* has no such output\. Did you mean 'body:z'"):
        full["body.x", "actuator"]


@pytest.mark.parametrize(("states", "dt", "expected"), [(0, None, 0), (0, 0.1, 0.1), (0, 0, 0), (0, True, True),
                                                        (1, None, None), (1, 0.1, 0.1), (1, 0, 0), (1, True, True)])
def test_steps_are_those_of_the_system(states, dt, expected):
    """A gain of no particular time is one in continuous time: products with it would else be of no time either."""
    space = control.StateSpace(-np.eye(states), np.ones((states, 1)), np.ones((1, states)), [[2.0]], dt)
    made = NamedStateSpace.of(space)
    assert (made.dt, type(made.dt)) == (expected, type(expected))
    assert made(0.3, squeeze=True) == pytest.approx(space(0.3, squeeze=True))


def test_names_given_to_it_are_those_of_mbsvib_and_differ():
    """python-control refused dots in its own words, and kept one label of two inputs with one name."""
    space = control.ss([[-1.0]], [[1.0, 2.0]], [[1.0]], [[0.0, 0.0]])
    made = NamedStateSpace.of(space, ["leg1.f", "b"], ["leg1.x"], ["leg1.v"], "leg.1")
    assert (made.input_labels, made.output_labels, made.state_labels, made.name) == (
        ["leg1:f", "b"], ["leg1:x"], ["leg1:v"], "leg:1")  # fmt: skip
    assert made["leg1.x", "leg1.f"].B[0, 0] == 1.0
    with pytest.raises(mv.ExportError, match=r"inputs = \['a', 'a'\]; expected 2 names, none of them twice"):
        NamedStateSpace.of(space, ["a", "a"])
    with pytest.raises(mv.ExportError, match=r"name = 3; expected a text"):
        NamedStateSpace.of(space, name=3)


def test_names_with_brackets_are_names_before_they_are_patterns():
    """As a pattern ``leg[1].z`` fits ``leg1.z``, which is another output here."""
    plant = mx.to_control(slider(inputs=("F[1]", "F[2]"), outputs=("leg[1].z", "leg1.z", "leg[12].z")))
    assert plant["leg[1].z", "F[2]"].output_labels == ["leg~5B1]:z"]
    assert plant["leg[1].z", "F[2]"].input_labels == ["F~5B2]"]
    assert plant["leg[12].z", "F[1]"].output_labels == ["leg~5B12]:z"]
    assert plant["leg1.z", "F[1]"].output_labels == ["leg1:z"]
    assert plant["leg*.z", "F[[]*"].output_labels == plant["leg*:z", "*"].output_labels == plant.output_labels
    assert plant[["leg1.z", "leg*"], "F*"].output_labels == ["leg1:z", "leg~5B1]:z", "leg~5B12]:z"]
    with pytest.raises(mv.ResponseError, match=r"the pattern 'F\[3\]' picks no input"):
        plant["leg1.z", "F[3]"]
