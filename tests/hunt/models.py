"""Features that random scenes have not: one model of each, its parameter that varies, and what engines make of them."""

import tempfile
from pathlib import Path

import numpy as np

import mbsvib as mv
from mbsvib import report

OMEGA = np.array([1.0, 7.0, 40.0])
H, AGREED, STEP = 1e-5, 1e-6, 0.01
INERTIA = (0.1, 0.2, 0.25)


def moved_end():
    model = mv.Model("car", gravity=None)
    model.add_body("wheel", 4.0, INERTIA, (0, 0, 0.3))
    model.add_joint("rail", "prismatic", "ground", "wheel", (0, 0, 0.3), axis=(0, 0, 1))
    model.add_spring("tyre", "ground", "wheel", (0, 0, 0), (0, 0, 0.3), stiffness=2e4, damping=30.0)
    model.add_motion_input("road", "tyre", "velocity")
    model.add_output("z", "wheel", "z")
    return model, "rail.z", "tyre.stiffness"


def driven_joint():
    model = mv.Model("arm", gravity=None)
    model.add_body("upper", 2.0, INERTIA, (0.5, 0, 0))
    model.add_body("fore", 1.0, INERTIA, (1.1, 0, -0.4))
    model.add_joint("shoulder", "revolute", "ground", "upper", (0, 0, 0), axis=(0, 1, 0))
    model.add_joint("elbow", "revolute", "upper", "fore", (1.0, 0, 0), axis=(0, 1, 0))
    model.add_bushing("flex", "upper", "fore", (1.0, 0, 0), stiffness=(0, 0, 0, 0, 50.0, 0))
    model.add_motion_input("drive", "shoulder", "acceleration")
    model.add_output("x", "fore", "x")
    return model, "elbow.rz", "flex.stiffness.ry"


def hub():
    model = mv.Model("rotor", gravity=None)
    model.add_hub("hub", speed=30.0, axis=(0, 0, 1))
    model.add_body("blade", 1.0, INERTIA, (0.6, 0, 0))
    model.add_joint("flap", "revolute", "hub", "blade", (0.1, 0, 0), axis=(0, 1, 0))
    model.add_bushing("root", "hub", "blade", (0.1, 0, 0), stiffness=(0, 0, 0, 0, 500.0, 0))
    model.add_input("M", "blade", "ry", relative_to="hub")
    model.add_output("a", "blade", "ry")
    return model, "flap.rz", "hub.speed"


MODELS = {"Motions of ends of springs as inputs": moved_end, "Driven joints": driven_joint,
          "Bodies on hubs": hub}  # fmt: skip


def sparse_responses(model, *_):
    same(model.linearize(method="sparse").frequency_response(OMEGA), model.linearize().frequency_response(OMEGA), 1e-9)


def sparse_modes(model, *_):
    known = model.linearize().modes().frequencies
    same(model.linearize(method="sparse").modes(1).frequencies, known[:1], 1e-9)


def batches(model, _, name):
    value = model.parameters[name]
    batch = model.linearize(values={name: [value, 1.3 * value]})
    other = model.with_values({name: 1.3 * value}).linearize()
    same(batch.frequency_response(OMEGA)[1], other.frequency_response(OMEGA), 1e-10)
    same(batch.modes().frequencies[1], other.modes().frequencies, 1e-10)


def moved(model, coordinate, _):
    """Forces that hold this pose are those of the drive's own; springs are free of them."""
    plain = model.with_values({name: 0.0 for name in ("hub.speed",) if name in model.parameters})
    there = plain.moved({coordinate: STEP}, relaxed=True)
    there.linearize()
    back = there.moved({coordinate: -STEP}, relaxed=True)
    for name, body in model.bodies.items():
        same(np.array(back.bodies[name].position), np.array(body.position), 1e-12)


def equilibrium(model, *_):
    there = model.with_parts(gravity=(0, 0, -9.81)).equilibrium()
    there.linearize()


def sensitivities(model, _, name):
    value, slopes = model.parameters[name], model.linearize().mode_sensitivities([name]).frequencies[0]
    above, below = (model.with_values({name: value * (1.0 + h)}).linearize().modes().frequencies for h in (H, -H))
    same(slopes, (above - below) / (2.0 * H * value), AGREED)


def files(model, *_):
    with tempfile.TemporaryDirectory() as folder:
        again = mv.load(mv.save(model, Path(folder) / "model.yaml")).linearize()
    np.testing.assert_array_equal(again.frequency_response(OMEGA), model.linearize().frequency_response(OMEGA))


def written(model, *_):
    with tempfile.TemporaryDirectory() as folder:
        report.write(model, Path(folder) / "page.html")


def same(found, expected, share):
    np.testing.assert_allclose(found, expected, rtol=share, atol=share * np.abs(expected).max(initial=0.0))


ENGINES = {"Sparse responses": sparse_responses, "Sparse modes": sparse_modes, "Batches": batches, "Moved": moved,
           "Equilibrium": equilibrium, "Sensitivities": sensitivities, "Files": files, "Report": written}  # fmt: skip
