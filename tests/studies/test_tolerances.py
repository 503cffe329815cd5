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
    found = st.tolerances(two(), TWO, st.frequency(1), samples=4000)
    # f = sqrt(k/m)/2 pi: relative deviation = half of that of k and of m, tolerances being three deviations
    f = 10.0 / (2 * np.pi)
    assert found.first[0] == pytest.approx(0.5 * f * np.hypot(0.01, 0.02), rel=1e-12)
    assert found.worst[0] == pytest.approx(0.5 * f * (0.03 + 0.06), rel=1e-12)
    assert np.allclose(found.shares[0], [0.2, 0.8, 0.0], atol=1e-12)
    assert found.std[0] == pytest.approx(found.first[0], rel=0.05)
    assert found.mean[0] == pytest.approx(f, rel=1e-3)
    assert found.quantile(0.5)[0] == pytest.approx(f, rel=2e-3)
    label = found.labels[0]
    assert found.within(label, f - found.first[0], f + found.first[0]) == pytest.approx(0.683, abs=0.03)


def test_uniform_tolerances_are_wider():
    found = st.tolerances(two(), TWO, st.frequency(1), samples=3000, distribution="uniform")
    f = 10.0 / (2 * np.pi)
    assert found.first[0] == pytest.approx(0.5 * f * np.hypot(0.03, 0.06) / np.sqrt(3.0), rel=1e-12)
    assert found.std[0] == pytest.approx(found.first[0], rel=0.06)
    assert np.abs(found.sweep["slow.mass"] - 1.0).max() <= 0.06


def test_first_order_is_first_order_sample_by_sample():
    of = {"frequency [Hz]": st.frequency(), "damping ratio [-]": st.damping_ratio()}
    errors = []
    for share in ("1 %", "0.1 %"):
        names = {"k?.stiffness": share, "k2.damping": share, "*.mass": share}
        found = st.tolerances(absorber(45.0, 0.6, below=2.0), names, of, samples=200)
        errors.append(np.abs(found.sampled - found.linear).max(axis=0) / found.nominal)
    assert (errors[1] < 2e-2 * errors[0]).all(), "what is left falls with the square"
    assert (errors[0] < 2e-3).all()


def test_modes_that_coincide_part_as_samples_say():
    names = {"leg*.k.stiffness": "0.5 %", "leg?.*.mass": "0.5 %", "leg*.head.position.z": 1e-5}
    found = st.tolerances(stewart(), names, st.frequency(), samples=500)
    assert found.parted.tolist() == [True, True, False, True, True, False]
    parts = found.sampled - found.nominal
    assert (parts[:, 0] < parts[:, 1]).all()
    left = np.abs(found.sampled - found.linear).max(axis=0)
    assert (left < 0.02 * np.abs(parts).max(axis=0)).all()
    assert np.allclose(found.std, found.first, rtol=0.05)
    assert (np.abs(parts).max(axis=0) < found.worst * 1.6).all()
    assert np.allclose(found.shares.sum(axis=1), 1.0)


def test_modes_that_nearly_coincide_repel_each_other():
    model = two().with_values({"fast.spring.stiffness": 101.0, "slow.spring.damping": 0.5})  # 0.5 % apart
    model.add_spring("link", "slow", "fast", start=(0, 0, 0), end=(1, 1, 0), stiffness=0.4)
    names = {"slow.spring.stiffness": "3 %", "fast.spring.stiffness": "3 %", "link.stiffness": 0.2, "slow.mass": 0.02,
             "slow.spring.damping": "20 %"}  # fmt: skip
    found = st.tolerances(model, names, samples=2000)
    assert found.parted.all()
    # where two frequencies are one to the last digits, rounding says which damping ratio comes first
    left = np.quantile(np.abs(found.sampled - found.linear), 0.99, axis=0)
    assert (left < 0.05 * np.abs(found.sampled - found.nominal).max(axis=0)).all()
    assert np.allclose(found.std, found.first, rtol=0.02)
    assert found.mean[0] < found.nominal[0] < found.nominal[1] < found.mean[1]


def test_responses_and_ties():
    of = {"peak": st.peak("x", "F"), "both": st.frequency(1) * st.frequency(2)}
    names = {"k2.stiffness": "0.3 %", "k2.damping": "0.3 %", "scale": 0.003}
    ties = {"scale": {"k1.stiffness": 1000.0, "main.mass": 10.0}}  # frequencies of the main mass stay
    found = st.tolerances(absorber(45.0, 1.3), names, of, samples=15, ties=ties, workers=1)
    assert found.labels == ("peak", "both")
    assert np.allclose(found.sampled, found.linear, rtol=1e-4)
    assert "scale" in found.sweep.parameters
    alone = st.tolerances(two(), {"all": 0.01}, samples=20, ties={"all": {"*.mass": 1.0, "slow.spring.stiffness": 100.0,
                                                                          "fast.spring.stiffness": 400.0}})  # fmt: skip
    assert np.abs(alone.sampled[:, :2] / alone.nominal[:2] - 1.0).max() < 1e-12
    assert (alone.shares >= 0.0).all()


def test_samples_are_those_of_the_seed_and_resumed(tmp_path):
    file = tmp_path / "samples.jsonl"
    one = st.tolerances(two(), TWO, samples=50, file=file)
    again = st.tolerances(two(), TWO, samples=50, file=file)
    other = st.tolerances(two(), TWO, samples=50, seed=1)
    assert (one.sampled == again.sampled).all()
    assert not (one.sampled == other.sampled).any()


def test_samples_that_fail_are_not_within():
    found = st.tolerances(two(), {"slow.mass": 2.0}, st.frequency(1), samples=200)
    failed = int(found.sweep.failed.sum())
    assert 0 < failed < 60
    assert found.within(found.labels[0]) == pytest.approx(1.0 - failed / 200)
    assert f"{failed} failures" in str(found)
    assert np.isfinite(found.std).all()


def test_table_and_figures():
    found = st.tolerances(stewart(), {"leg*.k.stiffness": "2 %"}, samples=50)
    text = str(found)
    assert "frequency 1 [Hz]" in text
    assert "repel each other" in text
    for label, panels in ((None, 12), ("frequency 2 [Hz]", 1)):
        figure = found.plot(label)
        shown = [axes for axes in figure.axes if axes.get_visible()]
        assert len(shown) == panels
        assert all(axes.get_xlabel().endswith("]") for axes in shown)
    with pytest.raises(ModelError, match="Did you mean 'frequency 2"):
        found.plot("frequency 2")


def test_models_without_derivatives_are_sampled():
    model = mv.Model("pendulum", gravity=(0, 0, -9.81))
    model.add_body("bob", 1.0, (0.01, 0.01, 0.01), position=(0, 0, -0.5))
    model.add_joint("pivot", "revolute", "ground", "bob", position=(0, 0, 0), axis=(0, 1, 0))
    found = st.tolerances(model, {"bob.position.z": 0.01}, st.frequency(), samples=100, derivatives=False)
    length = -found.sweep["bob.position.z"]
    expected = np.sqrt(9.81 * length / (0.01 + length**2)) / (2 * np.pi)
    assert np.allclose(found.sampled[:, 0], expected, rtol=1e-12)
    assert np.isnan(found.first).all()
    assert "-" in str(found).split()
    assert found.plot().axes[0].get_xlabel() == "frequency [Hz]"


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


@pytest.mark.parametrize(("names", "words", "said"), BAD)
def test_bad_input_is_told(names, words, said):
    with pytest.raises(ModelError, match=said):
        st.tolerances(two(), names, **words)
