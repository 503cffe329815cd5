"""What state spaces and closed loops have in common: selection by name, zeros, grids and norms."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any, Self

from mbsvib.common.selection import key_ports
from mbsvib.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from mbsvib.common.arrays import Array, Complex
    from mbsvib.common.selection import Names
    from mbsvib.responses.norms import Norm
    from mbsvib.responses.step_info import StepInfo


class PortedVerbs:
    """Selection of outputs and inputs by name."""

    if TYPE_CHECKING:
        name: Any

        def _with_ports(self, outputs: Names, inputs: Names) -> Self:
            """The equations with some outputs and inputs."""

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


class StepVerbs(PortedVerbs):
    """Measures of step responses, of systems as of all other linear equations."""

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


class LinearVerbs(StepVerbs):
    """Methods of linear equations with named inputs and outputs."""

    if TYPE_CHECKING:
        inputs: Any
        outputs: Any

        def poles(self) -> Complex:
            """Return the poles [1/s]."""

        def state_space(self) -> Any:
            """Return first-order equations."""

        def frequency_response(self, omega: ArrayLike, outputs: Names = None, inputs: Names = None) -> Complex:
            """Return the frequency response."""

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
            If times do not ascend, shapes do not match, or the hold or a name is unknown; of a sampled loop also if
            initial states are given, or there are more than two million samples.
        """
        return self._over_time(self.with_ports(outputs, inputs), (t, u, hold, initial))

    def _over_time(self, part: Any, record: tuple[ArrayLike, ArrayLike, str, Any]) -> Array:
        """The time response of a part to times, inputs, how these are held, and initial states."""
        result: Array = part.equations.time_response(*record)
        return result

    def transmission_zeros(self, outputs: Names = None, inputs: Names = None) -> Complex:
        """Return the invariant zeros from some inputs to some outputs.

        The finite s at which [[A - s, B], [C, D]] has less than its normal rank.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Their numbers may differ.

        Returns
        -------
        array, shape (zeros,)
            Zeros [1/s] in ascending magnitude; modes that are not controllable or not observable are among them.

        Raises
        ------
        ResponseError
            If a name is unknown.
        """
        from mbsvib.responses.finite_zeros import first_order_zeros

        space = self.with_ports(outputs, inputs).state_space()
        return first_order_zeros(space.A, space.B, space.C, space.D)

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
            First and last frequency [Hz]; default: a tenth of the lowest and three times the highest natural frequency,
            of a sampled loop at most half the rate.

        Returns
        -------
        array, shape (points,)
            Ascending angular frequencies [rad/s].

        Raises
        ------
        ResponseError
            If a name is unknown, n is less than 2, or f_min and f_max are not positive and in ascending order.
        """
        from mbsvib.responses.frequency_grid import frequency_grid

        resolved, highest = self._resolved()
        return frequency_grid(resolved.with_ports(outputs, inputs), self.poles(), n, f_min=f_min, f_max=f_max,
                              highest=highest)  # fmt: skip

    def _resolved(self) -> tuple[LinearVerbs, float]:
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
        parameters : None
            Derivatives belong to systems of a mechanism; here there are none.

        Returns
        -------
        Norm
            ``value``.

        Raises
        ------
        ResponseError
            If the norm is infinite, because a pole does not decay, an input acts directly on an output, or noise is
            sampled without a filter; or if a name is unknown.
        ModelError
            If parameters are given.
        """
        self._refuse_parameters("h2_norm", parameters)
        return self._h2(self.with_ports(outputs, inputs))

    def _h2(self, part: Any) -> Norm:
        from mbsvib.responses.norms import h2

        return h2(part.state_space())

    def hinf_norm(self, outputs: Names = None, inputs: Names = None, parameters: Any = None) -> Norm:
        """Return the highest peak of the frequency response, of its largest singular value.

        ||G|| = max over w of sigma(G(i w))

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names or patterns; default: all. Their units are not weighed.
        parameters : None
            Derivatives belong to systems of a mechanism; here there are none.

        Returns
        -------
        Norm
            ``value`` and ``omega`` [rad/s].

        Raises
        ------
        ResponseError
            If the peak is infinite, or a name is unknown.
        ModelError
            If parameters are given.
        """
        from mbsvib.responses.first_order_solver import decaying_response
        from mbsvib.responses.norms import decaying_part, hinf

        self._refuse_parameters("hinf_norm", parameters)
        part = self.with_ports(outputs, inputs)
        space = part.state_space()
        parts = decaying_part(space, f"Hinf norm of '{self.name}'", "the norm is infinite")
        response = decaying_response(parts, space.D, self.name) if parts.lasting else part.frequency_response
        return hinf(response, parts.decaying.poles, space.D)

    def _refuse_parameters(self, caller: str, parameters: Any) -> None:
        if parameters is not None and len(parameters):
            raise ModelError(f"{caller}: parameters = {parameters!r}; '{self.name}' has matrices and no parameters. "
                             f"Derivatives are those of a system of a mechanism, model.linearize().")  # fmt: skip
