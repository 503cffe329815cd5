"""Noise, uncertain plants and their bounds against references that share nothing with mbsvib: errors and CPU times.

python benchmarks/loops.py: residues and integrals by scipy, lifted equations written out, eigenvalues of small loops.
"""

from __future__ import annotations

import time
from itertools import pairwise, product

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm, solve_discrete_lyapunov
from scipy.optimize import brentq

import mbsvib as mv
from mbsvib import isolation


def stage(damping: float = 20.0) -> isolation.Active:
    """A cubic hexapod with an actuator and a force sensor in each leg."""
    return isolation.actuated(mv.library.cubic_hexapod(stiffness=2e5, damping=damping), "platform")


def timed(function, least: float = 0.3):
    """The result of a function, and its CPU time [s], the median of several calls."""
    result, times = None, list[float]()
    while sum(times) < least:
        began = time.process_time()
        result = function()
        times.append(time.process_time() - began)
    return result, float(np.median(times))


def slope_of(function, at: float, step: float) -> float:
    """The derivative of a function, by differences of fourth order."""
    far, near = (function(at + k * step) - function(at - k * step) for k in (2, 1))
    return float((8.0 * near - far) / (12.0 * step))


def by_residues(space, output, source):
    """The mean square under white noise of density 1, half the sum over pole pairs of -r_i r_j / (p_i + p_j)."""
    poles, right = np.linalg.eig(space.A)
    row = (space.C @ right)[space.outputs.index(output)]
    r = row * np.linalg.solve(right, space.B[:, space.inputs.index(source)].astype(complex))
    return float(-0.5 * (r[:, None] * r / (poles[:, None] + poles)).sum().real)


def noise() -> None:
    """Mean squares of a loop with integral force feedback."""
    active = stage()
    law = isolation.force_feedback(active, 120.0, leak=6.0)
    loop = active.system.feedback(law, noise=True)
    source, space = {"leg1.k.force.noise": 1.0}, loop.state_space()
    value, fast = timed(lambda: loop.rms("z", source)["z"] ** 2)
    print(f"white noise: {abs(value / by_residues(space, 'z', *source) - 1):.0e} off residues, {1e3 * fast:.1f} ms")
    band = {"leg1.k.force.noise": lambda f: np.ones_like(f)}
    there, slow = timed(lambda: loop.rms("z", band, band=(0.0, 3e3))["z"] ** 2)
    cut, _ = timed(lambda: loop.rms("z", source, band=(0.0, 3e3))["z"] ** 2)
    print(f"a function up to 3 kHz: {abs(there / cut - 1):.0e} off, {slow / fast:.0f} times as long by quadrature")

    def density(f: float) -> float:
        table = np.interp(np.log(f), np.log([1.0, 30.0, 300.0]), np.log([1e-3, 1.0, 1e-2]))
        return float(np.exp(table) * np.abs(loop.frequency_response([2 * np.pi * f], "z", "Fz")[0, 0, 0]) ** 2)

    knots = [1.0, 10.0, 25.0, 30.0, 32.0, 34.0, 40.0, 60.0, 300.0]
    exact = sum(quad(density, a, b, epsabs=0.0, epsrel=1e-11, limit=200)[0] for a, b in pairwise(knots))
    value = loop.rms("z", {"Fz": [(1.0, 1e-3), (30.0, 1.0), (300.0, 1e-2)]})["z"] ** 2
    print(f"table: {abs(value / exact - 1):.0e} off an adaptive integral")
    value = loop.budget({"Fz": 1.0}, "z").sensitivities(["leg*.k.stiffness"])["z"]["leg*.k.stiffness"]

    def at(stiffness: float) -> float:
        other = isolation.actuated(mv.library.cubic_hexapod(stiffness=stiffness, damping=20.0), "platform")
        return float(other.system.feedback(law).rms("z", {"Fz": 1.0})["z"])

    print(f"sensitivity: {abs(value / slope_of(at, 2e5, 100.0) - 1):.0e} off differences of fourth order")


