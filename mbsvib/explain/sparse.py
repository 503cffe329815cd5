"""Explain: description of a sparse system and its derivation."""

from __future__ import annotations

import numpy as np

from mbsvib.common.tables import listed
from mbsvib.errors import counted
from mbsvib.explain.dense import alignments, rank_decision, removed, separated, undamped
from mbsvib.sparse.equations import SparseEquations

SHOWN = 8  # groups of loops


def explain(system: SparseEquations) -> str:
    """Return in words how the equations of a sparse system were derived: topology, loops, rank decisions, the tableau,
    skipped computations.
    """
    if system.matrices is not None:
        given = system.matrices
        joined = [f"  {one.explained}\n" for one in system.connections[:SHOWN]]
        if len(system.connections) > SHOWN:
            farthest = max((one.distance or 0.0 for one in system.connections), default=0.0)
            joined.append(f"  and {len(system.connections) - SHOWN} more, at most {1e3 * farthest:.3g} mm apart\n")
        origin = "assembled of parts" if joined else "made of matrices; there is no mechanism"
        return (f"{system.name}: {system.dof} DOF, sparse matrices\n  {origin}\n{''.join(joined)}"
                f"  {len(system.joint_coordinates)} coordinates, {len(given.massless)} of them without mass\n"
                f"  {given.M.nnz} entries in M, {given.C.nnz} in C, {given.K.nnz} in K")  # fmt: skip
    topology = system.topology
    parts = ((topology.bodies, "body"), (topology.joints, "joint"), (system.springs, "spring-damper"))
    lines = [
        f"{system.name}: {system.dof} DOF, sparse matrices", "topology",
        "  " + ", ".join(counted(len(group), noun) for group, noun in parts),
    ]  # fmt: skip
    if topology.floating:
        lines.append(f"  floating, with free joints added: {listed([topology.bodies[i] for i in topology.floating])}")
    lines.append(f"  spanning tree: {listed(system.tree) or 'no joint'}")
    owners = system.springs + system.loading
    acting = {owners[i] for i in np.unique(system.row_owner).tolist()}
    idle = [name for name in system.springs if name not in acting]
    if system.removed is not None:
        lines += [f"  {text}" for text in removed(system.removed)]
    elif idle:
        lines.append(f"  without effect, as no motion of the mechanism strains them: {listed(idle)}")
    if system.loading:
        count = int(np.count_nonzero(system.row_owner >= len(system.springs)))
        of = "of geometric stiffness from gravity, loads, preloads and forces in joints"
        lines += ["loads", f"  in balance; {counted(count, 'row')} {of}"]
    lines += ["loops", *_loops(system), *alignments(system.model)]
    if system.separation is not None:
        lines += ["coordinates", *separated(system.separation, 2 * system.dof - system.massless)]
    lines += ["tableau", *_tableau(system), *_forces(system), "skipped", *_skipped(system)]
    return "\n".join(lines)


def _loops(system: SparseEquations) -> list[str]:
    if not system.constraints.names:
        return ["  none"]
    lines = [f"  cut at {listed(system.cut_joints)}"] if system.cut_joints else ["  none but those of couplers"]
    lines += [line for group in system.constraints.groups[:SHOWN] for line in rank_decision(group)]
    remaining = len(system.constraints.groups) - SHOWN
    if remaining > 0:
        lines.append(f"  and {counted(remaining, 'more group')} of loops")
    return lines


def _tableau(system: SparseEquations) -> list[str]:
    size = system.layout.size
    moving = int(system.structure.moves.sum())
    order = "from leaves to root" if system.tableau.ordering == "NATURAL" else "of COLAMD, as loops overlap"
    return [
        f"  {size} unknowns: {moving} displacements and as many joint forces, "
        f"{counted(len(system.joint_coordinates), 'coordinate')}, "
        f"{counted(len(system.layout.multiplier), 'multiplier')}",
        f"  {len(system.tableau.indices)} entries, eliminated in the order {order}",
    ]  # fmt: skip


def _forces(system: SparseEquations) -> list[str]:
    force_outputs = [output for output in system.model.outputs.values()
              if output.element is not None and output.element not in system.model.springs]  # fmt: skip
    if not force_outputs:
        return []
    count = counted(len(force_outputs), "output")
    names = listed([output.name for output in force_outputs])
    lines = [f"  {count} by virtual work, rows as long as what they sum: {names}"]
    return [*lines, *(text for forces in system.undetermined for text in forces.explained())]


def _skipped(system: SparseEquations) -> list[str]:
    result = ["  no dense matrix was formed: the number of coordinates is too large for an efficient one"]
    fixed = int((~system.structure.moves).sum())
    if fixed:
        result.append(f"  {fixed} of {system.structure.moves.size} displacements cannot move: they were left out")
    if not system.loading:
        result.append("  no gravity, load or preload: no statics, no geometric stiffness")
    if not system.constraints.groups:
        result.append("  no loop: no constraint was checked")
    if not system.row_damping.any():
        result.append(f"  {undamped(system)}")
    return result
