"""Laws by synthesis: closed forms, python-control's Riccati solutions, and what is refused."""

import sys

import control
import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library
from tests.isolation.scenes import MASS, active_strut, relaxing_hexapod


def plant(**words):
    return isolation.actuated(active_strut(**words), "payload", "leg", directions="z")


def test_lqg_against_python_control():
    p = plant(damping=60.0)
    sensors, effort, base, noise = ["leg.acceleration", "leg.stroke"], 1e-3, 0.7, 1e-5
    law = isolation.lqg(p, sensors, effort, base, noise)
    space = p.system.state_space("modal")
    y = [space.outputs.index(name) for name in sensors]
    z, u, w = space.outputs.index("acceleration.z"), space.inputs.index("leg.actuator"), space.inputs.index("base.z")
    a, b, bw = space.A, space.B[:, [u]], space.B[:, [w]]
    c, d, dw = space.C[y], space.D[y][:, [u]], space.D[y][:, [w]]
    cz, dz = space.C[[z]], space.D[[z]][:, [u]]
    back = control.lqr(a, b, cz.T @ cz, dz.T @ dz + effort, cz.T @ dz)[0]
    # noise of base and sensors correlates, as accelerometers feel the base: by duality
    inject = control.lqr(a.T, c.T, base * bw @ bw.T, base * dw @ dw.T + noise * np.eye(2), base * bw @ dw.T)[0].T
    exact = control.ss(a - b @ back - inject @ (c - d @ back), inject, -back, 0)
    s = 1j * np.geomspace(1.0, 1e4, 20)
    ours = law.at(s)
    theirs = np.moveaxis(exact(s), 2, 0)
    assert np.allclose(ours, theirs, rtol=1e-7, atol=1e-9 * np.abs(theirs).max())


def test_cheap_position_control_of_a_mass_in_closed_form():
    # u = -k1 x - k2 v with k1 = m (sqrt(w^4 + r) - w^2), r = 1 / (m^2 effort): poles s^4 + 2 w^2 s^2 + w^4 + r = 0
    p, effort = plant(), 1e-9
    law = isolation.lqg(p, ["leg.stroke", "leg.rate"], effort, noise=1e-16, performance=["displacement.z"])
    square = 1.2e5 / MASS
    root = np.roots([1, 0, 2 * square, 0, square**2 + 1 / (MASS**2 * effort)])
    loop = p.with_gains(law)
    exact = root[root.real < 0]
    result = loop.poles()
    assert all(np.abs(result - pole).min() <= 1e-6 * abs(pole) for pole in exact)


@pytest.mark.slow
def test_lqg_on_the_platform_beats_the_open_loop():
    p = isolation.actuated(library.stewart(), "platform")
    f = np.geomspace(10.0, 5000.0, 200)
    law = isolation.lqg(p, p.names("acceleration"), 1e-4)
    loop = p.with_gains(law)
    assert loop.stable
    assert loop.isolation(f).amplification < 0.1 * p.isolation(f).amplification
    assert len(law.A) == 12


@pytest.mark.parametrize("noise", [1e-10, 1e-6, 1e-2])
def test_lqg_of_modes_that_coincide(noise):
    """A cubic hexapod is alike along three axes: each eigenvalue is there several times but for rounding."""
    p = isolation.actuated(relaxing_hexapod(), "platform")
    controller = isolation.lqg(p, p.names("acceleration"), 1e-4, noise=noise)
    assert p.with_gains(controller).stable


def test_what_is_refused():
    p = plant()
    with pytest.raises(mv.ResponseError, match="effort = 0"):
        isolation.lqg(p, ["leg.rate"], 0.0)
    with pytest.raises(mv.ResponseError, match=r"leg\.rat"):
        isolation.lqg(p, ["leg.rat"], 1.0)


def test_hinf_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "ctrlsys", None)
    with pytest.raises(mv.ExportError, match=r'pip install "mbsvib\[ctrlsys\]", or use lqg'):
        isolation.hinf(plant(), ["leg.rate"], 1.0)


def test_hinf_keeps_the_norm_that_it_tells():
    pytest.importorskip("ctrlsys")
    p = plant(damping=60.0)
    effort, noise = 1e-2, 1e-3
    law, norm = isolation.hinf(p, ["leg.acceleration"], effort, noise)
    loop = p.with_gains(law)
    assert loop.stable
    f = np.geomspace(0.1, 1e3, 4000)
    assert loop.isolation(f).amplification <= norm * (1 + 1e-6)
    assert loop.isolation(f).amplification < p.isolation(f).amplification


def test_hinf_of_the_hexapod():
    """24 states, six sensors and actuators; no controller does better than 1 at high frequencies."""
    pytest.importorskip("ctrlsys")
    p = isolation.actuated(library.stewart_isolator(), "platform")
    law, norm = isolation.hinf(p, p.names("acceleration"), 1e-2)
    loop = p.with_gains(law)
    assert loop.stable
    f = np.geomspace(0.1, 1e3, 2000)
    assert loop.isolation(f).amplification <= norm * (1 + 1e-6)
    assert loop.isolation(f).amplification < 0.5 * p.isolation(f).amplification


def test_hinf_without_a_solution_is_refused():
    pytest.importorskip("ctrlsys")
    p = isolation.actuated(library.stewart(), "platform")
    with pytest.raises(mv.ResponseError, match="Effort or noise may be too small"):
        isolation.hinf(p, p.names("acceleration"), 1e-12)  # SLICOT takes such weights of controls for dependent ones
