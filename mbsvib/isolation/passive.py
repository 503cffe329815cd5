"""Passive design: springs, dampers, masses and places of an isolation, by exact gradients."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.api.in_equilibrium import in_equilibrium
from mbsvib.api.model import Model
from mbsvib.common import arguments as check
from mbsvib.common.arrays import Array
from mbsvib.common.display import Displayed
from mbsvib.common.expected import band_of, hertz, names, one_of, reals
from mbsvib.common.patterns import matching
from mbsvib.errors import ModelError
from mbsvib.isolation.design import Design, Front, MeanSquares
from mbsvib.isolation.isolation_study import Isolation, figures
from mbsvib.isolation.study_scene import ACCELERATIONS, DIRECTIONS, DISPLACEMENTS, LOADS, StudyScene, scene
from mbsvib.mechanism.mechanism import GROUND
from mbsvib.random.sources import BaseNoise, base_noise
from mbsvib.studies import Constraint, Quantity, optimize
from mbsvib.studies.quantities import Leaf
from mbsvib.studies.responses import Peak, PortResponses

Bounds = Mapping[str, tuple[float | None, float | None] | None]

GRAVITY = 9.80665


@dataclass(frozen=True, repr=False, eq=False)
class Passive(Displayed):
    """Quantities of an isolation that ``optimize`` makes small or keeps within bounds, with their exact gradients."""

    _engine = "scene"

    model: Model
    """The model that is designed."""
    scene: StudyScene = field(repr=False)
    joints: tuple[str, ...] = ()
    """Names of the joints whose angles are watched."""

    def peak(self, band: tuple[float, float] | None = None) -> Quantity:
        """Return the peak of the Frobenius index of the transmissibility.

        Parameters
        ----------
        band : (float, float), optional
            First and last frequency [Hz]; default: around all modes.

        Returns
        -------
        Quantity
            max ||T||_F / sqrt(base directions).
        """
        return Peak(self._transmissibility, band_of(band, "peak", above=True))

    def index(self, frequencies: ArrayLike) -> Quantity:
        """Return the Frobenius index at frequencies.

        Parameters
        ----------
        frequencies : array-like, shape (n,)
            Where [Hz].

        Returns
        -------
        Quantity
            ||T||_F / sqrt(base directions) at each.
        """
        f = hertz(frequencies)
        span = f"{f[0]:g} Hz" if len(f) == 1 else f"{f[0]:g} to {f[-1]:g} Hz"
        return Leaf(f"index at {span} [1]", partial(self._transmissibility.size, w=2.0 * np.pi * f))

    def rms(self, spectra: Mapping[str, Any], band: tuple[float, float] | None = None) -> Quantity:
        """Return the root mean square acceleration of the body under base noise, rotations times the length.

        Parameters
        ----------
        spectra : mapping of str to float, array-like or noise
            Density of the base's acceleration by direction, as in ``Isolation.under``.
        band : (float, float), optional
            First and last frequency [Hz]; default: all.

        Returns
        -------
        Quantity
            One number [m/s^2].
        """
        squares = self._squares("rms acceleration", ACCELERATIONS, spectra, band)
        result = (squares * self.scene.scale() ** 2).sum() ** 0.5
        result.label = "rms acceleration [m/s^2]"
        return result

    def stroke(self, spectra: Mapping[str, Any], band: tuple[float, float] | None = None) -> Quantity:
        """Return the root mean square strokes of all legs under base noise.

        Parameters
        ----------
        spectra : mapping of str to float, array-like or noise
            Density of the base's acceleration by direction.
        band : (float, float), optional
            First and last frequency [Hz]; default: all.

        Returns
        -------
        Quantity
            One number for each of ``legs`` [m].
        """
        return self._rms_by_leg("rms stroke [m]", [leg.stroke for leg in self.scene.legs], spectra, band)

    def force(self, spectra: Mapping[str, Any], band: tuple[float, float] | None = None) -> Quantity:
        """Return the root mean square forces in all legs and joints under base noise.

        Parameters
        ----------
        spectra : mapping of str to float, array-like or noise
            Density of the base's acceleration by direction.
        band : (float, float), optional
            First and last frequency [Hz]; default: all.

        Returns
        -------
        Quantity
            One number for each of ``legs`` [N].
        """
        return self._rms_by_leg("rms force [N]", [leg.force for leg in self.scene.legs], spectra, band)

    def angle(self, spectra: Mapping[str, Any], band: tuple[float, float] | None = None) -> Quantity:
        """Return the root mean square angles by which joints turn under base noise, all axes together.

        Parameters
        ----------
        spectra : mapping of str to float, array-like or noise
            Density of the base's acceleration by direction.
        band : (float, float), optional
            First and last frequency [Hz]; default: all.

        Returns
        -------
        Quantity
            One number for each of ``joints`` [rad].

        Raises
        ------
        ModelError
            If no joints were named.
        """
        if not self.joints:
            raise ModelError("passive: no joints are watched; name them, passive(model, body, joints=['leg*.foot']).",
                             field="joints")  # fmt: skip
        names = [f"{joint}.angle.{axis}" for axis in "xyz" for joint in self.joints]
        squares, n = self._squares("angle", names, spectra, band), len(self.joints)
        result = (squares[:n] + squares[n : 2 * n] + squares[2 * n :]) ** 0.5
        result.label = "rms angle of joints [rad]"
        return result

    def sag(self, direction: str = "z", load: float | None = None) -> Quantity:
        """Return how far a constant load, such as its weight, displaces the body along the load.

        Parameters
        ----------
        direction : str
            x, y or z, of the load and of the displacement.
        load : float, optional
            Force at the reference point [N]; default: the body's weight on earth, of its present mass.

        Returns
        -------
        Quantity
            One number [m].

        Raises
        ------
        ModelError
            If the direction or the load is refused.
        """
        one_of(direction, DIRECTIONS[:3], "sag", "direction", ModelError)
        weight = GRAVITY * self.model.bodies[self.scene.body].mass if load is None else load
        newton = abs(check.number(weight, "sag", "load"))
        ports = PortResponses({f"displacement.{direction}": 1.0}, {f"load.{direction}": newton})
        return Leaf(f"sag along {direction} [m]", partial(ports.size, w=np.zeros(1)))

    def compliance(self, frequency: float = 0.0) -> Quantity:
        """Return the compliance of the body to forces and moments, their arm being the length.

        Parameters
        ----------
        frequency : float
            Where [Hz].

        Returns
        -------
        Quantity
            Frobenius norm over sqrt 6 [m/N].
        """
        scale = self.scene.scale()
        ports = PortResponses(dict(zip(DISPLACEMENTS, scale, strict=True)),
                              dict(zip(LOADS, scale / np.sqrt(6.0), strict=True)))  # fmt: skip
        return Leaf(f"compliance at {frequency:g} Hz [m/N]", partial(ports.size, w=np.array([2.0 * np.pi * frequency])))

    @property
    def legs(self) -> tuple[str, ...]:
        """Names of the legs of strokes and forces."""
        return tuple([leg.name for leg in self.scene.legs])

    @cached_property
    def before(self) -> Isolation:
        """Figures of the present model."""
        return figures(self.scene, self.scene.system)

    def optimize(
        self, variables: Bounds, objective: Quantity, constraints: Constraint | Iterable[Constraint] = (), **kwargs: Any
    ) -> Design:
        """Return the mechanism at which a quantity is smallest.

        Parameters
        ----------
        variables : mapping of str to (float, float) or None
            Bounds of parameters, patterns or ties, as for ``studies.optimize``.
        objective : Quantity
            What is to be small: ``peak``, ``rms``, ...
        constraints : Constraint or iterable of Constraint
            What has to hold: ``stroke(...) <= 1e-3``.
        **kwargs
            ``ties``, ``start``, ``method``, ``options``, ``starts``, ``seed`` of ``studies.optimize``.

        Returns
        -------
        Design
            Values, and figures before and after.

        Raises
        ------
        ModelError
            If a variable is unknown or its derivatives are not supported.
        """
        optimum = optimize(self.scene.model, variables, objective, constraints, **kwargs)
        changed = {name: value for name, value in optimum.parameters.items() if name in self.model.parameters}
        model = in_equilibrium(self.model.with_values(changed))[0]
        old = self.scene
        studied = scene(model, old.body, old.base, old.point, old.length, old.base_directions)
        return Design(model, optimum, self.before, figures(studied, studied.system, self.before.frequencies))

    def front(
        self, variables: Bounds, objective: Quantity, against: Quantity, bounds: Sequence[float],
        constraints: Constraint | Iterable[Constraint] = (), **kwargs: Any,
    ) -> Front:  # fmt: skip
        """Return the Pareto front of two quantities: the smallest objective for each bound of the other.

        Parameters
        ----------
        variables : mapping of str to (float, float) or None
            Bounds of parameters, patterns or ties.
        objective : Quantity
            What is to be small.
        against : Quantity
            The bounded quantity, ``compliance()``; one number.
        bounds : sequence of float
            Largest values of it, one design each; ascending or descending, as each design starts at the one before.
        constraints : Constraint or iterable of Constraint
            What else has to hold.
        **kwargs
            ``ties``, ``start``, ``method``, ``options``, ``starts``, ``seed`` of ``studies.optimize``.

        Returns
        -------
        Front
            Designs, in the order of the bounds.

        Raises
        ------
        ModelError
            If there are no bounds, or a variable is refused.
        """
        limits = reals(bounds, "front", "bounds", "one or more finite numbers", ModelError)
        if limits.ndim != 1 or not len(limits) or not np.isfinite(limits).all():
            raise check.refuse("front", "bounds", bounds, "one or more finite numbers")
        others = (constraints,) if isinstance(constraints, Constraint) else tuple(constraints)
        designs: list[Design] = []
        price: list[Array] = []
        for bound in limits.tolist():  # each search starts at the previous result
            designs.append(self.optimize(variables, objective, (*others, against <= bound), **kwargs))
            kwargs["start"] = dict(designs[-1].values)
            price.append([*designs[-1].optimum.constraints.values()][-1])
            if len(price[-1]) != 1:
                raise ModelError(f"front: '{against.label}' has {len(price[-1])} numbers; expected one, as largest() "
                                 f"makes.", field="against")  # fmt: skip
        labels = objective.label, against.label + (" (bounded)" if objective.label == against.label else "")
        return Front(labels, np.array([design.optimum.objective for design in designs]),
                     np.array(price)[:, 0], limits, tuple(designs))  # fmt: skip

    @property
    def _transmissibility(self) -> PortResponses:
        scene, count = self.scene, len(self.scene.base_directions)
        return PortResponses(dict(zip(ACCELERATIONS, scene.scale() / np.sqrt(count), strict=True)),
                             dict(zip(scene.inputs, 1.0 / scene.scale(scene.base_directions), strict=True)),
                             "transmissibility")  # fmt: skip

    def _rms_by_leg(self, label: str, outputs: list[str], spectra: Mapping[str, Any], band: Any) -> Quantity:
        if not outputs:
            raise ModelError(f"passive: model '{self.model.name}' has no leg, spring or damper whose strokes and "
                             f"forces could be computed.", field="legs")  # fmt: skip
        result = self._squares(label, outputs, spectra, band) ** 0.5
        result.label = label
        return result

    def _squares(self, label: str, outputs: Sequence[str], spectra: Mapping[str, Any], band: Any) -> Quantity:
        noise, span = base_noise(spectra, self.scene.base_directions), band_of(band, "rms")
        if span is not None or not noise.unbounded:
            # over a band all mean squares are finite, and computed together
            squares = self._shared.setdefault((*_contents(noise), span), self._mean((), noise, span)).requested(outputs)
        else:
            squares = self._mean(outputs, noise, span)
        return Leaf(label, partial(squares.at, outputs=outputs))

    def _mean(self, outputs: Sequence[str], noise: BaseNoise, span: tuple[float, float] | None) -> MeanSquares:
        laws = {leg.stroke: (leg.force, *leg.law) for leg in self.scene.legs if leg.law}
        return MeanSquares(outputs, [f"base.{direction}" for direction in noise.directions], noise, span, laws)

    @cached_property
    def _shared(self) -> dict[Any, MeanSquares]:
        return {}

    def __repr__(self) -> str:
        return f"Passive({self.model.name!r}: {self.scene.base} to {self.scene.body})"


def _contents(noise: BaseNoise) -> tuple[Any, ...]:
    """What noise is made of, equal for equal noise: directions, and the numbers or functions of all densities."""
    parts = [getattr(spectrum, one.name) for spectrum in noise.spectra for one in fields(spectrum)]
    return (noise.directions, noise.correlation.tobytes(), *map(type, noise.spectra),
            *[(part.shape, part.tobytes()) if isinstance(part, np.ndarray) else id(part) if callable(part) else part
              for part in parts])  # fmt: skip


def passive(
    model: Model, body: str, base: str = GROUND, *, point: ArrayLike | None = None, length: float | None = None,
    directions: Sequence[str] | None = None, joints: Sequence[str] = (),
) -> Passive:  # fmt: skip
    """Return the passive design of an isolation: quantities, and the optimization of parameters.

    Derivatives to parameters of Maxwell elements are those of the parts that ``unfolded`` makes of them.

    Parameters
    ----------
    model : Model
        The mechanism, which is not changed.
    body : str
        The isolated body.
    base : str
        What is shaken.
    point : array-like, shape (3,), optional
        Reference point [m], which stays where it is while masses and legs move; default: the body's centre of mass.
    length : float, optional
        Length [m] that makes rotations comparable.
    directions : sequence of str, optional
        In which the base is shaken.
    joints : sequence of str
        Joints whose angles are to be kept small, by name or pattern.

    Returns
    -------
    Passive
        Quantities and ``optimize``.

    Raises
    ------
    ModelError
        If a name is unknown.
    """
    watched: list[str] = []

    def add_angles(changed: Model) -> None:
        for pattern in names(joints, "passive", "joints", ModelError):
            these = matching(pattern, changed.joints)
            if not these:
                raise check.unknown(pattern, changed.joints, f"passive: joints: no joint is named '{pattern}'",
                                    "joints", "Joints are:")  # fmt: skip
            watched.extend(name for name in these if name not in watched)
        for joint in (changed.joints[name] for name in watched):
            for axis in "xyz":
                changed.add_output(f"{joint.name}.angle.{axis}", joint.second, f"r{axis}", joint.position, joint.first)

    studied = scene(model, body, base, point, length, directions, more=add_angles)
    return Passive(model, studied, tuple(watched))
