"""Sets of sensors and actuators: closed forms, Gramians and controllers by other routines, brute force, refusals."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

import mbsvib as mv
from mbsvib import isolation, library

SHAPER = isolation.shaped([0.0, 40.0], [1.0, 8.0, 100.0], 4.0)


def chain(n=6, damping=0.0):
    """n masses of 1 kg in a row, one end held; forces and displacements of all."""
    stiffness = 1e4 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    stiffness[-1, -1] = 1e4
    names = range(1, n + 1)
    return mv.System.from_matrices(np.eye(n), damping * stiffness, stiffness, np.eye(n), np.eye(n), name="chain",
                                   inputs=[f"F{k}" for k in names], outputs=[f"x{k}" for k in names])  # fmt: skip


def coupled(seed=0, n=4, sensors=7, actuators=6, unit=1.0, time=1.0):
    """A plant without symmetry; its outputs in another unit, its time in another one."""
    rng = np.random.default_rng(seed)
    root, rows = rng.standard_normal((2, n, n))
    matrices = np.eye(n) + 0.1 * root @ root.T, 0.3 * rows @ rows.T, 30.0 * np.diag(1.0 + np.arange(n)) + rows + rows.T
    b, c = rng.standard_normal((n, actuators)), rng.standard_normal((sensors, n))
    m, d, k = matrices
    return mv.System.from_matrices(m * time**2, d * time, k, b, unit * c, name="coupled")


def ports(kind, count):
    return [f"{kind}{k + 1}" for k in range(count)]


def gramian(system, kind, names):
    space = system.state_space()
    a = space.A if kind == "controlled" else space.A.T
    ends = space.B.T if kind == "controlled" else space.C
    rows = [list(space.inputs if kind == "controlled" else space.outputs).index(name) for name in names]
    return solve_continuous_lyapunov(a, -ends[rows].T @ ends[rows])


def test_chain_in_closed_form():
    # shapes sin(i theta_k), theta_k = (2 k - 1) pi / (2 n + 1), of one norm: sum over i of sin^2 = (2 n + 1) / 4
    n = 6
    i, k = np.arange(1, n + 1)[:, None], np.array([1, 2])
    share = 4.0 / (2 * n + 1) * np.sin(i * (2 * k - 1) * np.pi / (2 * n + 1)) ** 2
    result = isolation.placement(chain(n), ["x*", "F*"], sensors=1, modes=[1, 2])
    score = dict(zip(ports("x", n), np.sqrt(share.prod(axis=1)), strict=True))
    assert [one.sensors[0] for one in result.sets] == sorted(score, key=score.get, reverse=True)
    for one in result.sets:
        row = share[int(one.sensors[0][1:]) - 1]
        assert one.actuators == ()
        assert np.isclose(one.score, score[one.sensors[0]], rtol=1e-9)
        assert np.allclose([one.values["mode 1"], one.values["mode 2"]], row, rtol=1e-9)
    driven = isolation.placement(chain(n), "F*", actuators=1, modes=[1, 2])
    assert [one.actuators[0][1:] for one in driven.sets] == [one.sensors[0][1:] for one in result.sets]
    assert result.bound == result.best.score
    assert result.gap == 0.0


def test_shares_are_those_of_gramians_by_lyapunov_equations():
    system = coupled()
    result = isolation.placement(system, ["y*", "u*"], sensors=2, actuators=1, modes="*", best=200)
    assert len(result.sets) == result.count == 21 * 6
    whole = gramian(system, "observed", system.outputs), gramian(system, "controlled", system.inputs)
    for one in result.sets[::17]:
        parts = gramian(system, "observed", one.sensors), gramian(system, "controlled", one.actuators)
        ratios = [np.linalg.det(part) / np.linalg.det(all_) for part, all_ in zip(parts, whole, strict=True)]
        assert np.isclose(one.score, np.prod(ratios) ** (1 / 8), rtol=1e-8)
    scores = [one.score for one in result.sets]
    assert scores == sorted(scores, reverse=True)


def test_modes_of_one_frequency_count_together():
    hexapod = isolation.actuated(library.cubic_hexapod(damping=1.0), "platform").system
    with pytest.raises(mv.ResponseError, match="modes 1, 2, 3 have one frequency"):
        isolation.placement(hexapod, "leg*.force", sensors=3, modes=1)
    best = isolation.placement(hexapod, "leg*.force", sensors=3, modes=[1, 2, 3], best=20).sets
    assert list(best[0].values) == ["modes 1, 2, 3"]
    # the legs are edges of a cube, two in each direction: 2^3 sets of orthogonal ones have half of the information
    assert np.allclose([one.score for one in best[:8]], 0.5, rtol=1e-9)
    assert [one.sensors for one in best[:8]] == sorted(one.sensors for one in best[:8])
    assert {one.score for one in best[8:]} == {0.0}
    with pytest.raises(mv.ResponseError, match="no set of 2 sensors distinguishes modes 1, 2, 3"):
        isolation.placement(hexapod, "leg*.force", sensors=2, modes=[1, 2, 3])


def lqg_by_hand(system, sensors, actuators, noise, effort):
    """Cost, mean square of the first output and of the actuators, of the loop around plant, filter and controller."""
    space = system.state_space()
    b, c = dict(zip(space.inputs, space.B.T, strict=True)), dict(zip(space.outputs, space.C, strict=True))
    n, k = len(space.A), len(SHAPER.a)
    a = np.block([[space.A, np.outer(b["u1"], SHAPER.c[0])], [np.zeros((k, n)), SHAPER.a]])
    drive = np.concatenate((np.zeros(n), SHAPER.b[:, 0])) * np.sqrt(SHAPER.level / 2)
    force = np.concatenate((np.array([b[name] for name in actuators]).T, np.zeros((k, len(actuators)))))
    seen = np.concatenate(([c[name] for name in sensors], np.zeros((len(sensors), k))), axis=1)
    z = np.concatenate((c["y1"], np.zeros(k)))
    r, v = np.diag(effort), np.diag(noise) / 2
    back = np.linalg.solve(r, force.T @ solve_continuous_are(a, force, np.outer(z, z), r))
    inject = solve_continuous_are(a.T, seen.T, np.outer(drive, drive), v) @ seen.T @ np.linalg.inv(v)
    loop = np.block([[a, -force @ back], [inject @ seen, a - force @ back - inject @ seen]])
    into = np.block([[np.outer(drive, drive), np.zeros_like(a)], [np.zeros_like(a), inject @ v @ inject.T]])
    spread = solve_continuous_lyapunov(loop, -into)
    square, acting = z @ spread[: n + k, : n + k] @ z, np.diag(back @ spread[n + k :, n + k :] @ back.T)
    return square + acting @ effort, square, acting


def test_root_mean_squares_are_those_of_loops_closed_by_hand():
    noise, ranges = {"y*": 1e-4, "y3": 4e-4}, {"u2": 2.0, "u[3-6]": 0.5}
    result = isolation.placement(coupled(), ["y[2-5]", "u[2-5]"], sensors=2, actuators=2, rms={"y1": 1.0},
                                 floor={"u1": SHAPER}, noise=noise, ranges=ranges, best=36)  # fmt: skip
    for one in result.sets[::7]:
        densities = [4e-4 if name == "y3" else 1e-4 for name in one.sensors]
        limit = np.array([2.0 if name == "u2" else 0.5 for name in one.actuators])
        cost, square, acting = lqg_by_hand(coupled(), one.sensors, one.actuators, densities, 1.0 / limit**2)
        assert np.isclose(one.score**2, cost, rtol=1e-7)
        assert np.isclose(one.values["y1"] ** 2, square, rtol=1e-7)
        assert np.allclose([one.values[name] ** 2 for name in one.actuators], acting, rtol=1e-7)


CASES: dict[str, dict[str, Any]] = {
    "modes": {"modes": [1, 2, 3, 4]},
    "rms": {"rms": {"y1": 1.0}, "floor": {"u1": SHAPER}, "noise": {"y*": 1e-4}, "ranges": {"u*": 1.0}},
}


@pytest.mark.parametrize("case", CASES)
def test_units_do_not_change_ranks(case):
    words = {"sensors": 2, "actuators": 1, "best": 8} | CASES[case]
    plain = isolation.placement(coupled(), ["y[2-6]", "u[2-5]"], **words)
    scaled = words | {"noise": {"y*": 1e-4 * 1e6}, "ranges": words.get("ranges")}
    if case == "rms":
        scaled |= {"rms": {"y1": 1e3}}
    other = isolation.placement(coupled(unit=1e3), ["y[2-6]", "u[2-5]"], **scaled)
    assert [(one.sensors, one.actuators) for one in other.sets] == [(one.sensors, one.actuators) for one in plain.sets]
    assert np.allclose([one.score for one in other.sets], [one.score for one in plain.sets], rtol=1e-8)
    if case == "modes":
        slow = isolation.placement(coupled(time=1e3), ["y[2-6]", "u[2-5]"], **words)
        assert np.allclose([one.score for one in slow.sets], [one.score for one in plain.sets], rtol=1e-8)


@pytest.mark.few(2)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(("sensors", "actuators"), [(3, 0), (0, 3), (2, 2)])
def test_bounds_hold_against_all_sets(case, sensors, actuators):
    names = ["y[2-7]", "u[2-6]"]
    words = {"sensors": sensors, "actuators": actuators} | CASES[case]
    every = isolation.placement(coupled(3), names, best=1000, **words)
    some = isolation.placement(coupled(3), names, most=1, **words)
    assert every.exhaustive
    assert not some.exhaustive
    sign = 1.0 if some.larger else -1.0
    assert sign * some.bound >= sign * every.best.score * (1 - 1e-9 * sign)
    assert sign * some.best.score <= sign * every.best.score * (1 + 1e-9 * sign)
    assert some.gap < 0.3
    known = {(one.sensors, one.actuators): one.score for one in every.sets}
    assert all(np.isclose(one.score, known[one.sensors, one.actuators], rtol=1e-9) for one in some.sets)
    # exchanges end where no other candidate is better
    own = some.best.sensors
    for out in own:
        for into in sorted({*every.everything.sensors} - {*own}):
            swapped = tuple(sorted({*own} - {out} | {into}))
            assert sign * known[swapped, some.best.actuators] <= sign * some.best.score * (1 + 2e-6 * sign)


def test_large_sets_have_tight_bounds():
    result = isolation.placement(chain(40, 1e-4), ["x*", "F*"], sensors=5, actuators=3, modes=range(1, 7), best=3)
    assert result.count > 1e9
    assert result.tried < 2000
    assert result.gap < 0.02
    assert "No set is more than" in str(result)


def two_sliders():
    """Two masses that do not touch; the first is measured and driven twice."""
    model = mv.Model("sliders", gravity=None)
    for k, name in enumerate("ab"):
        model.add_body(name, 2.0, (1, 1, 1), position=(0, k, 0))
        model.add_joint(f"{name}.guide", "prismatic", "ground", name, position=(0, k, 0), axis=(1, 0, 0))
        model.add_spring(f"{name}.k", "ground", name, start=(-1, k, 0), end=(0, k, 0), stiffness=100.0, damping=3.0)
    for port, body in (("1", "a"), ("2", "a"), ("3", "b")):
        model.add_input(f"F{port}", body, "x")
        model.add_output(f"x{port}", body, "x")
    return model.linearize()


def test_information_about_parameters_in_closed_form():
    words = {"frequencies": [0.5, 1.0, 2.0], "noise": {"x1": 1.0, "x[23]": 3.0}, "ranges": {"F1": 1.0, "F[23]": 2.0}}
    one = isolation.placement(two_sliders(), ["x*", "F*"], sensors=1, actuators=1, parameters="a.k.stiffness", **words)
    # x1 has 1 / (1 + 1/3) of the information, F2 has 4 / (1 + 4), and they multiply; b tells nothing about a
    scores = {(s.sensors[0], s.actuators[0]): s.score for s in one.sets}
    assert np.isclose(scores["x1", "F2"], 0.75 * 0.8, rtol=1e-12)
    assert np.isclose(scores["x2", "F1"], 0.25 * 0.2, rtol=1e-12)
    assert scores["x3", "F1"] == scores["x1", "F3"] == scores["x3", "F3"] == 0.0
    assert (one.best.sensors, one.best.actuators) == (("x1",), ("F2",))
    pair = isolation.placement(two_sliders(), "x[12]", sensors=1, parameters=["a.k.stiffness", "a.k.damping"], **words)
    assert np.isclose(pair.best.values["a.k.damping"], 0.75, rtol=1e-12)
    with pytest.raises(mv.ResponseError, match=r"no set of 1 sensors distinguishes a.k.stiffness, b.k.stiffness"):
        isolation.placement(two_sliders(), "x*", sensors=1, parameters="?.k.stiffness", **words)
    with pytest.raises(mv.ResponseError, match=r"b.k.stiffness is not seen by any candidate"):
        isolation.placement(two_sliders(), "x[12]", sensors=1, parameters="?.k.stiffness", **words)


@pytest.mark.parametrize("frequencies", [[0.3], [0.4, 1.7, 2.3]])
def test_information_about_a_spring_of_two_masses(frequencies):
    """|dG/dk|^2 of each sensor, summed over frequencies, G = Z^-1 b and dG/dk = -Z^-1 e e^T Z^-1 b."""
    model = mv.Model("chain", gravity=None)
    for k, (name, mass) in enumerate((("a", 2.0), ("b", 0.5))):
        model.add_body(name, mass, (1, 1, 1), position=(float(k), 0, 0))
        model.add_joint(f"{name}.guide", "prismatic", "ground", name, position=(float(k), 0, 0), axis=(1, 0, 0))
        model.add_spring(f"{name}.k", "a" if k else "ground", name, start=(k - 1.0, 0, 0), end=(float(k), 0, 0),
                         stiffness=70.0 if k else 100.0, damping=3.0 if k else 2.0)  # fmt: skip
        model.add_output(f"x{name}", name, "x")
    model.add_input("F", "a", "x")
    result = isolation.placement(model.linearize(), "x?", sensors=1, parameters="b.k.stiffness",
                                 frequencies=frequencies)  # fmt: skip
    information = np.zeros(2)
    for w in 2 * np.pi * np.array(frequencies):
        coupling = np.array([[1.0, -1.0], [-1.0, 1.0]])
        z = (70.0 + 3.0j * w) * coupling + np.diag([100.0 + 2.0j * w - 2.0 * w * w, -0.5 * w * w])
        information += np.abs(np.linalg.solve(z, coupling @ np.linalg.solve(z, [1.0, 0.0]))) ** 2
    scores = {one.sensors[0]: one.score for one in result.sets}
    np.testing.assert_allclose([scores["xa"], scores["xb"]], information / information.sum(), rtol=1e-10)


def test_equal_sets_are_in_the_order_of_the_candidates():
    names = ["x4", "x2", "x6", "x1", "x5", "x3"]
    result = isolation.placement(chain(), names, sensors=1, modes="*")
    assert [one.sensors[0] for one in result.sets] == names  # each shows all modes alike: 13 is a prime number
    assert {row[0] for row in result.table()["rows"]} == {"1", "all"}
    large = isolation.placement(chain(), names, sensors=1, modes="*", most=1)
    assert [one.sensors[0] for one in large.sets] == names


def test_information_is_monotone_in_the_set():
    result = isolation.placement(coupled(), ["y[1-5]"], sensors=2, modes="*", best=10)
    three = isolation.placement(coupled(), ["y[1-5]"], sensors=3, modes="*", best=10)
    score = {one.sensors: one.score for one in result.sets}
    for one in three.sets:
        assert all(score[pair] < one.score < 1.0 for pair in combinations(one.sensors, 2))


def test_table_and_figure():
    result = isolation.placement(chain(), ["x*", "F*"], sensors=2, actuators=1, modes=[1, 3], best=3)
    assert str(result).splitlines()[0] == "Placement in chain, by observability and controllability of 2 modes"
    assert "All 90 sets were compared." in str(result)
    figure = result.plot()
    used = {name for one in result.sets for name in (*one.sensors, *one.actuators)}
    assert {label.get_text() for label in figure.axes[1].get_yticklabels()} == used
    assert figure.axes[0].get_ylabel().endswith("[1]")


RMS: dict[str, Any] = CASES["rms"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"sensors": 0}, "sensors = 0 and actuators = 0"),
        ({"candidates": 3}, "candidates = 3"),
        ({"candidates": "speed"}, "'speed' is neither an output nor an input of 'coupled'"),
        ({"sensors": 8}, "sensors = 8, yet the candidates have 7 outputs"),
        ({"actuators": 1, "candidates": "y*"}, "actuators = 1, yet the candidates have 0 inputs"),
        ({"modes": None}, "no criterion; expected one of"),
        ({"parameters": "k"}, "modes and parameters; expected one of"),
        ({"modes": 5}, "mode 5: 'coupled' has 4 modes"),
        ({"modes": 0}, "at least 1"),
        ({"modes": "first"}, "modes = 'first'"),
        ({"modes": []}, "no mode is named"),
        ({"floor": {"u1": 1.0}}, "floor is given; expected it with rms="),
        ({"noise": {"y1": 1.0}}, "noise has nothing for 'y2'"),
        ({"noise": {"y*": -1.0}}, r"noise of 'y\*' = -1"),
        ({"noise": 1.0}, "noise = 1.0; expected"),
        ({"modes": None, "parameters": "k", "frequencies": [1.0]}, "made of matrices and has no bodies"),
        ({"modes": None, **RMS, "noise": None}, "noise is not given"),
        ({"modes": None, "candidates": ["y*", "u*"], "actuators": 1, **RMS}, "'u1' is a candidate and has noise"),
        ({"modes": None, **RMS, "floor": {"u1": [(1.0, 1.0), (9.0, 1.0)]}}, "'u1' is not filtered white noise"),
        ({"modes": None, **RMS, "floor": None}, "floor is missing"),
        ({"modes": None, **RMS, "rms": "y1"}, "rms = 'y1'"),
        ({"modes": None, **RMS, "rms": {"y1": -1.0}}, "rms of 'y1' = -1"),  # it was called noise
    ],
)  # fmt: skip
def test_refusals(words, message):
    with pytest.raises(mv.MbsvibError, match=message):
        isolation.placement(coupled(), **({"candidates": "y*", "sensors": 1, "modes": 1} | words))


def test_motions_without_gramians_units_and_sampled_loops_are_refused():
    free = mv.System.from_matrices(np.eye(2), np.zeros((2, 2)), np.diag([0.0, 4.0]), np.eye(2), np.eye(2))
    with pytest.raises(mv.ResponseError, match="mode 1 is a rigid motion"):
        isolation.placement(free, "y*", sensors=1, modes=1)
    with pytest.raises(mv.ResponseError, match="mode 2 is not seen by any candidate"):
        isolation.placement(free, "y1", sensors=1, modes=2)
    hexapod = library.cubic_hexapod(damping=1.0).linearize()
    with pytest.raises(mv.ResponseError, match="the sensors have the units m, rad, and noise is not given"):
        isolation.placement(hexapod, ["x", "rx"], sensors=1, modes=6)
    unstable = mv.System.from_matrices(np.eye(1), -np.eye(1), np.eye(1), np.eye(1), np.eye(1))
    with pytest.raises(mv.ResponseError, match="mode 1 is unstable"):
        isolation.placement(unstable, "y*", sensors=1, modes=1)
    velocity = mv.System.from_matrices(np.eye(1), np.eye(1), np.eye(1), np.eye(1), Ca=np.eye(1))
    with pytest.raises(mv.ResponseError, match="white noise at 'u1' acts directly on 'y1'"):
        isolation.placement(velocity, "y1", sensors=1, rms={"y1": 1.0}, floor={"u1": 1.0}, noise={"y1": 1.0})


def test_closed_loops_and_state_spaces():
    system = chain(3, 1e-4)
    loop = system.feedback(mv.StateSpace.from_arrays(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[-5.0]],
                                                     inputs=["x1"], outputs=["F1"]))  # fmt: skip
    best = isolation.placement(loop, "x*", sensors=1, modes="*").best
    part, whole = (gramian(loop, "observed", names) for names in (best.sensors, loop.outputs))
    assert np.isclose(best.score, (np.linalg.det(part) / np.linalg.det(whole)) ** (1 / 6), rtol=1e-7)
    space = isolation.placement(loop.state_space(), "x*", sensors=1, modes="*")
    assert space.best.sensors == best.sensors
    assert np.isclose(space.best.score, best.score, rtol=1e-7)
