"""Certify: linearize a model; check its balance, ranks, digits, units and linear range, and ask another engine.

The eigenvalues must not depend on units; the last printed digit of the data moves them, to first order.
"""

from __future__ import annotations

import platform
import warnings
from collections.abc import Callable, Mapping
from decimal import Decimal
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from mbsvib.api.linear_range import participating
from mbsvib.api.model import Model
from mbsvib.api.rolling_system import RollingSystem
from mbsvib.api.system import System
from mbsvib.certificate.engines import by_exudyn, masses_of_tree
from mbsvib.certificate.result import FAILED, PASSED, Certificate, Check
from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import a_model
from mbsvib.equations.equations import Equations
from mbsvib.errors import EquilibriumError, MbsvibError, NearSingularWarning, SingularPoseError
from mbsvib.linalg.rank import BALANCE, RANK_FACTOR, RANK_GAP
from mbsvib.rolling.equations import rolling_equations
from mbsvib.version import __version__

# A number with as many significant digits was computed, or printed with all its digits: it is known to its rounding.
ALL_DIGITS = 15


def half_last_digit(value: float) -> float:
    """Return half a unit in the last printed digit of a number; half its spacing if it has all digits, 0 for zero.

    The digits are the shortest that give the number back. Zeros behind the last other digit and before the decimal
    point count as printed: 200.0 is known to 0.5.
    """
    if value == 0.0:
        return 0.0
    _, digits, exponent = Decimal(repr(value)).normalize().as_tuple()
    if len(digits) >= ALL_DIGITS:
        return 0.5 * float(np.spacing(abs(value)))
    return 0.5 * 10.0 ** min(int(exponent), 0)


def accuracy_radius(
    values: Mapping[str, float], eigenvalues: Complex, slopes: Complex
) -> tuple[float, float, str, int, tuple[str, ...]]:
    """Return bounds on the relative change of eigenvalues, to first order in all numbers of the model at once.

    ``values`` of the parameters (p) by name, ``slopes`` (p, eigenvalues) of the eigenvalues to them.

    |d lambda_k| <= sum over p of |d lambda_k / dp| delta_p,  delta_p half a unit in the last printed digit of p

    Returns the largest bound over all eigenvalues that are not 0; the same with delta_p = eps |p| / 2; the parameter
    with the largest part in the first; the number of its eigenvalue; and the parameters without a derivative, such as
    those that tilt one pin of a planar loop, which are taken as exact. Numbers that are 0 are taken as exact.
    """
    names, at = list(values), np.array(list(values.values()))
    slopes = np.abs(slopes)
    exact = ~np.asarray(np.isfinite(slopes).all(axis=1))
    slopes[exact] = 0.0
    moving = eigenvalues != 0.0
    if not moving.any() or not names:
        return 0.0, 0.0, "", 0, ()
    relative: Array = slopes[:, moving] / np.abs(eigenvalues[moving])
    parts = relative * np.array([half_last_digit(float(value)) for value in at])[:, None]
    total = parts.sum(axis=0)
    k = int(total.argmax())
    rounding = float((relative * (0.5 * np.finfo(float).eps * np.abs(at))[:, None]).sum(axis=0).max())
    known = zip(names, exact.tolist(), at.tolist(), strict=True)
    left_out = tuple(name for name, one, value in known if one and value != 0.0)
    return float(total[k]), rounding, names[int(parts[:, k].argmax())], int(np.flatnonzero(moving)[k]), left_out


def rolling_slopes(system: RollingSystem, values: Mapping[str, float]) -> Complex:
    """Return derivatives (p, eigenvalues) of a system on rolling wheels; not a number where a change is refused, as one
    of a wheel's axle alone, and zero for parameters that are 0.
    """
    result = np.zeros((len(values), len(system.states)), dtype=complex)
    for row, (name, value) in zip(result, values.items(), strict=True):
        if value != 0.0:
            try:
                row[:] = system.eigenvalue_sensitivities(name)[0]
            except MbsvibError:
                row[:] = np.nan
    return result


# Numbers of a model in mm, ms and g, of which none is a power of two: all digits are rounded anew.
SCALES = {"m": 1e3, "s": 1e3, "kg": 1e3, "N": 1e3 * 1e3 / 1e3**2, "rad": 1.0, "-": 1.0, "1": 1.0}


