"""Eigenvalues and responses as callbacks: their values, their Jacobians, and a solver that uses both."""

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from tests.export.plants import slider, stewart

casadi = pytest.importorskip("casadi", reason="CasADi is not installed: pip install 'mbsvib[casadi]'")
PARAMETERS = ("leg1.k.stiffness", "platform.mass", "leg1.head.position.x", "leg2.k.damping")


def jacobians(made):
    p = casadi.MX.sym("p", len(made.values))
    real, imag = made(p)
    slope = casadi.Function("slope", [p], [casadi.jacobian(real, p), casadi.jacobian(imag, p)])
    return [item.full() for item in slope(made.values)]


def test_eigenvalues_and_their_jacobian_at_any_parameter():
    system = stewart()
    made = mx.to_casadi_eigenvalues(system, PARAMETERS)
    assert made.parameters == PARAMETERS
    assert made.values.tolist() == [system.parameters[name] for name in PARAMETERS]
    real, imag = (item.full().ravel() for item in made(made.values))
    assert real + 1j * imag == pytest.approx(system.modes().eigenvalues, rel=1e-13)
    real, imag = jacobians(made)
    truth = system.eigenvalue_sensitivities(PARAMETERS).T
    assert np.abs(real + 1j * imag - truth).max() <= 1e-12 * np.abs(truth).max()


def test_responses_and_their_jacobian():
    system = stewart()
    omega = 2 * np.pi * np.array([30.0, 200.0, 900.0])
    made = mx.to_casadi_response(system, omega, PARAMETERS, "ry", "Fx")
    real, imag = (item.full().ravel() for item in made(made.values))
    row, column = system.outputs.index("ry"), system.inputs.index("Fx")
    assert real + 1j * imag == pytest.approx(system.frequency_response(omega)[row, column], rel=1e-12)
    real, imag = jacobians(made)
    truth = system.frequency_response_sensitivities(omega, PARAMETERS)[:, row, column].T
    assert np.abs(real + 1j * imag - truth).max() <= 1e-12 * np.abs(truth).max()


def test_a_solver_finds_the_mass_of_a_frequency():
    made = mx.to_casadi_eigenvalues(slider(), "mass.mass")
    p = casadi.MX.sym("p")
    imag = made(p)[1]
    problem = {"x": p, "f": ((imag[0] ** 2 - 50.0**2) / 2500) ** 2}
    options = {"ipopt": {"hessian_approximation": "limited-memory", "print_level": 0, "tol": 1e-12}, "print_time": 0}
    result = casadi.nlpsol("find", "ipopt", problem, options)(x0=2.0, lbx=0.5, ubx=20.0)
    # w^2 = k/m - (c/2m)^2 with k = 1e4, c = 3
    mass = (1e4 + np.sqrt(1e8 - 2500 * 9)) / 5000
    assert float(result["x"]) == pytest.approx(mass, rel=1e-6)


def test_where_there_is_no_system_there_is_no_number():
    made = mx.to_casadi_eigenvalues(slider(), "mass.mass")
    assert np.isnan(made(-1.0)[0].full()).all()
    assert np.isfinite(made(1.0)[0].full()).all()


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: mx.to_casadi_eigenvalues(stewart().state_space(), "a"), mv.ExportError, "system = StateSpace"),
        (lambda: mx.to_casadi_eigenvalues(stewart(), "leg1.k.stif"), mv.ModelError, "leg1.k.stif"),
        (lambda: mx.to_casadi_eigenvalues(slider(locked=True), "mass.mass"), mv.ExportError, "no degree of freedom"),
        (lambda: mx.to_casadi_response(stewart(), 1.0, "*.mass"), mv.ExportError, "24 outputs; expected the name"),
        (lambda: mx.to_casadi_response(stewart(), 1.0, "*.mass", "xx", "Fx"), mv.ResponseError, "no output 'xx'"),
        (lambda: mx.to_casadi_response(library.chain(3).linearize(method="sparse").reduced(2), 1.0, "*.mass"),
         mv.ExportError, "not a system that model.linearize"),
    ],
)  # fmt: skip
def test_what_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()
