"""A state space of python-control that keeps names where python-control (0.10.2) answers with u[0], x[0] and y[0]."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import control

from mbsvib.common.arguments import shown
from mbsvib.common.expected import names
from mbsvib.common.patterns import matching
from mbsvib.common.selection import selected
from mbsvib.errors import ExportError
from mbsvib.responses.from_control import is_control
from mbsvib_export.names_ import SignalNames


class NamedStateSpace(control.StateSpace):  # type: ignore[misc]  # python-control has no types
    """A control.StateSpace whose parts, sums, products and loops have names of states, inputs and outputs.

    ``plant[outputs, inputs]`` takes the names of mbsvib as well, ``"leg1.force"``, and patterns. It, ``append``,
    ``feedback``, ``lft``, ``sample``, ``+``, ``-``, ``*`` and ``/``, and with them ``control.append``, ``feedback``,
    ``series``, ``parallel``, ``negate`` and ``c2d``, call the method of python-control and name its result: states as
    they were, with the names of their systems before them where two are called alike; inputs and outputs those at which
    the signals enter and leave. Matrices are python-control's. ``append``, ``feedback`` and ``lft`` are methods of the
    first system, which must be of this class: ``NamedStateSpace.of(controller)`` where it is not.
    """

    @classmethod
    def of(
        cls, space: Any, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None,
        states: Sequence[str] | None = None, name: str | None = None,
    ) -> Self:  # fmt: skip
        """Return a state space of python-control as one of this class.

        Parameters
        ----------
        space : control.StateSpace
            It is not changed.
        inputs, outputs, states : sequence of str, optional
            Names, those with dots as of mbsvib: ``"leg1.f"`` is ``"leg1:f"``; default: those that it has.
        name : str, optional
            Of the system; default: that of ``space``.

        Returns
        -------
        NamedStateSpace
            With copies of the matrices.

        Raises
        ------
        ExportError
            If it is no state space, the number of names is another one than that of signals, or a name is there twice.
        """
        if not is_control(space):
            raise ExportError(f"NamedStateSpace.of: space = {type(space).__name__}; expected a control.StateSpace, as "
                              f"control.ss(...) makes it.")  # fmt: skip
        labels = {}
        for field, given, known in (("inputs", inputs, space.input_labels), ("outputs", outputs, space.output_labels),
                                    ("states", states, space.state_labels)):  # fmt: skip
            listed = known if given is None else names(given, "NamedStateSpace.of", field, ExportError)
            labels[field] = [SignalNames.to_control(label) if "." in label else label for label in listed]
            if len(set(labels[field])) != len(known):  # of a name twice python-control would keep one
                raise ExportError(f"NamedStateSpace.of: {field} = {shown(given)}; expected {len(known)} names, none of "
                                  f"them twice.")  # fmt: skip
        if not isinstance(name, (str, type(None))):
            raise ExportError(f"NamedStateSpace.of: name = {shown(name)}; expected a text.")
        called = SignalNames.system_to_control(name) if name and "." in name else name or space.name
        result: Any = cls(
            *(getattr(space, key).copy() for key in "ABCD"), 0 if space.dt is None and not space.nstates else space.dt,
            name=called, remove_useless_states=False, **labels,
        )  # fmt: skip
        return result  # type: ignore[no-any-return]

    def __getitem__(self, key: Any) -> Self:
        if isinstance(key, tuple) and len(key) == 2:
            key = (_numbers(key[0], self.output_labels, "output", self.name, self.input_labels),
                   _numbers(key[1], self.input_labels, "input", self.name, self.output_labels))  # fmt: skip
        return self.of(super().__getitem__(key), states=self.state_labels)

    def __neg__(self) -> Any:
        return self._named(super().__neg__(), [self], self, self)

    def __add__(self, other: Any) -> Any:
        return self._named(super().__add__(other), [self, other], self, self)

    def __radd__(self, other: Any) -> Any:
        # python asks a subclass first: the order of the states is that of the sum
        if isinstance(other, control.StateSpace):
            return self.of(other) + self
        return self._named(super().__radd__(other), [self, other], self, self)

    def __sub__(self, other: Any) -> Any:
        return self + (-self.of(other)) if isinstance(other, control.StateSpace) else super().__sub__(other)

    def __mul__(self, other: Any) -> Any:
        return self._named(super().__mul__(other), [other, self], self if _is_number(other) else other, self)

    def __rmul__(self, other: Any) -> Any:
        if isinstance(other, control.StateSpace):
            return self.of(other) * self
        return self._named(super().__rmul__(other), [self, other], self, self if _is_number(other) else other)

    def append(self, other: Any) -> Any:
        """Return both systems beside each other, as ``control.append`` does.

        Parameters
        ----------
        other : system of python-control
            Its inputs and outputs come last.

        Returns
        -------
        NamedStateSpace
            With the inputs and outputs of both.
        """
        appended = super().append(other)
        if not isinstance(other, (control.StateSpace, control.TransferFunction)):
            return appended
        return self.of(appended, unique_names([self, other], "input"), unique_names([self, other], "output"),
                       _names_of_states([self, other], appended.nstates), _joined([self, other]))  # fmt: skip

    def feedback(self, other: Any = 1, sign: float = -1) -> Any:
        """Return the closed loop with ``other`` in the feedback path, as ``control.feedback`` does.

        Parameters
        ----------
        other : system of python-control or number
            From the outputs to the inputs.
        sign : float
            -1 for negative feedback, 1 for positive.

        Returns
        -------
        NamedStateSpace
            With the inputs and outputs of this system.
        """
        return self._named(super().feedback(other, sign), [self, other], self, self)

    def lft(self, other: Any, nu: int = -1, ny: int = -1) -> Any:
        """Return the lower linear fractional transformation, the loop around the last outputs and inputs.

        Parameters
        ----------
        other : control.StateSpace
            From the last outputs to the last inputs, by positive feedback.
        nu, ny : int
            Number of these inputs and outputs; default: all that ``other`` has.

        Returns
        -------
        NamedStateSpace
            With the inputs and outputs that are left, and those that are left of ``other``.
        """
        appended = super().lft(other, nu, ny)
        nu = min(other.noutputs, self.ninputs) if nu < 0 else nu
        ny = min(other.ninputs, self.noutputs) if ny < 0 else ny
        inputs = [*self.input_labels[: self.ninputs - nu], *other.input_labels[ny:]]
        outputs = [*self.output_labels[: self.noutputs - ny], *other.output_labels[nu:]]
        return self.of(appended, inputs, outputs, unique_names([self, other], "state"), _joined([self, other]))

    def sample(self, *arguments: Any, **options: Any) -> Self:
        """Return the discrete-time system, as ``control.sample_system`` does.

        Parameters
        ----------
        *arguments
            Step [s] and method, as python-control takes them.
        **options
            Its options.

        Returns
        -------
        NamedStateSpace
            With the same names.
        """
        return self.of(super().sample(*arguments, **options))

    def _named(self, space: Any, parts: list[Any], first: Any, last: Any) -> Any:
        """The result of python-control with the names of its parts, as far as their numbers fit."""
        if not isinstance(space, control.StateSpace):  # NotImplemented, or a system that is not linear
            return space
        systems = [part for part in parts if isinstance(part, control.StateSpace)]
        inputs, outputs = getattr(first, "input_labels", None), getattr(last, "output_labels", None)
        return self.of(
            space, inputs if inputs and len(inputs) == space.ninputs else None,
            outputs if outputs and len(outputs) == space.noutputs else None,
            _names_of_states(parts, space.nstates), _joined(systems),
        )  # fmt: skip


def _names_of_states(parts: list[Any], count: int) -> list[str] | None:
    """Names of the states of parts in their order, those of a transfer function numbered after its name."""
    spaces = [part for part in parts if isinstance(part, control.StateSpace)]
    names, added = unique_names(spaces, "state"), count - sum(space.nstates for space in spaces)
    other = next((part for part in parts if isinstance(part, control.TransferFunction)), None)
    if other is not None:
        at = sum(space.nstates for space in spaces[: parts.index(other)])
        names[at:at] = [f"{other.name}_x[{k}]" for k in range(added)]
    return names if len(set(names)) == count else None


def unique_names(systems: Sequence[Any], kind: str) -> list[str]:
    """Return the names of signals of several systems, made different from each other.

    If two are equal, all get the name of their system in front, as in ``control.interconnect``, unless all systems have
    one name; names that are still equal get ``_2`` and so on appended. ``kind``: "state", "input" or "output".
    """
    names = [label for system in systems for label in getattr(system, f"{kind}_labels")]
    if len(set(names)) == len(names):
        return names
    if len({system.name for system in systems}) > 1:
        names = [f"{system.name}_{label}" for system in systems for label in getattr(system, f"{kind}_labels")]
    appended: dict[str, None] = {}
    for name in names:
        other, count = name, 1
        while other in appended:
            count += 1
            other = f"{name}_{count}"
        appended[other] = None
    return list(appended)


def _joined(systems: Sequence[Any]) -> str:
    return "_".join(dict.fromkeys(system.name for system in systems))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float, complex)) or getattr(value, "ndim", None) == 0


def _numbers(key: Any, labels: Sequence[str], kind: str, owner: str, others: Sequence[str]) -> Any:
    """The numbers of signals that are named here or in mbsvib, or by patterns; what is no name stays as it is."""
    names = [key] if isinstance(key, str) else key
    if not isinstance(names, (list, tuple)) or not names or not all(isinstance(name, str) for name in names):
        return key
    originals = [SignalNames.original(label) for label in labels]
    numbers: dict[int, None] = {}
    for name in names:
        known = labels if name in labels or not matching(name, originals) else originals
        numbers |= dict.fromkeys(selected(name, known, kind, owner, others))
    return list(numbers)
