"""Modes that keep their names: frequencies that cross, and eigenvalues on their way as a damper grows.

Left, the payload of a cubic hexapod is moved up, away from the centre where all directions are decoupled. Swaying and
rocking modes repel each other more and more; the rocking ones cross the twist, which knows nothing of them. Sorting by
frequency would mix both up; followed by their shapes, each keeps its name.

Right, the root locus of a quarter car over the damper of its suspension: body and wheel get their damping, the body
until it creeps; a damper that is much too stiff ties both together, and they swing on the tyre without any.
"""

import numpy as np

import mbsvib as mv

hexapod = mv.library.cubic_hexapod()
height = np.linspace(0.01, 0.2, 39)
names = {"twist": 6}  # as print(hexapod.linearize().modes()) counts
centre = hexapod.parameters["platform.position.z"]
modes = mv.track(hexapod, {"platform.position.z": centre + height}, names)
twist = modes.mode("twist")
assert np.ptp(twist) < 1e-9 * twist[0], "the twist does not feel the height"
rocking = modes["frequencies"][:, 4]
assert rocking[0] < twist[0] < rocking[-1]
assert np.argmax(modes["frequencies"][-1]) != 5, "sorting would take another mode for the twist"

car = mv.library.quarter_car()
damping = np.geomspace(50.0, 5e4, 800)  # N s/m
damping = np.union1d(damping, np.linspace(4800.0, 5100.0, 1000))  # where poles meet on the real axis, and part
locus = mv.track(car, {"suspension.damping": damping}, {"body": 1, "wheel": 2})
body, wheel = locus.mode("body", "eigenvalues"), locus.mode("wheel", "eigenvalues")
# A damper that locks leaves one mass on the tyre, without any damping.
masses = car.parameters["body.mass"] + car.parameters["wheel.mass"]
locked = np.sqrt(car.parameters["tyre.stiffness"] / masses)
assert np.isclose(wheel[-1].imag, locked, rtol=0.01)
assert body[-1].imag == 0.0, "the body creeps"
ratios = locus.mode("wheel", "damping_ratios")
assert ratios.max() > 0.8
assert ratios[-1] < 0.07, "a damper that is too stiff dampens nothing"


def draw():
    """Frequencies over the height, eigenvalues over the damper."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
    styles = ("-", "--", "-", "-", "--", "-")
    for name, track, style in zip(modes.modes, modes["frequencies"].T, styles, strict=True):
        left.plot(100 * height, track, style, label=name.removeprefix("platform "), linewidth=2)
    left.set(xlabel="height of the payload's centre of mass [cm]", ylabel="natural frequency [Hz]",
             title="Cubic hexapod: a crossing")  # fmt: skip
    left.legend(ncols=2)
    for name, track in (("body", body), ("wheel", wheel)):
        (line,) = right.plot(track.real, track.imag, label=name)
        right.plot(track[0].real, track[0].imag, "x", color=line.get_color(), markersize=8)
    right.axvline(0.0, color="0.6", linewidth=0.8)
    right.set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]", xlim=(-65, 4), ylim=(-3, 75),
              title="Quarter car: damper from 50 to 50 000 N s/m")  # fmt: skip
    right.legend(loc="upper left")
    for axes in (left, right):
        axes.grid(alpha=0.3)
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    draw()
    plt.show()
