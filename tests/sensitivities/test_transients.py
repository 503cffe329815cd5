"""Sensitivities of time responses and of norms: closed forms, and differences of the whole computation."""

import pickle

import numpy as np
import pytest
from hypothesis import assume, given

import mbsvib as mv
from mbsvib.sensitivities import norms
from tests.sensitivities.differences import difference
from tests.sensitivities.test_responses import isolator
from tests.support.random_models import seeds, spatial
from tests.support.sizes import examples


def test_step_of_an_undamped_oscillator():
    """y = (1 - cos w t) / k."""
    model = mv.Model()
    model.add_body("mass", 2.0, (1.0, 1.0, 1.0))
    model.add_joint("rail", "prismatic", "ground", "mass")
    model.add_spring("spring", "ground", "mass", (0, 0, -1), (0, 0, 0), 800.0)
    model.add_input("push", "mass", "z")
    model.add_output("way", "mass", "z")
    t = np.linspace(0, 2, 300)
    result = model.linearize().time_response_sensitivities(t, np.ones(300), ["spring.stiffness", "mass.mass"], "zero")
    w, k, m = 20.0, 800.0, 2.0
    by_frequency = t * np.sin(w * t) / k
    expected = [by_frequency * w / (2 * k) - (1 - np.cos(w * t)) / k**2, -by_frequency * w / (2 * m)]
    assert (np.abs(result[:, 0] - expected).max(axis=1) <= 1e-13 * np.abs(expected).max(axis=1)).all()


@pytest.mark.few(1)
@pytest.mark.parametrize("hold", ["zero", "first"])
def test_uneven_steps_initial_states_and_all_kinds_of_outputs(hold):
    model, rng = isolator(), np.random.default_rng(5)
    system = model.linearize()
    t, u = np.sort(rng.uniform(size=25)), rng.normal(size=(2, 25))
    names = ["mass.mass", "spring.stiffness", "spring.damping"]
    result = system.time_response_sensitivities(t, u, names, hold, ([0.02], [-1.0]))
    for row, name in zip(result, names, strict=True):
        expected = difference(model, system, name, lambda s: s.time_response(t, u, hold, ([0.02], [-1.0])))
        assert (np.abs(row - expected).max(axis=1) <= 1e-7 * np.abs(expected).max(axis=1) + 1e-12).all(), name


@pytest.mark.slow
@examples(3, slow=9)
@pytest.mark.filterwarnings("ignore::mbsvib.errors.NearSingularWarning")
@given(seeds())
def test_differences_of_random_mechanisms(seed):
    model = spatial(seed, bodies=2, loops=seed % 2)
    try:
        system = model.linearize()
    except mv.MbsvibError:
        assume(False)
    assume(system.dof > 0 and len(system.inputs) > 0 and len(system.outputs) > 0)
    retained = [group.retained for group in system.provenance.reduction.groups]
    assume(min(retained, default=1.0) > 0.05)
    rng, fastest = np.random.default_rng(seed), np.abs(system.poles()).max()
    t, u = np.linspace(0, 30 / fastest, 60), rng.normal(size=(len(system.inputs), 60))
    result, value = system.time_response_sensitivities(t, u), np.abs(system.time_response(t, u)).max()
    names = list(system.parameters)
    for k in rng.choice(len(names), size=4, replace=False):
        if not np.isnan(result[k]).any():
            expected = difference(model, system, names[k], lambda s: s.time_response(t, u))
            assert np.abs(result[k] - expected).max() <= 1e-7 * np.abs(expected).max() + 1e-8 * value, names[k]


