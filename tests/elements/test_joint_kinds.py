"""Each kind of joint in the tree and cut: matrices and their derivatives against 50 digits, and every variant."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.couplers.test_cut_joints import CUT, loop
from tests.support.compare import assert_same_matrices
from tests.support.exact import Exact

MIXED = {"orientation.rx": 1.0, "orientation.ry": -0.7, "orientation.rz": 0.4, "position.x": 0.3, "position.y": 0.9,
         "position.z": -0.5}  # fmt: skip
STEP = 1e-3
QUICK = {("skew universal", "cut"), ("skew universal", "link"), ("screw", "cut"), ("screw", "link"), ("planar", "cut"),
         ("x and ry", "link"), ("spherical", "cut"), ("prismatic", "link")}  # fmt: skip
CASES = [pytest.param(kind, cut, marks=() if (kind, cut) in QUICK else pytest.mark.slow)
         for kind in CUT for cut in ("cut", "link")]  # fmt: skip


@pytest.mark.few(2)
@pytest.mark.parametrize(("kind", "cut"), CASES)
def test_matrices_derivatives_and_variants(kind, cut):
    """The joint of this kind is cut, or in the tree of a loop that is cut at the other joint."""
    model = loop(kind, cut == "link", coupled=False)
    system = model.linearize(cut=[cut])
    assert system.cut_joints == (cut,)
    assert_same_matrices(system, Exact(model), 1e-11)
    known = model.parameters
    rates = {f"{joint}.{field}": rate * sign for joint, sign in (("cut", 1.0), ("link", -1.3))
             for field, rate in MIXED.items() if f"{joint}.{field}" in known}  # fmt: skip
    result = system.matrix_derivatives({"all": rates})
    values = {name: known[name] + np.array([STEP, -STEP]) * rate for name, rate in rates.items()}
    batch = model.linearize(values=values, cut=[cut], independent=list(system.coordinates))
    sides = []
    for i in range(2):
        there = Exact(model.with_values({name: array[i] for name, array in values.items()}))
        sides.append(there.minimal(system.coordinates))
        for key in ("M", "C", "K", "B", "Cq"):
            size = np.abs(sides[i][key]).max(initial=0.0)
            assert_allclose(getattr(batch, key)[i], sides[i][key], rtol=0, atol=1e-11 * size)
    for key in ("M", "C", "K", "B", "Cq"):
        expected = (sides[0][key] - sides[1][key]) / (2 * STEP)
        size = np.abs(expected).max() + 1e-3 * np.abs(sides[0][key]).max()
        assert_allclose(getattr(result, key)[0], expected, rtol=0, atol=3e-5 * size)