def sampled(m: float = 2.0, c: float = 1.5, k: float = 800.0, gain: float = 20.0, step: float = 5e-3) -> None:
    """One mass, its velocity fed back at 200 Hz: lifted equations written out, and the integral of the density."""
    plant = mv.System.from_matrices([[m]], [[c]], [[k]], B=[[1.0]], Cq=[[1.0], [0.0]], Cv=[[0.0], [1.0]],
                                    inputs=["F"], outputs=["x", "v"])  # fmt: skip
    loop = plant.feedback([[-gain]], "v", "F").sampled(1.0 / step)
    value = loop.rms("x", {"F": 1.0})["x"] ** 2
    a, b = np.array([[0.0, 1.0], [-k / m, -c / m]]), np.array([[0.0], [1.0 / m]])
    held = np.array([[0.0, -gain]])

    def over(t: float):
        noise = expm(np.block([[-a, 0.5 * b @ b.T], [np.zeros((2, 2)), a.T]]) * t)
        drift = expm(np.block([[a, b], [np.zeros((1, 3))]]) * t)
        return drift[:2, :2] + drift[:2, 2:] @ held, noise[2:, 2:].T @ noise[:2, 2:]

    at_samples = solve_discrete_lyapunov(*over(step))
    exact = 0.0
    for x, weight in zip(*np.polynomial.legendre.leggauss(24), strict=True):
        phi, more = over(0.5 * step * (x + 1.0))
        exact += 0.5 * weight * float((phi @ at_samples @ phi.T + more)[0, 0])
    f = np.concatenate(([0.0], np.geomspace(1e-4, 2e4, 200_001)))
    area = np.trapezoid(loop.psd("x", {"F": 1.0}, f)[0], f)
    print(f"sampled: {abs(value / exact - 1):.0e} off lifted equations, the area of the density {area / exact - 1:.0e}")
    law, sources = isolation.force_feedback(stage(), 120.0, leak=6.0), {"leg*.k.force.noise": 1.0, "Fz": 1.0}

    def budget(stiffness: float):
        active = isolation.actuated(mv.library.cubic_hexapod(stiffness=stiffness, damping=20.0), "platform")
        return active.system.feedback(law, noise=True).sampled(2000.0, 2e-4).budget(sources, "z")

    here = budget(2e5)
    slopes, spent = timed(lambda: here.sensitivities()["z"])
    error = abs(slopes["leg1.k.stiffness"] * 6.0 / slope_of(lambda k: budget(k).rms["z"], 2e5, 200.0) - 1.0)
    print(f"sampled, {len(slopes)} sensitivities: {error:.0e} off differences of fourth order, {1e3 * spent:.0f} ms")


def near_poles() -> None:
    """An undamped mass whose velocity is fed back: 1 / (k - m w^2 + i w g) near the pole of the plant."""
    m, k, g = 2.0, 800.0, 3.0
    plant = mv.System.from_matrices([[m]], [[0.0]], [[k]], B=[[1.0]], Cq=[[1.0], [0.0]], Cv=[[0.0], [1.0]],
                                    inputs=["F"], outputs=["x", "v"])  # fmt: skip
    loop = plant.feedback([[-g]], "v", "F")
    w = np.sqrt(k / m) * (1.0 + np.array([0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-4]))
    exact = 1.0 / (k - m * w**2 + 1j * w * g)
    error = np.abs(loop.frequency_response(w, "x", "F")[0, 0] / exact - 1.0).max()
    print(f"response at 0 and 1e-14 to 1e-4 of a pole of the plant: {error:.0e} off")


def bounds() -> None:
    """Repetitions; robust stability and worst gains: lower and upper bounds, and a search on a grid."""
    names = "leg1.k.stiffness", "platform.mass", "leg1.lower.mass"
    print("repetitions:", mv.library.stewart().linearize().uncertain(dict.fromkeys(names, 0.1)).blocks)
    legs = {f"leg{k}.k.stiffness": 0.4 for k in range(1, 7)}
    active = stage()
    loop = active.system.uncertain(legs).feedback(isolation.force_feedback(active, 120.0, leak=0.6))
    stable, spent = timed(loop.robust_stability)
    print(f"force feedback, legs +-40 %: {stable.lower:.4f} to {stable.upper:.4f} (a leg vanishes: 2.5), {spent:.1f} s")
    worst, spent = timed(lambda: loop.worst_gain("acceleration.z", "base.z"))
    print(f"worst gain: upper/lower {worst.upper / worst.lower:.4f}, {spent:.1f} s, linearized anew "
          f"{abs(loop.at(worst.values).hinf_norm('acceleration.z', 'base.z').value / worst.lower - 1):.0e} off")
    mass = active.system.uncertain({**dict.fromkeys(legs, 0.1), "platform.mass": (9.0, 12.0)})
    gain, spent = timed(lambda: mass.worst_gain("z", "Fz"))
    corners = (mass.at(dict(zip(mass.limits, corner, strict=True))).hinf_norm("z", "Fz").value
               for corner in product(*mass.limits.values()))  # fmt: skip
    print(f"legs +-10 % and 9 to 12 kg: upper/lower {gain.upper / gain.lower:.4f}, {spent:.1f} s; "
          f"best of all corners/lower {max(corners) / gain.lower:.4f}")
    light = stage(3.5).system.uncertain(dict.fromkeys(legs, 0.1))
    rms, spent = timed(lambda: light.worst_rms("z", {"Fz": 1.0}))
    print(f"worst rms, damping ratios from 0.18 %: upper/lower {rms.upper['z'] / rms.lower['z']:.4f}, {spent:.1f} s")


