"""One style of labels on the axes of all public figures: a quantity and its unit in brackets, [1] where it has none."""

import re
from functools import cache

import numpy as np
import pytest

import mbsvib as mv
from mbsvib import isolation, library, plots, studies
from mbsvib.campbell import campbell
from mbsvib.common import units

HEXAPOD = library.stewart_isolator()
ORDINALS = {"mode", "sample", "number of points", "number of samples"}
LABEL = re.compile(r"(?P<quantity>[^\[\]]*)\[(?P<unit>[^\[\]]+)\](?: for 1 (?P<input>.+))?")
ANGLES = 2 * np.pi * np.arange(128) / 128


@cache
def system():
    return HEXAPOD.linearize()


@cache
def loop():
    plant = isolation.actuated(HEXAPOD, "platform")
    return plant.with_gains(isolation.force_feedback(plant, 80.0, 1.0))


def locus():
    plant = isolation.actuated(HEXAPOD, "platform")
    return isolation.root_locus(plant, lambda gain: isolation.force_feedback(plant, gain), [0.0, 50.0, 100.0])


def front():
    goal = isolation.passive(HEXAPOD, "platform", directions="z")
    return goal.front({"leg*.stiffness": (1e3, 1e5)}, goal.index([100.0]), goal.sag(load=1.0), [1e-4, 2e-4])


def spinning():
    return campbell(library.rotor_stator(), np.linspace(0.0, 500.0, 6))


@cache
def cycle():
    return library.hoeken().cycle("crank.rz", ANGLES, speed=2 * np.pi)


def trade_off():
    places = {"link1": (0.0, (-0.08, 0, 0)), "link3": (0.0, (0.2, -0.08, 0))}
    model = studies.with_counterweights(library.hoeken(), places)
    measures = studies.cycle("crank.rz", ANGLES[::16], speed=2 * np.pi)
    quantities = {what: measures.mean_square(what) for what in ("force", "moment", "torque")}
    return studies.trade_off(model, {"link*.counterweight.mass": (0.0, 2.0)}, quantities, divisions=1)


def run():
    model = library.four_bar()
    return model.simulate(np.linspace(0.0, 0.02, 5))


FIGURES = {
    "bode": lambda: [plots.bode(system(), ["z", "rx"], ["Fz", "Mx"], decibels=decibels, radians=radians)
                     for decibels in (False, True) for radians in (False, True)],
    "campbell": lambda: [plots.campbell(spinning())],
    "comparison": lambda: [mv.compare(system(), system()).plot()],
    "cycle": lambda: [plots.cycle(cycle()), plots.cycle(library.toggle().cycle("rail.z", [0.0, -0.01], speed=0.1))],
    "energy": lambda: [plots.energy(system()), plots.energy(system(), "kinetic")],
    "front": lambda: [plots.front(front())],
    "isolation": lambda: [plots.isolation(isolation.study(HEXAPOD, "platform"))],
    "loop_gain": lambda: [plots.loop_gain(loop(), decibels=decibels) for decibels in (False, True)],
    "loop_nyquist": lambda: [plots.loop_nyquist(loop())],
    "mechanism": list,
    "mode_comparison": lambda: [plots.mode_comparison(system(), [1.0, 2.0]), plots.mode_comparison(system(), system())],
    "mode_strips": lambda: [plots.mode_strips(system())],
    "mode_contributions": lambda: [plots.mode_contributions(system(), "z", "Fz")],
    "transmissibility": lambda: [plots.transmissibility(isolation.study(HEXAPOD, "platform"))],
    "modes": lambda: [plots.modes(system())],
    "nyquist": lambda: [plots.nyquist(system(), "z", "Fz")],
    "path": lambda: [plots.path(library.toggle(angle=0.284).path("base.rz", [0.0, -0.1]))],
    "periodic": lambda: [plots.periodic(cycle().periodic({"crank.rz": (0.2, 1e-3)}))],
    "pole_zero_map": lambda: [plots.pole_zero_map(system(), "z", "Fz")],
    "root_locus": lambda: [plots.root_locus(locus())],
    "sensitivity": lambda: [plots.sensitivity(loop(), decibels=decibels) for decibels in (False, True)],
    "singular_values": lambda: [plots.singular_values(system(), ["x", "y"], ["Fx", "Fy"])],
    "step": lambda: [plots.step(system(), ["z", "rx"], ["Fz", "Mx"])],
    "time_grid": list,
    "topology": list,
    "trade_off": lambda: [plots.trade_off(trade_off())],
    "run": lambda: [run().plot()],
    "sweep": lambda: [mv.track(library.quarter_car(), {"suspension.damping": np.geomspace(50.0, 5e3, 20)}).plot(),
                      mv.track(library.quarter_car(), {"suspension.damping": np.geomspace(50.0, 5e3, 20)}).root_locus(),
                      mv.track(library.quarter_car(), {"suspension.damping": [50.0, 60.0]}).plot("damping_ratios")],
}  # fmt: skip


def labels(figure):
    for axes in figure.axes:
        if axes.get_visible():
            yield from filter(None, (axes.get_xlabel(), axes.get_ylabel()))
    yield from filter(None, (figure.get_supxlabel(), figure.get_supylabel()))


def test_every_public_figure_is_here():
    assert set(plots.__all__) - {"STYLE"} <= set(FIGURES)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FIGURES if name not in ("mechanism", "topology", "time_grid")])
def test_labels_have_units_in_one_style(name):
    for figure in FIGURES[name]():
        words = list(labels(figure))
        assert words
        for label in words:
            text, _, note = label.partition("\n")
            assert not note or note.startswith("("), label
            if text in ORDINALS or text.startswith("mode of "):
                continue
            match = LABEL.fullmatch(text)
            assert match, label
            unit = match["unit"].removeprefix("dB re 1 ")
            assert unit == unit.strip() == units.pretty(unit), label
            assert unit not in ("-", "", "/"), label
            assert " / " not in unit, label


@pytest.mark.parametrize("draw", [plots.bode, plots.step, plots.nyquist])
def test_more_panels_than_a_figure_holds_are_asked_for(draw):
    """No ports are chosen in silence."""
    with pytest.raises(mv.ResponseError, match="panels; a figure holds at most 12: choose"):
        draw(system())


@pytest.mark.slow
def test_what_is_left_out_is_said():
    many = plots.energy(library.chain(70).linearize())
    assert many.get_suptitle() == "60 of 70 modes"
    assert plots.energy(system()).get_suptitle() == ""
    model = library.chain(20)
    figure = model.simulate(np.linspace(0.0, 1e-3, 3)).plot()
    total = len(model.linearize().outputs or model.linearize().coordinates)
    what = "outputs" if model.linearize().outputs else "coordinates"
    assert figure.get_suptitle() == (f"12 of {total} {what}; name others by run.plot([...])" if total > 12 else "")