def test_norms_of_an_isolator_in_closed_form():
    """H2^2 = 1 / 2 c k, Hinf = 1 / c w sqrt(1 - zeta^2)."""
    system = isolator().linearize()
    names = ["mass.mass", "spring.stiffness", "spring.damping"]
    two, peak = (norm("way", "push", names) for norm in (system.h2_norm, system.hinf_norm))
    m, k, c = 2.0, 800.0, 3.0
    value = np.sqrt(1 / (2 * c * k))
    assert two.value == pytest.approx(value, rel=1e-13)
    assert two.slopes == pytest.approx([0, -value / (2 * k), -value / (2 * c)], rel=1e-12, abs=1e-15)
    square = k / m - c**2 / (4 * m**2)  # of the damped frequency, which is that of the free oscillation
    height = 1 / (c * np.sqrt(square))
    assert peak.value == pytest.approx(height, rel=1e-13)
    assert peak.omega == pytest.approx(np.sqrt(k / m - c**2 / (2 * m**2)), rel=1e-8)
    by_square = -height / (2 * square)
    expected = [by_square * (-k / m**2 + c**2 / (2 * m**3)), by_square / m, -height / c - by_square * c / (2 * m**2)]
    assert peak.slopes == pytest.approx(expected, rel=1e-9)


@pytest.mark.slow
def test_norms_of_the_platform_against_differences():
    model = mv.library.stewart()
    system = model.linearize()
    names = ["platform.mass", "leg1.k.stiffness", "leg2.k.damping"]
    ports = {"inputs": ["Fx", "Fz"], "outputs": ["x", "z"]}
    for key in ("h2_norm", "hinf_norm"):
        result = getattr(system, key)(parameters=names, **ports)
        assert len(result.slopes) == len(names)
        for slope, name in zip(result.slopes, names, strict=True):
            expected = difference(model, system, name, lambda s, key=key: getattr(s, key)(parameters=[], **ports).value)
            assert slope == pytest.approx(expected, rel=1e-7, abs=1e-9 * result.value), (key, name)


def test_static_compliance_is_that_of_the_spring():
    result = isolator().linearize().compliance_sensitivities(["spring.stiffness", "mass.mass"], "way", "push")
    assert result[:, 0, 0] == pytest.approx([-1 / 800.0**2, 0], rel=1e-13)


@pytest.mark.parametrize(("verb", "engine"), [("hinf_norm", "frequency_response_sensitivities"),
                                              ("h2_norm", "changed")])  # fmt: skip
def test_slopes_of_norms_that_nobody_named_are_computed_when_asked_for(verb, engine, monkeypatch):
    system = isolator().linearize()
    norm, kept = (getattr(system, verb)("way", "push") for _ in range(2))
    named = getattr(system, verb)("way", "push", list(system.parameters))
    same = pickle.loads(pickle.dumps(kept))

    def refuse(*_, **__):
        raise NotImplementedError

    monkeypatch.setattr(norms, engine, refuse)
    assert (norm.value, norm.variables, norm.omega) == (named.value, named.variables, named.omega)
    np.testing.assert_array_equal(same.slopes, named.slopes)
    with pytest.raises(NotImplementedError):
        getattr(system, verb)("way", "push", "mass.mass")
    monkeypatch.undo()
    np.testing.assert_array_equal(norm.slopes, named.slopes)


def test_infinite_norms_are_refused():
    system = isolator().linearize()
    with pytest.raises(mv.ResponseError, match="'felt' sees input 'push' at once"):
        system.h2_norm("felt", "push")
    undamped = isolator().with_values({"spring.damping": 0.0}).linearize()
    with pytest.raises(mv.ResponseError, match=r"the pole 0\+20j 1/s \(3.183 Hz\) of mode 1 does not decay"):
        undamped.h2_norm("way", "push")
    with pytest.raises(mv.ResponseError, match=r"the pole 0\+20j 1/s \(3.183 Hz\) of mode 1 does not decay"):
        undamped.hinf_norm("way", "push")
    with pytest.raises(mv.ModelError, match=r"Did you mean 'mass\.mass'"):
        system.hinf_norm("way", "push", "mass.mas")


