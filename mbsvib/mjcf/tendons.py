"""Tendons: sums of joint coordinates, and straight lines between two sites."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mbsvib.common.arrays import Array
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.mjcf.bodies import added, along
from mbsvib.mjcf.scene import Scene

# A tendon is at the end of its slack range within this share of its length.
MET = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """What has a length: ``terms`` pairs joints and coefficients, or ``ends`` are a straight line's two (body of
    MuJoCo's, point); ``kind`` and ``number`` name it in the file.
    """

    kind: str
    number: int
    length: float
    terms: tuple[tuple[int, float], ...] = ()
    ends: tuple[tuple[int, Array], ...] = field(default=())


def add_tendons(scene: Scene) -> dict[int, Path | None]:
    """Add the springs, dampers and armature of tendons.

    Returns the path of each tendon by its number; None where it wraps or has pulleys.
    """
    file, paths = scene.file, {}
    for i in range(scene.file.m.ntendon):
        path = paths[i] = _path(scene, i)
        k, force = _spring(scene, i)
        damping = float(file.m.tendon_damping[i]) + added(file, "tendon", i, "damping")
        c = 0.0 if file.off("DAMPER", "PASSIVE") else damping
        inertia = float(file.value("tendon_armature", i)) + added(file, "tendon", i, "armature")
        if not (k or c or force or inertia):
            continue
        if path is None:
            raise file.refuse("tendon", i, "goes by more than two sites, around a shape or by pulleys; only fixed "
                              "tendons and straight ones between two sites are known here.")  # fmt: skip
        name = scene.fresh(file.name("tendon", i), "tendon")
        if inertia:
            if path.ends:
                raise file.refuse("tendon", i, "armature on a line between sites has no place in a model.", "armature")
            _wheel(scene, path, inertia)
        if k or c or force:
            attach(scene, scene.fresh(name, "k"), path, 1.0, k, c, force)
    return paths


def joint_path(scene: Scene, joint: int) -> Path:
    """Return a hinge or slide as a path; its length is its position."""
    return Path("joint", joint, float(scene.file.position(joint)[0]), ((joint, 1.0),))


def _path(scene: Scene, i: int) -> Path | None:
    file, m, d = scene.file, scene.file.m, scene.file.d
    wraps = range(int(m.tendon_adr[i]), int(m.tendon_adr[i]) + int(m.tendon_num[i]))
    kinds, length = {int(m.wrap_type[j]) for j in wraps}, float(d.ten_length[i])
    if kinds == {int(file.api.mjtWrap.mjWRAP_JOINT)}:
        terms: dict[int, float] = {}
        for j in wraps:
            terms[int(m.wrap_objid[j])] = terms.get(int(m.wrap_objid[j]), 0.0) + float(m.wrap_prm[j])
        return Path("tendon", i, length, tuple((joint, value) for joint, value in terms.items() if value))
    if kinds == {int(file.api.mjtWrap.mjWRAP_SITE)} and len(wraps) == 2:
        sites = [int(m.wrap_objid[j]) for j in wraps]
        return Path("tendon", i, length, (), tuple([(int(m.site_bodyid[s]), np.array(d.site_xpos[s])) for s in sites]))
    return None


def _spring(scene: Scene, i: int) -> tuple[float, float]:
    """Stiffness of a tendon in the pose, and its force towards longer."""
    file, m = scene.file, scene.file.m
    k, length = float(m.tendon_stiffness[i]), float(file.d.ten_length[i])
    if k == 0.0 or file.off("SPRING", "PASSIVE"):
        return 0.0, 0.0
    low, high = (float(value) for value in m.tendon_lengthspring[i])
    if low < high:
        near = MET * max(abs(low), abs(high))
        if min(abs(length - low), abs(length - high)) <= near:
            raise file.refuse("tendon", i, f"its length {length:.9g} is where it goes slack, so that it has no "
                              f"stiffness there. Give a pose beside it.", "springlength")  # fmt: skip
        if low < length < high:
            scene.remark("spring of slack tendon", f"'{file.name('tendon', i)}'")
            return 0.0, 0.0
    return k, -k * (length - (high if length > high else low if length < low else length))


def attach(scene: Scene, name: str, path: Path, gear: float, k: float, c: float, force: float) -> None:
    """Add a spring-damper along a path.

    ``k``, ``c``, ``force``: stiffness, damping, and the force towards longer in the pose.
    """
    k, c, force = k * gear**2, c * gear**2, force * gear
    if not (k or c or force):
        return
    if path.ends:
        (a, start), (b, end) = path.ends
        if scene.bodies[a] != scene.bodies[b]:
            scene.joint_forces += force * _line_rates(scene, path)
            scene.model.add_spring(name, scene.bodies[a], scene.bodies[b], start, end, k, c, -force if force else None)
        return
    for joint, value in path.terms:
        scene.joint_forces[int(scene.file.m.jnt_dofadr[joint])] += force * value
    link, six = scene.links[path.terms[0][0]], np.zeros(6)
    if len(path.terms) == 1:
        first, second, six[link.direction] = link.first, link.second, path.terms[0][1]
    else:
        first, (second, six[5]) = GROUND, _wheel(scene, path, 0.0)
    scene.model.add_bushing(name, first, second, link.at, k * six**2, c * six**2, link.axes,
                            force * six if force else None)  # fmt: skip


def drive(scene: Scene, name: str, path: Path, gain: float) -> None:
    """Add a force along a path, towards longer, as an input; ``gain``: force [N] or torque [N m] per unit of the input.
    """
    model = scene.model
    if path.ends:
        (a, start), (b, end) = path.ends
        direction = gain * (end - start) / np.linalg.norm(end - start)
        model.add_input(name, scene.bodies[b], direction, end, relative_to=scene.bodies[a])
    elif len(path.terms) == 1:
        link = scene.links[path.terms[0][0]]
        model.add_input(name, link.second, along(link, gain * path.terms[0][1]), link.at, relative_to=link.first)
    else:
        wheel, radius = _wheel(scene, path, 0.0)
        axis = scene.links[path.terms[0][0]].z
        model.add_input(name, wheel, np.concatenate((np.zeros(3), gain * radius * axis)))


def sums(scene: Scene, path: Path, factor: float = 1.0) -> dict[str, float]:
    """Return the coefficients of joint coordinates, "JOINT.rz", in a path's length, times a factor."""
    return {scene.links[joint].coordinate: factor * value for joint, value in path.terms}


