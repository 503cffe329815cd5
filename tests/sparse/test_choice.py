"""Which equations are taken, what each refuses by name, and what is said about them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mbsvib as mv
from mbsvib.api.sparse_system import SparseSystem
from mbsvib.api.system import System
from mbsvib.sparse.choice import MANY
from tests.sparse import scenes


@pytest.mark.slow
def test_size_decides_unless_said_otherwise():
    small, large = mv.library.chain(MANY), mv.library.chain(MANY + 1, line=(0, 1, 0))
    assert isinstance(small.linearize(), System)
    assert isinstance(large.linearize(), SparseSystem)
    assert isinstance(large.linearize(method="dense"), System)
    assert isinstance(mv.library.chain(3).linearize(method="sparse"), SparseSystem)
    assert isinstance(mv.linearize(large), SparseSystem)


def test_coordinates_count_and_not_bodies():
    """Six coordinates for each body that floats, three for a ball joint."""
    assert isinstance(scenes.floating(250).linearize(), SparseSystem)
    assert isinstance(mv.library.chain(250).linearize(), System)


@pytest.mark.parametrize(("words", "message"), [
    ({"independent": ["joint1.rz"]}, "independent is given, yet method='sparse' has no minimal coordinates"),
    ({"values": {"body1.mass": [1.0, 2.0]}}, "values is given, yet method='sparse' linearizes one variant at a time"),
])  # fmt: skip
def test_what_the_sparse_path_cannot_do_is_refused(words, message):
    with pytest.raises(mv.ModelError, match=message):
        mv.library.chain(5).linearize(method="sparse", **words)


def test_an_unknown_method_is_refused():
    with pytest.raises(mv.ModelError, match=r"method = 'sparce'.*Did you mean 'sparse'"):
        mv.library.chain(5).linearize(method="sparce")


@pytest.mark.slow
def test_words_that_ask_for_dense_equations_get_them():
    model = mv.library.chain(MANY + 1)
    assert isinstance(model.linearize(independent=["joint1.rz"]), System)
    assert len(model.linearize(values={"spring1.stiffness.rz": [1e4, 2e4]})) == 2


def test_cut_joints_may_be_chosen():
    model = mv.library.ladder(8)
    names = [f"right{i}.foot" for i in range(1, 9)]
    dense, sparse = (model.linearize(cut=names, method=method) for method in ("dense", "sparse"))
    assert sparse.cut_joints == dense.cut_joints == tuple(names)
    assert_allclose(sparse.modes(8).frequencies, dense.modes().frequencies, rtol=1e-12)


def test_what_needs_a_number_of_modes_says_so():
    system = mv.library.chain(700, line=(0, 1, 0)).linearize()
    for call, word in ((system.modes, r"modes\(10\)"), (system.state_space, r"state_space\(modes=k\)"),
                       (lambda: system.time_response([0, 1], np.zeros((2, 2))), "modes=k")):  # fmt: skip
        with pytest.raises(mv.ResponseError, match=word):
            call()
    for name in ("M", "C", "K", "B", "Cq", "Cv", "Ca"):
        with pytest.raises(AttributeError, match=f"no attribute '{name}'; dense systems have it, system.reduced"):
            getattr(system, name)
    with pytest.raises(AttributeError, match="no attribute 'masses'"):
        _ = system.masses


@pytest.mark.few(2)
@pytest.mark.parametrize("count", [0, -1, 701, 2.5, True, "all"])
def test_bad_numbers_of_modes(count):
    with pytest.raises(mv.ResponseError, match="expected a whole number from 1 to 700, the degrees of freedom"):
        mv.library.chain(700, line=(0, 1, 0)).linearize().modes(count)


@pytest.mark.parametrize("method", ["dense", "sparse"])
def test_frequencies_may_be_numbers_of_any_type(method):
    system = mv.library.chain(30).linearize(method=method)
    expected = system.modes(2, near=3.0).frequencies
    for near in (3, np.float32(3.0), np.int64(3), np.array(3.0)):
        assert np.array_equal(system.modes(2, near=near).frequencies, expected)


@pytest.mark.parametrize("method", ["dense", "sparse"])
@pytest.mark.parametrize("near", [-1.0, np.nan, np.inf, 1e200, "low"])
def test_bad_frequencies(method, near):
    with pytest.raises(mv.ResponseError, match="expected a frequency"):
        mv.library.chain(30).linearize(method=method).modes(3, near=near)


def test_frequencies_that_are_none():
    with pytest.raises(mv.ResponseError, match="expected a finite vector"):
        mv.library.chain(700, line=(0, 1, 0)).linearize().frequency_response([1.0, np.nan])


def test_accuracy_that_is_asked_for_is_checked():
    system = scenes.dashed(700).linearize()
    system.modes(3, rtol=1e-9)
    with pytest.warns(mv.AccuracyWarning, match="exceeds rtol = 1e-18 in modes 1, 2, 3"):
        system.modes(3, rtol=1e-18)


@pytest.mark.slow
def test_it_says_how_it_came_about():
    text = mv.library.ladder(200).linearize(method="sparse").explain()
    for words in ("200 DOF, sparse matrices", "cut at", "redundant: ", "multipliers", "from leaves to root",
                  "and 192 more groups of loops"):  # fmt: skip
        assert words in text
    assert "no loop: no constraint was checked" in scenes.dashed(700).linearize().explain()
    assert "COLAMD" in scenes.grid(20, 20, "spherical", flat=False).linearize(method="sparse").explain()
    assert "floating, with free joints added: b0" in scenes.floating(300).linearize().explain()


def test_modes_are_shown_as_a_table():
    modes = mv.library.chain(700, line=(0, 1, 0)).linearize().modes(3)
    assert "3 of 700 DOF" in str(modes)
    assert len(str(modes).splitlines()) > 5
    assert sum(v.sum() for v in modes.kinetic_energy.values()) == pytest.approx(3.0)
