"""The file of numbers that the binary reads, resources/model.lti; ``source/model.c`` is its reader.

Little-endian: magic (8 bytes), CRC-32 of all from byte 16 on (8), six sizes (states, inputs, outputs, parameters,
blocks of A, twice the number of parameter entries, plus 1 where there are E and F; 8 each), token (64); then whole
numbers of 8 bytes: first rows of the blocks, first entry of each parameter, place of each entry; then doubles: start
and nominal values of the states, start values of inputs and parameters, derivatives of the entries, A (its blocks, one
behind the other), B, C, D, and E, F where they are. Places count doubles from the start of A.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from itertools import pairwise

import numpy as np

from mbsvib_export.fmu_.plant import Plant

MAGIC = b"MBSLTI02"


def matrices_file(plant: Plant, described: str) -> tuple[bytes, str]:
    """Return resources/model.lti and the token that ties it to its description, ``described`` without the token.
    """
    blocks, space = plant.blocks, plant.space
    n, m = len(space.states), len(space.inputs)
    first = np.cumsum([0, *(len(item.indices) for item in plant.tunable)])
    integers = [blocks, first, *(item.indices for item in plant.tunable)]
    real = [
        np.zeros(n), plant.nominal, np.zeros(m), np.array([item.value for item in plant.tunable]),
        *(item.slope for item in plant.tunable),
        *(space.A[a:b, a:b].ravel() for a, b in pairwise(blocks)),
        space.B.ravel(), space.C.ravel(), space.D.ravel(),
        *(() if plant.E is None or plant.F is None else (plant.E.ravel(), plant.F.ravel())),
    ]  # fmt: skip
    body = b"".join([*(np.asarray(item, dtype="<i8").tobytes() for item in integers),
                     *(np.asarray(item, dtype="<f8").tobytes() for item in real)])  # fmt: skip
    sizes = struct.pack("<6q", n, m, len(space.outputs), len(plant.tunable), len(blocks) - 1,
                        2 * int(first[-1]) + (plant.E is not None))  # fmt: skip
    digest = hashlib.sha256(sizes + body + described.encode()).hexdigest()
    token = "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"
    content = sizes + token.encode().ljust(64, b"\0") + body
    return MAGIC + struct.pack("<Q", zlib.crc32(content)) + content, token
