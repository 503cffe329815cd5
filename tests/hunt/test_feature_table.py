"""Which engine takes which feature: the smallest scenes that have one, compared with the dense engine or refused.

The table in the documentation is held to what these scenes find.
"""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import mbsvib as mv
from mbsvib.plots._scene import of_system
from mbsvib.report.data import collect
from tests.hunt import checks, features, models
from tests.hunt.answers import compare_responses, response_of
from tests.hunt.generate import draft_of, example
from tests.hunt.run import outcome_of
from tests.hunt.scene import Scene
from tests.hunt.sensitivities import sensitivities

PAGE = Path(__file__).parents[2] / "docs" / "pages" / "features.md"
# Scenes that are made of a feature until an engine has something to do with one.
SEEDS = range(1, 9)
# A joint is moved by this [m, rad] and back, to where its bodies were up to this.
STEP, SAME = 0.01, 1e-12
ROWS = {
    "Joints in the tree": features.TREE,
    "Joints that close loops": features.LOOP,
    "Redundant joints": features.REDUNDANT,
    "Couplers, gears, worms, racks": features.COUPLERS,
    "Bushings, springs, dampers": ("bushing 6x6", "line spring", "negative stiffness", "damper alone",
                                   *features.DAMPING),
    "Cross-coupled bushings": ("cross-coupled bushing",),
    "Bushings whose stiffness depends on frequency": ("dynamic bushing",),
    "Springs and torsion springs whose stiffness depends on frequency": ("dynamic spring", "dynamic torsion spring"),
    "Maxwell elements": ("maxwell",),
    "Maxwell elements with a static spring": ("maxwell with static spring",),
    "Inerters": ("inerter",),
    "Torsion springs": ("torsion spring",),
    "Massless bodies": ("massless node",),
    "Massless bodies with dampers": ("massless damped node",),
    "Point masses": ("point mass",),
    "Rotors": features.SPIN,
    "Beams": features.BEAMS,
    "Flexures": ("flexure",),
    "Superelements": features.SUPERELEMENTS,
    "Gravity and forces": ("gravity", "dead force"),
    "Preloads and free lengths": ("bushing preload", "line preload", "free length", "preloaded torsion spring"),
    "Torques and follower loads": ("dead torque", "follower force", "follower torque"),
    "Base motion": features.BASE,
    "Displacements, velocities, accelerations": features.SIGNALS,
    "Forces in springs, bushings and inerters": ("spring force", "bushing force", "inerter force",
                                                 "torsion spring moment"),
    "Forces in joints, sums on bodies and ground": ("joint force", "cut joint force", "sum on body", "sum on ground"),
    "Forces in beams": ("beam force",),
    "Strains of beams": ("beam strain",),
    "Forces in Maxwell elements": ("maxwell force",),
    "Forces in bushings whose stiffness depends on frequency": ("dynamic bushing force",),
    "Forces in springs whose stiffness depends on frequency": ("dynamic spring force",),
}  # fmt: skip
# What a single scene has against being moved or loaded, whatever its element; another scene is asked.
OF_SCENE = re.compile(r"which no joint with|is not a linear relation|off its axis|leave no choice|wound up")
# Gravity does not turn with a ground that turns, springs on bodies that spin would be wound up, and the mass of what
# stands on the ground within does not tell how gravity acts.
NO_EQUILIBRIUM = ("base rotation", "spinning body", "rotating damper", "grounded superelement")
WORDS = {"held": "yes", "refused": "refused", "skipped": "–"}


def alone(feature):
    """A feature with what it needs, and what holds it in balance."""
    selected = features.with_needs(feature)
    return frozenset((*selected, "held by bushings") if set(selected) & set(features.LOADING) else selected)


def sparse_responses(subject):
    system = subject.scene.model().linearize(method="sparse")
    compare_responses(response_of(system, subject.question), subject.answers.response, subject.question)


def sparse_modes(subject):
    subject.scene.model().linearize(method="sparse").modes(1)
    checks.sparse(subject)


