"""Plants with uncertain parameters, in open and in closed loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mbsvib.common import arguments as check
from mbsvib.common.display import Displayed
from mbsvib.common.selection import Names
from mbsvib.errors import ModelError, ResponseError, counted
from mbsvib.uncertain.blocks import Block, ranges, with_blocks

if TYPE_CHECKING:
    from mbsvib.uncertain.results import RobustStability, WorstGain, WorstRms


@dataclass(frozen=True, repr=False, eq=False)
class UncertainPlant(Displayed):
    """A system or a loop whose parameters lie within limits: each enters as w = delta z, as often as its rank.

    ``nominal`` is the plant at the values of the model, ``limits`` {parameter: (lower, upper)}, ``parameters`` all that
    is known of each. ``linear`` is the same
    with the inputs "PARAMETER.w" and outputs "PARAMETER.z" of changes in units of half their width, before its own.
    (MATLAB: ``uss``.)
    """

    _engine = "kind linear"

    kind: ClassVar[str] = "uncertain plant"

    nominal: Any
    linear: Any
    parameters: tuple[Block, ...] = field(repr=False)
    _loops: tuple[dict[str, Any], ...] = field(default=(), repr=False)
    _origin: Any = field(default=None, repr=False)
    error: float = 0.0
    """Largest error of the matrices at sampled values, as a share of their change: 0 of exact maps, of ``order`` 1."""

    @property
    def name(self) -> str:
        """Name of the plant, and those of its controllers."""
        return str(self.nominal.name)

    @property
    def blocks(self) -> dict[str, int]:
        """How often each uncertain parameter enters, {parameter: repetitions}."""
        return {block.name: block.repetitions for block in self.parameters}

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Limits of each parameter, {parameter: (lower, upper)}."""
        return {block.name: (block.low, block.high) for block in self.parameters}

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs, without those of parameters."""
        return tuple(self.nominal.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs, without those of parameters."""
        return tuple(self.nominal.outputs)

    def at(self, values: Mapping[str, float] | None = None) -> Any:
        """Return the plant at values of its uncertain parameters, linearized anew.

        Parameters
        ----------
        values : mapping of str to float, optional
            Values by name, within limits or not; all others have their nominal value.

        Returns
        -------
        System, ClosedLoop or SampledLoop
            The plant.

        Raises
        ------
        ModelError
            If a parameter is not uncertain, or a value is refused.
        """
        chosen = {str(name): check.number(value, "at", str(name)) for name, value in (values or {}).items()}
        for name in chosen:
            check.known(name, self.blocks, f"at: '{name}' is not an uncertain parameter of '{self.name}'")
        result = _vary(self._origin, chosen) if chosen else self._origin
        for settings in self._loops:
            result = result.feedback(**settings)
        return result

    def sample(self, n: int, seed: int = 0) -> list[Any]:
        """Return plants at values that are distributed evenly within the limits.

        Parameters
        ----------
        n : int
            How many.
        seed : int
            Of the random numbers: the same seed gives the same plants.

        Returns
        -------
        list of System or ClosedLoop
            The plants.

        Raises
        ------
        ModelError
            If n is no positive whole number.
        """
        check.count(n, "sample", "n", 1)
        rng = np.random.default_rng(check.count(seed, "sample", "seed", 0))
        share = rng.random((n, len(self.parameters)))
        return [self.at({name: low + x * (high - low) for (name, (low, high)), x in
                         zip(self.limits.items(), row.tolist(), strict=True)}) for row in share]  # fmt: skip

    def feedback(
        self, controller: Any, sensors: Names = None, actuators: Names = None, name: str | None = None,
        noise: bool = False,
    ) -> UncertainPlant:  # fmt: skip
        """Return the uncertain loop with a controller, u = w + K y, as ``System.feedback`` does.

        Parameters
        ----------
        controller : Controller, StateSpace, control.StateSpace, control.TransferFunction or array-like
            In continuous time; an array, shape (actuators, sensors), is a static gain.
        sensors, actuators : str or sequence of str, optional
            Names or patterns of outputs and of inputs; default: the names that the controller has.
        name : str, optional
            Name of the controller in tables.
        noise : bool
            Whether the loop has the noise of sensors and actuators as inputs.

        Returns
        -------
        UncertainPlant
            The loop.

        Raises
        ------
        ResponseError
            If a name is unknown, shapes do not match, the controller is discrete, or noise is asked for around a loop.
        """
        if noise and self._loops:
            raise ResponseError(f"feedback: '{self.name}' is a loop; give noise=True with its first controller.")
        settings = {"controller": controller, "sensors": sensors, "actuators": actuators, "name": name} | (
            {"noise": True} if noise else {})  # fmt: skip
        nominal = self.nominal.feedback(**settings)
        if getattr(nominal, "period", None) is not None:
            raise ResponseError(f"feedback: '{nominal.name}' is sampled; uncertain loops are those in continuous time.")
        return replace(self, nominal=nominal, linear=self.linear.feedback(**settings), _loops=(*self._loops, settings))

    def robust_stability(self, accuracy: float = 1e-3) -> RobustStability:
        """Return by which factor all limits may be moved away from the nominal values before the plant is unstable.

        ``lower`` is proven at all frequencies by scalings D and G, ``upper`` is where values were found that
        destabilize. Polynomials hold within the limits, so that factors of theirs end at 1.01. (MATLAB: ``robstab``.)

        Parameters
        ----------
        accuracy : float
            Steps of the proven factor, as a share of it.

        Returns
        -------
        RobustStability
            ``lower``, ``upper``, ``values`` and ``omega``.

        Raises
        ------
        ResponseError
            If the nominal plant is not stable.
        """
        from mbsvib.uncertain.certain import robust_stability

        return robust_stability(self, accuracy)

    def worst_gain(self, outputs: Names = None, inputs: Names = None, accuracy: float = 1e-3) -> WorstGain:
        """Return the largest gain within the limits: the highest peak of the largest singular value.

        ``upper`` is proven at all frequencies by scalings D and G, ``lower`` is reached at ``values``. (MATLAB:
        ``wcgain``.)

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Their units are not weighed.
        accuracy : float
            Steps of the proven bound, as a share of it.

        Returns
        -------
        WorstGain
            ``lower``, ``upper``, ``values`` and ``omega``; both infinite if the limits hold an unstable plant.

        Raises
        ------
        ResponseError
            If a name is unknown, or the nominal plant is not stable.
        """
        from mbsvib.uncertain.certain import worst_gain

        return worst_gain(self, outputs, inputs, accuracy)

    def worst_rms(self, outputs: Names, floor: Mapping[str, Any]) -> WorstRms:
        """Return the largest root mean squares under noise within the limits.

        ``lower`` is reached at ``values``. ``upper`` is proven, as the least of three bounds. Of a mechanism whose
        dampers act on all motions: energy against dissipation, which the modes do not change, near ``lower`` for noise
        and outputs at one place in one direction. Of all plants, as a rule within 2 %: the covariance is a polynomial
        of the parameters, what it leaves of Lyapunov's equation bounds its error, and the box is halved where that is
        large. Where this does not succeed, as for many parameters that let lightly damped modes of a loop cross: the
        integral over bands of frequencies of the worst gain of each, whose values may differ from band to band, up to
        a few times ``lower``, or infinite where limits move resonances by many times their widths.

        Parameters
        ----------
        outputs : str or sequence of str or None
            Names or patterns; None: all.
        floor : mapping of str to density
            Noise at the inputs, as of ``rms``: filtered white noise, independent.

        Returns
        -------
        WorstRms
            ``lower`` and ``upper`` {output: rms}, with the ``values`` of the parameters at which each is reached.

        Raises
        ------
        ResponseError
            If a name is unknown, noise is refused, or the nominal plant is not stable.
        """
        from mbsvib.uncertain.certain import worst_rms

        return worst_rms(self, outputs, floor)

    def table(self) -> dict[str, Any]:
        """Return the table of parameters as arguments of ``mbsvib.common.tables.text`` and ``show``."""
        rows = [(block.name, f"{block.low:.6g}", f"{block.nominal:.6g}", f"{block.high:.6g}", block.unit,
                 str(block.repetitions)) for block in self.parameters]  # fmt: skip
        columns: list[tuple[str, Any]] = [("parameter", "left"), ("lower", "right"), ("nominal", "right"),
                                          ("upper", "right"), ("unit", "left"), ("repetitions", "right")]  # fmt: skip
        notes = [f"Polynomials: at sampled values off by up to {self.error:.1e} of the change."] * bool(self.error)
        return {"title": f"Uncertain {self.name}", "columns": columns, "rows": rows, "notes": notes}

    def __repr__(self) -> str:
        return f"UncertainPlant({self.name!r}: {counted(len(self.parameters), 'parameter')}, " \
               f"{counted(sum(self.blocks.values()), 'channel')})"  # fmt: skip


