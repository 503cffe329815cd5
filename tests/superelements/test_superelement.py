"""Superelements: a reduced beam is the beam, rigid motions are free, what does not fit is refused by name."""

import json

import jsonschema
import numpy as np
import pytest

import mbsvib as mv
from mbsvib.files import schema
from mbsvib.finite_motion.statement import finite_motion
from tests.superelements.craig_bampton import NODES, beam, reduced

ENDS = {"left": NODES[0], "right": NODES[-1]}


def with_hub(retained=18, bodies=None, turn=None, **words):
    m, k = reduced(retained)
    turn = np.eye(3) if turn is None else turn
    full = np.eye(len(m))
    full[:12, :12] = np.kron(np.eye(4), turn)
    model = mv.Model("reduced")
    model.add_body("hub", 0.8, (0.002, 0.003, 0.002), position=(0, -0.25, 0.3))
    model.add_superelement("pipe", full.T @ m @ full, None, full.T @ k @ full, ENDS,
                           bodies={"left": "hub"} if bodies is None else bodies, orientation=turn, **words)  # fmt: skip
    return model


def turned():
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    return turn * np.linalg.det(turn)


def test_with_all_modes_it_is_the_beam():
    expected = beam("whole", "hub", None).linearize().modes().frequencies
    model = with_hub()
    system = model.linearize()
    result = system.modes().frequencies
    assert (result[:6] == 0.0).all()
    assert result == pytest.approx(expected, rel=1e-9)
    assert {"pipe.right.x", "pipe.mode1", "pipe.mode18"} < set(system.coordinates)
    assert model.superelements["pipe"].rank == (30, 24)


def test_coordinates_of_runs_that_are_others_have_other_names():
    """Internal coordinates of the matrices, and modes with the nodes held; of these even the sign is free."""
    model = with_hub()
    names = set(finite_motion(model).motion.names)
    assert "pipe.fixed_mode18" in names
    assert not {name for name in model.linearize().coordinates if name.startswith("pipe.mode")} & names


def test_held_at_both_ends_and_in_turned_axes():
    expected = beam("whole", "hub", "ground").linearize().modes().frequencies
    model = with_hub(bodies={"left": "hub", "right": "ground"}, turn=turned())
    assert model.linearize().modes().frequencies == pytest.approx(expected, rel=1e-9)


def test_few_modes_are_enough_for_the_lowest():
    expected = beam("whole", "hub", "ground").linearize().modes().frequencies[:3]
    result = with_hub(4, bodies={"left": "hub", "right": "ground"}).linearize().modes().frequencies[:3]
    assert (result >= expected * (1 - 1e-9)).all()
    assert result == pytest.approx(expected, rel=0.02)


def test_nodes_are_bodies_for_joints_and_ports():
    models = []
    for model, node, hung in ((with_hub(), "pipe.right", "pipe"), (beam("whole", "hub", None), "pipe.4", "pipe")):
        model.add_joint("pin", "revolute", "ground", "hub", position=(0, 0, 0), axis=(0, 1, 0))
        model.add_spring("stay", "ground", node, start=(0.6, 0.25, 2), end=NODES[-1], stiffness=1e3, damping=3.0)
        model.add_input("F", node, (1, 2, 3, 0.1, 0.2, 0.3))
        model.add_output("x", node, "x", relative_to="hub")
        model.add_base_motion("shake", "y")
        model.add_base_motion("roll", "rx", position=(1, 1, 1))
        model.add_output("a", node, "y", quantity="acceleration")
        assert hung in model.composed
        models.append(model.linearize())
    omega = 2 * np.pi * np.array([1.0, 30.0, 200.0, 700.0])
    first, second = (system.frequency_response(omega) for system in models)
    assert np.abs(first / second - 1.0).max() < 1e-7


def test_damping_proportional_to_mass_and_stiffness():
    m, k = reduced(6)
    for alpha, beta in ((2.0, 0.0), (0.0, 1e-5), (2.0, 1e-5)):
        model = mv.Model("damped")
        model.add_superelement("pipe", m, alpha * m + beta * k, k, ENDS, bodies={"left": "ground"})
        modes = model.linearize().modes()
        omega = 2 * np.pi * modes.frequencies
        assert modes.damping_ratios == pytest.approx(0.5 * (alpha / omega + beta * omega), rel=1e-8)


def test_structural_damping_leaves_rigid_motion_free():
    m, k = reduced(6)
    model = mv.Model("free")
    model.add_superelement("pipe", m, 1e-5 * k, k, ENDS)
    eigenvalues = model.linearize().modes().eigenvalues
    assert (eigenvalues[:12] == 0.0).all()


