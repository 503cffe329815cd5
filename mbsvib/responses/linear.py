"""What state spaces and closed loops have in common: selection by name, zeros, grids and norms."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from mbsvib.common.arrays import Array, Complex
from mbsvib.common.expected import angular
from mbsvib.common.selection import Names, key_ports
from mbsvib.errors import ModelError, ResponseError

if TYPE_CHECKING:
    from mbsvib.responses.norms import Norm
    from mbsvib.responses.step_info import StepInfo


class PortedVerbs:
    """Selection of outputs and inputs by name."""

    if TYPE_CHECKING:
        name: Any

        def _with_ports(self, outputs: Names, inputs: Names) -> Self:
            """The equations with some outputs and inputs."""

        def _response(self, part: Any, w: Array) -> Complex:
            """The frequency response (outputs, inputs, n) of a part at angular frequencies (n,) [rad/s]."""

    def _ipython_key_completions_(self: Any) -> list[tuple[str, str]]:
        """What notebooks complete after ``system[``: pairs of an output and an input."""
        return [(output, port) for output in self.outputs for port in self.inputs]

    def __getitem__(self, key: Any) -> Self:
        """Return the equations with some of their outputs and inputs, ``system[outputs, inputs]``.

        y_selected = G(outputs, inputs) u_selected; coordinates, states and modes stay the same.

        Parameters
        ----------
        key : pair of str, sequence of str or slice
            Names or patterns of outputs, then of inputs: ``system["tilt", "motor"]``,
            ``system[["x", "y"], "leg*.F"]``; ``:`` takes all. The order of the names is kept; what a pattern picks is
            in the order of the system.

        Returns
        -------
        System, StateSpace, ...
            The same equations with these ports.

        Raises
        ------
        ResponseError
            If a name is unknown, or a pattern picks nothing; the nearest name is suggested.
        """
        return self.with_ports(*key_ports(key, self.name))

    def with_ports(self, outputs: Names = None, inputs: Names = None) -> Self:
        """Return the equations with some of their outputs and inputs, as ``system[outputs, inputs]`` does.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns, in the order in which they are wanted; default: all.

        Returns
        -------
        System, StateSpace, ...
            The same equations with these ports; sensors and actuators of a loop stay connected.

        Raises
        ------
        ResponseError
            If a name is unknown, or a pattern picks nothing.
        """
        return self if outputs is None and inputs is None else self._with_ports(outputs, inputs)

    def frequency_response(self, omega: ArrayLike, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return the frequency response from inputs to outputs.

        G(i w) = (Cq + i w Cv - w^2 Ca) (K + i w C - w^2 M)^-1 B + D;  of first-order equations C (i w - A)^-1 B + D;
        of a plant with controllers G + G_u (1 - K G_yu)^-1 K G_y

        Parameters
        ----------
        omega : array-like, shape (n,)
            Angular frequencies [rad/s].
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all.

        Returns
        -------
        array, shape (outputs, inputs, n)
            Complex responses [output unit / input unit].

        Raises
        ------
        ResponseError
            If a frequency is not finite or is an undamped pole, or a name is unknown. Poles on the imaginary axis of
            which the outputs of a state space do not show what the inputs do are none.

        Warns
        -----
        UnstableWarning
            If a loop is not stable: no steady vibration has this response.
        """
        w = angular(omega)
        return self._response(self.with_ports(outputs, inputs), w)


class StepVerbs(PortedVerbs):
    """Responses over time, zeros and grids, of systems as of all other linear equations."""

    if TYPE_CHECKING:
        def poles(self) -> Complex:
            """Return the poles [1/s]."""

        def state_space(self) -> Any:
            """Return first-order equations."""

        def _over_time(self, part: Any, record: tuple[ArrayLike, ArrayLike, str, Any]) -> Array:
            """The time response of a part to times, inputs, how these are held, and initial states."""

        def _norm(self, question: str, outputs: Names, inputs: Names, parameters: Any) -> Norm:
            """What ``h2_norm`` or ``hinf_norm`` returns."""

    def step_info(self, outputs: Names = None, inputs: Names = None, band: float = 0.02) -> StepInfo:
        """Return rise time, settling time, overshoot and peak of the responses to unit steps, from rest.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all.
        band : float
            Share of the final value within which a response has settled.

        Returns
        -------
        StepInfo
            Arrays (outputs, inputs), printed as a table.

        Raises
        ------
        ResponseError
            If a name is unknown, or a pole does not decay.
        """
        from mbsvib.responses.step_info import step_info

        return step_info(self.with_ports(outputs, inputs), band)

    def time_response(
        self, t: ArrayLike, u: ArrayLike, hold: str = "first", initial: Any = None, outputs: Names = None,
        inputs: Names = None,
    ) -> Array:  # fmt: skip
        """Return the time response to inputs that are held or vary linearly between the samples; exact for these.

        Parameters
        ----------
        t : array-like, shape (n,)
            Ascending times [s].
        u : array-like, shape (inputs, n), or (n,) for a single input
            Inputs at these times; of a loop they add to what the controllers demand.
        hold : str
            "first": linear between samples; "zero": constant from each sample to the next.
        initial : array-like, optional
            At t[0]: q and q' where the equations are of second order, else the states of ``state_space()``; default: 0.
            A sampled loop starts at rest, and takes its first sample there.
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Rows of ``u`` are those of ``inputs``, other inputs are 0.

        Returns
        -------
        array, shape (outputs, n)
            Outputs at these times.

        Raises
        ------
        ResponseError
            If times do not ascend, shapes do not match, or the hold or a name is unknown, or outputs grow beyond all
            numbers; of a sampled loop also if initial states are given, or there are more than two million samples.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            result = self._over_time(self.with_ports(outputs, inputs), (t, u, hold, initial))
        beyond = np.flatnonzero(~np.isfinite(result).all(axis=0))
        if len(beyond):
            raise ResponseError(f"time_response: '{self.name}' is unstable and grows beyond all numbers before "
                                f"t = {np.asarray(t)[beyond[0]]:g} s; ask for a shorter time, or stabilise it."
                                )  # fmt: skip
        return result

    def transmission_zeros(self, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return the invariant zeros from some inputs to some outputs.

        The finite s at which [[K + s C + s^2 M, -B], [Cq + s Cv + s^2 Ca, D]], of first-order equations
        [[A - s, B], [C, D]], has less than its normal rank.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Their numbers may differ.

        Returns
        -------
        array, shape (zeros,)
            Zeros [1/s] in ascending magnitude. A mode that the inputs do not reach or the outputs do not show is one
            too.

        Raises
        ------
        ResponseError
            If a name is unknown, or no output responds to any input: every s is a zero then.
        """
        return self._zeros(outputs, inputs)

    def _zeros(self, outputs: Names, inputs: Names) -> Complex:
        from mbsvib.responses.finite_zeros import first_order_zeros

        space = self.with_ports(outputs, inputs).state_space()
        return first_order_zeros(space.A, space.B, space.C, space.D, space)

    def frequency_grid(
        self, outputs: Names = None, inputs: Names = None, n: int | None = None, *, f_min: float | None = None,
        f_max: float | None = None,
    ) -> Array:  # fmt: skip
        """Return angular frequencies that resolve every resonance and antiresonance from inputs to outputs.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Each pair's zeros count, of a sampled loop under continuous controllers.
        n : int, optional
            Number of points on an even logarithmic spacing, to which the others are added; default: 150 a decade.
        f_min, f_max : float, optional
            First and last frequency [Hz]; default: a tenth of the lowest and three times the highest natural
            frequency, rounded outwards to 1, 2 or 5, of a sampled loop at most half the rate.

        Returns
        -------
        array, shape (points,)
            Ascending angular frequencies [rad/s], as ``frequency_response`` takes them; next to w no farther apart than
            half the distance of i w to the nearest pole or zero.

        Raises
        ------
        ResponseError
            If a name is unknown, n is less than 2, or f_min and f_max are not positive and in ascending order.
        """
        from mbsvib.responses.frequency_grid import frequency_grid

        resolved, highest = self._resolved()
        return frequency_grid(resolved.with_ports(outputs, inputs), self.poles(), n, f_min=f_min, f_max=f_max,
                              highest=highest)  # fmt: skip

    def _resolved(self) -> tuple[StepVerbs, float]:
        """The equations whose zeros a grid resolves, and the highest frequency [Hz] that they are looked for up to."""
        return self, inf

    def h2_norm(self, outputs: Names = None, inputs: Names = None, parameters: Any = None) -> Norm:
        """Return the H2 norm of the frequency response, the rms of all outputs under white noise.

        ||G||^2 = 1 / 2 pi integral of tr(G(i w)^H G(i w)) dw over all frequencies

        That of a sampled loop is averaged over time, between samples as well, with what sampling folds.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Their units are not weighed.
        parameters : str, iterable of str or mapping, optional
            Of systems of a mechanism: names, patterns or linear maps, as for ``eigenvalue_sensitivities``. Default:
            every parameter, computed when ``slopes`` is first asked for; ``[]`` for none. Other equations have none.

        Returns
        -------
        Norm
            ``value``, and ``slopes`` of systems of a mechanism.

        Raises
        ------
        ResponseError
            If the norm is infinite, because a pole does not decay, an input acts directly on an output, or noise is
            sampled without a filter; or if a name is unknown.
        ModelError
            If a parameter is unknown, the equations have none, or do not change smoothly with it.
        """
        return self._norm("h2_norm", outputs, inputs, parameters)

    def hinf_norm(self, outputs: Names = None, inputs: Names = None, parameters: Any = None) -> Norm:
        """Return the highest peak of the frequency response, of its largest singular value.

        ||G|| = max over w of sigma(G(i w))

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Their units are not weighed.
        parameters : str, iterable of str or mapping, optional
            As of ``h2_norm``.

        Returns
        -------
        Norm
            ``value``, ``omega`` [rad/s], and ``slopes`` of systems of a mechanism.

        Raises
        ------
        ResponseError
            If the peak is infinite, or a name is unknown.
        ModelError
            As of ``h2_norm``.
        """
        return self._norm("hinf_norm", outputs, inputs, parameters)


class LinearVerbs(StepVerbs):
    """Methods of linear equations with named inputs and outputs."""

    if TYPE_CHECKING:
        inputs: Any
        outputs: Any

    @property
    def equations(self) -> Any:
        """The first-order equations, or a system of second order, which modes and time responses are those of."""
        return self.state_space()

    def modes(self) -> Any:
        """Return the modes, natural frequencies, damping ratios and shapes.

        Returns
        -------
        Modes or StateModes
            Those of a system where the equations are of second order, else those of the states; printed as a table.
        """
        return self.equations.modes()

    def _over_time(self, part: Any, record: tuple[ArrayLike, ArrayLike, str, Any]) -> Array:
        result: Array = part.equations.time_response(*record)
        return result

    def _norm(self, question: str, outputs: Names, inputs: Names, parameters: Any) -> Norm:
        if parameters is not None and len(parameters):
            raise ModelError(f"{question}: parameters = {parameters!r}; '{self.name}' has matrices and no parameters. "
                             f"Derivatives are those of a system of a mechanism, model.linearize().")  # fmt: skip
        part = self.with_ports(outputs, inputs)
        return self._h2(part) if question == "h2_norm" else peak(part)

    def _h2(self, part: Any) -> Norm:
        from mbsvib.responses.norms import h2

        return h2(part.state_space())


def peak(linear: Any) -> Norm:
    """Return the H-infinity norm of linear equations, by the decaying part of their first-order equations."""
    from mbsvib.responses.first_order_solver import decaying_response
    from mbsvib.responses.norms import decaying_part, hinf

    space = linear.state_space()
    parts = decaying_part(space, f"Hinf norm of '{linear.name}'", "the norm is infinite")
    response = decaying_response(parts, space.D, linear.name) if parts.lasting else linear.frequency_response
    return hinf(response, parts.decaying.poles, space.D)