def uncertain(system: Any, limits: Mapping[str, Any], order: int = 1) -> UncertainPlant:
    """Return a system whose parameters lie within limits; arguments as of ``System.uncertain``."""
    provenance = system.provenance
    provenance.check_parameters(system.name, "uncertain")
    if provenance.origin is None or provenance.truncation is not None or provenance.removed is not None:
        raise ModelError(f"uncertain: '{system.name}' is reduced or a part of a system; ask the whole system, "
                         f"model.linearize().")  # fmt: skip
    def within(values: Mapping[str, float]) -> Any:
        try:
            return _vary(system, values)
        except ModelError as refusal:
            at = ", ".join([f"{name} = {value:.6g}" for name, value in values.items()])
            raise ModelError(f"uncertain: {at} is within the limits, and no mechanism has it: {refusal} Give narrower "
                             f"limits; 0.1 is 10 % to both sides.", element=refusal.element) from refusal  # fmt: skip

    linear, blocks, error = with_blocks(system, ranges(system, limits), within,
                                        check.count(order, "uncertain", "order", 1))  # fmt: skip
    return UncertainPlant(system, linear, blocks, (), system, error)


def _vary(system: Any, values: Mapping[str, float]) -> Any:
    """The system with other values of parameters, with the same coordinates and ports, also of motions as inputs.

    What the system has beside that of its model, such as actuators in measured forces, stays as it is.
    """
    ends = getattr(system, "ends", None)
    if ends is not None:
        return replace(system, ends=_vary(ends, values))
    there, here = (_linearized(system, changed) for changed in (values, {}))
    own = {key: getattr(system, key) - getattr(here, key) for key in ("B", "Cq", "Cv", "Ca", "D")}
    return replace(there, **{key: getattr(there, key) + more for key, more in own.items() if more.any()})


def _linearized(system: Any, values: Mapping[str, float]) -> Any:
    model = system.provenance.origin
    changed = model.with_values(values) if values else model
    result = changed.linearize(method="dense")
    if result.coordinates != system.coordinates:
        result = changed.linearize(method="dense", independent=system.coordinates)
    return getattr(result, "ends", result).with_ports(list(system.outputs), list(system.inputs))
