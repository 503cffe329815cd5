"""A hexapod of one's own: voice coils that hold a camera still, from the mechanism to FMUs for co-simulation.

Six legs (universal joint, slide, ball joint) carry a table; each slide has a flexure and a voice coil, and a sensor of
the force in the leg's head. An offset camera stands on a soft mount. First each leg's force, integrated, damps the
suspension (integral force feedback). Then python-control designs a linear-quadratic regulator on the damped plant: it
keeps the camera's acceleration small, and a Kalman filter of its accelerometers feeds it. Margins, the loop at 5 kHz,
plant and controllers as FMUs, and a report that compares both follow from the same loop.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import control
import numpy as np

import mbsvib as mv
import mbsvib_export as mx
from mbsvib import report

LEGS, ALONG = [f"leg{i}" for i in range(1, 7)], ("x", "y", "z", "rx", "ry", "rz")
FEET, HEADS = np.radians([-12, 12, 108, 132, 228, 252]), np.radians([-48, 48, 72, 168, 192, 288])
RATE = 5e3  # sampling rate [Hz]

model = mv.Model("hexapod")
model.add_body("table", 8.0, (0.10, 0.10, 0.18), (0, 0, 0.25))
model.add_body("camera", 3.0, (0.02, 0.03, 0.02), (0.07, 0.02, 0.33))
model.add_bushing("mount", "table", "camera", (0.06, 0.03, 0.27), (6e6, 6e6, 9e6, 2e4, 2e4, 2e4),
                  (120, 120, 150, 0.4, 0.4, 0.4))  # fmt: skip
for leg, low, high in zip(LEGS, FEET, HEADS, strict=True):
    foot, head = np.array([0.22 * np.cos(low), 0.22 * np.sin(low), 0]), (0.15 * np.cos(high), 0.15 * np.sin(high), 0.25)
    line = (head - foot) / np.linalg.norm(head - foot)
    tangent = np.cross(line, (0, 0, 1)) / np.linalg.norm(np.cross(line, (0, 0, 1)))
    axes = np.column_stack((np.cross(tangent, line), tangent, line))
    stator, coil = f"{leg}.stator", f"{leg}.coil"
    model.add_body(stator, 0.6, (2e-3, 2e-3, 3e-4), foot + 0.05 * line)
    model.add_body(coil, 0.25, (8e-4, 8e-4, 8e-5), head - 0.05 * line)
    model.add_joint(f"{leg}.foot", "universal", "ground", stator, foot, axis=tangent, axis2=axes[:, 0])
    model.add_joint(f"{leg}.slide", "prismatic", stator, coil, foot, axes)
    model.add_joint(f"{leg}.head", "spherical", coil, "table", head, axes)
    model.add_bushing(f"{leg}.flexure", stator, coil, foot, (0, 0, 2e4, 0, 0, 0), (0, 0, 10, 0, 0, 0), axes)
    model.add_input(f"{leg}.push", coil, line, head, relative_to=stator)
    model.add_force_output(f"{leg}.force", f"{leg}.head", "z")
for direction in ALONG:
    model.add_output(f"camera.{direction}", "camera", direction, quantity="acceleration")
    model.add_base_motion(f"floor.{direction}", direction)

system = model.linearize()
coils, forces = [f"{leg}.push" for leg in LEGS], [f"{leg}.force" for leg in LEGS]
camera = [f"camera.{direction}" for direction in ALONG]
assert system.dof == 12
integrator = control.ss(-np.pi * np.eye(6), np.eye(6), 80.0 * np.eye(6), 0 * np.eye(6), name="force feedback")
damped = system.feedback(integrator, forces, coils)

driven, shaken = mx.to_control(damped[camera, coils]), mx.to_control(damped[camera, "floor.*"])
weighted = np.diag([1, 1, 1, 0.2, 0.2, 0.2]) @ driven.C
gain, _, _ = control.lqr(driven.A, driven.B, weighted.T @ weighted, 1e-2 * np.eye(6), method="scipy")
observer, _, _ = control.lqe(driven.A, shaken.B, driven.C, np.eye(6), 1.0 * np.eye(6), method="scipy")
regulator = control.ss(driven.A - driven.B @ gain - observer @ driven.C, observer, -gain, 0 * np.eye(6), name="LQG")
loop = damped.feedback(regulator, camera, coils)

margins = loop.margins()
assert margins.all_phases > 10.0
assert loop.sampled(RATE, delay=0.2 / RATE).stable

peaks = [each.hinf_norm("camera.z", "floor.z", []).value for each in (system, damped)]
shaking = [each.h2_norm("camera.*", "floor.*", []).value for each in (system, damped, loop)]
assert peaks[1] < peaks[0] / 8
assert shaking[2] < 0.6 * shaking[1] < 0.3 * shaking[0]

with TemporaryDirectory() as folder:
    plant, laws = (mx.to_fmu(each, Path(folder) / f"{each.name}.fmu") for each in (system, loop.law))
    check = mx.check_cosimulation(plant, laws, 1 / RATE, masters=["jacobi", "iteration"])
    report.write(system, Path(folder) / "hexapod.html", compare=loop, names=("passive", "controlled"))
assert check["iteration"].errors[0] < check["jacobi"].errors[0] < 0.1

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    for result in (system.modes(), loop, margins, check):
        print(result)
    grid = system.frequency_grid(n=600, outputs="camera.z", inputs="floor.z")
    for name, each in (("passive", system), ("force feedback", damped), ("and LQG", loop)):
        response = each.frequency_response(grid, "camera.z", "floor.z")[0, 0]
        plt.loglog(grid / (2 * np.pi), abs(response), label=name)
    plt.gca().set(xlabel="frequency [Hz]", ylabel="floor z to camera z [1]", title="Isolation of the camera")
    plt.legend()
    plt.show()
