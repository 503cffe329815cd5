"""Reference data of 50 digits, and closed forms of the families."""

import json
from pathlib import Path

import numpy as np

from mbsvib.library import build, chain

FOLDER = Path(__file__).parent.parent / "data" / "reference"
NAMES = sorted(path.stem.removeprefix("ref_") for path in FOLDER.glob("ref_*.json"))


def model(name):
    """The mechanism of a reference; chains run along y, across their joints' axes."""
    made = build(name)
    if name.startswith("C"):
        made = chain(len(made.bodies), line=data(name)["line"])
    return made


def data(name):
    """What the file of a reference holds."""
    return json.loads((FOLDER / f"ref_{name}.json").read_text())


def eigenvalues(name):
    """One eigenvalue of each pair, the one above the real axis, in ascending size."""
    parts = data(name)
    return np.array([complex(float(re), float(im)) for re, im in zip(parts["lam_re"], parts["lam_im"], strict=True)])


def fixed_free(n):
    """Frequencies [rad/s] of n unit masses in line on n unit springs, the first of them on the ground."""
    return 2 * np.sin((2 * np.arange(1, n + 1) - 1) * np.pi / (2 * (2 * n + 1)))


def graph_frequencies(edges):
    """Frequencies [rad/s] of unit masses (nodes) on unit springs (edges; "ground" does not move)."""
    nodes = sorted({node for edge in edges for node in edge} - {"ground"})
    index_of = {node: i for i, node in enumerate(nodes)}
    rows = np.zeros((len(edges), len(nodes)))
    for row, (a, b) in zip(rows, edges, strict=True):
        for node, sign in ((a, -1.0), (b, 1.0)):
            if node != "ground":
                row[index_of[node]] = sign
    return np.linalg.svd(rows, compute_uv=False)[::-1]
