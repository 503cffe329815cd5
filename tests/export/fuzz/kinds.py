"""All readers: how a valid file of each kind is made, and what reads it."""

from __future__ import annotations

import hashlib
import re
import struct
import zipfile
import zlib
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.io import savemat
from scipy.sparse import csc_matrix

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import library
from mbsvib.superelements import read_mat, read_punch
from mbsvib.superelements import read_op4 as read_reduced_op4
from mbsvib_export import mat_
from mbsvib_export.dmig_ import read_dmig
from mbsvib_export.fmu_.reading import state_space_in
from mbsvib_export.op4_ import read_op4
from tests.export.fuzz.mutations import damaged, damaged_text
from tests.export.plants import slider, stewart

if TYPE_CHECKING:
    from collections.abc import Callable

ANCHORS = """name: a
bodies:
  one: &one {mass: 1.0, inertia: [1, 1, 1]}
  two: {<<: *one, position: [0, 0, 1]}
joints:
  j: {kind: revolute, first: ground, second: two, position: [0, 0, 0]}
"""
PUNCH = """DMIG    NAME           0       6       2       0
DMIG    NAME           1       1               1       1     4.0
DMIG    NAME           1       2               1       2     2.0
+              7             1.5
DMIG    NAME           7                       7           1.5+3
"""
ROBOTS = Path(__file__).parents[3] / "examples" / "robots"


@dataclass(frozen=True)
class Kind:
    """``write`` makes valid files in a folder; ``checked``: a checksum covers all numbers, so that what is read of a
    damaged file must be what was written. ``damage`` is another way to damage a file: with checksums put right, as
    hostile files have them.
    """

    write: Callable[[Path], list[Path]]
    read: Callable[[Path], Any]
    checked: bool = False
    damage: Callable[[bytes, np.random.Generator], bytes] = damaged
    package: str = "numpy"
    holes: bool = False  # whether NaN stands for what was not measured


def several(write, *systems):
    """Files of some systems."""
    return lambda folder: [Path(write(system, folder / f"{k}.file")) for k, system in enumerate(systems)]


mat_files = partial(several, partial(mx.to_mat, loader=False))


def space():
    """First-order equations alone, with a bound on an error."""
    return library.quarter_car(suspension_damping=900.0).linearize().reduced(3)


def json_files(folder):
    for k, system in enumerate((slider(), library.quarter_car().linearize(), space())):
        mx.to_json(system, folder / f"{k}.json")
    return sorted(folder.glob("*.json"))


def batch_files(folder):
    model = library.quarter_car()
    name = next(name for name in model.parameters if name.endswith("stiffness"))
    return [mx.to_npz_batch(model.linearize(values={name: [1e4, 2e4, 3e4]}), folder / "x.npz")]


def fmu_files(folder):
    car = library.quarter_car().linearize()
    return [mx.to_fmu(slider(), folder / "a.fmu", "2.0").path,
            mx.to_fmu(car, folder / "b.fmu", tunable=("*.stiffness",)).path]  # fmt: skip


def model_files(suffix):
    def write(folder):
        result = []
        for name in ("stewart", "quarter_car", "cantilever"):
            path = folder / f"{name}{suffix}"
            mv.save(library.build(name), path)
            result.append(path)
        if suffix == ".yaml":
            path = folder / "anchors.yaml"
            path.write_text(ANCHORS)
            result.append(path)
        return result

    return write


def copies(folder, *names):
    result = []
    for name in names:
        path = folder / name
        path.write_bytes((ROBOTS / name).read_bytes())
        result.append(path)
    return result