def test_poles_of_an_infinite_norm_are_listed_in_few_words():
    chain = mv.System.from_matrices(np.eye(6), None, 4 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1), np.eye(6)[0])
    with pytest.raises(mv.ResponseError, match=r": the poles ([^;]*; ){3}[^;]* and 2 more do not decay and appear in "
                                               r"the response .* Give them damping"):  # fmt: skip
        chain.hinf_norm()


@pytest.mark.parametrize(("k", "c"), [(1.0, 2e-3), (1e-6, 2e-9)])
def test_rms_of_a_slow_mode_beside_a_fast_one(k, c):
    """White noise on a body that a soft spring holds, ||x||^2 = 1 / (2 c k), and a stiff spring in it: k_stiff 1e10."""
    model = mv.Model()
    for i, name in enumerate(("a", "b")):
        model.add_body(name, 1.0, (1, 1, 1), position=(i, 0, 0))
    model.add_joint("ja", "prismatic", "ground", "a", position=(0, 0, 0), axis=(1, 0, 0))
    model.add_joint("jb", "prismatic", "a", "b", position=(1, 0, 0), axis=(1, 0, 0))
    model.add_spring("soft", "ground", "a", start=(-1, 0, 0), end=(0, 0, 0), stiffness=k, damping=c)
    model.add_spring("stiff", "a", "b", start=(0, 0, 0), end=(1, 0, 0), stiffness=1e10, damping=2.0)
    model.add_input("F", "b", "x")
    model.add_output("x", "b", "x")
    norm = model.linearize().h2_norm("x", "F", ["soft.stiffness", "soft.damping"])
    value = (2 * c * k) ** -0.5
    assert norm.value == pytest.approx(value, rel=1e-9 * k + 1e-14)
    assert norm.slopes == pytest.approx([-0.5 * value / k, -0.5 * value / c], rel=2e-5)


def test_a_response_may_be_highest_at_infinite_frequency():
    """The acceleration under strong damping tends to 1/m from below."""
    system = isolator().with_values({"spring.damping": 200.0}).linearize()
    mass = system.parameters["mass.mass"]
    norm = system.hinf_norm("felt", "push", ["mass.mass", "spring.stiffness", "spring.damping"])
    assert (norm.value, norm.omega) == (pytest.approx(1 / mass, rel=1e-12), np.inf)
    assert norm.slopes == pytest.approx([-1 / mass**2, 0.0, 0.0], rel=1e-12, abs=1e-15)
    assert str(norm)


def beside_a_swing(own):
    """A damped body, and one that swings for ever; a bushing ties the damped one's directions to each other."""
    model = mv.Model()
    model.add_body("a", 1.0, (1, 1, 1), position=(0, 0, 1))
    model.add_bushing("k", "ground", "a", position=(0.1, 0.2, 0.3), stiffness=(9, 8, 7, 6, 5, 4),
                      damping=(1, 1, 1, 1, 1, 0.1))  # fmt: skip
    model.add_input("push", "a", "x")
    model.add_output("way", "a", "x")
    if not own:
        model.add_body("b", 1.0, (1, 1, 1), position=(0, 3, 1))
        model.add_spring("s", "ground", "b", start=(0, 0, 0), end=(0, 3, 1), stiffness=3.0)
        model.add_input("kick", "b", "z")
        model.add_output("swing", "b", "x")
        model.add_output("lift", "b", "z")
        model.add_output("felt", "b", "x", quantity="acceleration")
    return model.linearize()


