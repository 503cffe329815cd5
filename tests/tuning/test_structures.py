"""Structures of controllers: equations against their transfer functions, derivatives against differences."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.errors import ModelError, ResponseError
from mbsvib.feedback.closing import transfer
from mbsvib.tuning.structures import Signals, law

S = np.array([0.3j, 2.0j, 1.0 + 5.0j])
NAMES = ("a", "b", "c")
SIZES = Signals(dict.fromkeys(NAMES, 3.0), dict.fromkeys(NAMES, 0.2))
T = mv.tunable

STRUCTURES = {
    "gain": T.gain(["a", "b"], ["a", "b", "c"]),
    "pid": T.pid("a", "b"),
    "pd": T.pid("a", "b", terms="dp"),
    "lead_lag": T.lead_lag("a", "b"),
    "notch": T.notch("a", "b"),
    "full": T.state_space(3, ["a", "b"], ["c"]),
    "modal": T.state_space(3, ["a", "b"], ["c", "b"], "modal"),
    "modal of one sensor": T.state_space(3, ["a", "b"], "c", "modal"),
    "diagonal": T.state_space(2, "a", ["c", "b"], "diagonal", feedthrough=False),
    "diagonal of one sensor": T.state_space(2, "a", "c", "diagonal"),
    "sum": T.pid("a", "b") + T.gain(["b", "a"], ["b", "c"]),
    "series": T.gain(["a", "b"], ["y", "z"]) * T.diagonal([T.pid("y", "a"), T.notch("z", "c")]),
    "shared": T.diagonal([T.pid("a", "a", name="leg"), T.pid("b", "b", name="leg"), T.gain("c", "c")]),
}


def at_random(structure, seed=0):
    known = law(structure, SIZES, 4.0)
    rng = np.random.default_rng(seed)
    values = np.array([v.size * abs(v.start + 0.3 * rng.normal()) if v.positive else
                       v.size * (v.start + 0.3 * rng.normal()) for v in known.values])  # fmt: skip
    return known, values


@pytest.mark.parametrize("name", STRUCTURES)
def test_derivatives_equal_differences(name):
    known, p = at_random(STRUCTURES[name])
    slopes = known.realized(p)[1]
    for k in range(len(p)):
        step = 1e-6 * max(abs(p[k]), 1e-3)
        x = [known.realized(p + sign * step * np.eye(len(p))[k])[0].x for sign in (1.0, -1.0)]
        np.testing.assert_allclose(slopes[k], (x[0] - x[1]) / (2.0 * step), rtol=1e-7, atol=1e-7 * np.abs(slopes).max())


@pytest.mark.parametrize(("name", "formula"), [
    ("pid", lambda s, kp, ki, kd, tau: kp + ki / s + kd * s / (tau * s + 1.0)),
    ("pd", lambda s, kd, tau, kp: kp + kd * s / (tau * s + 1.0)),
    ("lead_lag", lambda s, gain, zero, pole: gain * (s / zero + 1.0) / (s / pole + 1.0)),
    ("notch", lambda s, w, depth, width: (s**2 + 2 * depth * w * s + w**2) / (s**2 + 2 * width * w * s + w**2)),
])  # fmt: skip
def test_transfer_functions(name, formula):
    known, p = at_random(STRUCTURES[name])
    np.testing.assert_allclose(transfer(known.realized(p)[0].matrices, S)[:, 0, 0], formula(S, *p), rtol=1e-12)


def block(value, symbol, rows, columns):
    """A matrix of values whose symbols have its name, and numbers where it is no single one."""
    return np.array([[value.get(f"{symbol}[{r + 1},{c + 1}]", value.get(symbol) if rows == columns == 1 else None)
                      for c in range(columns)] for r in range(rows)])  # fmt: skip


def described(value, structure, order, outputs, inputs, s):
    """C (s - A)^-1 B + D by the names of the values."""
    a, drive = np.zeros((order, order)), np.zeros((order, 1))
    if structure == "full":
        a = block(value, "A", order, order)
    else:
        pairs = order // 2 if structure == "modal" else 0
        for k in range(pairs):
            w, damping = value[f"frequency[{k + 1}]"], value[f"damping[{k + 1}]"]
            a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[0.0, w], [-w, -2.0 * damping * w]]
            drive[2 * k + 1] = w
        for k in range(2 * pairs, order):
            drive[k] = value["pole" if structure == "modal" else f"pole[{k + 1}]"]
            a[k, k] = -drive[k, 0]
    b = drive if structure != "full" and inputs == 1 else block(value, "B", order, inputs)
    d = block(value, "D", outputs, inputs) if any(name.startswith("D") for name in value) else 0.0
    c = block(value, "C", outputs, order) if outputs * order > 1 else np.array([[value["C[1,1]"]]])
    return np.array([c @ np.linalg.solve(at * np.eye(order) - a, b.astype(complex)) + d for at in s])


@pytest.mark.parametrize("feedthrough", [True, False])
@pytest.mark.parametrize("inputs", ["a", "ab"])
@pytest.mark.parametrize("outputs", ["c", "bc"])
@pytest.mark.parametrize(("structure", "order"), [("full", 1), ("full", 3), ("modal", 1), ("modal", 4), ("modal", 5),
                                                  ("diagonal", 1), ("diagonal", 3)])  # fmt: skip
def test_state_spaces_are_those_of_their_values(structure, order, outputs, inputs, feedthrough):
    made = T.state_space(order, list(outputs), list(inputs), structure, feedthrough=feedthrough, name="k")
    known, p = at_random(made)
    value = {name.removeprefix("k."): number for name, number in zip(known.names, p, strict=True)}
    assert any(name.startswith("D") for name in value) is feedthrough
    expected = described(value, structure, order, len(outputs), len(inputs), S)
    np.testing.assert_allclose(transfer(known.realized(p)[0].matrices, S), expected, rtol=1e-11)


def test_gains_and_sums_go_from_their_sensors_to_their_actuators():
    known, p = at_random(STRUCTURES["sum"])
    value = dict(zip(known.names, p, strict=True))
    got = transfer(known.realized(p)[0].matrices, S)
    assert (known.structure.outputs, known.structure.inputs) == (("a", "b"), ("b", "c"))
    pid = value["a/b.kp"] + value["a/b.ki"] / S + value["a/b.kd"] * S / (value["a/b.tau"] * S + 1.0)
    np.testing.assert_allclose(got[:, 0, 0], pid + value["b/b.gain[2,1]"], rtol=1e-12)
    for (row, column), name in (((0, 1), "2,2"), ((1, 0), "1,1"), ((1, 1), "1,2")):
        np.testing.assert_allclose(got[:, row, column], value[f"b/b.gain[{name}]"], rtol=1e-12)


@pytest.mark.parametrize("name", [name for name in STRUCTURES if name != "notch"])  # which has the unit of its sensor
def test_starts_do_not_depend_on_units(name):
    """Of time and of each signal: K_ij at a start times sensor over actuator is the same number."""
    structure, unit = STRUCTURES[name], {"a": 1e3, "b": 0.2, "c": 7.0}
    other = Signals({n: SIZES.actuators[n] * unit[n] for n in NAMES},
                    {n: SIZES.sensors[n] * unit[n] ** 2 for n in NAMES})  # fmt: skip
    found = []
    for signals, rate in ((SIZES, 4.0), (other, 400.0)):
        known = law(structure, signals, rate)
        noise = np.random.default_rng(5).normal(size=len(known.values))
        p = np.array([v.size * (v.start * np.exp(v.spread * x) if v.positive else v.start + v.spread * x)
                      for v, x in zip(known.values, noise, strict=True)])  # fmt: skip
        k = transfer(known.realized(p)[0].matrices, S * rate / 4.0)
        to, of = ([sizes[n] for n in names] for sizes, names in ((signals.actuators, structure.outputs),
                                                                 (signals.sensors, structure.inputs)))  # fmt: skip
        found.append(k * np.array(of) / np.array(to)[:, None])
    if name == "shared":  # values of parts of one name begin where the first one does
        found = [part[:, :1, :1] for part in found]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)
    assert np.abs(found[0]).max() > 0.01


def test_series_is_the_product_of_transfer_functions_right_one_first():
    first, last = T.state_space(2, ["y", "z"], ["a", "b", "c"]), T.state_space(3, "a", ["p", "q"])
    known, p = at_random(last * first)
    inner = Signals(dict.fromkeys("yzapqbc", 1.0), dict.fromkeys("yzapqbc", 1.0))
    count = len(law(first, inner, 1.0).names)
    k1, k2 = law(last, inner, 1.0).realized(p[count:])[0], law(first, inner, 1.0).realized(p[:count])[0]
    expected = transfer(k1.matrices, S) @ transfer(k2.matrices, S)
    np.testing.assert_allclose(transfer(known.realized(p)[0].matrices, S), expected, rtol=1e-10)


def test_parts_of_one_name_share_values_and_unnamed_ones_do_not():
    assert law(STRUCTURES["shared"], SIZES, 1.0).names == ("leg.kp", "leg.ki", "leg.kd", "leg.tau", "c/c.gain")
    twice = T.notch("a", "b") * T.notch("n", "b")
    assert len(law(twice, SIZES, 1.0).names) == 6


def test_fixed_controllers_may_be_factors():
    fixed = mv.StateSpace.from_arrays([[-2.0]], [[1.0]], [[3.0]], [[0.0]], inputs=["b"], outputs=["y"])
    known, p = at_random(T.gain("a", "y") * fixed)
    np.testing.assert_allclose(transfer(known.realized(p)[0].matrices, S)[:, 0, 0], p[0] * 3.0 / (S + 2.0), rtol=1e-12)
    last = mv.StateSpace.from_arrays([[-2.0]], [[1.0]], [[3.0]], [[0.0]], inputs=["y"], outputs=["a"])
    assert (last * T.gain("y", "b")).inputs == ("b",)
    with pytest.raises(mv.ResponseError, match="acts first"):
        fixed * T.gain(["y", "z"], ["a", "b"])


@pytest.mark.parametrize(("make", "words"), [
    (lambda: T.pid(["a", "b"], "c"), "expected one of each"),
    (lambda: T.pid("a", "b", terms="px"), "some of the letters"),
    (lambda: T.state_space(0, "a", "b"), "order"),
    (lambda: T.state_space(2, "a", "b", "sparse"), "modal"),
    (lambda: T.diagonal([T.gain("a", "b"), T.gain("a", "c")]), "two controllers have the actuator 'a'"),
    (lambda: T.gain("a", "b") * T.gain(["a", "b"], "c"), "acts first and has 2 outputs"),
    (lambda: T.gain("a", "b") + 3.0, "expected what mv.tunable makes"),
    (lambda: law(T.gain("a", "b", start={"gian": 1.0}), SIZES, 1.0), "gian"),
    (lambda: law(T.gain("a", "b", bounds={"gain": (2.0, 1.0)}), SIZES, 1.0), "ascending"),
    (lambda: law(T.notch("a", "b", start={"depth": -1.0}), SIZES, 1.0), "depth"),
])  # fmt: skip
def test_refusals(make, words):
    with pytest.raises((ModelError, ResponseError), match=words):
        make()


def test_positive_bounds_move_a_start_of_the_other_sign():
    """Gains begin negative; the logarithm of a positive one was not a number there."""
    system = mv.System.from_matrices([[1.0]], [[0.1]], [[1.0]], B=[[1.0]], Cq=[[1.0]], inputs=["F"], outputs=["x"])
    design = mv.tune(system, T.gain("F", "x", bounds={"gain": (0.2, 0.5)}), [mv.goals.rms("x", {"F": 1.0})], starts=1)
    # rms^2 = S / (4 c (k - g)) is least at the lowest gain
    assert design.values["F/x.gain"] == pytest.approx(0.2, rel=1e-6)
    assert design.objective == pytest.approx(np.sqrt(1.0 / (4.0 * 0.1 * 0.8)), rel=1e-6)
