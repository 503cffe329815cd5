"""A relaxation isolator against a plain damper: both suppress the resonance, only one still isolates above it.

A damper parallel to the spring of an isolator transmits vibration: far above the resonance it is the stiffer path, and
transmissibility falls by 20 dB a decade only. A spring in series with the damper (a Maxwell element, as in the
isolators of space telescopes) yields there, and 40 dB a decade come back. The node between both has no mass, and no
fake one is needed: it is one first-order state of three in all.

With the series spring N times the static one, all transmissibilities pass through 1 + 2/N at r^2 = 2 (N + 1) / (N + 2),
and the best damper has its peak there (Ruzicka & Derby, Influence of damping in vibration isolation, 1971).
"""

import numpy as np

import mbsvib as mv

MASS, FREQUENCY, N = 12.0, 2.0, 4.0  # kg, Hz without damper, series spring over static spring
OMEGA = 2 * np.pi * FREQUENCY
STATIC, CRITICAL = MASS * OMEGA**2, 2 * MASS * OMEGA
PEAK, RATIO = 1 + 2 / N, np.sqrt(2 * (N + 1) / (N + 2))
BEST = N / (4 * (N + 1)) * np.sqrt(2 * (N + 2))  # damping ratio of the best damper in series
PLAIN = 0.47872707  # of a damper beside the spring, for the same peak


def isolator(relaxing):
    """Return a payload on a moving floor, with the damper in series with a spring or alone."""
    model = mv.Model("relaxation isolator" if relaxing else "plain damper")
    model.add_body("payload", MASS, (0.2, 0.2, 0.3), position=(0, 0, 0.3))
    model.add_joint("guide", "prismatic", "ground", "payload", axis=(0, 0, 1))
    line = {"start": (0, 0, 0), "end": (0, 0, 0.2)}
    if relaxing:
        model.add_maxwell("leg", "ground", "payload", **line, stiffness=N * STATIC, damping=BEST * CRITICAL,
                          static_stiffness=STATIC)  # fmt: skip
    else:
        model.add_spring("leg", "ground", "payload", **line, stiffness=STATIC, damping=PLAIN * CRITICAL)
    model.add_base_motion("floor", "z")
    model.add_output("payload", "payload", "z", quantity="acceleration")
    return model.linearize()


relaxing, plain = isolator(True), isolator(False)
assert relaxing.state_space().states == ("guide.z", "leg.z", "d(guide.z)/dt")

omega = OMEGA * np.geomspace(0.05, 200.0, 20001)
s = 1j * omega / OMEGA
k = 1 + N * 2 * BEST * s / (N + 2 * BEST * s)
gain = [np.abs(system.frequency_response(omega)[0, 0]) for system in (relaxing, plain)]
assert np.allclose(gain[0], np.abs(k / (k + s**2)), rtol=1e-10, atol=0)
# Both peaks are equally high, that of the relaxation isolator where theory has it.
assert np.allclose([np.max(g) for g in gain], PEAK, rtol=1e-6)
assert abs(omega[np.argmax(gain[0])] / OMEGA - RATIO) < 1e-3
# A hundred times above the resonance one isolates some twenty times better.
far = np.argmin(np.abs(omega - 100 * OMEGA))
assert gain[1][far] / gain[0][far] > 15


def draw():
    """Transmissibility of both, magnitude and phase."""
    import matplotlib.pyplot as plt

    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(8, 6), layout="constrained", height_ratios=(3, 2))
    for system, label in ((plain, "damper beside the spring"), (relaxing, f"damper in series with a spring {N:g} k")):
        response = system.frequency_response(omega)[0, 0]
        above.loglog(omega / (2 * np.pi), np.abs(response), label=label)
        below.semilogx(omega / (2 * np.pi), np.degrees(np.unwrap(np.angle(response))), label=label)
    above.plot(FREQUENCY * RATIO, PEAK, "ko", label="1 + 2/N, whatever the damper")
    above.set(ylabel="transmissibility [1]", ylim=(1e-4, 4), title="Same peak, another slope")
    above.legend()
    below.set(xlabel="frequency [Hz]", ylabel="phase [deg]", xlim=(0.1, 400), yticks=(-180, -90, 0))
    return figure


if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(relaxing.modes(), plain.modes(), sep="\n\n")
    draw()
    plt.show()
