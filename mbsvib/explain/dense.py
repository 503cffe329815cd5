"""Explain: description of a system and its derivation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mbsvib.common.display import upper
from mbsvib.common.tables import SHOWN, listed
from mbsvib.elements.connection import Connection
from mbsvib.elements.motion_input import DrivenCoordinate
from mbsvib.elements.rotor import Rotor
from mbsvib.equations.equations import Equations, Removed, Separation, Truncation
from mbsvib.equations.statics import Statics
from mbsvib.errors import counted
from mbsvib.explain.energy_shares import ELASTIC, energies
from mbsvib.kinematics.loops import LoopGroup
from mbsvib.linalg.rank import BALANCE
from mbsvib.mechanism.mechanism import Mechanism
from mbsvib.mechanism.topology import FLOATS
from mbsvib.mechanism.unit_warnings import unit_warnings
from mbsvib.sparse.equations import SparseEquations

if TYPE_CHECKING:
    from mbsvib.responses.basis import Basis

MOST_STIFFNESSES = 12  # coordinates whose stiffness is shown
_ENOUGH = {
    "products": "eigenvalues of M and K were accurate enough: no singular values of the factors, no Jacobi rotations",
    "factors": "singular values of the factors were accurate enough: no Jacobi rotations",
}


def explain(system: Equations, basis: Basis | None = None) -> str:
    """Return a description of the equations of a system: topology, loops, rank decisions, and skipped steps.

    ``basis``: what has been computed of their modes.
    """
    if system.provenance.truncation is not None:
        return _reduced(system, system.provenance.truncation)
    if system.provenance.from_matrices:
        return _of_matrices(system, basis)
    lines = [f"{system.name}: {system.dof} DOF"]
    if system.provenance.closed_loop:
        lines.append("  a controller acts on it: M, C and K contain its gains; the rest is said of the open loop")
    if system.dof == 0:
        lines.append(f"  {system.provenance.rest}")
    lines += ["topology", *_topology(system), "loops", *_loops(system)]
    lines += [*alignments(system.provenance.origin), "coordinates", *_coordinates(system)]
    statics = system.provenance.statics
    if statics is not None:
        lines += ["loads", *_loads(system, statics)]
    undetermined = system.provenance.undetermined or (() if statics is None else statics.undetermined)
    if undetermined:
        lines += ["forces in joints", *(text for forces in undetermined for text in forces.explained())]
    if system.gyroscopic is not None or system.circulatory is not None:
        lines += ["symmetry", *_unsymmetric(system)]
    doubtful = unit_warnings(system.provenance.parts, system.provenance.origin)
    if doubtful:
        lines += ["doubtful", *(f"  {text}" for text in doubtful)]
    lines += ["skipped", *(f"  {text}" for text in skipped(system, basis))]
    return "\n".join(lines)


def _reduced(system: Equations, truncation: Truncation) -> str:
    """Description of a reduced model."""
    return "\n".join([
        f"{system.name}: {system.dof} DOF, a reduced model of {truncation.before} DOF (method '{truncation.method}')",
        f"  the frequency response differs by {upper(truncation.error_bound)} at most, as its largest singular value, "
        f"output by input in SI units",
        f"  coordinates: {listed(system.coordinates) or 'none'}",
    ])  # fmt: skip


def _of_matrices(system: Equations, basis: Basis | None) -> str:
    """Description of a system that was made of matrices, or assembled of parts."""
    connections = system.provenance.connections
    origin = "assembled of parts" if connections else "made of matrices; there is no mechanism to be explained"
    lines = [f"{system.name}: {system.dof} DOF, {origin}", *(f"  {one.explained}" for one in connections),
             f"  coordinates: {listed(system.coordinates) or 'none'}"]  # fmt: skip
    if system.gyroscopic is not None:
        lines.append("  C has an antisymmetric part: modes have right and left vectors")
    if system.circulatory is not None:
        lines.append("  K has an antisymmetric part: flutter is possible")
    if system.provenance.removed is not None:
        lines += [f"  {text}" for text in removed(system.provenance.removed)]
    if system.dof:
        lines += ["skipped", *(f"  {text}" for text in _modal_skips(basis))]
    return "\n".join(lines)


def _topology(system: Equations) -> list[str]:
    topology = system.provenance.topology
    jointed = {part for joint in topology.joints for part in (joint.first, joint.second)}
    declared: dict[str, Any] = {part.name: part for part in system.provenance.parts}
    composed = [part for part in declared.values() if part.symbol == "composed"]
    owners = {part.name for part in composed}
    springs = [name for name in system.provenance.springs if name not in owners]
    parts = ((topology.bodies, "body"), (topology.joints, "joint"), (springs, "spring-damper"))
    lines = ["  " + ", ".join(counted(len(group), noun) for group, noun in parts)]
    lines += [f"  {part.summary}" for part in composed]
    for body in topology.floating:
        name = topology.bodies[body]
        why = "no joint reaches it" if name not in jointed else "no chain of joints leads from ground to it"
        lines.append(f"  body '{name}' is floating: {why}, so a free joint was added")
    if topology.joints:
        lines.append(f"  spanning tree: {listed(system.tree) or 'no joint'}")
        total = topology.cumulative
        lines.append("  cumulative degree of freedom (CDOF) from ground: "
                     + listed([f"{name} {total[name]}" for name in topology.bodies]))  # fmt: skip
    straining = set(system.row_owner.tolist())
    forces = () if system.provenance.statics is None else system.provenance.statics.applied.names
    inerters = {name for name in springs if name in declared and declared[name].inertance}  # they are part of M
    idle = [name for i, name in enumerate(system.provenance.springs)
            if i not in straining and name not in forces and name not in inerters]  # fmt: skip
    if idle:
        separation = system.provenance.separation
        system_text = "the mechanism" if system.provenance.removed is None else "what is left"
        lines.append("  without effect on modes, as at most motions without mass strain them: " + listed(idle)
                     if separation is not None and separation.condensed else
                     f"  without effect, as no motion of {system_text} strains them: {listed(idle)}")  # fmt: skip
    return lines


def _loops(system: Equations) -> list[str]:
    groups = system.provenance.reduction.groups
    if not groups:
        return ["  none"] if not system.cut_joints else [f"  cut at {listed(system.cut_joints)}, no constraint"]
    lines = [f"  cut at {listed(_cut(system))}"] if system.cut_joints else ["  none but those of couplers"]
    locking = {name for group in groups for name in group.joints}
    idle = [name for name in system.cut_joints if name not in locking]
    if idle:
        lines.append(f"  without constraint: {listed(idle)}")
    return lines + [line for group in groups for line in rank_decision(group)]


def alignments(origin: Mechanism | None) -> list[str]:
    """Return the joints whose axes were aligned, one line each."""
    return [] if origin is None or not origin.alignments else [
        "  aligned within the tolerance, as the loops gain freedom by it:",
        *(f"    {change.explained}" for change in origin.alignments)]  # fmt: skip


def rank_decision(group: LoopGroup) -> list[str]:
    """Return which of the constraint rows of a group of loops are independent, and how clearly."""
    pivots = f"smallest pivot kept {group.retained:.1e}, largest" if group.rank else "largest pivot"
    lines = [f"  {listed(group.joints)}: {group.rank} of {len(group.rows)} constraint rows independent; "
             f"{pivots} dropped {group.dropped:.1e} (loop size {group.length:.3g} m)"]  # fmt: skip
    return [*lines, f"    redundant: {listed(group.redundant)}"] if group.redundant else lines


def _loads(system: Equations, statics: Statics) -> list[str]:
    """The loads of a system, their balance, and their effect on stiffness."""
    applied = statics.applied
    lines = []
    if applied.weight.any():
        lines.append("  gravity: acts at the centres of mass; its geometric stiffness is in the reactions and preloads")
    for names, kind in ((applied.names[: applied.loads], "loads"),
                        (applied.names[applied.loads :], "preloads")):  # fmt: skip
        if names:
            lines.append(f"  {kind}: {listed(names)}")
    lines.append(f"  balance: relative residual of the forces {statics.imbalance:.1e} (allowed {BALANCE:g})")
    lines += _stiffness(system)
    if system.circulatory is not None:
        lines.append("  follower loads, torques or cross-coupled bushings make K unsymmetric")
    return lines


def _stiffness(system: Equations) -> list[str]:
    """The diagonal of K by kinds, and the largest contribution of each element of a loaded model."""
    names, kinds, parts = energies(system, np.eye(system.dof))
    total = np.diagonal(system.K)
    lines = []
    for i, coordinate in enumerate(system.coordinates[:MOST_STIFFNESSES]):
        sums = {kind: sum(parts[k, i] for k in range(len(names)) if kinds[k] == kind) for kind in dict.fromkeys(kinds)}
        text = " ".join(f"{value:+.6g} {kind}" for kind, value in sums.items() if value)
        unit = "N/m" if system.coordinate_units[i] == "m" else "N m/rad"
        lines.append(f"  stiffness along {coordinate}: {total[i]:.6g} {unit} = {text or 'nothing'}")
    for name, kind, part in zip(names, kinds, parts, strict=True):
        if kind != ELASTIC:
            most = int(np.argmax(np.abs(part)))
            where = system.coordinates[most]
            unit = "N/m" if system.coordinate_units[most] == "m" else "N m/rad"
            lines.append(f"  {kind} of '{name}': {part[most]:+.6g} {unit} along {where}, its largest contribution")
    return lines


def _cut(system: Equations) -> list[str]:
    """The cut joints with the CDOF of the two bodies that each of them joins."""
    topology = system.provenance.topology
    total = topology.cumulative
    joints = [topology.joints[k] for k in topology.cut]
    return [f"{joint.name} (CDOF {total[joint.first]} and {total[joint.second]})" for joint in joints]


def _coordinates(system: Equations) -> list[str]:
    everything = system.provenance.joint_coordinates
    if not everything:
        return ["  none"]
    independent = set(system.coordinates)
    removed_part = system.provenance.removed
    independent |= set(removed_part.names) if removed_part else set()
    driven = [part.element for part in system.provenance.ports if isinstance(part, DrivenCoordinate) and not part.order]
    dependent = [name for name in everything if name not in {*independent, *driven}]
    lines = [f"  minimal: {listed(system.coordinates) or 'none'}"]
    if driven:
        lines.append(f"  driven by motion inputs: {listed(driven)}")
    if dependent:
        lines.append(f"  dependent: {listed(dependent)}")
    return lines + _massless(system) + ([] if removed_part is None else [f"  {text}" for text in removed(removed_part)])


def removed(part: Removed) -> list[str]:
    """Return the uncontrollable and unobservable parts for the given ports, one sentence each."""
    result = []
    if part.uncontrollable:
        result.append(f"removed, not controllable from {listed(part.inputs)}: {listed(part.uncontrollable)}")
    if part.unobservable:
        result.append(f"removed, not observable from {listed(part.outputs)}: {listed(part.unobservable)}")
    return result or ["nothing was removed: every part is coupled to an input and to an output"]


def _unsymmetric(system: Equations) -> list[str]:
    """Rotors and other causes of unsymmetric C and K."""
    rotors = [part for part in system.provenance.parts if isinstance(part, Rotor)]
    lines = []
    for rotor in rotors[:SHOWN]:
        axis = " ".join(f"{entry:.6g}" for entry in rotor.axis)
        moment = "" if rotor.inertia is None else f"{rotor.inertia:.6g} kg m^2 on "
        subject = f"{moment}body '{rotor.body}'{'' if moment else ' itself'}"
        lines.append(f"  rotor '{rotor.name}': {subject}, {rotor.speed:.6g} rad/s about ({axis})")
    coupled = [part.name for part in system.provenance.parts
               if isinstance(part, Connection) and part.cross_coupling is not None]  # fmt: skip
    if coupled:
        lines.append(f"  cross-coupled, with unsymmetric stiffness or damping: {listed(coupled)}")
    if system.gyroscopic is not None:
        lines.append("  C = dampers + gyroscopic terms: modes have right and left vectors")
    if system.circulatory is not None:
        lines.append("  K = stiffness + circulatory terms (rotating dampers, follower loads, cross-coupling): flutter "
                     "is possible")
    return lines


def _massless(system: Equations) -> list[str]:
    separation = system.provenance.separation
    return [] if separation is None else separated(separation, 2 * system.dof - system.massless)


def separated(separation: Separation, states: int) -> list[str]:
    """Return the treatment of motions without mass, one line each; ``states`` is the number of states."""
    lines = [f"  motions without mass: {len(separation.condensed) + len(separation.first_order)}; of the mass rows, "
             f"smallest pivot kept {separation.smallest_kept:.1e}, "
             f"largest dropped {separation.largest_dropped:.1e}"]  # fmt: skip
    if separation.condensed:
        lines.append(f"  condensed statically, as no damper acts on them: {listed(separation.condensed)}")
    if separation.first_order:
        lines.append(f"  without mass but damped, one first-order state each: {listed(separation.first_order)}; "
                     f"{states} states in all")  # fmt: skip
    return lines


def skipped(system: Equations, basis: Basis | None = None) -> list[str]:
    """Return the steps of the computation that the model does not need, one sentence each.

    ``basis``: what has been computed of their modes.
    """
    result = []
    if not system.provenance.reduction.groups:
        result.append("no closed loops: the cut-joint matrix B'' was not needed")
    elif not any(group.surplus for group in system.provenance.reduction.groups):
        result.append("no redundant constraint: neighbouring poses were not checked")
    elif system.provenance.planar:
        result.append("planar loops with the largest possible constraint rank: neighbouring poses were not checked")
    if not system.row_damping.any():
        result.append(undamped(system))
    if not any(branch.joint == FLOATS for branch in system.provenance.topology.branches):
        result.append("joints connect every body to ground: no free joint was added")
    if system.dof:
        result += _modal_skips(basis)
    if system.provenance.statics is None:
        result.append("no gravity, load or preload: no statics, no geometric stiffness")
    if system.gyroscopic is None:
        result.append("nothing spins: no gyroscopic terms")
    return result


def undamped(system: Equations | SparseEquations) -> str:
    """Return what follows for equations on which no damper acts."""
    symmetric = system.gyroscopic is None and system.circulatory is None
    return f"no damper acts: C {'is zero and modes are real' if symmetric else 'has no symmetric part'}"


def _modal_skips(basis: Basis | None) -> list[str]:
    """Steps that the modes computed so far, if any, did not need."""
    if basis is None or "modes" not in basis.computed:
        return ["no mode and no response was requested yet: no eigenvalue was computed"]
    result, modes = [], basis.modes
    if modes.classical:
        result.append(f"{modes.classical}: modes are real, and no eigenvalue problem of twice the size was solved")
    if modes.solver in _ENOUGH:
        result.append(_ENOUGH[modes.solver])
    if "modal_sum" in basis.computed and "schur" not in basis.computed:
        result.append("responses are sums over modes: no equations were solved frequency by frequency")
    return result