def single(scene: Scene, path: Path) -> tuple[str, float]:
    """Return a coordinate and its coefficient in a path's length: of the only joint, or of the path's wheel."""
    if len(path.terms) == 1:
        return next(iter(sums(scene, path).items()))
    wheel, radius = _wheel(scene, path, 0.0)
    axis = next(joint.name for joint in scene.model.joints.values() if joint.second == wheel)
    return f"{axis}.rz", radius


def _wheel(scene: Scene, path: Path, inertia: float) -> tuple[str, float]:
    """The wheel of a fixed tendon; its inertia must be given at its first use."""
    key = f"{path.kind} {path.number}"
    if key not in scene.wheels:
        name = f"{scene.file.name(path.kind, path.number)}.wheel"
        scene.wheels[key] = scene.add_wheel(name, sums(scene, path), inertia, scene.links[path.terms[0][0]])
    return scene.wheels[key]


def _line_rates(scene: Scene, path: Path) -> Array:
    """Derivatives of the length of a line with respect to MuJoCo's coordinates."""
    file, ((a, start), (b, end)) = scene.file, path.ends
    direction, total = (end - start) / np.linalg.norm(end - start), np.zeros(file.m.nv)
    for body, point, sign in ((b, end, 1.0), (a, start, -1.0)):
        rates = np.zeros((3, file.m.nv))
        file.api.mj_jac(file.m, file.d, rates, None, point, body)
        total += sign * direction @ rates
    return total
