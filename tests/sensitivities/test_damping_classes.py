"""Derivatives in each class of damping against differences of first-order equations written by hand."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

import mbsvib as mv
from tests.support.compare import nearest_pairs
from tests.support.damping_classes import (
    CLASSES,
    UNDAMPED_OR_FREE,
    by_hand,
    frequency_response,
    model,
    slope,
    time_response,
)

OMEGA = np.array([5.0, 23.0, 60.0])
T = np.array([0.0, 0.03, 0.1, 0.2, 0.25, 0.7])
# values repeat, or all but: a defective pair, three pairs on one circle
REPEATED = ("critical", "defective", "free", "free and coupled", "braked", "two brakes", "free and braked")
APART = [name for name in CLASSES if name not in REPEATED]


@pytest.fixture(scope="module", params=CLASSES)
def case(request):
    """Parameters, system, names, and what rounding leaves of differences."""
    p = CLASSES[request.param]
    system = model(p).linearize()
    names = [name for name in p if name in system.parameters]  # a damper of 0 is one too
    return p, system, names, 3e-4 if request.param == "strong damper" else 1e-6


def assert_close(result, expected, rtol):
    size = np.abs(expected).max(axis=-1, keepdims=True)
    assert (np.abs(result - expected) <= rtol * size + 1e-9 * size.max()).all()


@pytest.mark.few(4)
def test_frequency_responses(case):
    p, system, names, rtol = case
    result = system.frequency_response_sensitivities(OMEGA, names)
    for k, name in enumerate(names):
        assert_close(result[k], slope(lambda q: frequency_response(q, OMEGA), p, name), rtol)


@pytest.mark.few(2)
def test_time_responses_from_moving_starts(case):
    p, system, names, rtol = case
    rng = np.random.default_rng(1)
    u = rng.normal(size=(2, len(T)))
    q, rate = rng.normal(size=(2, system.dof))
    for hold in ("first", "zero"):
        result = system.time_response_sensitivities(T, u, names, hold, (q, rate))

        def answer(p, hold=hold):
            state = [q, rate]
            if "mx.stiffness" in p:
                state = [q[:3], rate[:3], [p["mx.stiffness"] * (q[2] - q[0] + q[3])]]
            return time_response(p, T, u, hold, state)

        for k, name in enumerate(names):
            assert_close(result[k], slope(answer, p, name), rtol)


@pytest.mark.few(3)
@pytest.mark.parametrize("name", APART)
def test_eigenvalues(name):
    p = CLASSES[name]
    system = model(p).linearize()
    names = [name for name in p if name in system.parameters]
    values = system.modes().eigenvalues
    result = system.eigenvalue_sensitivities(names)
    for k, name in enumerate(names):
        expected = slope(lambda p: nearest_pairs(np.linalg.eigvals(by_hand(p)[0]), values)[0], p, name)
        order = [int(np.flatnonzero(values == v)[0]) for v in nearest_pairs(values, values)[0]]
        size = np.abs(expected).max()
        assert (np.abs(result[k, order] - expected) <= 1e-6 * np.abs(expected) + 1e-6 * size).all()


@pytest.mark.few(2)
@pytest.mark.parametrize("name", [name for name in CLASSES if name not in UNDAMPED_OR_FREE])
def test_norms(name):
    """H2 by the Lyapunov equation; the peak by the response at its frequency, which the peak does not change with."""
    p = CLASSES[name]
    system = model(p).linearize()
    names = [name for name in p if name in system.parameters]
    total, peak = (norm(outputs="velocity", parameters=names) for norm in (system.h2_norm, system.hinf_norm))

    def rms(p):
        a, b, c, _ = by_hand(p)
        return np.sqrt(c[1] @ solve_continuous_lyapunov(a, -b @ b.T) @ c[1])

    def highest(p):
        return np.linalg.norm(frequency_response(p, [peak.omega])[1])

    for norm, of in ((total, rms), (peak, highest)):
        expected = np.array([slope(of, p, name, 3e-6) for name in names])
        assert np.abs(norm.slopes - expected).max() <= 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["spinning", "spinning and damped", "coupled"])
def test_eigenvalues_of_two_equal_mechanisms(name):
    """Every eigenvalue is there twice; a parameter of the second mechanism moves one of the two as if it were alone."""
    p = CLASSES[name]
    twin = mv.Model("two")
    both = ((0, ""), (1, "2"))
    for k, end in both:
        if "spin.speed" in p:
            twin.add_body(f"wheel{end}", 1.0, (p["wheel.inertia.xx"], p["wheel.inertia.yy"], 0.6))
            twin.add_joint(f"tilt{end}", "universal", "wheel" if k else "ground", f"wheel{end}", (0, 0, 0))
            twin.add_bushing(f"k{end}", "ground", f"wheel{end}", (0, 0, 0), (0, 0, 0, 30.0, 50.0, 0),
                             (0, 0, 0, p["k.damping.rx"], 0, 0))  # fmt: skip
            twin.add_rotor(f"spin{end}", f"wheel{end}", 9.0, (0, 0, 1), inertia=0.6)
        else:
            for i in range(3):
                twin.add_body(f"b{i}{end}", p[f"b{i}.mass"], (1.0, 1.0, 1.0), (i + 1.0, 0, 0))
                twin.add_joint(f"j{i}{end}", "prismatic", "b0" if k else "ground", f"b{i}{end}", axis=(1, 0, 0))
            names = ("ground", f"b0{end}", f"b1{end}", f"b2{end}", "ground")
            for i in range(4):
                twin.add_spring(f"s{i}{end}", names[i], names[i + 1], (float(i), 0, 0), (i + 1.0, 0, 0),
                                stiffness=p[f"s{i}.stiffness"], damping=p[f"s{i}.damping"])  # fmt: skip
    system, single = twin.linearize(), model(p).linearize()
    values, own = system.modes().eigenvalues, single.modes().eigenvalues
    for parameter in ("wheel.inertia.xx", "k.stiffness.ry", "spin.speed") if "spin.speed" in p else (
        "b1.mass", "s1.damping", "s2.stiffness"):  # fmt: skip
        part, _, field = parameter.partition(".")
        result = system.eigenvalue_sensitivities(f"{part}2.{field}")[0]
        expected = single.eigenvalue_sensitivities(parameter)[0]
        for value, slope_there in zip(own, expected, strict=True):
            pair = sorted(result[np.abs(values - value) <= 1e-9 * np.abs(value)], key=abs)
            assert len(pair) == 2
            size = np.abs(expected).max()
            assert abs(pair[0]) <= 1e-8 * size
            assert abs(pair[1] - slope_there) <= 1e-8 * size
