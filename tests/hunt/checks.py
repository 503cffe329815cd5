"""The comparisons of a scene with itself, stated in other ways or asked in other ways, and with the reference."""

import re
import tempfile
import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

import mbsvib as mv
from mbsvib.responses.modal_blocks import DEPENDENT
from tests.hunt import restated
from tests.hunt import sensitivities as derivatives
from tests.hunt.answers import (
    UNDETERMINED,
    Mismatch,
    answers,
    compare_eigenvalues,
    compare_reactions,
    compare_responses,
    compare_rigid,
    question,
    response_of,
    rows_of,
)
from tests.hunt.divided import divided
from tests.hunt.generate import Example
from tests.hunt.skip import Skip as Skip
from tests.support.random_models import rotation

MATRICES = ("M", "C", "K", "B", "Cq", "Cv", "Ca", "D")
# A coordinate is free where motions that the constraints leave move it by this share of what all motions do.
MOVES = 1e-3
# Of sums over states this share of the terms is allowed for, and of a response that of its largest: states mix motions
# of very different size, and modal ones may lose eight digits before they are refused.
OF_STATES, OF_RESPONSE = DEPENDENT * float(np.finfo(float).eps), 1e-7
# Condition number of eigenvectors that depend on each other, as of a rigid-body mode; rounding makes it infinite.
DEFECTIVE = 1e30


@dataclass
class Subject:
    """A scene with its model, system and answers, computed when they are first asked for."""

    example: Example
    warned: str = ""

    @property
    def scene(self):
        return self.example.scene

    @property
    def rng(self):
        return np.random.default_rng((self.scene.seed, 7))

    @cached_property
    def question(self):
        return question(self.example)

    @cached_property
    def system(self):
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("error")
            warnings.simplefilter("always", mv.UndeterminedForceWarning)
            warnings.filterwarnings("ignore", ".*(out of line|nearly redundant)", mv.NearSingularWarning)
            result = self.scene.model().linearize(method="dense")
        self.warned = " ".join(str(item.message) for item in seen)
        return result

    @cached_property
    def answers(self):
        return answers(self.system, self.question)

    @cached_property
    def equations(self):
        return self.example.reference.equations

    def compare(self, other, reactions=None):
        """Other answers with those of the scene as it is."""
        q, own = self.question, self.answers
        compare_eigenvalues(other, own.eigenvalues, tolerances(own.eigenvalues, q))
        compare_responses(other.response, own.response, q, np.flatnonzero(q.determined))
        determined = self.example.reference.determined_joints
        if reactions is not None:
            compare_reactions(
                reactions, own.reactions, [name for name, fixed in determined.items() if fixed], self.equations
            )
        compare_responses(other.response, own.response, q)
        if reactions is not None:
            try:
                compare_reactions(reactions, own.reactions, determined, self.equations)
            except Mismatch as error:
                raise Mismatch(f"{error}; it is {UNDETERMINED}") from None


def tolerances(values, q):
    """Tolerances of the reference's eigenvalues in the order of others."""
    if len(values) != len(q.eigenvalues) or not len(values):
        return np.zeros(len(values))
    nearest = np.abs(values[:, None] - q.eigenvalues[None, :]).argmin(axis=1)
    return q.eigenvalue_tolerance[nearest]


def reference(subject):
    """The absolute equations: eigenvalues, rigid modes, responses and reactions as far as they are determined."""
    q, own, known = subject.question, subject.answers, subject.example.reference
    compare_eigenvalues(own, q.eigenvalues, q.eigenvalue_tolerance)
    # Rayleigh damping of a beam or flexure brakes what it floats with by next to nothing
    if not {"rayleigh damping", "flexure"} & subject.scene.features:
        compare_rigid(own, q)
    compare_responses(own.response, q.response, q, np.flatnonzero(q.determined))
    if subject.scene.loaded:
        names = [name for name, fixed in known.determined_joints.items() if fixed]
        compare_reactions(own.reactions, known.reactions, names, subject.equations)
    named = {name for text in re.findall(r"does not determine the outputs? ([^:]*):", subject.warned)
             for name in text.split(", ")}  # fmt: skip
    undetermined = {name for name, fixed in zip(q.outputs, q.determined, strict=True) if not fixed}
    if named != undetermined:
        raise Mismatch(f"a warning names {sorted(named)} as {UNDETERMINED}, not {sorted(undetermined)}")
    if len(subject.system.redundant) != known.redundant:
        raise Mismatch(f"{len(subject.system.redundant)} redundant rows, not {known.redundant}")


