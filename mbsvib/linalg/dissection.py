"""Nested dissection: an order of the unknowns of a sparse symmetric matrix in which elimination fills little.

Unknowns with the same neighbours (those of a node) stay together. Each part of the graph is split by the smallest of
some separators between levels of equal distance; it is eliminated after both halves.

Source: George, SIAM J. Numer. Anal. 10 (1973) 345; George & Liu, Computer Solution of Large Sparse Positive Definite
Systems (1981), chapter 8.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.linalg.groups import by_label, part_numbers

if TYPE_CHECKING:
    from mbsvib.common.arrays import Array, Index

# Parts with fewer unknowns are not split: dense factors of this size cost less than more fronts.
LEAF = 480
# Shares of the nodes before a separator that are tried, and the least share of either half.
SPLITS, LEAST = (0.42, 0.5, 0.58), 0.2
# Nodes with more neighbours than this multiple of the root of their number are eliminated last: they join all others.
HUB = 10.0


def dissected(pattern: Any) -> list[tuple[Index, int]]:
    """Return the fronts of a symmetric sparse ``pattern`` (n, n), children before parents: unknowns, number of parent.

    The parent of the last ones is -1.
    """
    from scipy.sparse import csr_matrix

    n = pattern.shape[0]
    weight = np.random.default_rng(0).integers(0, 2**62, n)
    ones = csr_matrix((np.ones(len(pattern.indices), dtype=np.int64), pattern.indices, pattern.indptr), (n, n))
    _, label = np.unique(ones @ weight, return_inverse=True)
    members = by_label(label.reshape(-1))
    join = csr_matrix((np.ones(n), (label.reshape(-1), np.arange(n))), (len(members), n))
    graph = (join @ ones.astype(float) @ join.T).tocsr()
    graph.setdiag(0.0)
    graph.eliminate_zeros()
    size, degree = np.bincount(label.reshape(-1)), np.diff(graph.indptr)
    hubs = degree > max(LEAF, HUB * np.sqrt(len(members)))
    fronts: list[tuple[Index, int]] = []  # parents first

    def add(nodes: Index, parent: int) -> int:
        fronts.append((np.concatenate([members[i] for i in nodes.tolist()]), parent))
        return len(fronts) - 1

    pending = [(np.flatnonzero(~hubs), add(np.flatnonzero(hubs), -1) if hubs.any() else -1)]
    while pending:
        nodes, parent = pending.pop()
        local = graph[nodes][:, nodes]
        split = None if size[nodes].sum() <= LEAF else _separator(local, size[nodes])
        if split is None:
            add(nodes, parent)
            continue
        last = nodes[split == 2]
        above = add(last, parent) if len(last) else parent
        pending += [(nodes[split == side], above) for side in (0, 1)]
    order = range(len(fronts) - 1, -1, -1)
    return [(fronts[i][0], len(fronts) - 1 - fronts[i][1] if fronts[i][1] >= 0 else -1) for i in order]


def _separator(graph: Any, size: Index) -> Index | None:
    """0 and 1 for the halves of a graph, 2 for the nodes between them; None if there is no small separator."""
    from scipy.sparse.csgraph import dijkstra

    part = part_numbers(graph)
    if part.max(initial=0) > 0:  # whole parts, about equal halves
        total = np.bincount(part, size)
        return np.asarray((np.cumsum(total) - 0.5 * total > 0.5 * size.sum()).astype(np.intp)[part])

    def distance(start: int) -> Array:
        return np.asarray(dijkstra(graph, unweighted=True, indices=start))

    a = distance(int(distance(0).argmax()))
    b = distance(int(a.argmax()))
    c = distance(int(np.minimum(a, b).argmax()))
    d = distance(int(c.argmax()))
    best, result, whole = np.inf, None, float(size.sum())
    for level in (a - b, c - d):
        order = np.argsort(level, kind="stable")
        share = np.cumsum(size[order]) / whole
        for at in SPLITS:
            first = level <= level[order[np.searchsorted(share, at)]]
            if not LEAST < float(size[first].sum()) / whole < 1.0 - LEAST:
                continue
            for side in (first, ~first):
                between = side & (graph @ (~side).astype(float) > 0.0)
                halves = [float(size[half & ~between].sum()) / whole for half in (side, ~side)]
                cost = float(size[between].sum()) * (1.0 + (halves[0] - halves[1]) ** 2)
                if cost < best and min(halves) > 0.0:
                    best, result = cost, np.where(between, 2, np.where(side, 0, 1))
    return result
