"""Signal names that python-control can hold, and the way back.

python-control (0.10.2) splits ``"system.signal"`` at the dot and refuses it in names, takes a leading ``-`` for a gain
of -1 and ``name[0:2]`` for a range of signals, and hands names to matplotlib, where ``$`` opens a formula. So a dot
becomes a colon, and what else would be misread (the colon too, now that it stands for a dot) becomes ``~`` with two
hexadecimal digits: ``leg1.force`` is ``leg1:force``, ``a:b`` is ``a~3Ab``, ``-x`` is ``~2Dx``.
"""

from __future__ import annotations

import re

from mbsvib.common.display import Displayed
from mbsvib.errors import ExportError

_SIGNAL = re.compile(r"^-|[.:~\[$]")
# A system's name is also pasted between quotes by repr, and into titles that "$indexed" turns into formulas.
_SYSTEM = re.compile(r"""^-|[.:~\[$"#%'\\^`{}]""")
_ESCAPE = re.compile(r":|~([0-9A-F]{2})")
_SAME_NAME = "~system"  # no escape begins with ~s


class SignalNames(Displayed):
    """The map between names of mbsvib and of python-control: reversible, and no two names meet.

    It needs no table, so that it holds for every system, in every session, and for names python-control has taken
    from one system into another.
    """

    @staticmethod
    def to_control(name: str) -> str:
        """Return the name that an input, output or state has in python-control.

        Parameters
        ----------
        name : str
            Name in mbsvib, such as ``"leg1.force"``.

        Returns
        -------
        str
            Name in python-control, such as ``"leg1:force"``.

        Raises
        ------
        ExportError
            If the name is empty.
        """
        return _encoded(name, _SIGNAL)

    @staticmethod
    def to_mbsvib(name: str) -> str:
        """Return the mbsvib name of a signal, state or system of python-control.

        Parameters
        ----------
        name : str
            Name that ``to_control`` or ``system_to_control`` made.

        Returns
        -------
        str
            The name it was made from.

        Raises
        ------
        ExportError
            If neither of them makes this name.
        """
        plain = name.removesuffix(_SAME_NAME)
        origin = _ESCAPE.sub(lambda match: chr(int(match[1], 16)) if match[1] else ".", plain)
        if not origin or (name != _encoded(origin, _SIGNAL) and plain != _encoded(origin, _SYSTEM)):
            raise ExportError(
                f"name = {name!r}; expected one that to_control made, with ':' for '.' and '~2D' and the like for what "
                f"python-control misreads. Names that python-control itself made up have no counterpart in mbsvib."
            )
        return origin

    @staticmethod
    def original(name: str) -> str:
        """Return the mbsvib name of a signal of python-control, or its own name if it does not come from mbsvib.

        Parameters
        ----------
        name : str
            Name in python-control.

        Returns
        -------
        str
            Name in mbsvib where ``to_mbsvib`` finds one, else ``name``.
        """
        try:
            return SignalNames.to_mbsvib(name)
        except ExportError:
            return name

    @staticmethod
    def system_to_control(name: str, signals: tuple[str, ...] = ()) -> str:
        """Return the name that a system has in python-control.

        Parameters
        ----------
        name : str
            Name of the system in mbsvib.
        signals : tuple of str
            Names of its inputs and outputs in mbsvib. ``control.interconnect`` cannot tell a system from a signal of
            the same name; the system is then marked by ``~system`` at its end.

        Returns
        -------
        str
            Name in python-control.

        Raises
        ------
        ExportError
            If the name is empty.
        """
        result = _encoded(name, _SYSTEM)
        return result + _SAME_NAME if result in map(SignalNames.to_control, signals) else result


def _encoded(name: str, misread: re.Pattern[str]) -> str:
    if not name:
        raise ExportError("name = ''; expected a text that is not empty: python-control cannot find a nameless signal.")
    return misread.sub(lambda match: ":" if match[0] == "." else f"~{ord(match[0]):02X}", name)
