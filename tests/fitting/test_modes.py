"""Fits to measured modes: pairs by shapes, derivatives of shapes, and what modes alone do not tell."""

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.api.fitting import _problem, _started
from mbsvib.errors import AccuracyWarning, ResponseError
from mbsvib.fitting.data import conditioned
from mbsvib.fitting.variables import variables
from tests.fitting.scenes import away, chain, measured

MIXED = ("acceleration", "displacement", "velocity")


def modes_of(model, order=(0, 1, 2), damping=True, factors=(1.0, -2.0, 3.0j)):
    system = model.linearize()
    modes = system.modes()
    shapes = (system.Cq @ modes.shapes) * np.array(factors)
    ratios = modes.damping_ratios[list(order)] if damping else None
    return mv.MeasuredModes(modes.frequencies[list(order)], ratios, shapes[:, list(order)], system.outputs)


def test_modes_in_any_order_give_exact_values():
    model = chain()
    free = ["k*.stiffness", "k*.damping"]
    fit = away(model, free, 0.1, 1).fit(modes_of(model, (2, 0, 1)), free)
    for name, value in fit.values.items():
        assert value == pytest.approx(model.parameters[name], rel=1e-5), name
    assert fit.residual_test.passed


def test_shapes_are_displacements_whatever_the_outputs_of_the_model_are():
    """Of outputs of three quantities, in any units of the mode, one with the other direction by its place."""
    model = chain(quantities=MIXED)
    plain = modes_of(chain())
    shapes = plain.shapes * np.array([[1.0], [-1.0], [1.0]])
    points = [((0, 0, k + 1.0), (0, 0, -1.0 if k == 1 else 1.0)) for k in range(3)]
    data = mv.MeasuredModes(plain.frequencies, plain.damping_ratios, shapes, plain.outputs, output_points=points)
    free = ["k*.stiffness", "k*.damping"]
    fit = away(model, free, 0.05, 1).fit(data, free)
    for name, value in fit.values.items():
        assert value == pytest.approx(model.parameters[name], rel=1e-6), name
    assert fit.residual_test.ratio < 1e-9


def test_modes_alone_do_not_tell_the_scale():
    """Masses and stiffnesses times one factor have the same frequencies and shapes."""
    model = chain(damping=(0.0, 0.0, 0.0))
    free = ["k*.stiffness", "b*.mass"]
    fit = away(model, free, 0.05, 2).fit(modes_of(model, damping=False), free)
    assert len(fit.unidentified) == 1
    assert all(name in fit.unidentified[0] for name in fit.values)
    ratio = fit.values["k1.stiffness"] / fit.values["b2.mass"]
    assert ratio == pytest.approx(2e4 / 3.0, rel=1e-4)
    known = away(model, ["k*.stiffness"], 0.05, 2).fit(modes_of(model, damping=False), ["k*.stiffness", "b1.mass"])
    with pytest.raises(ResponseError, match="no frequency responses were fitted"):
        known.next_sensor()
    assert known.unidentified == ()
    assert known.values["b1.mass"] == pytest.approx(2.0, rel=1e-5)


def test_modes_and_responses_together():
    model = chain()
    omega = 2 * np.pi * np.linspace(2.0, 60.0, 40)
    data = [measured(model, omega, 0.01, 1, ["z0"], ["F"]), modes_of(model)]
    start = away(model, ["k*.stiffness"], 0.2, 1)
    both, one = start.fit(data, ["k*.stiffness"]), start.fit(data[:1], ["k*.stiffness"])
    assert (both.covariance.diagonal() < one.covariance.diagonal()).all()
    assert both.residual_test.passed
    np.testing.assert_allclose(both.responses(), data[0].responses, rtol=0.06)
    with pytest.raises(ResponseError, match="expected 1 to 1"):
        both.responses(2)


def test_more_modes_than_the_model_has_are_refused():
    model = chain()
    many = mv.MeasuredModes([1.0, 2.0, 3.0, 4.0])
    with pytest.raises(ResponseError, match="has 4 modes, and the model 3"):
        model.fit(many, "k0.stiffness")


