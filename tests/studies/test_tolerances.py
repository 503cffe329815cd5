"""Tolerances: first order against samples and closed forms, modes that coincide, and what is refused."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import studies as st
from mbsvib.errors import ModelError
from mbsvib.library import stewart
from tests.studies.test_optimize import absorber, two

TWO = {"slow.spring.stiffness": "3 %", "slow.mass": 0.06, "fast.spring.stiffness": 12.0}


def test_deviation_of_one_mass_on_one_spring():
    result = st.tolerances(two(), TWO, st.frequency(1), samples=4000)
    # f = sqrt(k/m)/2 pi: relative deviation = half of that of k and of m, tolerances being three deviations
    f = 10.0 / (2 * np.pi)
    assert result.first[0] == pytest.approx(0.5 * f * np.hypot(0.01, 0.02), rel=1e-12)
    assert result.worst[0] == pytest.approx(0.5 * f * (0.03 + 0.06), rel=1e-12)
    assert np.allclose(result.shares[0], [0.2, 0.8, 0.0], atol=1e-12)
    assert result.std[0] == pytest.approx(result.first[0], rel=0.05)
    assert result.mean[0] == pytest.approx(f, rel=1e-3)
    assert result.quantile(0.5)[0] == pytest.approx(f, rel=2e-3)
    label = result.labels[0]
    assert result.within(label, f - result.first[0], f + result.first[0]) == pytest.approx(0.683, abs=0.03)
    worst = f * (1.0 - 0.045), f * (1.0 + 0.045)  # values, as the nominal one beside them is
    assert f"{worst[0]:.5g} ... {worst[1]:.5g}" in str(result)


def test_uniform_tolerances_are_wider():
    result = st.tolerances(two(), TWO, st.frequency(1), samples=3000, distribution="uniform")
    f = 10.0 / (2 * np.pi)
    assert result.first[0] == pytest.approx(0.5 * f * np.hypot(0.03, 0.06) / np.sqrt(3.0), rel=1e-12)
    assert result.std[0] == pytest.approx(result.first[0], rel=0.06)
    assert np.abs(result.sweep["slow.mass"] - 1.0).max() <= 0.06
    assert "all values within a tolerance are equally likely" in str(result)
    normal = st.tolerances(two(), TWO, st.frequency(1), samples=10)
    assert "a tolerance is three standard deviations" in str(normal)


def test_first_order_is_first_order_sample_by_sample():
    of = {"frequency [Hz]": st.frequency(), "damping ratio [1]": st.damping_ratio()}
    errors = []
    for share in ("1 %", "0.1 %"):
        names = {"k?.stiffness": share, "k2.damping": share, "*.mass": share}
        result = st.tolerances(absorber(45.0, 0.6, below=2.0), names, of, samples=200)
        errors.append(np.abs(result.sampled - result.linear).max(axis=0) / result.nominal)
    assert (errors[1] < 2e-2 * errors[0]).all(), "what is left falls with the square"
    assert (errors[0] < 2e-3).all()


def test_modes_that_coincide_part_as_samples_say():
    names = {"leg*.k.stiffness": "0.5 %", "leg?.*.mass": "0.5 %", "leg*.head.position.z": 1e-5}
    result = st.tolerances(stewart(), names, st.frequency(), samples=500)
    assert result.close_modes.tolist() == [True, True, False, True, True, False]
    parts = result.sampled - result.nominal
    assert (parts[:, 0] < parts[:, 1]).all()
    left = np.abs(result.sampled - result.linear).max(axis=0)
    assert (left < 0.02 * np.abs(parts).max(axis=0)).all()
    assert np.allclose(result.std, result.first, rtol=0.05)
    assert (np.abs(parts).max(axis=0) < result.worst * 1.6).all()
    assert np.allclose(result.shares.sum(axis=1), 1.0)


def test_modes_that_nearly_coincide_repel_each_other():
    model = two().with_values({"fast.spring.stiffness": 101.0, "slow.spring.damping": 0.5})  # 0.5 % apart
    model.add_spring("link", "slow", "fast", start=(0, 0, 0), end=(1, 1, 0), stiffness=0.4)
    names = {"slow.spring.stiffness": "3 %", "fast.spring.stiffness": "3 %", "link.stiffness": 0.2, "slow.mass": 0.02,
             "slow.spring.damping": "20 %"}  # fmt: skip
    result = st.tolerances(model, names, samples=2000)
    assert result.close_modes.all()
    # where two frequencies are one to the last digits, rounding says which damping ratio comes first
    left = np.quantile(np.abs(result.sampled - result.linear), 0.99, axis=0)
    assert (left < 0.05 * np.abs(result.sampled - result.nominal).max(axis=0)).all()
    assert np.allclose(result.std, result.first, rtol=0.02)
    assert result.mean[0] < result.nominal[0] < result.nominal[1] < result.mean[1]


@pytest.mark.slow
def test_responses_and_ties():
    of = {"peak": st.peak("x", "F"), "both": st.frequency(1) * st.frequency(2)}
    names = {"k2.stiffness": "0.3 %", "k2.damping": "0.3 %", "scale": 0.003}
    ties = {"scale": {"k1.stiffness": 1000.0, "main.mass": 10.0}}  # frequencies of the main mass stay
    result = st.tolerances(absorber(45.0, 1.3), names, of, samples=15, ties=ties, workers=1)
    assert result.labels == ("peak", "both")
    assert np.allclose(result.sampled, result.linear, rtol=1e-4)
    assert "scale" in result.sweep.parameters
    ties = {"all": {"*.mass": 1.0, "slow.spring.stiffness": 100.0, "fast.spring.stiffness": 400.0}}
    single = st.tolerances(two(), {"all": 0.01}, samples=20, ties=ties)
    assert np.abs(single.sampled[:, :2] / single.nominal[:2] - 1.0).max() < 1e-12
    assert (single.shares >= 0.0).all()


def test_samples_are_those_of_the_seed_and_resumed(tmp_path):
    file = tmp_path / "samples.jsonl"
    first = st.tolerances(two(), TWO, samples=50, file=file)
    again = st.tolerances(two(), TWO, samples=50, file=file)
    second = st.tolerances(two(), TWO, samples=50, seed=1)
    assert (first.sampled == again.sampled).all()
    assert not (first.sampled == second.sampled).any()


def test_samples_that_fail_are_not_within():
    result = st.tolerances(two(), {"slow.mass": 2.0}, st.frequency(1), samples=200)
    failed = int(result.sweep.failed.sum())
    assert 0 < failed < 60
    assert result.within(result.labels[0]) == pytest.approx(1.0 - failed / 200)
    with pytest.raises(mv.ResponseError, match=r"within: limits = .*expected two numbers"):
        result.within(result.labels[0], "low")
    assert f"{failed} failures" in str(result)
    assert np.isfinite(result.std).all()


@pytest.mark.slow
def test_table_and_figures():
    result = st.tolerances(stewart(), {"leg*.k.stiffness": "2 %"}, samples=50)
    text = str(result)
    assert "frequency 1 [Hz]" in text
    assert "repel each other" in text
    for label, panels in ((None, 12), ("frequency 2 [Hz]", 1)):
        figure = result.plot(label)
        shown = [axes for axes in figure.axes if axes.get_visible()]
        assert len(shown) == panels
        assert all(axes.get_xlabel().endswith("]") for axes in shown)
    with pytest.raises(ModelError, match="Did you mean 'frequency 2"):
        result.plot("frequency 2")


def test_models_without_derivatives_are_sampled():
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", 1.0, (0.01, 0.01, 0.01), position=(0, 0, -0.5))
    model.add_joint("pivot", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    result = st.tolerances(model, {"bob.position.z": 0.01}, st.frequency(), samples=100, derivatives=False)
    length = -result.sweep["bob.position.z"]
    expected = np.sqrt(9.81 * length / (0.01 + length**2)) / (2 * np.pi)
    assert np.allclose(result.sampled[:, 0], expected, rtol=1e-12)
    assert np.isnan(result.first).all()
    assert "-" in str(result).split()
    assert result.plot().axes[0].get_xlabel() == "frequency [Hz]"
    named = st.tolerances(model, {"bob.position.z": 0.01}, {"slow": st.frequency()}, samples=10, derivatives=False)
    assert named.plot().axes[0].get_xlabel() == "slow"


BAD = [
    ({"slow.spring.stifness": 1.0}, {}, "Did you mean 'slow.spring.stiffness'"),
    ({"leg*.stiffness": 1.0}, {}, "no parameter 'leg"),
    ({"axle.mass": 1.0}, {}, "no parameter 'axle.mass'"),
    ({"slow.mass": "2"}, {}, "such as '2 %'"),
    ({"slow.mass": "two %"}, {}, "such as '2 %'"),
    ({"slow.mass": -1.0}, {}, "more than 0"),
    ({"slow.mass": np.nan}, {}, "how far"),
    ({"slow.position.x": "2 %"}, {}, "of 0 is nothing"),
    ({}, {}, "how far each"),
    ({"slow.mass": 0.1}, {"samples": 1}, "at least 2"),
    ({"slow.mass": 0.1}, {"distribution": "gauss"}, "'normal' or 'uniform'"),
    ({"slow.mass": 0.1}, {"of": "frequency"}, "a quantity"),
    ({"slow.mass": 0.1}, {"of": {"f": 3.0}}, "a quantity"),
]


@pytest.mark.parametrize(("names", "words", "message"), BAD)
def test_bad_input_is_told(names, words, message):
    with pytest.raises(ModelError, match=message):
        st.tolerances(two(), names, **words)
