"""The library's revolute chain by transfer matrices in 60 digits: one pass over the bodies for each frequency."""

from mpmath import mp, mpf


def closure(model, omega):
    """Return the determinant that is zero at the natural frequencies of ``library.chain(n, line=(0, 1, 0))``.

    Displacement and rotation, force and moment are handed on from joint to joint, from two independent reactions at
    ground to two conditions at the free end.
    """
    with mp.workdps(60):
        square = mpf(omega) ** 2
        bodies, joints = list(model.bodies.values()), list(model.joints.values())
        stiffness = [mpf(spring.stiffness[5]) for spring in model.springs.values()]
        ends = []
        for force, moment in ((mpf(1), mpf(0)), (mpf(0), mpf(1))):
            shift = turn = mpf(0)
            for i, body in enumerate(bodies):
                centre = mpf(body.position[1])
                below = mpf(joints[i].position[1]) - centre
                above = mpf(joints[i + 1].position[1]) - centre if i + 1 < len(joints) else mpf(0)
                turn -= moment / stiffness[i]
                x = shift + turn * below
                moment += square * body.inertia[2] * turn - below * force
                force += square * body.mass * x
                moment += above * force
                shift = x - turn * above
            ends.append((force, moment))
        (a, b), (c, d) = ends
        return a * d - b * c


def off_by_less(model, omega, relative):
    """Tell whether a natural frequency lies within ``relative`` of ``omega``: the determinant changes sign."""
    with mp.workdps(60):
        low, high = (closure(model, mpf(omega) * (1 + side * mpf(relative))) for side in (-1, 1))
        return bool(low * high < 0)


def root(n, damping, stiffness, link, start):
    """Return the complex natural frequency next to ``start`` of n equal links with dampers, by Newton's method.

    ``link`` is (mass, inertia, half length); joint i has the stiffness and ``damping[i]``, link i joint i at its foot.
    """
    mass, inertia, half = link
    with mp.workdps(60):

        def determinant(s):
            square, ends = -(s**2), []
            for force, moment in ((mpf(1), mpf(0)), (mpf(0), mpf(1))):
                shift = turn = mpf(0)
                for i in range(n):
                    turn -= moment / (mpf(stiffness) + s * mpf(damping[i]))
                    x = shift - turn * half
                    moment += square * inertia * turn + half * force
                    force += square * mass * x
                    above = mpf(half) if i + 1 < n else mpf(0)
                    moment += above * force
                    shift = x - turn * above
                ends.append((force, moment))
            (a, b), (c, d) = ends
            return a * d - b * c

        s = mp.mpmathify(start)
        for _ in range(8):
            step = abs(s) * mpf("1e-25")
            low, high = determinant(s - step), determinant(s + step)
            move = (low + high) / 2 / ((high - low) / (2 * step))
            s -= move
            if abs(move) < mpf("1e-24") * abs(s):
                break
        return s