@pytest.mark.parametrize("unit", [1e-20, 1e20])
def test_units_of_force_do_not_change_slopes_of_modes(unit):
    """Masses, springs and dampers times one factor have the same modes, and slopes to relative changes."""
    free = ["k*.stiffness", "k*.damping", "b*.mass"]
    normal = []
    for factor in (1.0, unit):
        model = chain(*(tuple(factor * one for one in group) for group in ((1e4, 2e4, 3e4), (2, 4, 6), (1, 2, 3))))
        problem = _problem(model, conditioned(modes_of(chain())), variables(model.parameters, free, (), None, None), ())
        x = problem.variables.unknowns(problem.variables.start)
        x[1] += 0.1
        normal.append(problem.sums(x, far=False).normal)
    np.testing.assert_allclose(normal[1], normal[0], rtol=1e-8, atol=1e-8 * np.abs(normal[0]).max())


def test_a_mode_without_a_shape_far_from_those_of_the_model_is_named():
    """Frequencies of the chain times a factor: shapes, responses and nearer starts leave nothing to guess."""
    model = chain()
    modes = modes_of(model)
    f = modes.frequencies[0]

    def started(*data):
        free = variables(model.parameters, ["k0.stiffness"], (), None, None)
        return _started(_problem(model, conditioned(list(data)), free, ()))

    far = mv.MeasuredModes([1.5 * f])
    started(mv.MeasuredModes([1.2 * f]))
    started(mv.MeasuredModes([1.5 * f], shapes=modes.shapes[:, :1], outputs=modes.outputs))
    started(far, measured(model, np.array([20.0, 30.0]), 0.01, 1, ["z0"], ["F"]))
    with pytest.warns(AccuracyWarning, match=rf"mode at {1.5 * f:.4g} Hz has no shape.*model.*at {f:.4g} Hz"):
        started(far)


def test_damping_ratios_of_zero_are_not_measured():
    """As finite elements write normal modes: stiffness is fitted as without them."""
    model = chain().with_values({"k1.stiffness": 2.1e4})
    f = modes_of(chain()).frequencies
    with_zeros, without = (model.fit(mv.MeasuredModes(f, ratios), "k1.stiffness") for ratios in (0.0, None))
    assert with_zeros.values == without.values
    assert with_zeros.values["k1.stiffness"] == pytest.approx(2e4, rel=1e-6)


def standing(stiffness=(1e5, 1e5, 2e5, 3e3, 3e3, 2e3), unit=1.0, height=0.05):
    """A body on a bushing that is the same along and about x and y: two pairs of equal modes."""
    model, scale = mv.Model("standing"), np.repeat([1.0, unit**2], 3)
    model.add_body("b", 5.0, unit**2 * np.array([0.05, 0.05, 0.08]))
    model.add_bushing("k", "ground", "b", (0, 0, height * unit), scale * stiffness, 2e-4 * scale * stiffness)
    for axis in ("x", "y", "rx", "ry"):
        model.add_output(axis, "b", axis)
    return model


def seen(model):
    """Frequencies and shapes of the modes that the outputs show."""
    system = model.linearize()
    modes = system.modes()
    shapes = system.Cq @ modes.shapes
    which = np.abs(shapes).max(axis=0) > 1e-6
    return modes.frequencies[which], shapes[:, which]


@pytest.mark.parametrize("height", [0.0, 0.05])
@pytest.mark.parametrize("shown", [True, False])
def test_modes_of_one_frequency_part_from_a_start_of_symmetry(shown, height):
    """Shapes choose vectors of the common space; without shapes the sum of both tells the frequencies."""
    true, outputs = standing((1.05e5, 0.97e5, 2e5, 3.1e3, 2.9e3, 2e3), height=height), ["x", "y", "rx", "ry"]
    free = ["k.stiffness.x", "k.stiffness.y", "k.stiffness.rx", "k.stiffness.ry"]
    frequencies, shapes = seen(true)
    known = {"shapes": shapes, "outputs": outputs} if shown else {}
    start = standing((1.0001e5, 1e5, 2e5, 3e3, 3e3, 2e3), height=height)
    fit = start.fit(mv.MeasuredModes(frequencies, **known), free)
    assert fit.residual_test.passed
    np.testing.assert_allclose(seen(fit.model)[0], frequencies, rtol=1e-6)
    if shown:
        np.testing.assert_allclose([fit.values[name] for name in free], [1.05e5, 0.97e5, 3.1e3, 2.9e3], rtol=1e-5)
        frequencies, shapes = seen(standing(height=height))  # any two vectors of each space
        back = true.fit(mv.MeasuredModes(frequencies, shapes=shapes, outputs=outputs), free)
        np.testing.assert_allclose([back.values[name] for name in free], [1e5, 1e5, 3e3, 3e3], rtol=1e-4)


