"""How the modes of the toolbox are held against the reference in 80 digits."""

import warnings

import numpy as np

import mbsvib as mv
from tests.stress import reference
from tests.support.digits import mp

# Geometry in doubles, levers above all, is off by some roundings before any eigenvalue is asked for, and the bound of
# an eigenvalue doesn't see it: measured 1.6e-14 at most on 250 such models whose loops are far from singular.
GEOMETRY = 4e-14
# errors.max() of an eigenvalue may be exceeded by this factor and GEOMETRY, no more.
HONEST = 2.0


def modes_of(model, rtol=1e-12, accurate=True):
    """The modes at ``rtol``; with ``accurate`` none may be warned of."""
    system = model.linearize()
    with warnings.catch_warnings():
        warnings.simplefilter("error" if accurate else "ignore", mv.AccuracyWarning)
        return system.modes(rtol=rtol)


def undamped_errors(model, modes, redundant=None):
    """Relative errors of the frequencies, those of rigid-body modes left out, once they are seen to be exact zeros."""
    squares = reference.squares(reference.exact(model, redundant))
    assert modes.rigid == sum(v == 0 for v in squares)
    assert not modes.eigenvalues.real.any()
    result = modes.eigenvalues[0::2].imag
    assert (result[: modes.rigid] == 0.0).all()
    with mp.workdps(reference.DIGITS):
        pairs = [(mp.mpf(float(a)), mp.sqrt(b)) for a, b in zip(result, squares, strict=True) if b]
        return np.array([float(abs(a / b - 1)) for a, b in pairs])


def damped_errors(model, modes):
    """Relative errors and their bounds of all eigenvalues that aren't 0, largest eigenvalue first."""
    left = reference.eigenvalues(reference.exact(model), modes.eigenvalues)
    errors = []
    with mp.workdps(reference.DIGITS):
        for k in np.argsort(-np.abs(modes.eigenvalues), kind="stable"):
            result = mp.mpmathify(complex(modes.eigenvalues[k]))
            expected = left.pop(min(range(len(left)), key=lambda i: abs(left[i] - result)))
            assert (expected == 0) == (result == 0)
            if result:
                errors.append((float(abs(result - expected) / abs(expected)), modes.errors[k]))
    return np.array(errors).T


def assert_honest(errors, bounds, rtol=1e-12):
    """Every error within rtol and within its bound."""
    assert errors.max() <= rtol, f"error {errors.max():.1e}"
    late = errors > HONEST * bounds + GEOMETRY
    assert not late.any(), f"errors {errors[late]}, promised {bounds[late]}"