def factor(unit: str) -> float:
    """Return the value of an SI unit in mm, ms, g; raises KeyError where it is not one of products of powers."""
    above, _, below = unit.partition("/")
    result = 1.0
    for words, sign in ((above, 1), (below, -1)):
        for word in words.split():
            base, _, power = word.partition("^")
            result *= SCALES[base] ** (sign * int(power or 1))
    return result


def restated(model: Model) -> Model:
    """Return a model with all numbers in mm, ms and g."""
    parameters = model.parameters
    return model.with_values({name: value * factor(parameters.units[name]) for name, value in parameters.items()
                              if value != 0.0 and factor(parameters.units[name]) != 1.0})  # fmt: skip


def difference(found: Complex, expected: Complex) -> float:
    """Return the largest relative difference of eigenvalues, paired so that their sum is least; inf if numbers differ.

    Eigenvalues that are expected to be 0 are left out, as double ones scatter by the root of rounding; those below 1e-3
    of the largest are compared with that, as the rounding of matrices is relative to the largest.
    """
    if len(found) != len(expected):
        return np.inf
    expected = expected[expected != 0.0]
    if not len(expected):
        return 0.0
    size = np.maximum(np.abs(expected), 1e-3 * float(np.abs(expected).max()))
    off = np.abs(np.asarray(found)[:, None] - expected[None]) / size
    return float(off[linear_sum_assignment(off)].max())


# Eigenvalues in other units agree to what results are promised to, 1e-12, and the condition of badly scaled models.
SAME_UNITS = 1e-9
# Eigenvalues of another engine that differentiates by differences are good to the root of eps, relative to the largest.
SAME_ENGINE = 1e-6
# Mass matrices of two engines agree to this share of their largest entry; numbers are written with all digits.
SAME_MASS = 1e-12
# Second derivatives of all modes take some 50 ms each.
MOST_MODES = 30
# Share of the second-order part at which the linear range is stated.
SHARE = 0.1


def certify(model: Model, align: float | None = None) -> Certificate:
    """Return a certificate of the linear equations of a model: what was checked, with which result, what was skipped.

    The checks: the balance of the pose (``equilibrium.residual``, the largest unbalanced share of the forces); the rank
    decisions of loops (``rank.margin``, the smallest pivot kept over the largest dropped, or over rounding); how far
    half a unit in the last printed digit of all numbers at once moves eigenvalues, to first order, by exact
    derivatives (``accuracy.radius``, relative, a value without a limit: it is a property of the data; digits are the
    shortest that give a number back, so that 0.01 counts as known to 0.005 even if a file has 0.0100); the same model
    in mm, ms and g (``units.invariance``, relative); the linear range (``linear.range``, the smallest travel of a
    coordinate [rad, mechanism sizes] where the second-order part of an output is a tenth, without a limit); eigenvalues
    of another engine (``engine.difference``, relative; exudyn, where it can), and the mass matrices of MuJoCo and
    Pinocchio, where installed, of trees of hinges and slides (``mass.difference``, over the roots of its diagonal).
    Models on rolling wheels have the first four.

    Parameters
    ----------
    model : Model
        The model.
    align : float, optional
        As of ``Model.linearize``.

    Returns
    -------
    Certificate
        ``verdict``, ``checks``, ``skipped``, ``table()`` and ``to_json(path)``.

    Raises
    ------
    ModelError
        If ``model`` is not a Model, or ``align`` is out of range.
    """
    model = a_model(model, "certify")
    if align is not None:
        model = model.aligned(align)
    run = _Run(model)
    system = run.linearized()
    if system is not None:
        run.rank(system)
        run.modal_checks(system)
    return run.certificate()


