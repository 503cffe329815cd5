"""Sensitivities of frequencies, damping ratios and shapes: closed forms, differences, repeated and rigid modes."""

import numpy as np
import pytest
from hypothesis import assume, given

import mbsvib as mv
from tests.sensitivities.differences import difference
from tests.sensitivities.test_eigenvalues import oscillator
from tests.support.random_models import seeds, spatial
from tests.support.sizes import examples


def test_oscillator_in_closed_form():
    """omega = sqrt(k / m), zeta = c / 2 sqrt(k m), shape = 1 / sqrt(m)."""
    result = oscillator().linearize().mode_sensitivities(["mass.mass", "spring.stiffness", "spring.damping"])
    m, k, c = 2.0, 800.0, 3.0
    omega, zeta = np.sqrt(k / m), c / (2 * np.sqrt(k * m))
    wd = omega * np.sqrt(1 - zeta**2)
    d_omega = np.array([-omega / (2 * m), omega / (2 * k), 0])
    d_zeta = np.array([-zeta / (2 * m), -zeta / (2 * k), zeta / c])
    assert result.frequencies[:, 0] == pytest.approx(d_omega / (2 * np.pi), rel=1e-13, abs=1e-15)
    assert result.damping_ratios[:, 0] == pytest.approx(d_zeta, rel=1e-13)
    assert result.damped_frequencies[:, 0] == pytest.approx(
        (d_omega * wd / omega - omega**2 * zeta * d_zeta / wd) / (2 * np.pi), rel=1e-12)  # fmt: skip
    assert result.shapes[:, 0, 0] == pytest.approx([-0.5 * m**-1.5, 0, 0], rel=1e-13, abs=1e-15)


def test_creeping_mode_has_natural_frequency_and_ratio_too():
    result = oscillator(damping=500.0).linearize().mode_sensitivities(["spring.stiffness", "spring.damping"])
    omega = np.sqrt(400.0)
    assert result.frequencies[:, 0] == pytest.approx([omega / 1600 / (2 * np.pi), 0], rel=1e-12, abs=1e-15)
    assert result.damping_ratios[:, 0] == pytest.approx([-500.0 / (4 * 40.0 * 800.0), 1 / 80.0], rel=1e-12)
    assert (result.damped_frequencies == 0).all()


def chain():
    """Two free masses and a spring: one rigid-body mode."""
    model = mv.Model()
    for name, mass, z in (("left", 1.0, 0.0), ("right", 3.0, 1.0)):
        model.add_body(name, mass, (1, 1, 1), position=(0, 0, z))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name)
    model.add_bushing("between", "left", "right", (0, 0, 0.5), (0, 0, 50.0, 0, 0, 0))
    model.add_bushing("hold", "ground", "left", (0, 0, 0), stiffness=(0, 0, 0, 0, 0, 0), damping=(0, 0, 0, 1, 0, 0))
    return model


def test_rigid_body_mode_keeps_its_norm():
    system = chain().linearize()
    result = system.mode_sensitivities(["left.mass", "hold.stiffness.z"])
    shape = system.modes().shapes[:, 0]
    assert result.shapes[0, :, 0] == pytest.approx(-0.5 * shape / 4.0, rel=1e-13)
    assert result.frequencies[0, 0] == 0
    assert np.isinf(result.frequencies[1, 0])
    assert np.isnan(result.shapes[1, :, 0]).all()
    assert np.isfinite(result.shapes[1, :, 1]).all()


def test_repeated_modes_move_as_a_subspace():
    """A projector on the subspace of a repeated pair does not care for its basis."""
    model = mv.library.stewart()
    system = model.linearize()
    names = ["leg1.k.stiffness", "platform.mass", "leg1.head.position.x"]
    result, pair = system.mode_sensitivities(names).shapes, [0, 1]

    def projector(of):
        shapes = of.modes().shapes[:, pair]
        return shapes @ shapes.conj().T

    shapes = system.modes().shapes[:, pair]
    values = system.modes().eigenvalues
    assert abs(values[0] - values[2]) <= 1e-9 * abs(values[0])
    for row, name in enumerate(names):
        own = result[row][:, pair] @ shapes.conj().T
        expected = difference(model, system, name, projector)
        assert np.abs(own + own.conj().T - expected).max() <= 1e-7 * np.abs(expected).max() + 1e-9 * np.abs(own).max()