def moved(subject):
    """Along one coordinate and back: bodies are where they were; a rod goes back from there along another circle."""
    model = subject.scene.model()
    names = [name for name in subject.system.coordinates if name.split(".")[0] in model.joints]
    if subject.scene.features & set(features.LOADING) or not names:
        raise checks.Skip("nothing that may be moved")
    there = model.moved({names[0]: STEP}, relaxed=True)
    assert there.linearize(method="dense").dof == subject.system.dof
    back = there.moved({names[0]: -STEP}, relaxed=True)
    rods = any(joint.kind == "distance" for joint in model.joints.values())
    for name, body in model.bodies.items():
        allowed = STEP**2 if rods else SAME
        np.testing.assert_allclose(back.bodies[name].position, body.position, rtol=0, atol=allowed)
        np.testing.assert_allclose(back.bodies[name].orientation, body.orientation, rtol=0, atol=allowed)


def equilibrium(subject):
    """Springs that give way to gravity: nothing is left over."""
    wanted = subject.scene.features - {"held by bushings"} | {"gravity"}
    draft = draft_of(subject.scene.seed, 0, wanted)
    try:
        Scene(subject.scene.seed, tuple(draft.calls), draft.gravity, wanted).model().equilibrium().linearize()
    except mv.EquilibriumError as error:
        raise checks.Skip("there is none") from error


def report(subject):
    """All numbers of a report are finite or left out, and its picture has all bodies."""
    facts = collect(subject.system)
    json.dumps(facts, allow_nan=False)
    assert of_system(subject.system.name, subject.system.provenance).bodies == subject.system.bodies


ENGINES = {"Sparse responses": sparse_responses, "Sparse modes": sparse_modes, "Batches": checks.batch,
           "Moved": moved, "Equilibrium": equilibrium, "Sensitivities": sensitivities, "Files": checks.saved,
           "Report": report}  # fmt: skip


def table():
    """Rows of the page: for each engine what it says."""
    head, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")]
                      for line in PAGE.read_text(encoding="utf-8").partition("| Column")[0].splitlines()
                      if line.startswith("|")]  # fmt: skip
    return {name: dict(zip(head[1:], cells, strict=True)) for name, *cells in rows}


@cache
def scene_of(feature, seed):
    """The scene of a feature with its answers, None where there is none; engines share what they ask of it."""
    scene = example(seed, alone(feature))
    if scene is None or outcome_of(lambda subject: subject.system, subject := checks.Subject(scene))[0] != "held":
        return None
    return subject


def answer(feature, engine):
    """What an engine does with the first scene of a feature that has something for it."""
    for seed in SEEDS:
        subject = scene_of(feature, seed)
        if subject is None:
            continue
        kind, error = outcome_of(ENGINES[engine], subject)
        if kind != "skipped" and not OF_SCENE.search(str(error)):
            return kind, error
    return "skipped", None


def test_the_table_lists_all_features_and_engines():
    listed = {feature for row in ROWS.values() for feature in row}
    assert listed == set(features.ALL) - set(features.HOLDS) - set(features.GLOBAL)
    assert list(table()) == [*ROWS, *models.MODELS]
    assert list(models.ENGINES) == list(ENGINES)
    assert all(list(row) == list(ENGINES) for row in table().values())


def check(row, engine, selected):
    for feature in selected:
        if engine == "Equilibrium" and feature in NO_EQUILIBRIUM:
            continue
        kind, error = answer(feature, engine)
        assert WORDS.get(kind) == table()[row][engine], f"{feature}: {kind}: {error}"
        if kind == "refused":
            assert re.search("use |linearize|ask|make it", str(error)), f"{feature}: nothing says what to do: {error}"


@pytest.mark.few(3)
@pytest.mark.parametrize("row", ROWS)
@pytest.mark.parametrize("engine", ENGINES)
def test_the_table_says_what_engines_do(row, engine):
    """With one feature of each row in every run; another test takes the others."""
    check(row, engine, ROWS[row][:1])


@pytest.mark.slow
@pytest.mark.parametrize("row", [row for row, listed in ROWS.items() if len(listed) > 1])
@pytest.mark.parametrize("engine", ENGINES)
def test_the_table_says_what_engines_do_with_other_features(row, engine):
    check(row, engine, ROWS[row][1:])


@pytest.mark.few(3)
@pytest.mark.parametrize("row", models.MODELS)
@pytest.mark.parametrize("engine", ENGINES)
def test_the_table_says_what_engines_do_with_models(row, engine):
    """Of features that random scenes have not."""
    try:
        models.ENGINES[engine](*models.MODELS[row]())
        found, advice = "yes", True
    except mv.ModelError as error:
        found, advice = "refused", re.search("use |linearize", str(error))
    assert found == table()[row][engine]
    assert advice, f"{row}: the refusal does not say what to do"
