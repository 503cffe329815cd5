"""Modes as users get them: data with tables, and animations."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from mbsvib.mechanism.unit_warnings import unit_warnings
from mbsvib.modes import result

if TYPE_CHECKING:
    from mbsvib.plots.animation import Animation


class Modes(result.Modes):
    """The modes of a system, one for each degree of freedom or a choice of them, in ascending natural frequency.

    ``eigenvalues`` (2n,) [1/s] of n modes come in pairs, two for each mode: conjugate where the mode oscillates, real
    where it creeps or diverges, exactly 0 for rigid-body modes. ``errors`` (2n,) estimates the relative error of each.
    ``shapes`` (m, n) are the displacements of the minimal coordinates, one column a mode, real where damping is
    classical (``classical`` is the reason, else empty). ``rigid`` counts the rigid-body modes; ``first_order``
    (n,) marks massless motions that dampers hold, which have one eigenvalue in place of two, and is None where there is
    none. ``solver`` names the solver of undamped modes that was accurate enough.
    """

    @cached_property
    def _range_notes(self) -> tuple[str, ...]:
        from mbsvib.api.linear_range import with_modes

        return with_modes(self, self._provenance)

    def remarks(self) -> tuple[str, ...]:
        """Return notes on the table: rigid-body, overdamped and diverging modes, accuracy, values that suggest wrong
        units, and of small mechanisms outputs whose ``linear_range`` is small.

        Returns
        -------
        tuple of str
            One sentence each.
        """
        doubts = () if self._provenance is None else unit_warnings(self._provenance.parts, self._provenance.origin)
        return (*super().remarks(), *(f"Doubtful: {text}" for text in doubts), *self._range_notes)

    def animate(
        self, mode: int, path: str | os.PathLike[str] | None = None, *, amplitude: float = 0.1,
        view: str | Sequence[float] = "3-D", frames: int = 30, rate: float = 20.0,
    ) -> Animation:  # fmt: skip
        """Return a mode in motion, shown in Jupyter, and write it to a file if a ``path`` is given.

        Parameters
        ----------
        mode : int
            Its number in the table, from 1.
        path : str or path-like, optional
            A file that ends in .gif, .mp4 (needs ffmpeg: ``pip install "mbsvib[video]"``) or .html.
        amplitude : float
            Largest displacement of a point, as a share of the mechanism's size.
        view : str or sequence of 2 float
            From where: "3-D", "x", "y", "z", or azimuth and elevation [deg].
        frames : int
            Pictures in one period.
        rate : float
            Pictures in a second [Hz].

        Returns
        -------
        Animation
            With ``figure`` for a single picture and ``save`` for a file.

        Raises
        ------
        ResponseError
            If there is no such mode or view, or the geometry of the mechanism is unknown.
        ExportError
            If the file cannot be written.
        """
        from mbsvib.plots.animation import animation

        if self._provenance is not None:
            self._provenance.check_mechanism(self.name, "animate")
        result = animation(self, self._provenance, mode, amplitude, view, frames, rate)
        if path is not None:
            result.save(path)
        return result
