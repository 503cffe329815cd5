"""A Stewart platform from its drawing to its Bode plot.

Six piezo legs carry a one-kilogram platform. Thirteen bodies, eighteen joints, five closed loops: and yet six second-
order equations are all there is, and python-control could have them in one more line. What limits a controller here
is in the picture: pushed sideways the platform has two resonances, as x and ry are coupled; lifted, it has one.

The same platform was linearised in Simscape (T. Dehaeze, stewart-simscape); the frequencies printed there are the
numbers this script is held to.
"""

import numpy as np

from mbsvib.library import stewart

system = stewart().linearize()
modes = system.modes()
assert system.dof == 6
assert np.allclose(modes.frequencies, [780.6, 780.6, 903.9, 1061.4, 1061.4, 1269.6], atol=0.1)

# At rest only the six springs matter: compliance is the inverse of J^T k J, one row of J for each leg.
compliance = system.frequency_response([0.0])[:, :, 0].real
assert np.isclose(compliance[0, 0], 2.8371955207e-8, rtol=1e-10, atol=0)  # x over Fx, m/N
assert np.isclose(compliance[5, 5], 1.7072960141e-6, rtol=1e-10, atol=0)  # rz over Mz, rad/(N m)

# Close to a resonance of 0.25 % damping points have to lie close together: this grid follows poles and zeros.
omega = system.frequency_grid(["x", "z"], ["Fx", "Fz"], f_min=300.0, f_max=3000.0)
frequency = omega / (2 * np.pi)
response = system.frequency_response(omega)
across, lift = response[0, 0], response[2, 2]
peak = system.hinf_norm("z", "Fz", [])
assert peak.omega is not None
assert np.isclose(peak.omega, 2 * np.pi * modes.frequencies[2], rtol=1e-5, atol=0)  # lifting excites one mode only
assert 0.99 * peak.value < abs(lift).max() <= peak.value


def draw():
    """Bode plot of two collocated responses, with all natural frequencies marked."""
    import matplotlib.pyplot as plt

    figure, (magnitude, phase) = plt.subplots(2, 1, sharex=True, figsize=(8, 6), layout="constrained")
    for curve, label in ((across, "x over Fx"), (lift, "z over Fz")):
        magnitude.loglog(frequency, 1e9 * abs(curve), label=label)
        phase.semilogx(frequency, np.degrees(np.unwrap(np.angle(curve))))
    for axes in (magnitude, phase):
        for natural in modes.frequencies:
            axes.axvline(natural, color="0.8", linewidth=0.8, zorder=0)
        axes.grid(alpha=0.3)
    magnitude.set(title="Stewart platform: six modes, two of them double", ylabel="magnitude [nm/N]")
    magnitude.set_yticks([10, 100, 1000], labels=["10", "100", "1000"])
    magnitude.legend(loc="lower left")
    phase.set(ylabel="phase [deg]", xlabel="frequency [Hz]", yticks=(0, -90, -180), xlim=(300, 3000))
    ticks = (300, 500, 700, 1000, 2000, 3000)
    phase.set_xticks(ticks, labels=map(str, ticks))
    phase.minorticks_off()
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(modes)
    draw()
    plt.show()