@pytest.mark.parametrize("shown", [True, False])
def test_slopes_of_modes_of_one_frequency(shown):
    """With both stiffnesses of a pair f changes by half of their share, and shapes stay."""
    model = standing(height=0.0)
    frequencies, shapes = seen(model)
    known = {"shapes": shapes @ np.kron(np.eye(2), [[0.8, 0.6], [-0.6, 0.8]]), "outputs": ["x", "y", "rx", "ry"]}
    chosen = variables(model.parameters, (), ["k.stiffness.[xy]", "k.stiffness.r[xy]"])
    problem = _problem(model, conditioned(mv.MeasuredModes(frequencies, **(known if shown else {}))), chosen, ())
    ((_, block),) = problem.blocks(problem.variables.unknowns(problem.variables.start))
    rows = np.flatnonzero(np.abs(block.slopes).max(axis=0) > 1e-3)  # those of frequencies
    np.testing.assert_allclose(np.sort(np.abs(block.slopes[:, rows]), axis=0), [[0.0] * 4, [500.0] * 4], rtol=1e-9,
                               atol=1e-6)  # fmt: skip
    np.testing.assert_allclose(np.abs(block.residual), 0.0, atol=1e-6)


def test_real_shapes_have_one_number_an_entry():
    """Residuals of normal modes have no imaginary parts: of noise as stated, chi^2 is as large as its freedom."""
    model, rng, ratios = chain(damping=(0.0, 0.0, 0.0)), np.random.default_rng(3), []
    exact = modes_of(model, damping=False, factors=(1.0, 1.0, 1.0))
    size = 0.05 * np.abs(exact.shapes).max(axis=0)
    for _ in range(8):
        noisy = exact.shapes.real + size * rng.standard_normal(exact.shapes.shape)
        known = mv.MeasuredModes(exact.frequencies * (1.0 + 1e-3 * rng.standard_normal(3)), shapes=noisy,
                                 outputs=exact.outputs)  # fmt: skip
        problem = _problem(model, conditioned(known), variables(model.parameters, "k*.stiffness", ()), ())
        assert problem.numbers == 3 + 9 - 3
        x = problem.variables.unknowns(problem.variables.start)
        ratios.append(2.0 * problem.cost(x, far=False) / problem.numbers)
    assert np.mean(ratios) == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / (8 * 9)))


def test_units_of_length_do_not_change_what_shapes_tell():
    """Rotations beside displacements of the same machine in m and in mm, with errors of frequencies and shapes."""
    exact, rng = seen(standing((1.05e5, 0.97e5, 2e5, 3.1e3, 2.9e3, 2e3))), np.random.default_rng(1)
    frequencies = exact[0] * (1.0 + 1e-3 * rng.standard_normal(4))
    shapes = exact[1] * (1.0 + 0.1 * rng.standard_normal((4, 4)))
    free = ["k.stiffness.x", "k.stiffness.ry", "k.position.z"]
    metres, other = (standing(unit=unit).fit(mv.MeasuredModes(
        frequencies, shapes=shapes * np.array([[unit], [unit], [1], [1]]), outputs=["x", "y", "rx", "ry"]), free)
        for unit in (1.0, 1e3))  # fmt: skip
    for name, scale in zip(free, (1.0, 1e6, 1e3), strict=True):
        np.testing.assert_allclose(other.intervals[name], scale * np.array(metres.intervals[name]), rtol=1e-7)
