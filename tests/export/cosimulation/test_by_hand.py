"""All masters by hand on a plant and a controller of unlike sizes: errors, radii, energy and who is worst."""

from functools import cache

import control
import numpy as np
import pytest
from fmpy import read_model_description
from scipy.linalg import block_diag, expm

import mbsvib_export as mx

H, COUNT = 0.05, 16
SMALL = 1e-6  # of what the plant makes of forces, and shows: outputs of both sides are twelve decades apart
INPUTS, OUTPUTS = ("F", "G", "d", "y", "s", "r"), ("z", "rate", "third", "f", "g")
TAKES = {"F": "f", "G": "g", "y": "rate", "s": "third"}
EXCITED = {"d": 2.0, "r": -0.7}


def plant():
    """Three states and outputs, and a feedthrough that the controller answers a little later."""
    return control.ss(
        [[0.0, 1.0, 0.0], [-9.0, -0.5, 2.0], [0.3, 0.0, -4.0]],
        SMALL * np.array([[0, 0, 0], [1.0, 0.4, 0.7], [0, 2.0, 0]]),
        SMALL * np.array([[1.0, 0, 0], [0, 1.0, 0.5], [0.3, 0, 1.0]]),
        SMALL**2 * np.array([[0, 0, 0], [0, 0, 0], [0.2, 0, 0]]),
        inputs=["F", "G", "d"], outputs=["z", "rate", "third"], name="thing",
    )  # fmt: skip


def law():
    """Two states; f follows what it measures after a lag, g at once."""
    return control.ss(
        [[-6.0, 1.0], [0.0, -3.0]], [[1.0, 0.0, 0.2], [0.5, 1.0, 0.0]], np.array([[-8.0, 1.0], [2.0, -3.0]]) / SMALL**2,
        np.array([[0, 0, 0], [0.6, 0, 0.3]]) / SMALL**2, inputs=["y", "s", "r"], outputs=["f", "g"], name="law",
    )  # fmt: skip


PARTS = tuple(tuple(np.array(getattr(system, key)) for key in "ABCD") for system in (plant(), law()))
A, B, C, D = (block_diag(*parts) for parts in zip(*PARTS, strict=True))
K, E = np.zeros((6, 5)), np.zeros((6, 2))  # u = K y + E e
for goal, source in TAKES.items():
    K[INPUTS.index(goal), OUTPUTS.index(source)] = 1.0
E[2, 0] = E[5, 1] = 1.0
SIDES = (slice(0, 3), slice(0, 3), slice(0, 3)), (slice(3, 5), slice(3, 6), slice(3, 5))  # states, inputs, outputs


@cache
def flow(side, h):
    """States after a step from (states, inputs, their slopes)."""
    a, b, _, _ = PARTS[side]
    n, i = b.shape
    rows = np.block([[a, b, np.zeros((n, i))], [np.zeros((i, n + i)), np.eye(i)], [np.zeros((i, n + 2 * i))]])
    return expm(h * rows)[:n]


def moved(side, x, u, slope, h):
    """States and outputs of a side after a step with inputs u + slope t."""
    (_, _, c, d), (own, into, _) = PARTS[side], SIDES[side]
    end = flow(side, h) @ np.concatenate((x[own], u[into], slope[into]))
    return end, c @ end + d @ (u + h * slope)[into]


def step(method, x, y, rate, e, h):
    """States, outputs, their rates and inputs in the middle of a step of a master."""
    u, slope, x, new = K @ y + E @ e, np.zeros(6), x.copy(), y.copy()
    middle = u
    if method == "slopes":
        slope = K @ rate
        middle = u + h / 2 * slope
    if method == "iteration":
        ends, new = sweep(x, y, y, e, h, 60)
        return ends, new, rate, u + h / 2 * K @ (new - y) / h
    for side, (own, _, out) in enumerate(SIDES):
        x[own], new[out] = moved(side, x, u, slope, h)
        if method == "gauss-seidel":
            u = K @ new + E @ e
    rate = C @ (A @ x + B @ (u + h * slope)) + D @ slope
    return x, new, rate, middle


def sweep(x, y, guess, e, h, count):
    """Ends of both sides, each with inputs that run straight to the newest outputs, over and over."""
    guess, end = guess.copy(), x.copy()
    for _ in range(count):
        for side, (own, _, out) in enumerate(SIDES):
            end[own], guess[out] = moved(side, x, K @ y + E @ e, K @ (guess - y) / h, h)
    return end, guess