def turned(subject):
    by = rotation(subject.rng)
    again = answers(restated.turned(subject.scene, by).model().linearize(method="dense"), subject.question)
    back = {name: np.concatenate((by.T @ w[:3], by.T @ w[3:])) for name, w in again.reactions.items()}
    subject.compare(again, back)


def shifted(subject):
    by = 5.0 * subject.rng.normal(size=3)
    again = answers(restated.shifted(subject.scene, by).model().linearize(method="dense"), subject.question)
    subject.compare(again, again.reactions)


def units(subject):
    rng = subject.rng
    u = restated.Units(1e3, 1e-3, 1.0) if rng.random() < 0.3 else restated.Units(*10 ** rng.uniform(-2, 2, size=3))
    system = restated.rescaled(subject.scene, u).model().linearize(method="dense")
    again = answers(system, subject.question, u.time)
    subject.compare(again, {name: w / u.wrench for name, w in again.reactions.items()})


def shuffled(subject):
    again = answers(restated.shuffled(subject.scene, subject.rng).model().linearize(method="dense"), subject.question)
    subject.compare(again, again.reactions)


def renamed(subject):
    scene, new = restated.renamed(subject.scene, subject.rng)
    again = answers(scene.model().linearize(method="dense"), subject.question)
    subject.compare(again, {name: again.reactions[new[name]] for name in subject.scene.names("joint")})


def saved(subject):
    """Model files in YAML and JSON: the same matrices to the last bit."""
    with tempfile.TemporaryDirectory() as folder:
        for suffix in ("yaml", "json"):
            path = mv.save(subject.scene.model(), Path(folder) / f"scene.{suffix}")
            again = mv.load(path).linearize(method="dense")
            same_matrices(again, subject.system, suffix)


def same_matrices(again, system, what):
    names = [rows_of(getattr(again, key), getattr(system, key)) for key in ("coordinates", "outputs", "inputs")]
    for key, (rows, columns) in zip(
        MATRICES, ((0, 0), (0, 0), (0, 0), (0, 2), (1, 0), (1, 0), (1, 0), (1, 2)), strict=True
    ):
        matrix, expected = getattr(again, key), getattr(system, key)
        if matrix.shape != expected.shape or not np.array_equal(matrix[np.ix_(names[rows], names[columns])], expected):
            raise Mismatch(f"{what}: matrix {key} is another one")


def cut(subject):
    """Loops cut at other joints: those outside a random spanning tree."""
    joints = subject.scene.of("joint")
    tree_of = {}

    def root(name):
        while name in tree_of:
            name = tree_of[name]
        return name

    selected = []
    for k in subject.rng.permutation(len(joints)):
        ends = [root(joints[k].arguments[end]) for end in ("first", "second")]
        if ends[0] == ends[1]:
            selected.append(joints[k].name)
        else:
            tree_of[ends[0]] = ends[1]
    if not selected:
        raise Skip("no loop")
    again = answers(subject.scene.model().linearize(cut=selected, method="dense"), subject.question)
    subject.compare(again, again.reactions)


def independent(subject):
    """Another joint coordinate among the minimal ones; refused only where the loops hold it, or nothing moves mass."""
    e = subject.example.reference.equations
    known = set(subject.system.coordinates)
    dependent = [(view.name, d) for view in e.exact.views.values() if view.name in subject.system.tree
                 for d in view.free if f"{view.name}.{d}" not in known]  # fmt: skip
    names = [f"{joint}.{d}" for joint, d in dependent if moves(e, joint, d)]
    if not names:
        raise Skip("no dependent coordinate")
    name = names[subject.rng.integers(len(names))]
    try:
        system = subject.scene.model().linearize(independent=[name], method="dense")
    except mv.ModelError as error:
        if "cannot be kept" in str(error):
            raise Skip("condensed") from error
        raise
    subject.compare(answers(system, subject.question))


def moves(e, joint, direction):
    """Whether the constraints leave a joint's coordinate free to move."""
    if e.exact.views[joint].kind == "distance":
        return False
    row = np.pad(e.exact.coordinate_row(joint, direction), (0, e.size - e.rigid))
    return bool(np.linalg.norm(row[e.moving] @ e.N) > MOVES * np.linalg.norm(row * e.unit))


