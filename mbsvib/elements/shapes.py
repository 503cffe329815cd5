"""Solid shapes of uniform density: mass, centre of mass and inertia of a body.

m = rho V. About the centre, in the axes of the shape, with z along the axis of cylinder and tube:

- box of edges a, b, c: V = a b c, Jxx = m (b^2 + c^2) / 12, and so on;
- cylinder of radius r and length h: V = pi r^2 h, Jzz = m r^2 / 2, Jxx = Jyy = m (3 r^2 + h^2) / 12;
- tube with the inner radius r_i = r - wall: V = pi (r^2 - r_i^2) h, and r^2 + r_i^2 in place of r^2;
- sphere: V = 4/3 pi r^3, J = 2/5 m r^2;
- mesh: integrals over the volume that its triangles enclose, by trimesh.

Source: Beer, Johnston, Mechanics for Engineers: Dynamics, inside cover (mass moments of inertia); for meshes Eberly,
Polyhedral Mass Properties (Revisited), https://www.geometrictools.com.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any

from mbsvib.common import arguments as check
from mbsvib.common.arguments import Vector
from mbsvib.errors import ModelError, nearest

ORIGIN: Vector = (0.0, 0.0, 0.0)
MESHES = (".stl", ".obj")


@dataclass(frozen=True, slots=True)
class Solid:
    """Mass [kg], inertia (xx, yy, zz, xy, xz, yz) [kg m^2] about the centre of mass, and this centre [m], all in the
    axes of the shape.
    """

    mass: float
    inertia: tuple[float, ...]
    centre: Vector = ORIGIN


def solid(shape: Any, density: Any, who: str) -> Solid:
    """Return mass, inertia and centre of a shape of uniform ``density`` [kg/m^3], by its words ``{"type": "box",
    "size": (a, b, c)}`` [m].

    ``who``: the body, for messages. Raises an error if a word is unknown or missing, a number is not positive, or a
    mesh encloses no volume.
    """
    expected = "its words, such as {'type': 'box', 'size': (0.1, 0.2, 0.3)}"
    if not isinstance(shape, Mapping):
        raise check.refuse(who, "shape", shape, expected)
    words = dict(shape)
    kind = words.pop("type", None)
    if kind not in SHAPES:
        raise check.refuse(who, "shape", shape, f"type: one of {', '.join(SHAPES)}",
                           nearest(str(kind), SHAPES).strip())  # fmt: skip
    make, needed, optional = SHAPES[kind]
    for word in words:
        if word not in (*needed, *optional):
            raise ModelError(f"{who}: shape: a {kind} has no '{word}'.{nearest(str(word), needed)} It has "
                             f"{', '.join((*needed, *optional))}.", element=who, field="shape")  # fmt: skip
    missing = [word for word in needed if word not in words]
    if missing:
        raise ModelError(f"{who}: shape: a {kind} needs {', '.join(needed)}; {', '.join(missing)} is missing.",
                         element=who, field="shape")  # fmt: skip
    rho = _positive(density, who, "density", "kg/m^3")
    return make(who, rho, **words)


def _positive(value: Any, who: str, field: str, unit: str) -> float:
    expected = f"a positive number [{unit}]"
    number = check.number(value, who, field, expected)
    if number <= 0.0:
        raise check.refuse(who, field, value, expected)
    return number


def _box(who: str, rho: float, size: Any) -> Solid:
    a, b, c = check.vector(size, who, "shape.size", "three edges along x, y, z [m]")
    for edge in (a, b, c):
        _positive(edge, who, "shape.size", "m")
    m = rho * a * b * c
    return Solid(m, (m / 12.0 * (b * b + c * c), m / 12.0 * (a * a + c * c), m / 12.0 * (a * a + b * b), *ORIGIN))


def _cylinder(who: str, rho: float, radius: Any, length: Any) -> Solid:
    return _round(who, rho, _positive(radius, who, "shape.radius", "m"), 0.0, length)


def _tube(who: str, rho: float, radius: Any, wall: Any, length: Any) -> Solid:
    outer, thickness = (_positive(value, who, f"shape.{word}", "m") for value, word in (
        (radius, "radius"), (wall, "wall")))  # fmt: skip
    if thickness > outer:
        raise check.refuse(who, "shape.wall", wall, f"at most the outer radius {outer:g} m")
    return _round(who, rho, outer, outer - thickness, length)


def _round(who: str, rho: float, outer: float, inner: float, length: Any) -> Solid:
    h = _positive(length, who, "shape.length", "m")
    m = rho * pi * (outer - inner) * (outer + inner) * h
    square = outer * outer + inner * inner
    across = m / 12.0 * (3.0 * square + h * h)
    return Solid(m, (across, across, 0.5 * m * square, *ORIGIN))


def _sphere(who: str, rho: float, radius: Any) -> Solid:
    r = _positive(radius, who, "shape.radius", "m")
    m = 4.0 / 3.0 * pi * r * r * r * rho
    return Solid(m, (0.4 * m * r * r,) * 3 + ORIGIN)


def _mesh(who: str, rho: float, file: Any, scale: Any = 1.0) -> Solid:
    try:
        import trimesh
    except ImportError:
        raise ModelError(f'{who}: shape: meshes are read by trimesh; pip install "mbsvib[mesh]"', element=who,
                         field="shape") from None  # fmt: skip
    factor = _positive(scale, who, "shape.scale", "m per unit of the file")
    path = Path(str(file))
    if path.suffix.lower() not in MESHES:
        raise check.refuse(who, "shape.file", str(file), f"a file whose name ends in {' or '.join(MESHES)}")
    if not path.is_file():
        raise ModelError(f"{who}: shape: there is no file '{file}'.", element=who, field="shape")
    try:
        mesh: Any = trimesh.load(path, force="mesh")  # type: ignore[no-untyped-call,unused-ignore]
    except Exception as error:
        raise ModelError(f"{who}: shape: the mesh '{file}' cannot be read: {error}", element=who,
                         field="shape") from error  # fmt: skip
    if not (len(mesh.faces) and mesh.is_watertight):
        raise ModelError(f"{who}: shape: the mesh '{file}' is not watertight: edges without a second triangle leave "
                         f"its volume open. Close it, or export the solid anew.",
                         element=who, field="shape")  # fmt: skip
    if not mesh.is_volume:
        raise ModelError(f"{who}: shape: the mesh '{file}' encloses no positive volume, as its triangles are not all "
                         f"turned outwards. Repair its normals.", element=who, field="shape")  # fmt: skip
    mesh.apply_scale(factor)
    mesh.density = rho
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = mesh.moment_inertia.tolist()
    x, y, z = mesh.center_mass.tolist()
    return Solid(float(mesh.mass), (xx, yy, zz, xy, xz, yz), (x, y, z))


SHAPES: Mapping[str, tuple[Callable[..., Solid], tuple[str, ...], tuple[str, ...]]] = {
    "box": (_box, ("size",), ()),
    "cylinder": (_cylinder, ("radius", "length"), ()),
    "tube": (_tube, ("radius", "wall", "length"), ()),
    "sphere": (_sphere, ("radius",), ()),
    "mesh": (_mesh, ("file",), ("scale",)),
}
