"""Beams and superelements after the text books: matrices on the displacements of their nodes, world axes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from scipy.linalg import eigh

from tests.beams.reference import PLANES, matrices
from tests.hunt.scene import Call


@dataclass(frozen=True)
class Flexible:
    """Matrices on six displacements at each of its ``nodes`` (body, point), then on ``internal`` coordinates.

    ``elements`` are those of a beam: (first, second, middle, axes), with ``springs`` (elements, 6) between their rigid
    halves, ``beta`` of their damping, and ``under_tension``, what its bent line adds to the stiffness of two rigid
    halves under 1 N, and ``under_weight``, what it adds to that of the weights at the nodes as tension falls along the
    element by 1 N. ``line`` is its mass per length.
    """

    name: str
    nodes: tuple[Any, ...]
    internal: int
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    elements: tuple[Any, ...] = ()
    springs: np.ndarray | None = None
    under_tension: tuple[Any, ...] = ()
    under_weight: tuple[Any, ...] = ()
    beta: float = 0.0
    line: float = 0.0


def points_of(call):
    """The nodes of a beam."""
    a = call.arguments
    if "nodes" in a:
        return [np.array(p, dtype=float) for p in a["nodes"]]
    start = np.array(a["start"], dtype=float)
    end = np.array(a["end"], dtype=float) if "end" in a else \
        start + a["length"] * np.array(a["axis"]) / np.linalg.norm(a["axis"])  # fmt: skip
    return [start + (end - start) * i / a["elements"] for i in range(a["elements"] + 1)]


def node_names(call):
    """Names of the bodies at the nodes of a beam, and whether the node is a body of its own."""
    a, count = call.arguments, len(points_of(call))
    names = [(f"{call.name}.{i}", True) for i in range(count)]
    for i, end in ((0, a.get("a")), (count - 1, a.get("b"))):
        if end is not None:
            names[i] = (end, False)
    return names


def properties(section, nu):
    """A, Iy, Iz, J, ky, kz of a section; shear factors after Cowper (1966), torsion after Saint-Venant."""
    s = dict(section)
    kind = s.pop("type", "properties")
    if kind == "properties":
        return s["A"], s["Iy"], s["Iz"], s["J"], s.get("ky"), s.get("kz")
    if kind == "rectangle":
        b, h = s["width"], s["height"]
        long, short = max(b, h), min(b, h)
        n = np.arange(1, 4000, 2)
        series = np.sum(np.tanh(0.5 * np.pi * n * long / short) / n**5.0)
        torsion = long * short**3 * (1 / 3 - 64 / np.pi**5 * short / long * series)
        shear = 10 * (1 + nu) / (12 + 11 * nu)
        return b * h, b * h**3 / 12, h * b**3 / 12, torsion, s.get("ky", shear), s.get("kz", shear)
    outer = s["radius"]
    inner = outer - s["wall"] if kind == "tube" else 0.0
    second, m = np.pi / 4 * (outer**4 - inner**4), inner / outer
    shear = 6 * (1 + nu) * (1 + m**2) ** 2 / ((7 + 6 * nu) * (1 + m**2) ** 2 + (20 + 12 * nu) * m**2)
    return (np.pi * (outer**2 - inner**2), second, second, 2 * second, s.get("ky", shear), s.get("kz", shear))


def axes_of(call, along):
    """Axes of an element: x along it, y towards ``y_axis``."""
    x = along / np.linalg.norm(along)
    towards = call.arguments.get("y_axis")
    z = np.cross(x, towards) if towards is not None else np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    z /= np.linalg.norm(z)
    return np.column_stack((x, np.cross(z, x), z))


def with_beams(scene):
    """The scene with each leaf spring as the beam that it is: z along it, clamped ends that hold its warping."""
    return scene.with_calls([_as_beam(call) if call.kind == "flexure" else call for call in scene.calls])


def _as_beam(call):
    a = dict(call.arguments)
    shape, position = a.pop("shape"), np.array(a.pop("position"), dtype=float)
    axes = np.array(a.pop("orientation"), dtype=float)
    length, b, t, nu = shape["length"], shape["width"], shape["thickness"], a["material"]["nu"]
    area, iy, iz, j, _, _ = properties({"type": "rectangle", "width": b, "height": t}, nu)
    x = length / b * np.sqrt(6 / (1 + nu))
    section = {"A": area, "Iy": iy, "Iz": iz, "J": j / (1 - np.tanh(x) / x), "ky": 5 / 6, "kz": 5 / 6}
    half = 0.5 * length * axes[:, 2]
    return Call("beam", call.name, a | {"section": section, "start": position - half, "end": position + half,
                                        "elements": 1, "y_axis": axes[:, 1]})  # fmt: skip


def beam(call):
    """The matrices of a beam."""
    a, points = call.arguments, points_of(call)
    material = a["material"]
    shear_modulus = material.get("G", material["E"] / (2 * (1 + material.get("nu", 0.0))))
    nu = material.get("nu", material["E"] / (2 * shear_modulus) - 1)
    area, iy, iz, j, ky, kz = properties(a["section"], nu)
    size = 6 * len(points)
    k, m = np.zeros((size, size)), np.zeros((size, size))
    elements, springs, tension, weight = [], [], [], []
    names = [name for name, _ in node_names(call)]
    for i in range(len(points) - 1):
        along = points[i + 1] - points[i]
        length, axes = float(np.linalg.norm(along)), axes_of(call, along)
        phi = [0.0, 0.0]
        if a.get("shear"):
            phi = [12 * material["E"] * second / (factor * shear_modulus * area * length**2)
                   for second, factor in ((iz, ky), (iy, kz))]  # fmt: skip
        own = matrices(length, area, iy, iz, j, material["E"], shear_modulus, material["rho"], *phi,
                       rotary=bool(a.get("shear")))  # fmt: skip
        turn, at = np.kron(np.eye(4), axes.T), slice(6 * i, 6 * i + 12)
        for matrix, part in zip((k, m), own, strict=True):
            matrix[at, at] += turn.T @ np.array(part) @ turn
        elements.append((names[i], names[i + 1], 0.5 * (points[i] + points[i + 1]), axes))
        bend = [12 * material["E"] * second / (length**3 * (1 + p)) for second, p in zip((iz, iy), phi, strict=True)]
        springs.append([material["E"] * area / length, *bend, shear_modulus * j / length,
                        material["E"] * iy / length, material["E"] * iz / length])  # fmt: skip
        tension.append(turn.T @ (slopes(length, phi) - rigid_halves(length)) @ turn)
        weight.append(turn.T @ (slopes(length, phi, Polynomial([0.5, -1.0])) - inward_weights(length)) @ turn)
    c = a.get("alpha", 0.0) * m + a.get("beta", 0.0) * k
    if a.get("damping_ratio"):
        c = c + modal_damping(k, m, a["damping_ratio"])
    return Flexible(call.name, tuple(zip(names, points, strict=True)), 0, m, c, k, tuple(elements),
                    np.array(springs), tuple(tension), tuple(weight), a.get("beta", 0.0),
                    material["rho"] * area)  # fmt: skip


def modal_damping(k, m, ratio):
    """C = sum of 2 zeta omega M phi phi^T M over the elastic modes of the free beam, the six lowest being rigid."""
    squares, shapes = eigh(k, m)
    moved = m @ shapes[:, 6:]
    return (moved * (2 * ratio * np.sqrt(squares[6:]))) @ moved.T


def slopes(length, phi, tension=1.0):
    """The integral of the squared slopes of both deflections times the tension: the geometric stiffness (12, 12)."""
    result = np.zeros((12, 12))
    for (index, sign), p in zip(PLANES, phi, strict=True):
        x = Polynomial([0, 1])
        shapes = [1 - 3 * x**2 + 2 * x**3 + p * (1 - x), length * sign * (x - 2 * x**2 + x**3 + p / 2 * (x - x**2)),
                  3 * x**2 - 2 * x**3 + p * x, length * sign * (-(x**2) + x**3 - p / 2 * (x - x**2))]  # fmt: skip
        slope = [(shape / (1 + p)).deriv() for shape in shapes]
        for i, first in zip(index, slope, strict=True):
            for j, second in zip(index, slope, strict=True):
                result[i, j] += (first * second * tension).integ()(1.0) / length
    return result


def rigid_halves(length):
    """Second derivatives of the stretch (along x) of two rigid halves, as seen from the first: what 1 N does to them.

    s_x = ... - theta_ay (w_b - w_a) + theta_az (v_b - v_a) - L/2 |theta_a|^2 + L/4 |theta_b - theta_a|^2  (y and z)
    """
    result = np.zeros((12, 12))
    for index, sign in PLANES:
        form = 0.25 * length * np.outer((0, -1, 0, 1), (0, -1, 0, 1)) - 0.5 * length * np.outer(
            (0, 1, 0, 0), (0, 1, 0, 0)
        )
        form += sign * np.outer((0, 1, 0, 0), (-1, 0, 1, 0))
        result[np.ix_(index, index)] += form + form.T
    return result


def inward_weights(length):
    """Stiffness of two forces of 1/2 N at the nodes, at a sixth of the length inwards, as they turn with the nodes."""
    result = np.zeros((12, 12))
    for index, _ in PLANES:
        result[index[1], index[1]] += length / 12.0
        result[index[3], index[3]] -= length / 12.0
    return result


def superelement(call):
    """The matrices of a superelement."""
    a = call.arguments
    bodies = a.get("bodies", {})
    nodes = tuple((bodies.get(name, f"{call.name}.{name}"), np.array(point, dtype=float))
                  for name, point in a["nodes"].items())  # fmt: skip
    m = np.array(a["M"], dtype=float)
    internal = len(m) - 6 * len(nodes)
    turn = np.eye(len(m))
    turn[: 6 * len(nodes), : 6 * len(nodes)] = np.kron(
        np.eye(2 * len(nodes)), np.array(a.get("orientation", np.eye(3))).T
    )
    c = np.zeros_like(m) if a.get("C") is None else np.array(a["C"], dtype=float)
    m, c, k = (turn.T @ matrix @ turn for matrix in (m, c, np.array(a["K"], dtype=float)))
    return Flexible(call.name, nodes, internal, m, c, k)


def strain(call, i, asked):
    """The strain (12,) of element i on the displacements of its nodes, world axes: eps = u' - y psi'.

    u is linear, psi the slope of a section of a beam with shear deformation, y where the strain is measured.
    """
    a, points = call.arguments, points_of(call)
    along = points[i + 1] - points[i]
    length, axes = float(np.linalg.norm(along)), axes_of(call, along)
    material = a["material"]
    shear_modulus = material.get("G", material["E"] / (2 * (1 + material.get("nu", 0.0))))
    nu = material.get("nu", material["E"] / (2 * shear_modulus) - 1)
    area, iy, iz, _, ky, kz = properties(a["section"], nu)
    section, side = a["section"], asked.get("side", "z")
    across = 0 if side[-1] == "y" else 1
    half = 0.5 * section.get(("width", "height")[across], 2 * section.get("radius", 0.0))
    offset = asked.get("distance", half) * (-1 if side[0] == "-" else 1)
    phi = 12 * material["E"] * (iz, iy)[across] / ((ky, kz)[across] * shear_modulus * area * length**2) if a.get(
        "shear") else 0.0  # fmt: skip
    row = np.zeros(12)
    row[[0, 6]] = -1 / length, 1 / length
    index, sign = PLANES[across]
    x, at = Polynomial([0, 1]), {"start": 0.0, "middle": 0.5, "end": 1.0}[asked.get("at", "start")]
    turns = [6 * (x**2 - x) / length, sign * (1 - 4 * x + 3 * x**2 + phi * (1 - x)), 6 * (x - x**2) / length,
             sign * (3 * x**2 - 2 * x + phi * x)]  # fmt: skip
    row[list(index)] += [-offset * turn.deriv()(at) / (length * (1 + phi)) for turn in turns]
    return row @ np.kron(np.eye(4), axes.T)