class _Run:
    """The checks of one model, one after the other."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.checks: list[Check] = []
        self.skipped: dict[str, str] = {}
        self.details: dict[str, dict[str, Any]] = {}
        self.engine: str | None = None
        self.near: list[str] = []
        self.versions = {"mbsvib": __version__, "python": platform.python_version(), "numpy": version("numpy"),
                         "scipy": version("scipy")}  # fmt: skip

    def certificate(self) -> Certificate:
        """The certificate of the checks so far; those without a value were skipped."""
        done = {check.name for check in self.checks}
        missing = [Check(name, None, "", None, "skipped") for name in NAMES[1:] if name not in done]
        for check in missing:
            self.skipped.setdefault(check.name, "the model could not be linearized")
        checks = sorted(self.checks + missing, key=lambda check: NAMES.index(check.name))
        verdict = FAILED if any(check.passed is False for check in checks) else PASSED
        return Certificate(self.model.name, verdict, tuple(checks), self.engine, self.skipped, self.details,
                           self.versions)  # fmt: skip

    def add(self, name: str, value: float | None, limit: float | None, passed: bool | None, words: str,
            **details: Any) -> None:  # fmt: skip
        """Add a check."""
        sign = ">" if name == "rank.margin" else "<"
        self.checks.append(Check(name, value, "" if limit is None else f"{sign} {limit:g}", passed, words))
        group, _, key = name.partition(".")
        self.details[group] = {key: value, "limit": limit, "passed": passed, **details}

    def linearized(self) -> Equations | None:
        """The system; None where the model is refused, which fails the check that the refusal is about."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                system: Any = self.model.linearize()
            except EquilibriumError as error:
                self.add("equilibrium.residual", None, BALANCE, False, str(error))
                return None
            except MbsvibError as error:
                name = "rank.margin" if isinstance(error, SingularPoseError) else "model"
                self.add(name, None, None, False, str(error))
                return None
        self.near = [str(one.message) for one in caught if issubclass(one.category, NearSingularWarning)]
        self.details["warnings"] = {"messages": [str(one.message) for one in caught]}
        system = getattr(system, "ends", system)  # of motion inputs: the system of the mechanism
        statics = system.provenance.statics if isinstance(system, Equations) else None
        if isinstance(system, Equations):
            residual = 0.0 if statics is None else statics.imbalance
            words = "no gravity, load or preload" if statics is None else "largest unbalanced share of the forces"
            self.add("equilibrium.residual", residual, BALANCE, residual <= BALANCE or None, words)
            return system
        if self.model.rolling:
            self.rolling(system)
            return None
        self.add("equilibrium.residual", None, BALANCE, True, "in balance, checked by the sparse equations")
        self.rank_of(system.constraints.groups)
        for name in NAMES[3:]:
            self.skipped[name] = "sparse equations: more than some hundred coordinates"
        return None

    def rolling(self, system: Any) -> None:
        """Check the equations of first order of rolling wheels."""
        found = rolling_equations(self.model)
        statics = found.equations.provenance.statics
        residual = 0.0 if statics is None else statics.imbalance
        self.add("equilibrium.residual", residual, BALANCE, residual <= BALANCE, "with the ground on the wheels")
        self.rank_of((*found.equations.provenance.reduction.groups, *found.groups))
        for name in NAMES[3:]:
            self.skipped[name] = "rolling wheels: no engine here has them, and their finite motion is not stated"
        self.attempt("accuracy.radius", self.accuracy, system)
        self.attempt("units.invariance", self.units, system)

    def rank(self, system: Equations) -> None:
        """Check the rank decisions of all loops."""
        self.rank_of(system.provenance.reduction.groups)

    def rank_of(self, groups: Any) -> None:
        """Check the rank decisions of groups of loops."""
        if not groups:
            self.skipped["rank.margin"] = "no loops: no rank was decided"
            return
        margins = [group.retained / max(group.dropped, RANK_FACTOR * group.noise) for group in groups]
        k = int(np.argmin(margins))
        words = self.near[0] if self.near else f"smallest pivot kept {groups[k].retained:.1e} over largest dropped"
        self.add("rank.margin", float(margins[k]), RANK_GAP, margins[k] > RANK_GAP and not self.near, words,
                 pivot=float(groups[k].retained), dropped=float(groups[k].dropped),
                 joints=list(groups[k].joints))  # fmt: skip

    def modal_checks(self, system: Any) -> None:
        """Check the eigenvalues; each check that is refused is skipped with the reason."""
        if not system.dof:
            for name in NAMES[3:]:
                self.skipped[name] = "no motion: no eigenvalues"
            return
        for name, check in (("accuracy.radius", self.accuracy), ("units.invariance", self.units),
                            ("linear.range", self.linear_range), ("engine.difference", self.cross_check),
                            ("mass.difference", self.mass)):  # fmt: skip
            self.attempt(name, check, system)

    def attempt(self, name: str, check: Callable[[Any], None], system: Any) -> None:
        """Check a system; a check that is refused is skipped with the reason."""
        self.skipped.pop(name, None)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of the system itself they are recorded
                check(system)
        except MbsvibError as error:
            self.skipped[name] = str(error)

    def accuracy(self, system: Any) -> None:
        """How far the last printed digit moves eigenvalues."""
        eigenvalues, rolls = np.asarray(system.modes().eigenvalues), bool(self.model.rolling)
        slopes = rolling_slopes(system, self.model.parameters) if rolls else system.eigenvalue_sensitivities()
        radius, rounding, name, mode, exact = accuracy_radius(self.model.parameters, eigenvalues, slopes)
        if exact:
            why = "as one alone cannot change" if rolls else "as they would lock loops or free what is at rest"
            self.skipped["derivatives"] = (f"taken as exact, {why}: "
                                           f"{', '.join(exact[:6])}{', ...' if len(exact) > 6 else ''}")  # fmt: skip
        words = "no eigenvalue but 0" if not name else \
            f"relative change of an eigenvalue if half the last digit of all data is off; most by {name}"
        self.add("accuracy.radius", radius, None, None, words, rounding=rounding, parameter=name, eigenvalue=mode)

    def units(self, system: System) -> None:
        """Eigenvalues in other units."""
        unstated = [name for name, part in self.model.couplers.items() if not part.unit]
        for part in (*self.model.superelements, *unstated):
            raise MbsvibError(f"'{part}' has matrices or ratios whose units are not stated")
        try:
            other = restated(self.model).linearize(method="dense")
        except KeyError as error:
            raise MbsvibError(f"a number has the unit {error}") from error
        off = difference(1e3 * np.asarray(other.modes().eigenvalues), np.asarray(system.modes().eigenvalues))
        passed = bool(off <= SAME_UNITS)
        self.add("units.invariance", off if np.isfinite(off) else None, SAME_UNITS, passed,
                 "relative difference of eigenvalues in mm, ms, g")  # fmt: skip

    def linear_range(self, system: System) -> None:
        """The smallest range in which the linear equations hold."""
        if not system.outputs:
            raise MbsvibError("no outputs")
        if system.dof > MOST_MODES:
            raise MbsvibError(f"more than {MOST_MODES} modes")
        known = system.linear_range(SHARE)
        travel = participating(known)
        if not np.isfinite(travel).any():
            raise MbsvibError("no output has a second-order part")
        k, j = np.unravel_index(int(travel.argmin()), travel.shape)
        self.add("linear.range", float(travel[k, j]), None, None,
                 f"travel [rad, mechanism sizes] in mode {k + 1} at which the linear '{known.outputs[j]}' is 10 % off",
                 amplitude=float(known.values[k, j]), unit=known.units[j], output=known.outputs[j])  # fmt: skip

    def mass(self, system: System) -> None:
        """The mass matrices of other engines, which know no springs."""
        ours, off = [name.rpartition(".")[0] for name in system.coordinates], {}
        for engine, (mass, joints, its_version) in masses_of_tree(self.model).items():
            if sorted(ours) != sorted(joints):
                raise MbsvibError(f"{engine} has other coordinates")
            order = [joints.index(name) for name in ours]
            root = np.sqrt(system.M.diagonal())
            off[engine] = float(np.abs((mass[np.ix_(order, order)] - system.M) / np.multiply.outer(root, root)).max())
            self.versions[engine] = its_version
        most = max(off.values())
        self.add("mass.difference", most, SAME_MASS, most <= SAME_MASS,
                 f"difference of the mass matrix from that of {' and '.join(off)}, over the roots of its diagonal",
                 engines=off)  # fmt: skip

    def cross_check(self, system: System) -> None:
        """Eigenvalues of another engine."""
        try:
            found, its_version = by_exudyn(self.model)
        except MbsvibError as error:
            raise MbsvibError(f"exudyn: {error}") from error
        ours = np.asarray(system.modes().eigenvalues)
        if not ours.any():
            raise MbsvibError("no eigenvalue but 0")
        off = difference(found, ours)
        self.engine, self.versions["exudyn"] = "exudyn", its_version
        self.add("engine.difference", off if np.isfinite(off) else None, SAME_ENGINE, bool(off <= SAME_ENGINE),
                 "relative difference of eigenvalues from those of exudyn")  # fmt: skip


NAMES = ("model", "equilibrium.residual", "rank.margin", "accuracy.radius", "units.invariance", "linear.range",
         "engine.difference", "mass.difference")  # fmt: skip