def matlab_files(folder):
    m = np.diag([1.0, 2.0, 3.0, 4.0])
    k = 1e4 * (2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    content = {"name": "text", "M": m, "K": csc_matrix(k), "nested": {"a": [1, "b"]}, "n": np.arange(5, dtype="i2")}
    paths = [folder / name for name in ("plain.mat", "packed.mat", "old.mat")]
    savemat(paths[0], content)
    savemat(paths[1], content, do_compression=True)
    savemat(paths[2], {"M": m, "K": k}, format="4")
    return paths


def hostile_mat(raw, rng):
    rest = damaged(raw, rng)[mat_.TITLE :]
    return mat_.title(rest) + rest


def _members(raw):
    with zipfile.ZipFile(BytesIO(raw)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _archive(members):
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def hostile_zip(raw, rng):
    """Damage one member of an archive."""
    members = _members(raw)
    name = sorted(members)[rng.integers(len(members))]
    return _archive(members | {name: damaged(members[name], rng)})


def hostile_fmu(raw, rng):
    """Damage the file of numbers, and put its checksum and token right."""
    members = _members(raw)
    body = bytearray(damaged(members["resources/model.lti"], rng))
    text = members["modelDescription.xml"].decode()
    token = re.search(r'(?:guid|Token)="([^"]*)"', text)[1]
    digest = hashlib.sha256(body[16:64] + body[128:] + text.replace(f'="{token}"', '=""', 1).encode()).hexdigest()
    new = "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"
    body[64:128] = new.encode().ljust(64, b"\0")
    body[8:16] = struct.pack("<Q", zlib.crc32(body[16:]))
    return _archive({"modelDescription.xml": text.replace(token, new).encode(), "resources/model.lti": bytes(body)})


def op4_files(*systems):
    return lambda folder: [mx.to_op4(system, folder / f"{k}{binary}.op4", binary)
                           for k, system in enumerate(systems) for binary in (False, True)]  # fmt: skip


def punch_files(folder):
    """Grid points and small fields as well."""
    path = folder / "small.pch"
    path.write_text("".join(PUNCH.replace("NAME", name) for name in ("MAAX", "KAAX")))
    return [path, mx.to_dmig(stewart(), folder / "large.pch")]


def uff_files(folder):
    car, ladder = library.quarter_car().linearize(), library.inclined_chain().linearize()
    return [mx.to_uff(car, folder / "a.uff", [1.0, 2.0, 30.0], modes=True),
            mx.to_uff(ladder, folder / "b.uff", [1.0, 2.0], modes=True)]  # fmt: skip


def uff_texts(folder):
    return [mx.to_uff(library.build(name).linearize(), folder / f"{name}.uff", [1.0, 2.0, 30.0], False, modes=True)
            for name in ("quarter_car", "inclined_chain", "rotor_stator")]  # fmt: skip


KINDS = {
    "json": Kind(json_files, mx.from_json, damage=damaged_text),
    "npz": Kind(several(mx.to_npz, slider(), stewart(), space()), mx.from_npz, checked=True),
    "npz with right checksums": Kind(several(mx.to_npz, slider(), stewart(), space()), mx.from_npz, damage=hostile_zip),
    "npz batch": Kind(batch_files, mx.from_npz_batch, checked=True),
    "npz batch with right checksums": Kind(batch_files, mx.from_npz_batch, damage=hostile_zip),
    "mat": Kind(mat_files(slider(), stewart(), space()), mx.from_mat, checked=True),
    "mat with right checksum": Kind(mat_files(slider(), slider(("ü",)), space()), mx.from_mat,
                                    damage=hostile_mat),
    "hdf5": Kind(several(mx.to_hdf5, slider(), stewart(), space()), mx.from_hdf5, checked=True, package="h5py"),
    "fmu": Kind(fmu_files, state_space_in, checked=True),
    "fmu with right checksums": Kind(fmu_files, state_space_in, damage=hostile_fmu),
    "yaml model": Kind(model_files(".yaml"), mv.load, damage=damaged_text),
    "json model": Kind(model_files(".json"), mv.load, damage=damaged_text),
    "urdf": Kind(lambda folder: copies(folder, "arm.urdf"), mv.load_urdf, damage=damaged_text),
    "mjcf": Kind(lambda folder: copies(folder, "gripper.xml"), mv.load_mjcf, damage=damaged_text, package="mujoco"),
    "superelement mat": Kind(matlab_files, read_mat),
    "op4": Kind(op4_files(slider(), stewart(), space()), read_op4),
    "superelement op4": Kind(op4_files(slider(), stewart()), read_reduced_op4),
    "uff": Kind(uff_files, mx.from_uff, holes=True),
    "uff as text": Kind(uff_texts, mx.from_uff, damage=damaged_text, holes=True),
    "dmig": Kind(several(mx.to_dmig, slider(), stewart()), read_dmig, damage=damaged_text),
    "superelement punch": Kind(punch_files, read_punch, damage=damaged_text),
}


def content(value, holes=False):
    """All numbers and texts of what was read, for comparison, and a look at whether numbers are finite."""
    if is_dataclass(value) and not isinstance(value, type):
        return tuple(content(getattr(value, field.name), holes) for field in fields(value))
    if isinstance(value, dict):
        return tuple((key, content(item, holes)) for key, item in value.items())
    if isinstance(value, (list, tuple)):
        return tuple(content(item, holes) for item in value)
    if isinstance(value, np.ndarray):
        assert value.dtype.kind in "fciuU", value.dtype
        assert value.dtype.kind == "U" or np.isfinite(value).all() or (holes and not np.isinf(value).any())
        return value.shape, value.tobytes()
    if isinstance(value, mv.Model):
        return value.name
    assert value is None or isinstance(value, (str, int, float)), type(value)
    return value
