"""Results show themselves: one short line by ``repr``, a table in notebooks; ``dir`` shows what is public."""

import importlib
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import isolation, library, studies
from mbsvib.campbell import campbell
from mbsvib.common.display import Displayed, brief, upper
from tests.support.public import returned_classes

LONGEST = 160
# what the verbs of results hand to each other: neither printed nor documented
INTERNAL = ("mbsvib.elements", "mbsvib.equations", "mbsvib.mechanism.mechanism", "mbsvib.modes.damped",
            "mbsvib.modes.general", "mbsvib.responses.basis", "mbsvib.responses.batch", "mbsvib.responses.energy_schur",
            "mbsvib.responses.modal_sum", "mbsvib.responses.rounding", "mbsvib.feedback.loop.Resolution",
            "mbsvib.feedback.closing",
            "mbsvib.sensitivities.basis", "mbsvib.sensitivities.forms", "mbsvib.sensitivities.loaded_network",
            "mbsvib.sensitivities.network", "mbsvib.sensitivities.parameter_groups", "mbsvib.sensitivities.pose_motion",
            "mbsvib.sensitivities.ports", "mbsvib.sensitivities.spectrum", "mbsvib.sensitivities.variants",
            "mbsvib.studies.evaluation", "mbsvib.studies.design")  # fmt: skip
RESULTS = {name: kind for name, kind in returned_classes().items() if not name.startswith(INTERNAL)}


