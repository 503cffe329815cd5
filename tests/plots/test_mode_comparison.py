"""Two sets of modes beside each other: differences in percent of the first."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots import mode_comparison


def bars(figure, column=0):
    below = figure.axes[len(figure.axes) // 2 :]
    return np.array([bar.get_height() for bar in below[column].patches])


@pytest.mark.slow
def test_differences_of_two_systems(tmp_path):
    model = mv.library.chain(5)
    heavier = model.with_values({name: 1.21 * value for name, value in model.parameters.items()
                                 if name.endswith(".mass") or ".inertia." in name})  # fmt: skip
    figure = mode_comparison(model.linearize(), heavier.linearize(), ["as built", "heavier"])
    assert np.allclose(bars(figure), 100.0 * (1.0 / 1.1 - 1.0))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["as built", "heavier"]
    figure.savefig(tmp_path / "modes.png")


def test_measured_frequencies_and_rigid_modes():
    figure = mode_comparison([0.0, 10.0, 20.0], [0.0, 11.0, 19.0, 400.0])
    assert np.allclose(bars(figure)[1:3], [10.0, -5.0])
    assert np.isnan(bars(figure)[0])
    assert len(bars(figure)) == 3
    assert figure.axes[0].get_yscale() == "log"
    assert len(figure.axes[0].lines[1].get_xdata()) == 4


def test_damping_ratios_of_two_systems():
    """Lighter bodies: frequencies 10 % higher, and damping proportional to stiffness grows with them."""
    model = mv.library.chain(5)
    lighter = model.with_values({name: value / 1.21 for name, value in model.parameters.items()
                                 if name.endswith(".mass") or ".inertia." in name})  # fmt: skip
    figure = mode_comparison(model.linearize(), lighter.linearize().modes())
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "natural frequency [Hz]", "damping ratio [%]", "difference [%]", "difference [%]"]  # fmt: skip
    assert np.allclose(bars(figure, 0), 10.0)
    assert np.allclose(bars(figure, 1), 10.0)
    assert np.allclose(figure.axes[1].lines[0].get_ydata(), 100.0 * model.linearize().modes().damping_ratios)


@pytest.mark.slow
def test_damping_ratios_of_another_program():
    """As in the source: frequencies and damping ratios over mode order."""
    system = mv.library.quadruped().linearize()
    modes = system.modes()
    theirs = np.array([modes.frequencies * (1.0 + 1e-6), modes.damping_ratios * 0.98])
    figure = mode_comparison(theirs, system, ["theirs", "ours"])
    assert np.allclose(bars(figure, 0), 100.0 * (1.0 / (1.0 + 1e-6) - 1.0), rtol=1e-6)
    assert np.allclose(bars(figure, 1), 100.0 * (1.0 / 0.98 - 1.0))
    undamped = mode_comparison([[1.0, 2.0], [0.0, 0.1]], [[1.0, 2.0], [0.1, 0.2]])
    assert np.isnan(bars(undamped, 1)[0])
    assert bars(undamped, 1)[1] == pytest.approx(100.0)
    assert len(mode_comparison([1.0, 2.0], [[1.0, 2.0], [0.1, 0.2]]).axes) == 2


@pytest.mark.parametrize(("values", "words"), [
    (([], [1.0]), "reference has no modes"), (([2.0, 1.0], [1.0]), "ascending order"),
    (([1.0], [-1.0]), "none negative"), (([1.0], "text"), "other"), (([[1.0], [0.1], [2.0]], [1.0]), "second row"),
])  # fmt: skip
def test_refusals(values, words):
    with pytest.raises(mv.MbsvibError, match=words):
        mode_comparison(*values)
    with pytest.raises(mv.ResponseError, match="3 labels"):
        mode_comparison([1.0], [2.0], ["a", "b", "c"])
