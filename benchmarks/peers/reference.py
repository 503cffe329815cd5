"""Eigenvalues to 50 digits, and how far others are from them."""

import json
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.peers.scenes import SCENES
from tests.support.exact import Exact

FILES = Path(__file__).parents[2] / "tests" / "data" / "reference"
# Eigenvalues this close to the real axis, as share of the largest, do not oscillate.
REAL = 1e-9


def exact(scene):
    """Return one eigenvalue of every pair, shape (m,), and the undamped frequencies [rad/s], both rounded once."""
    file = FILES / f"ref_{scene}RF1.json"
    if file.exists():
        data = json.loads(file.read_text())
        values = [complex(float(re), float(im)) for re, im in zip(data["lam_re"], data["lam_im"], strict=True)]
        return np.array(values), np.array([float(w) for w in data["omega"]])
    truth = Exact(SCENES[scene][0]())
    values = truth.eigenvalues[truth.eigenvalues.imag > 0.0]
    if len(values) != truth.dof:
        raise ValueError(f"{scene}: only scenes in which every mode oscillates can be compared")
    return values, np.sqrt(truth.squares)


def error(found, true):
    """Return the largest relative error, each true value beside its own found one; None if there are too few of them.

    A method may find more values than there are (soft constraints, penalties): those are left aside in its favour.
    """
    found = np.asarray(found)
    if np.iscomplexobj(true):
        found = found[found.imag > REAL * np.abs(found).max()]
    if len(found) < len(true):
        return None
    distance = np.abs(found - true[:, None]) / np.abs(true[:, None])
    return float(distance[linear_sum_assignment(distance)].max())
