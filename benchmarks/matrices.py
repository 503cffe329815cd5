"""CPU time of modes of sparse matrices: 100 000 coordinates and 50 modes of a block of solid springs, stage by stage.

``python benchmarks/matrices.py [nodes along an edge]``; scipy's shift-invert Lanczos in the same run, with its own
factor (SuperLU). A lattice n x n x 3 n with three displacements a node and springs along edges and diagonals.
"""

from __future__ import annotations

import sys
from time import process_time

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

import mbsvib as mv


def block(n):
    """M and K of a lattice of n x n x 3 n nodes, held softly."""
    nodes = np.array(list(np.ndindex(n, n, 3 * n)))
    shape, springs, size = (n, n, 3 * n), [], 3 * len(nodes)
    for step in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)):
        ends = nodes[(nodes + step < shape).all(axis=1)]
        one, other = (np.ravel_multi_index(part.T, shape) for part in (ends, ends + step))
        along, row = np.array(step) / np.linalg.norm(step), np.arange(len(ends))
        for sign, at in ((1.0, other), (-1.0, one)):
            where = np.repeat(row, 3), (3 * at[:, None] + [0, 1, 2]).ravel()
            springs.append(sp.csr_matrix((np.tile(sign * along, len(row)), where), shape=(len(row), size)))
    rows = sp.vstack([a + b for a, b in zip(springs[::2], springs[1::2], strict=True)])
    return sp.eye(size, format="csc"), (1e6 * rows.T @ rows + 10.0 * sp.eye(size)).tocsc()


def main():
    """Print CPU seconds of each stage."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 22
    mass, stiffness = block(n)
    system = mv.System.from_matrices(mass, None, stiffness)
    start = process_time()
    fronts = system.matrices.fronts
    ordered = process_time()
    factor = system.matrices.factor()
    factored = process_time()
    right = np.random.default_rng(0).standard_normal((mass.shape[0], 10))
    factor.solve(right)
    solved = process_time()
    modes = system.modes(50)
    done = process_time()
    print(f"{mass.shape[0]} coordinates, {fronts.entries / 1e6:.0f} million entries of the factor")
    print(f"order {ordered - start:.1f}, factor {factored - ordered:.1f}, ten right sides {solved - factored:.2f}, "
          f"50 modes (two factors among it) {done - solved:.1f} s of CPU; missed {modes.missed}, "
          f"largest error {modes.errors.max():.1e}")
    if "scipy" in sys.argv:
        begin = process_time()
        square = eigsh(stiffness, 50, mass, sigma=0.0)[0]
        apart = np.abs(np.sqrt(np.sort(square)) / 2 / np.pi / modes.frequencies - 1.0).max()
        print(f"scipy {process_time() - begin:.1f} s; frequencies apart by {apart:.1e}")


if __name__ == "__main__":
    main()
