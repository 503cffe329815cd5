"""A measured fine steering mirror: what a rough mechanism explains of it, and what not.

A mirror on three piezo stacks, of which nothing but the layout is known: mirror, frame and a bracket, each free to
heave and tilt, stacks between frame and mirror, two mounts of any stiffness. Masses, inertias, mounts and the gains of
sensors and amplifiers are fitted to nine measured responses; the force of a volt is assumed, so that masses are known
to a common factor only. All four resonances are met within 0.4 %, each sensor's responses to 10 %. The model is not
what was measured, all the same: residuals are four times the scatter of the measurement, and alike from line to line.
The fit says so, widens its intervals by it, and names the band that is not reached and the values that it cannot tell.

Data: M. Floren, CubeSpec Fine Steering Mirror benchmark dataset, CC BY 4.0; what was changed: data/fsm_excerpt.md.
"""

from pathlib import Path

import numpy as np

import mbsvib as mv

FORCE, DELAY = -1.35, 0.138e-3  # of a volt [N]; of the electronics [s]
BODIES = {"mirror": (0.015, (3e-6, 4e-6, 6e-6), 0.02), "frame": (0.08, (23e-6, 34e-6, 20e-6), 0.0),
          "bracket": (0.03, (5e-6, 3e-6, 7e-6), -0.01)}  # fmt: skip
MOUNTS = {"mount": ("ground", "frame", 6.6e5, 570.0, 40.0), "clamp": ("frame", "bracket", 9.6e5, 90.0, 50.0)}


def around(radius, angle, height):
    """A point on a circle about the optical axis [m]; angle in degrees."""
    return radius * np.cos(np.radians(angle)), radius * np.sin(np.radians(angle)), height


def drawn():
    """The mechanism as it may be sketched."""
    model = mv.Model("steering mirror")
    for name, (mass, inertia, height) in BODIES.items():
        model.add_body(name, mass, inertia, (0, 0, height))
        model.add_joint(f"{name}.free", None, "ground", name, (0, 0, height), free=("z", "rx", "ry"))
    for name, (first, second, *held) in MOUNTS.items():
        stiffness = np.zeros((6, 6))
        stiffness[2:5, 2:5] = np.sqrt(np.outer(held, held)) * (0.99 * np.eye(3) + 0.01)
        model.add_bushing(name, first, second, (0, 0, 0), stiffness, np.diag([0, 0, 10.0, 5e-4, 5e-4, 0]))
    for k, angle in enumerate((90, 210, 330), 1):
        ends = around(0.02, angle, 0.0), around(0.02, angle, 0.02)
        model.add_spring(f"stack{k}", "frame", "mirror", *ends, stiffness=2e5, damping=1.0)
        model.add_input(f"V{k}", "mirror", "z", ends[1], relative_to="frame")
    for k, angle in enumerate((30, 270, 150), 1):  # opposite V2, V1 and V3
        model.add_output(f"s{k}", "mirror", "z", around(0.019, angle, 0.02))
    return model


with np.load(Path(__file__).parent / "data" / "fsm_excerpt.npz") as file:
    record = dict(file)
omega = 2 * np.pi * record["frequencies"]
data = mv.Measurement(omega, record["responses_100"] * np.exp(1j * omega * DELAY) / FORCE, ("s1", "s2", "s3"),
                      ("V1", "V2", "V3"), variance=record["variance_100"] / FORCE**2)  # fmt: skip
places = [f"{body}.position.{axis}" for body in BODIES for axis in "xy"]
motions = ("z", "rx", "ry", "z.rx", "z.ry", "rx.ry")
free = [f"{body}.{what}" for body in BODIES for what in ("mass", "inertia.*")] + places + ["stack*.stiffness",
        "stack*.damping"] + [f"{mount}.stiffness.{way}" for mount in MOUNTS for way in motions] + [
        f"{mount}.damping.{way}" for mount in MOUNTS for way in motions[:3]]  # fmt: skip
known = dict.fromkeys(places, (0.0, 0.004)) | {f"s{k}.gain": (1.0, 0.1) for k in (1, 2, 3)}
fit = drawn().fit(data, free, channels=["gain"], prior=known)

off = np.linalg.norm(fit.responses() - data.responses, axis=(1, 2)) / np.linalg.norm(data.responses, axis=(1, 2))
print(fit)
print("Residuals of the sensors over their responses:", np.round(off, 3))
assert off.max() < 0.12
assert not fit.residual_test.passed
frequencies = fit.model.linearize().modes().frequencies
assert all(np.abs(frequencies / peak - 1.0).min() < 4e-3 for peak in (640.3, 813.2, 924.2, 999.5))


def draw():
    """Measured and fitted responses of each sensor to the three stacks."""
    import matplotlib.pyplot as plt

    _, panels = plt.subplots(1, 3, figsize=(12, 4.6), layout="constrained", sharey=True)
    fitted = np.abs(fit.responses())
    for k, axes in enumerate(panels):
        for j, (colour, mark) in enumerate(zip(("C0", "C1", "C2"), "o^s", strict=True)):
            axes.semilogy(data.frequencies, np.abs(data.responses[k, j]), mark, ms=2.5, color=colour, mfc="none")
            axes.semilogy(data.frequencies, fitted[k, j], color=colour, label=f"V{j + 1}")
        axes.set(title=f"s{k + 1}: marks measured, lines fitted", xlabel="frequency [Hz]")
    panels[0].set(ylabel="displacement per force [m/N]", ylim=(4e-7, 1e-4))
    panels[0].legend(loc="lower left")
    plt.show()


if __name__ == "__main__":
    draw()