def start(x, e):
    y = np.linalg.solve(np.eye(5) - D @ K, C @ x + D @ E @ e)
    return y, C @ (A @ x + B @ (K @ y + E @ e))


def simulated(method, x, e, h, count):
    y, rate = start(x, e)
    rows, middles = [y], []
    for _ in range(count):
        x, y, rate, middle = step(method, x, y, rate, e, h)
        rows.append(y)
        middles.append(middle)
    return np.array(rows), np.array(middles)


def closed():
    """x' = P x + Q e, y = R x + S e of the loop."""
    inner = np.linalg.inv(np.eye(5) - D @ K)
    r, s = inner @ C, inner @ D @ E
    return A + B @ K @ r, B @ E + B @ K @ s, r, s


def exact(x, e, h, count):
    p, q, r, s = closed()
    big = expm(h * np.block([[p, (q @ e)[:, None]], [np.zeros((1, 6))]]))
    z, rows = np.append(x, 1.0), []
    for _ in range(count + 1):
        rows.append(r @ z[:5] + s @ e)
        z = big @ z
    return np.array(rows)


def radius(method):
    columns = []
    for z in np.eye(15 if method == "slopes" else 10):
        x, y, rate, _ = step(method, z[:5], z[5:10], np.append(z[10:], np.zeros(15 - len(z))), np.zeros(2), H)
        columns.append(np.concatenate((x, y, rate))[: len(z)])
    largest = np.abs(np.linalg.eigvals(np.array(columns).T)).max()
    if method == "iteration":
        guesses = [sweep(np.zeros(5), np.zeros(5), guess, np.zeros(2), H, 1)[1][3:] for guess in np.eye(5)[3:]]
        largest = max(largest, np.abs(np.linalg.eigvals(np.array(guesses).T)).max())
    return largest


@pytest.mark.slow
@pytest.mark.parametrize("excitation", [EXCITED, {}], ids=["excited", "released"])
def test_masters_by_hand(excitation, tmp_path):
    files = [mx.to_fmu(system, tmp_path / f"{side}.fmu") for side, system in (("plant", plant()), ("law", law()))]
    result = mx.check_cosimulation(*files, H, connections=TAKES, excitation=excitation, duration=COUNT * H,
                                   bonds={"F": "z", "G": "third"})  # fmt: skip
    e = np.array([excitation.get(name, 0.0) for name in EXCITED])
    x = np.zeros(5)
    if not excitation:  # at the sizes of the states that the files state
        known = [{item.name: float(item.nominal or 1.0) for item in read_model_description(str(file)).modelVariables}
                 for file in files]  # fmt: skip
        x = np.array([sizes[name] for file, sizes in zip(files, known, strict=True)
                      for name in file.names["state"].values()])  # fmt: skip
        assert len(set(x)) > 2
    assert (("start at their nominal values" in str(result)) == (not excitation))
    assert result.excitation == {name: excitation.get(name, 0.0) for name in EXCITED}
    assert result.growth == pytest.approx(np.linalg.eigvals(closed()[0]).real.max(), rel=1e-9)
    assert result.duration == pytest.approx(COUNT * H)
    for item in result.masters:
        assert item.steps == (H, H / 2, H / 4)
        for k, (found, h) in enumerate(zip(item.errors, item.steps, strict=True)):
            truth = exact(x, e, h, COUNT << k)
            rows, middles = simulated(item.method, x, e, h, COUNT << k)
            size = np.abs(truth).max(axis=0)
            errors = (np.abs(rows - truth).max(axis=0) / size)[:3]
            assert found == pytest.approx(errors.max(), rel=1e-6), (item.method, k)
            if k == 0:
                assert item.worst == OUTPUTS[errors.argmax()]
                change = np.diff(rows[:, [0, 2]], axis=0)
                forces = rows[:, 3:]  # f and g are all that F and G take
                mean = (forces[1:] + forces[:-1]) / 2 * change
                made = (middles[:, :2] * change - mean).sum() / np.abs(mean).sum()
                assert item.energy == pytest.approx(made, rel=1e-6, abs=1e-12)
        assert item.radius == pytest.approx(radius(item.method), rel=1e-6)
        assert item.difference < 1e-11
        assert item.passed
    assert [item.method for item in result.masters] == ["jacobi", "gauss-seidel", "slopes", "iteration"]
