"""Bodies by shape and density: against integrals, meshes of the same solids, and refusals by name."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import mbsvib as mv
from mbsvib.elements.shapes import SHAPES, solid

trimesh = pytest.importorskip("trimesh")

TURN = (0.3, -0.5, 0.8)
DENSITY = 2700.0
WORDS: dict[str, dict[str, Any]] = {
    "box": {"type": "box", "size": (0.1, 0.25, 0.4)},
    "cylinder": {"type": "cylinder", "radius": 0.12, "length": 0.5},
    "tube": {"type": "tube", "radius": 0.12, "wall": 0.03, "length": 0.5},
    "sphere": {"type": "sphere", "radius": 0.2},
}
# Centres of three cubes of edge 1, which do not touch
CENTRES = np.array([(0.5, 0.5, 0.5), (2.5, 0.5, 0.5), (0.5, 3.5, 1.0)])


def discs(kind):
    """Radii inside and outside at the height z, and the half height, of solids of revolution."""
    words = WORDS[kind]
    r = words["radius"]
    if kind == "sphere":
        return lambda z: (0.0, np.sqrt(r * r - z * z)), r
    return lambda z: (r - words.get("wall", r), r), 0.5 * words["length"]


@pytest.mark.parametrize("kind", ["cylinder", "tube", "sphere"])
def test_solids_of_revolution_are_integrals_of_discs(kind):
    radii, half = discs(kind)
    precise = {"epsabs": 0, "epsrel": 1e-12}
    moments = [quad(lambda z, p=p: np.pi * (radii(z)[1] ** p - radii(z)[0] ** p), -half, half, **precise)[0]
               for p in (2, 4)]  # fmt: skip
    along = quad(lambda z: np.pi * z * z * (radii(z)[1] ** 2 - radii(z)[0] ** 2), -half, half, **precise)[0]
    result = solid(WORDS[kind], DENSITY, "body 'b'")
    zz = DENSITY * moments[1] / 2.0
    xx = DENSITY * (moments[1] / 4.0 + along)
    np.testing.assert_allclose(result.mass, DENSITY * moments[0], rtol=1e-10)
    np.testing.assert_allclose(result.inertia, (xx, xx, zz, 0, 0, 0), rtol=1e-10)


def test_a_box_is_that_of_its_mesh(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((100.0, 250.0, 400.0)).export(path)
    ours, mesh = (solid(words, DENSITY, "body 'b'") for words in (
        WORDS["box"], {"type": "mesh", "file": str(path), "scale": 1e-3}))  # fmt: skip
    np.testing.assert_allclose(mesh.mass, ours.mass, rtol=1e-6)  # a file of single precision
    np.testing.assert_allclose(mesh.inertia, ours.inertia, rtol=1e-6, atol=1e-6 * ours.inertia[0])


def test_a_thin_wall_keeps_its_digits():
    result = solid({"type": "tube", "radius": 0.5, "wall": 1e-9, "length": 1.0}, 1.0, "body 'b'")
    np.testing.assert_allclose(result.mass, np.pi * (1e-9 * (1.0 - 1e-9)), rtol=1e-7)


@pytest.mark.parametrize("suffix", [".stl", ".obj"])
def test_a_mesh_lies_where_its_file_says(tmp_path, suffix):
    """``position`` is the origin of the file; centre and tensor are those of cubes by the parallel axis theorem."""
    cubes = [trimesh.creation.box((1, 1, 1), transform=trimesh.transformations.translation_matrix(c)) for c in CENTRES]
    path = tmp_path / f"cubes{suffix}"
    trimesh.util.concatenate(cubes).export(path)
    model = mv.Model()
    body = model.add_body("b", shape={"type": "mesh", "file": path, "scale": 0.1}, density=1000.0, position=(1, 2, 3),
                          orientation=TURN)  # fmt: skip
    centre = CENTRES.mean(axis=0)
    arms = CENTRES - centre
    tensor = sum(np.eye(3) / 6.0 + (a @ a) * np.eye(3) - np.outer(a, a) for a in arms) * 1000.0 * 0.1**5
    np.testing.assert_allclose(body.mass, 3.0, rtol=1e-6)
    axes = np.array(body.orientation)
    np.testing.assert_allclose(body.position, (1, 2, 3) + axes @ (0.1 * centre), rtol=1e-6)
    xx, yy, zz, xy, xz, yz = body.inertia
    np.testing.assert_allclose([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], tensor, rtol=0, atol=1e-6 * tensor.max())


def test_open_and_inverted_meshes_are_refused(tmp_path):
    mesh = trimesh.creation.box((1, 1, 1))
    opened = trimesh.Trimesh(mesh.vertices, mesh.faces[1:])
    opened.export(tmp_path / "open.stl")
    with pytest.raises(mv.ModelError, match=r"body 'b': shape: the mesh '.*open\.stl' is not watertight"):
        mv.Model().add_body("b", shape={"type": "mesh", "file": tmp_path / "open.stl"}, density=1.0)
    mesh.invert()
    mesh.export(tmp_path / "inverted.stl")
    with pytest.raises(mv.ModelError, match=r"'.*inverted\.stl' encloses no positive volume"):
        mv.Model().add_body("b", shape={"type": "mesh", "file": tmp_path / "inverted.stl"}, density=1.0)
    (tmp_path / "text.obj").write_text("nothing\n", encoding="utf-8")
    with pytest.raises(mv.ModelError, match=r"text\.obj' (is not watertight|cannot be read)"):
        mv.Model().add_body("b", shape={"type": "mesh", "file": tmp_path / "text.obj"}, density=1.0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"shape": WORDS["box"], "density": 1.0, "mass": 1.0}, "mass = 1.0 is given beside a shape"),
        ({"shape": WORDS["box"], "density": 1.0, "inertia": (1, 1, 1)}, "inertia = .* is given beside a shape"),
        ({"shape": WORDS["box"]}, "shape is given without density"),
        ({"density": 1.0}, "density is given without shape"),
        ({}, "mass = None; expected .* Give mass and inertia, or shape and density"),
        ({"mass": 1.0}, "inertia = None; expected 3 principal"),
        ({"shape": "box", "density": 1.0}, "shape = 'box'; expected its words"),
        ({"shape": {"type": "bx"}, "density": 1.0}, "Did you mean 'box'"),
        ({"shape": {"type": "box"}, "density": 1.0}, "a box needs size; size is missing"),
        ({"shape": {"type": "sphere", "radus": 1.0}, "density": 1.0}, "a sphere has no 'radus'. Did you mean 'radius'"),
        ({"shape": {"type": "box", "size": (1, 0, 1)}, "density": 1.0}, r"shape.size = 0.0; expected a positive"),
        ({"shape": WORDS["sphere"], "density": -1.0}, "density = -1.0; expected a positive number"),
        ({"shape": WORDS["tube"] | {"wall": 0.2}, "density": 1.0}, "wall = 0.2; expected at most the outer radius"),
        ({"shape": {"type": "mesh", "file": "a.step"}, "density": 1.0}, r"ends in \.stl or \.obj"),
        ({"shape": {"type": "mesh", "file": "none.stl"}, "density": 1.0}, "there is no file 'none.stl'"),
    ],
)  # fmt: skip
def test_refusals(words, message):
    with pytest.raises(mv.ModelError, match=f"body 'b'.*{message}"):
        mv.Model().add_body("b", **words)


def test_every_shape_is_tried():
    assert {*SHAPES} == {*WORDS, "mesh"}


def test_files_have_the_words_and_keep_the_numbers(tmp_path):
    mesh = trimesh.creation.box((1, 1, 1), transform=trimesh.transformations.translation_matrix((2, 0, 0)))
    mesh.export(tmp_path / "cube.stl")
    text = "bodies:\n" + "".join(
        f"  {kind}: {{shape: { {k: list(v) if isinstance(v, tuple) else v for k, v in words.items()} }, "
        f"density: 2700}}\n" for kind, words in (WORDS | {"mesh": {"type": "mesh", "file": "cube.stl"}}).items()
    )  # fmt: skip
    (tmp_path / "solids.yaml").write_text(text, encoding="utf-8")
    model = mv.load(tmp_path / "solids.yaml")
    assert model.bodies["mesh"].position == pytest.approx((2, 0, 0))
    for kind, words in WORDS.items():
        assert model.bodies[kind] == mv.Model().add_body(kind, shape=words, density=DENSITY)
    again = mv.load(mv.save(model, tmp_path / "again.yaml"))
    assert dict(again.bodies) == dict(model.bodies)