@pytest.mark.few(1)
@pytest.mark.parametrize("norm", ["h2_norm", "hinf_norm"])
def test_norms_beside_a_mode_that_does_not_decay(norm):
    """A response that is 0 has the norm 0; one that has nothing to do with the mode has the norm that it has alone."""
    system, own = beside_a_swing(own=False), beside_a_swing(own=True)
    for ports in (("push", "swing"), ("push", "felt"), ("kick", "way"), ("kick", "swing")):
        result = getattr(system, norm)(*reversed(ports), ["b.mass", "k.stiffness.x"])
        assert (result.value, result.slopes.tolist()) == (0.0, [0.0, 0.0])
    result = getattr(system, norm)("way", "push", ["k.stiffness.x", "s.stiffness"])
    single = getattr(own, norm)("way", "push", ["k.stiffness.x"])
    assert result.value == pytest.approx(single.value, rel=1e-12)
    assert result.slopes == pytest.approx([single.slopes[0], 0.0], rel=1e-11)
    together = getattr(system, norm)(["way", "swing"], ["push", "kick"], [])
    assert together.value == pytest.approx(single.value, rel=1e-12)
    with pytest.raises(mv.ResponseError, match=r"1/s .* not decay"):
        getattr(system, norm)(["way", "lift"], ["push", "kick"], [])


@pytest.mark.parametrize("norm", ["h2_norm", "hinf_norm"])
def test_relative_motion_across_a_free_pair(norm):
    """What pushes the pair apart along its line turns and shifts nothing."""
    model = mv.Model()
    for name, z in (("a", 1), ("b", 2)):
        model.add_body(name, 1.0, (1, 1, 1), position=(0, 0, z))
    model.add_bushing("k", "a", "b", position=(0, 0, 1.5), stiffness=(9, 8, 7, 6, 5, 4), damping=(1, 1, 1, 1, 1, 1))
    model.add_input("F", "b", "z", relative_to="a")
    model.add_output("slip", "b", "x", relative_to="a")
    assert getattr(model.linearize(), norm)(parameters=[]).value == 0.0


def test_a_mode_that_does_not_decay_is_counted_beside_modes_of_first_order():
    model = mv.Model()
    model.add_body("a", 1.0, (1, 1, 1), position=(0, 0, 1))
    model.add_joint("rail", "prismatic", "ground", "a")
    model.add_spring("s", "ground", "a", start=(0, 0, 0), end=(0, 0, 1), stiffness=9e4)
    model.add_body("b", 1.0, (1, 1, 1), position=(0, 2, 1))
    model.add_joint("way", "prismatic", "ground", "b")
    for i in range(2):
        model.add_maxwell(f"m{i}", "ground", "b", (0, 2, 0), (0, 2, 1), 3.0, 5.0, static_stiffness=1.0)
    model.add_input("F", "a", "z")
    model.add_output("x", "a", "z")
    system = model.linearize()
    assert system.modes().first_order.tolist() == [True, True, False, False]
    with pytest.raises(mv.ResponseError, match="mode 4 does not decay"):
        system.h2_norm(parameters=[])


def test_transmissibility_has_no_feedthrough_to_rounding():
    """The felt acceleration sees the base through the spring only: D and what the mass takes back cancel."""
    system = isolator().linearize()
    result = system.h2_norm("way", "floor", ["spring.damping", "mass.mass"])
    assert np.isfinite(result.slopes).all()
    expected = difference(isolator(), system, "mass.mass", lambda s: s.h2_norm("way", "floor", []).value)
    assert result.slopes[1] == pytest.approx(expected, rel=1e-8)


def test_a_mode_whose_decay_is_rounding_has_no_h2_norm():
    """The Lyapunov equation of a mode with a damping ratio of 1e-20 is singular in double precision."""
    model = mv.Model("slide")
    model.add_body("b", 2.0, (1, 1, 1))
    model.add_joint("j", "prismatic", "ground", "b", axis=(0, 0, 1))
    model.add_bushing("k", "ground", "b", (0, 0, 0), (0, 0, 200.0, 0, 0, 0), (0, 0, 4e-19, 0, 0, 0))
    model.add_input("f", "b", "z")
    model.add_output("z", "b", "z")
    with pytest.raises(mv.ResponseError, match="mode 1 does not decay"):
        model.linearize().h2_norm()