def sparse(subject):
    system = subject.scene.model().linearize(method="sparse")
    q, own = subject.question, subject.answers
    if system.dof != subject.system.dof:
        raise Mismatch(f"{system.dof} degrees of freedom, not {subject.system.dof}")
    compare_responses(response_of(system, q), own.response, q)
    count = min(3, system.dof)
    if count:
        values = system.modes(count).eigenvalues
        reach = np.abs(values).max(initial=0.0) * (1 + 1e-6)
        allowed = tolerances(own.eigenvalues, q) + 1e-8 * np.abs(own.eigenvalues)
        for value in values:
            share = np.abs(own.eigenvalues - value) / (allowed + 1e-300)
            if share.min() > 1.0:
                raise Mismatch(f"eigenvalue {value:.9g} is none of the dense system; nearest "
                               f"{own.eigenvalues[share.argmin()]:.9g}")  # fmt: skip
        lowest = np.sort(np.abs(own.eigenvalues))[: len(values)]
        if np.any(lowest > reach + allowed.max()):
            raise Mismatch(f"the lowest modes are not among {values}")


def batch(subject):
    """Two variants, the scene as it is and with another number, which a scene of its own has as well."""
    name, changed, value = variant(subject)
    systems = subject.scene.model().linearize(values={name: [value, 1.3 * value]})
    q = subject.question
    rows, columns = rows_of(systems.outputs, q.outputs), rows_of(systems.inputs, q.inputs)
    responses = systems.frequency_response(q.omega)[:, rows][:, :, columns]
    compare_responses(responses[0], subject.answers.response, q)
    other = changed.model().linearize(method="dense")
    compare_responses(responses[1], response_of(other, q), replace(q, response_tolerance=10 * q.response_tolerance))
    values = systems.modes().eigenvalues
    for k, system in enumerate((subject.system, other)):
        own = replace(subject.answers, eigenvalues=values[k])
        compare_eigenvalues(own, system.modes().eigenvalues, 10 * tolerances(values[k], q))


def variant(subject):
    """A parameter that may vary while the pose stays in balance, the scene with 1.3 times its value, and the value."""
    choices = []
    for i, call in enumerate(subject.scene.calls):
        a = call.arguments
        if call.kind == "bushing" and np.ndim(a.get("stiffness")) == 1 and a["stiffness"][0]:
            factor = np.array([1.3, 1, 1, 1, 1, 1])
            choices.append(
                (f"{call.name}.stiffness.x", i, call.but(stiffness=factor * a["stiffness"]), a["stiffness"][0])
            )
        elif call.kind == "spring" and a.get("stiffness") and "free_length" not in a:
            choices.append((f"{call.name}.stiffness", i, call.but(stiffness=1.3 * a["stiffness"]), a["stiffness"]))
        elif call.kind == "body" and a["mass"] and not subject.scene.loaded:
            choices.append((f"{call.name}.mass", i, call.but(mass=1.3 * a["mass"]), a["mass"]))
    if not choices:
        raise Skip("nothing to vary")
    name, i, changed, value = choices[subject.rng.integers(len(choices))]
    calls = list(subject.scene.calls)
    calls[i] = changed
    return name, subject.scene.with_calls(calls), float(value)


def preloads(subject):
    """The smallest preloads that hold the pose: the same where the scene is turned or shuffled."""
    if "equilibrium preloads" not in subject.scene.features:
        raise Skip("no preloads are asked for")
    by, q = rotation(subject.rng), subject.question
    model = subject.scene.model().equilibrium(preload=True)
    own = answers(model.linearize(method="dense"), q)
    for scene in (restated.turned(subject.scene, by), restated.shuffled(subject.scene, subject.rng)):
        again = answers(scene.model().equilibrium(preload=True).linearize(method="dense"), q)
        compare_eigenvalues(again, own.eigenvalues, tolerances(own.eigenvalues, q))
        compare_responses(again.response, own.response, q, np.flatnonzero(q.determined))