class Balanced(HTMLParser):
    """A reader that counts tags which are open."""

    def __init__(self):
        super().__init__()
        self.open, self.words = [], []

    def handle_starttag(self, tag, attributes):
        if tag not in ("img", "br", "source"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def check(result):
    line = repr(result)
    assert "\n" not in line
    assert len(line) <= LONGEST
    assert type(result).__name__ in line or "(" in line
    reader = Balanced()
    reader.feed(result._repr_html_())
    assert reader.open == []
    assert any(word.strip() for word in reader.words)


@pytest.mark.parametrize("name", RESULTS)
def test_every_result_has_a_line_and_html(name):
    kind = RESULTS[name]
    assert callable(getattr(kind, "_repr_html_", None)), f"{name} has no _repr_html_: derive it from Displayed"
    assert kind.__repr__ is not object.__repr__
    generated = getattr(vars(kind).get("__repr__"), "__wrapped__", None) is not None
    assert not generated, f"{name}: @dataclass prints whole arrays; give it repr=False"


def test_every_result_is_in_the_reference():
    """By its own name, or that of the class which users get."""
    pages = (Path(mv.__file__).parents[1] / "docs" / "pages" / "reference").glob("*.md")
    shown = []
    for name in re.findall(r"^::: (\S+)$", "\n".join(page.read_text(encoding="utf-8") for page in pages), re.MULTILINE):
        home, _, last = name.rpartition(".")
        try:
            module = importlib.import_module(name)
        except ModuleNotFoundError:
            shown.append(getattr(importlib.import_module(home), last))
        else:
            shown += [getattr(module, public) for public in module.__all__]
    classes = tuple(item for item in shown if isinstance(item, type))
    missing = [name for name, kind in RESULTS.items() if not any(issubclass(item, kind) for item in classes)]
    assert missing == []


def test_there_are_results_to_look_at():
    names = {kind.__name__ for kind in RESULTS.values()}
    assert {"Norm", "Modes", "System", "ClosedLoop", "Margins", "Sweep", "Cycle", "SystemData", "StateSpace"} <= names
    assert len(RESULTS) > 50


def results():
    """Results of all folders, on the smallest scenes."""
    model = library.quarter_car()
    system = model.linearize()
    yield from (model, system, system.modes(), system.state_space(), system.parameters)
    damped = library.stewart().linearize()
    yield damped.hinf_norm("x", "Fx", ["*.stiffness", "*.mass"])
    yield damped.h2_norm("x", "Fx")
    yield damped.reduced(4)
    yield system.mode_sensitivities()
    yield system.matrix_derivatives()
    batch = model.linearize(values={"tyre.stiffness": [1e5, 2e5]})
    yield from (batch, batch.modes())
    yield studies.sweep(model, {"tyre.stiffness": [1e5, 2e5]}, "modes.frequencies")
    yield studies.tolerances(model, {"tyre.stiffness": "10 %"}, studies.frequency(), samples=20)
    yield studies.frequency(1)
    yield studies.frequency(1) >= 1.0
    yield model.equilibrium(report=True)
    loop = damped.feedback(np.array([[-100.0]]), "x", "Fx")
    yield from (loop, loop.margins(), loop.sampled(1000.0))
    hexapod = library.cubic_hexapod(damping=2.0)
    study = isolation.study(hexapod, "platform")
    yield from (study, study.under({"x y z": isolation.white(1e-6)}), isolation.white(1e-6))
    plant = isolation.actuated(hexapod, "platform")
    law = isolation.force_feedback(plant, 100.0)
    yield from (plant, law, plant.with_gains(law), isolation.passive(hexapod, "platform"))
    yield isolation.root_locus(plant, lambda g: isolation.force_feedback(plant, g), np.linspace(0.0, 100.0, 5))
    yield isolation.collocation(plant, [("leg1.k.actuator", "leg1.k.force")])
    yield campbell(library.rotor_stator(), np.linspace(0.0, 10.0, 3))
    yield library.chain(800).linearize()


@pytest.mark.slow
def test_results_of_all_folders():
    kinds = set()
    for result in results():
        check(result)
        kinds.add(type(result))
    assert len(kinds) > 25


def test_exports(tmp_path):
    system = library.quarter_car().linearize()
    mx.to_npz(system, tmp_path / "car.npz")
    check(mx.from_npz(tmp_path / "car.npz"))
    check(mx.to_c(system, tmp_path))
    check(mx.check_export(tmp_path / "car.npz", system))
    mx.to_uff(system, tmp_path / "car.uff", [1.0, 2.0])
    check(mx.from_uff(tmp_path / "car.uff"))


def test_a_norm_of_many_parameters_is_short():
    system = library.stewart().linearize()
    norm = system.hinf_norm("x", "Fx", [name for name in system.parameters if name.endswith((".mass", ".x"))])
    assert len(norm.variables) > 50
    assert repr(norm) == (f"Norm(value={norm.value:.6g}, variables={len(norm.variables)} entries, "
                          f"slopes=array of {len(norm.variables)}, omega={norm.omega:.6g})")  # fmt: skip
    assert str(norm) == repr(norm)


@pytest.mark.slow
def test_tables_of_many_modes_fit_on_a_page():
    """A fan on a shaft of beams had 54 columns."""
    rotor = mv.Model("fan")
    rotor.add_body("disk", 12.0, (0.1, 0.1, 0.19), position=(0, 0, 0.4))
    rotor.add_beam("shaft", "ground", "disk", {"type": "circle", "radius": 0.015}, {"E": 2e11, "nu": 0.3, "rho": 7800},
                   start=(0, 0, 0), end=(0, 0, 0.4), elements=6)  # fmt: skip
    rotor.add_rotor("wheel", "disk", 1.0, (0, 0, 1), inertia=0.19)
    data = campbell(rotor, np.linspace(0.0, 1.0, 25), orders=())
    assert data.frequencies.shape[1] > 30
    lines = str(data).splitlines()
    assert max(map(len, lines)) < 200
    assert f"25 speeds, {data.frequencies.shape[1]} modes in all" in lines[-1]


def test_brief_values():
    assert brief(np.array([1.0, 2.5])) == "[1, 2.5]"
    assert brief(np.zeros((3, 400))) == "array of 3 x 400"
    assert brief(np.float64(1.23456789)) == "1.23457"
    assert brief(True) == "True"
    assert brief(("a", 1)) == "('a', 1)"
    assert brief((1.5,)) == "(1.5,)"
    assert brief(list(range(9))) == "9 entries"
    assert brief({"x": np.zeros(9)}) == "{x: array of 9}"
    assert brief("w" * 200).endswith("...'")
    assert brief(library.quarter_car()) == "Model" or len(brief(library.quarter_car())) <= 60


def test_columns_of_numbers_are_no_table_to_print():
    """``Run.table`` is that."""
    class Numbers(Displayed):
        def table(self):
            return {"time": [0.0, 1.0]}

    assert str(Numbers()) == "Numbers()"
    assert "<pre>" not in Numbers()._repr_html_()


def test_html_is_escaped():
    class Named(Displayed):
        inputs = ("<script>",)

        def __repr__(self):
            return "Named('<b>')"

    assert "<script>" not in Named()._repr_html_()
    assert "&lt;b&gt;" in Named()._repr_html_()


@pytest.mark.parametrize("name", ["mbsvib", "mbsvib.library", "mbsvib.isolation", "mbsvib.studies", "mbsvib.plots",
                                  "mbsvib.errors", "mbsvib.report", "mbsvib_export"])  # fmt: skip
def test_dir_shows_the_public_names_and_nothing_else(name):
    module = importlib.import_module(name)
    assert sorted(dir(module)) == sorted(module.__all__)
    assert all(getattr(module, public) is not None for public in module.__all__)


def test_public_names_of_the_package():
    from mbsvib import errors

    assert set(errors.__all__) <= set(mv.__all__)
    page = Path(mv.__file__).parents[1] / "docs" / "pages" / "reference" / "systems.md"
    listed = page.read_text(encoding="utf-8").split("mbsvib.errors")[1]
    assert set(errors.__all__) == set(re.findall(r"\b[A-Z]\w+", listed.split("]")[0]))
    assert not [name for name in dir(mv) if name.startswith("_") and name != "__version__"]


def test_bounds_are_rounded_up():
    for bound in (0.0, 1.0, 117.4999, 1.0004e-7, 9.999e5, 2.5e-300):
        assert bound <= float(upper(bound)) <= bound * 1.01
    assert upper(117.1) == "118"