def aligned(shapes, mass, start):
    """Shapes with x^H M x = 1 and no phase against others."""
    shapes = shapes / np.sqrt(np.einsum("im,ij,jm->m", shapes.conj(), mass, shapes).real)
    phase = np.einsum("im,ij,jm->m", start.conj(), mass, shapes)
    return shapes * (np.abs(phase) / phase)


@pytest.mark.slow
@examples(3, slow=9)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
def test_differences_of_random_mechanisms(seed):
    model = spatial(seed, bodies=3, loops=seed % 2, ports=False)
    try:
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0)
    retained = [group.retained for group in system.provenance.reduction.groups]
    assume(min(retained, default=1.0) > 0.05)
    modes = system.modes()
    values = modes.eigenvalues
    apart = np.abs(values[:, None] - values)[np.triu_indices(len(values), 1)]
    assume(apart.min() > 1e-2 * np.abs(values).max())
    result, start = system.mode_sensitivities(), modes.shapes
    norm = np.sqrt(np.einsum("im,ij,jm->m", start.conj(), system.M, start).real)

    def of(changed):
        now = changed.modes()
        return [aligned(now.shapes, changed.M, start), now.frequencies, now.damping_ratios, now.damped_frequencies]

    names = list(system.parameters)
    for k in np.random.default_rng(seed).choice(len(names), size=3, replace=False):
        if np.isnan(result.eigenvalues[k]).any():
            continue
        shapes, *others = difference(model, system, names[k], of)
        ours, theirs = ([item - 1j * start * np.einsum("im,ij,jm->m", start.conj(), system.M, item).imag / norm**2]
                        for item in (result.shapes[k], shapes * norm))  # fmt: skip
        assert np.abs(ours[0] - theirs[0]).max() <= 1e-7 * max(np.abs(shapes * norm).max(), np.abs(start).max())
        for key, theirs in zip(("frequencies", "damping_ratios", "damped_frequencies"), others, strict=True):
            limit = 1e-7 * max(np.abs(theirs).max(), np.abs(getattr(modes, key)).max())
            assert np.abs(getattr(result, key)[k] - theirs).max() <= limit, (names[k], key)


def test_the_table_shows_derivatives_with_units_and_no_rounding():
    model = mv.Model("two")
    for name, way in (("a", (1, 0, 0)), ("b", (0, 1, 0))):
        model.add_body(name, 2.0, (1, 1, 1))
        model.add_joint(f"{name}.rail", "prismatic", "ground", name, axis=way)
        model.add_spring(f"{name}.k", "ground", name, start=tuple(-w for w in way), end=(0, 0, 0),
                         stiffness=800.0 if name == "a" else 1800.0)  # fmt: skip
    change = model.linearize().mode_sensitivities(["a.k.stiffness", "?.mass"])
    table = change.table()
    assert [row[:2] for row in table["rows"]] == [("a.k.stiffness", "Hz per N/m"), ("?.mass", "Hz per kg")]
    slope = np.sqrt(800.0 / 2.0) / (2.0 * np.pi) / 2.0                 # f / 2 k of the first mode, none of the second
    assert [float(cell) for cell in table["rows"][0][2:]] == pytest.approx([slope / 800.0, 0.0], rel=1e-3)
    assert [float(cell) for cell in table["rows"][1][2:]] == pytest.approx([-slope / 2.0, -1.5 * slope / 2.0], rel=1e-3)
    assert table["notes"] == []
    assert repr(change) == "ModeSensitivities(2 variables, 2 modes)"