def masses(stiffness: tuple[float, ...], damping: float) -> mv.System:
    """Masses of 1 kg, each on a spring and with a force."""
    model = mv.Model("masses")
    for k, value in enumerate(stiffness, start=1):
        model.add_body(f"m{k}", 1.0, (1, 1, 1), position=(k, 0, 0))
        model.add_joint(f"j{k}", "prismatic", "ground", f"m{k}", position=(k, 0, 0), axis=(0, 0, 1))
        model.add_spring(f"k{k}", "ground", f"m{k}", (k, 0, -1), (k, 0, 0), stiffness=value, damping=damping)
        model.add_input(f"F{k}", f"m{k}", "z")
        model.add_output(f"x{k}", f"m{k}", "z")
    return model.linearize()


def instability() -> None:
    """Flutter by forces across two masses, and a spring with half of its stiffness taken away: distances from both."""
    first, second, across, c = 100.0, 140.0, 15.0, 0.2

    def growth(t: float) -> float:
        k, one = np.array([[first * (1.0 + 0.5 * t), -across], [across, second]]), np.eye(2)
        return float(np.linalg.eigvals(np.block([[0.0 * one, one], [-k, -c * one]])).real.max())

    plant = masses((first, second), c).uncertain({"k1.stiffness": 0.5})
    loop = plant.feedback([[0.0, across], [-across, 0.0]], ["x1", "x2"], ["F1", "F2"])
    exact = float(brentq(growth, 0.0, 0.4, xtol=1e-14))
    stable, spent = timed(loop.robust_stability)
    print(f"flutter at {exact:.5f}: {stable.lower / exact:.4f} to {stable.upper / exact:.4f} of it, "
          f"{stable.omega:.3f} rad/s, {spent:.2f} s")  # fmt: skip
    loop = masses((100.0,), c).uncertain({"k1.stiffness": 0.99}).feedback([[50.0]], ["x1"], ["F1"])
    stable, spent = timed(loop.robust_stability)
    exact = 0.5 / 0.99
    print(f"static divergence at {exact:.5f}: {stable.lower / exact:.4f} to {stable.upper / exact:.4f} of it, "
          f"{spent:.2f} s")  # fmt: skip


def synthesis() -> None:
    """The least norms of a hexapod in other units of time and of states; needs ctrlsys (SLICOT)."""
    from mbsvib.isolation.synthesis import h2_synthesis, hinf_synthesis

    space = mv.library.cubic_hexapod(stiffness=2e5, damping=20.0).linearize().state_space("modal")
    a, b, c = space.A, space.B[:, [2]] / 1e3, space.C[[2]] * 1e6
    b, c = np.concatenate((b, np.zeros_like(b), b), axis=1), np.concatenate((c, np.zeros_like(c), c))
    d = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.1, 0.0]])
    norms: dict[str, list[float]] = {"H-infinity": [], "H2": []}
    for time_unit, state_unit in product((1e-6, 1.0, 3600.0), (1e-6, 1.0, 1e6)):
        other = a * time_unit, b * time_unit * state_unit, c / state_unit, d
        norms["H-infinity"].append(hinf_synthesis(other, 1, 1, "benchmark").norm or np.nan)
        k = h2_synthesis(other, 1, 1, "benchmark")
        gain = k.C @ np.linalg.solve(300j * time_unit * np.eye(len(k.A)) - k.A, k.B)
        norms["H2"].append(float(np.abs(gain[0, 0])))
    apart = {name: max(values) / min(values) - 1.0 for name, values in norms.items()}
    print(f"synthesis from 1 us to 1 h and over 12 decades of states: H-infinity norms {apart['H-infinity']:.0e} "
          f"apart, gains of H2 controllers {apart['H2']:.0e}")  # fmt: skip


if __name__ == "__main__":
    noise()
    sampled()
    near_poles()
    bounds()
    instability()
    try:
        synthesis()
    except mv.ExportError as error:
        print(error)