def realizations(subject):
    """First-order equations in physical, modal and balanced states: responses, and as many states as eigenvalues."""
    q, own = subject.question, subject.answers
    for kind in ("physical", "balanced", "modal"):
        space = subject.system.state_space(kind)
        loss = np.finfo(float).eps * eigenvector_condition(space.A) if kind == "modal" else 0.0
        if len(space.states) != own.size:
            raise Mismatch(f"{kind}: {len(space.states)} states, not {own.size}")
        rows, columns = rows_of(space.outputs, q.outputs), rows_of(space.inputs, q.inputs)
        response, size = np.empty_like(own.response), np.empty(own.response.shape)
        for k, w in enumerate(q.omega):
            states = solved(1j * w * np.eye(len(space.A)) - space.A, space.B) if own.size else space.B
            response[:, :, k] = (space.C @ states + space.D)[np.ix_(rows, columns)]
            size[:, :, k] = (np.abs(space.C) @ np.abs(states) + np.abs(space.D))[np.ix_(rows, columns)]
        largest = np.abs(own.response).max(axis=1, keepdims=True)
        allowed = q.response_tolerance + max(OF_STATES, loss) * size + OF_RESPONSE * largest
        wider = replace(q, response_tolerance=allowed + OF_STATES * largest.max(axis=2, keepdims=True))
        try:
            compare_responses(response, own.response, wider)
        except Mismatch as error:
            raise Mismatch(f"{kind}: {error}") from None


def eigenvector_condition(matrix):
    """Condition number of eigenvectors of unit length, by which modal states lose digits; finite for defective ones."""
    return min(np.linalg.cond(np.linalg.eig(matrix)[1]), DEFECTIVE) if len(matrix) else 1.0


def solved(matrix, right):
    """matrix^-1 right with one correction, which makes up for states of very different size."""
    first = np.linalg.solve(matrix, right)
    return first + np.linalg.solve(matrix, right - matrix @ first)


def zeros(subject):
    """Zeros and poles of one input and output make the ratio of the response at two points."""
    q, own = subject.question, subject.answers
    w = q.omega[-3:]
    if len(w) < 3 or not own.size:
        raise Skip("no poles")
    for i in np.flatnonzero(q.determined):
        size = np.abs(own.response[i, 0, -3:])
        if np.all(size > 1e4 * q.response_tolerance[i, 0, -3:]) and own.size < 30:
            break
    else:
        raise Skip("no response that is far from zero")
    roots = subject.system.transmission_zeros(inputs=q.inputs[0], outputs=q.outputs[i])
    s = 1j * w
    logs = np.log(s[:, None] - roots).sum(axis=1) - np.log(s[:, None] - own.eigenvalues).sum(axis=1)
    ratio = np.exp(logs - logs[0]) * own.response[i, 0, -3]
    off = np.abs(ratio - own.response[i, 0, -3:]) / np.abs(own.response[i, 0, -3:])
    sensitive = sum(
        np.abs(1 / (s[:, None] - part)).sum() * np.abs(part).max(initial=0.0) for part in (roots, own.eigenvalues)
    )
    if off.max() > 1e-7 + 1e-11 * sensitive:
        raise Mismatch(f"zeros from '{q.inputs[0]}' to '{q.outputs[i]}' ({len(roots)}) do not fit the response: off by "
                       f"{off.max():.1e}")  # fmt: skip


def questions(subject):
    """Questions whose answers are bounds, or are not compared: none may fail by accident."""
    system, q, own = subject.system, subject.question, subject.answers
    assert system.explain()
    assert str(system.modes())
    if len(system.poles()) != own.size:
        raise Mismatch(f"{len(system.poles())} poles, not {own.size}")
    ports = {"inputs": q.inputs[0], "outputs": q.outputs[0]}
    response = own.response[0, 0]
    pick = subject.rng.integers(4)
    if pick == 0:
        system.frequency_grid(n=20, **ports)
    elif pick == 3:
        off = np.abs(system.reachable(**ports).frequency_response(q.omega)[0, 0] - response)
        if np.any(off > q.response_tolerance[0, 0]):
            raise Mismatch("the reachable part responds in another way")
    else:
        try:
            norm = system.hinf_norm(parameters=[], **ports) if pick == 1 else system.h2_norm(parameters=[], **ports)
        except mv.ResponseError as error:
            if "infinite" not in str(error) and "does not decay" not in str(error):
                raise
            return
        if pick == 1 and norm.value < np.abs(response).max() - q.response_tolerance[0, 0].max():
            raise Mismatch(
                f"the H-infinity norm {norm.value:.6g} is less than a response, {np.abs(response).max():.6g}"
            )


def sensitivities(subject):
    """Derivatives of eigenvalues to one parameter of each kind of element."""
    derivatives.sensitivities(subject)


CHECKS = {check.__name__: check for check in (
    reference, turned, shifted, units, shuffled, renamed, saved, cut, independent, sparse, batch, preloads,
    realizations, zeros, questions, sensitivities, divided,
)}  # fmt: skip