def test_model_that_stands_on_the_ground_within():
    m, k = reduced(6)
    model = mv.Model("grounded")
    model.add_superelement("mast", m[6:, 6:], None, k[6:, 6:], {"top": NODES[-1]}, grounded=True)
    held = mv.Model("held")
    held.add_superelement("mast", m, None, k, ENDS, bodies={"left": "ground"})
    expected = held.linearize().modes().frequencies
    assert model.linearize().modes().frequencies == pytest.approx(expected, rel=1e-10)
    with pytest.raises(mv.ModelError, match=r"superelement 'mast': K resists .* grounded=True"):
        mv.Model("not").add_superelement("mast", m[6:, 6:], None, k[6:, 6:], {"top": NODES[-1]})


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_files(tmp_path, suffix):
    model = with_hub(2, turn=turned())
    path = mv.save(model, tmp_path / f"pipe{suffix}")
    back = mv.load(path)
    assert dict(back.superelements) == dict(model.superelements)
    assert np.array_equal(back.linearize().K, model.linearize().K)
    if suffix == ".json":
        jsonschema.Draft202012Validator(schema()).validate(json.loads(path.read_text("utf-8")))


def test_replace_and_values_of_other_parts():
    model = with_hub(2)
    heavier = model.with_values({"hub.mass": 3.0})
    assert heavier.superelements["pipe"] is model.superelements["pipe"]
    assert heavier.linearize().modes().frequencies[-1] != model.linearize().modes().frequencies[-1]
    assert model.replace("pipe", bodies={}).superelements["pipe"].node_names.keys() == {"pipe.left", "pipe.right"}


def test_refusals():
    m, k = reduced(2)

    def add(message, m=m, c=None, k=k, nodes=ENDS, **words):
        with pytest.raises(mv.ModelError, match=message):
            mv.Model("refused").add_superelement("pipe", m, c, k, nodes, **words)

    add(r"superelement 'pipe': bodies = \['hub'\]; expected", bodies=["hub"])
    skew = k.copy()
    skew[0, 7] *= 1.01
    add(r"superelement 'pipe': K is not symmetric: entries \[0, 7\]", k=skew)
    add(r"M is not positive semidefinite", m=-m)
    add(r"K has shape \(13, 13\); expected a symmetric 14 x 14", k=k[:13, :13])
    add(r"K has shape \(14,\)", k=k[0])
    add(r"K = 'stiff'", k="stiff")
    add(r"K = .*expected a symmetric 14 x 14 matrix. Complex ones are refused", k=k * (1 + 0.02j))
    add(r"entries that are not finite", m=np.full((14, 14), np.nan))
    add(r"M has 14 rows; expected 6 for each of the 3 nodes", nodes={**ENDS, "more": (0, 0, 0)})
    add(r"K resists a motion of all nodes as one rigid body along 'r[xyz]'", nodes={**ENDS, "right": (0.6, 0.25, 0.9)})
    add(r"nodes = \{\}", nodes={})
    add(r"bodies = .*expected names of its nodes \(left, right\)", bodies={"middle": "ground"})
    add(r"bodies = 'wall' is not a body", bodies={"left": "wall"})
    add(r"grounded = 1", grounded=1)


def test_names_are_taken():
    model = with_hub(2)
    for name in ("pipe", "pipe.right", "pipe.internal1"):
        with pytest.raises(mv.ModelError, match=r"taken by a superelement"):
            model.add_body(name, 1.0, (1, 1, 1))


@pytest.mark.parametrize("first", ["beam", "superelement"])
def test_files_in_which_beams_and_superelements_hold_each_other(tmp_path, first):
    m, k = reduced(1)
    bar, alloy = {"type": "circle", "radius": 0.01}, {"E": 7e10, "nu": 0.3, "rho": 2700}
    model = mv.Model("chained")
    if first == "beam":
        model.add_beam("rod", "ground", None, bar, alloy, start=(0, 0, 0), end=NODES[0], elements=2)
        model.add_superelement("pipe", m, None, k, ENDS, bodies={"left": "rod.2"})
    else:
        model.add_superelement("pipe", m, None, k, ENDS, bodies={"left": "ground"})
        model.add_beam("rod", "pipe.right", None, bar, alloy, start=NODES[-1], end=(1, 1, 1), elements=2)
        model.add_beam("tip", "rod.2", None, bar, alloy, start=(1, 1, 1), end=(1, 1, 2), elements=2)
    back = mv.load(mv.save(model, tmp_path / "chained.yaml"))
    assert dict(back.beams) == dict(model.beams)
    assert dict(back.superelements) == dict(model.superelements)
    assert back.linearize().modes().frequencies == pytest.approx(model.linearize().modes().frequencies, rel=1e-12)
