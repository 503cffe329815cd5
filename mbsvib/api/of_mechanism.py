"""What systems of a mechanism say of it beyond their matrices: forces in joints, energies, how far they hold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsvib.api.linear_range import LinearRange
    from mbsvib.common.arrays import Array
    from mbsvib.explain.energy_shares import StiffnessShares
    from mbsvib.modes import result


class OfMechanism:
    """Equations of motion that were made of a mechanism."""

    @property
    def _equations(self) -> Any:
        return self

    @property
    def reactions(self) -> dict[str, Array]:
        """Wrench in each joint at the pose, {joint: (6,)}: force [N] and moment [N m] on its second body at its point.

        World axes; its first body takes the opposite. A rod (distance joint) has its point at its end, a joint without
        position at the centre of mass of its second body (on ground: its first). Zeros where nothing loads the
        mechanism.

        Where constraints are redundant many such wrenches would hold the bodies; of all these it is the one of least
        norm, the least sum over the joints of |force|^2 + |moment / L|^2, with L the root mean square distance of the
        joints' points from their mean. Joints of loops that have joints or couplers in common count together.
        ``explain()`` names them. Frame, order, names, cut and units make no difference, and flexible joints, all with
        stiffness k along and k L^2 about what they lock, would carry the same.
        """
        from mbsvib.equations.equations import joint_wrenches

        return joint_wrenches(self._equations)

    def stiffness_shares(self, modes: result.Modes | None = None) -> StiffnessShares:
        """Return the strain energy by element: shares of springs, preloads, loads and joint reactions in each mode.

        Parameters
        ----------
        modes : Modes, optional
            Some of this system's modes, ``system.modes(6)``; default: all.

        Returns
        -------
        StiffnessShares
            Signed shares, 1 in sum for each mode; printed as a table.
        """
        from mbsvib.explain.energy_shares import stiffness_shares

        return stiffness_shares(self._equations.basis, modes)

    def linear_range(self, share: float = 0.1, *, conservative: bool = False) -> LinearRange:
        """Estimate the amplitudes of outputs up to which the linear equations hold, for each mode (extra ``casadi``).

        In free vibration in one mode, q = a Re(q1 e^(lambda t)) + a^2 (Re(q22 e^(2 lambda t)) + q20), an output has the
        amplitude a |Y1|, a mean a^2 |Y20| and a second harmonic a^2 |Y22|. The second-order part is the largest of
        these two, and of a^2 |y''| / 2 along the motion of the mode in minimal coordinates:

        values = share |Y1|^2 / max(|Y20|, |Y22|, |y''| / 2)

        Second derivatives are exact; terms of third and higher order are left out. This is an estimate and no bound: in
        nonlinear runs of 100 random chains at a share of 0.1, the larger of mean and second harmonic was 0.100 of the
        first in the median and 0.138 at most, and the largest deviation in time from the linear motion 0.34 at most.

        Parameters
        ----------
        share : float
            The second-order part over the first-order part.
        conservative : bool
            True: share / (1 + 5 share) in place of the share, which leaves room for terms of higher order: of the same
            100 chains, none reached the share. It is no proof for other mechanisms.

        Returns
        -------
        LinearRange
            ``values`` (modes, outputs), with a table. Rigid-body modes count with the motion alone. 0 where an output
            has no first-order part, or the second-order part grows without limit.

        Raises
        ------
        ResponseError
            If the share is not positive.
        ModelError
            If the system is not that of a mechanism as described, has beams, superelements, Maxwell elements or
            massless motions, or CasADi is not installed.

        Source: Nayfeh & Mook, Nonlinear Oscillations (1979), section 2.3.
        """
        from mbsvib.api.linear_range import linear_range

        return linear_range(self._equations, self._equations.modes(), share, conservative)
