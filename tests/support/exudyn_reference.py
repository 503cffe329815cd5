"""Makes tests/data/large_motion.json: the mechanisms of large_motion.py in exudyn, an independent engine.

Redundant coordinates, the trapezoidal rule of second order (index 2), and Richardson extrapolation over two halvings of
the step, whose change is the error that the file states. Run with exudyn and mbsvib installed:

    python -m tests.support.exudyn_reference
"""

import json
from pathlib import Path

import numpy as np

from tests.support.large_motion import FALL, SCENES, TIMES

STEPS = (8000, 16000, 32000)
# constrained axes: three translations, three rotations, in the axes of the joint
LOCKED = {"revolute": [1, 1, 1, 1, 1, 0], "spherical": [1, 1, 1, 0, 0, 0], "prismatic": [1, 1, 0, 1, 1, 1],
          "planar revolute": [1, 0, 1, 0, 0, 0]}  # fmt: skip


def simulated(model, steps, loops_in_plane):
    import exudyn as exu
    from exudyn.utilities import (
        Force,
        RigidBodyInertia,
        SensorBody,
        Torque,
    )

    container = exu.SystemContainer()
    mbs = container.AddSystem()
    body = {"ground": mbs.CreateGround()}
    centre, axes = {"ground": np.zeros(3)}, {"ground": np.eye(3)}
    for part in model.bodies.values():
        xx, yy, zz, xy, xz, yz = part.inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        centre[part.name], axes[part.name] = np.array(part.position), np.array(part.orientation)
        body[part.name] = mbs.CreateRigidBody(
            referencePosition=centre[part.name], referenceRotationMatrix=axes[part.name], gravity=list(FALL),
            inertia=RigidBodyInertia(part.mass, tensor), nodeType=exu.NodeType.RotationEulerParameters,
        )  # fmt: skip

    def marker(name, point):
        local = axes[name].T @ (np.array(point) - centre[name])
        return mbs.AddMarker({"markerType": "BodyRigid", "bodyNumber": body[name], "localPosition": local.tolist()})

    for k, joint in enumerate(model.joints.values()):
        kind = "planar revolute" if loops_in_plane and k == len(model.joints) - 1 else joint.kind
        point = joint.position if joint.position is not None else centre[joint.second]
        own = np.eye(3) if kind == "planar revolute" else np.array(joint.axes)
        mbs.AddObject({
            "objectType": "JointGeneric", "markerNumbers": [marker(joint.first, point), marker(joint.second, point)],
            "constrainedAxes": LOCKED[kind], "rotationMarker0": (axes[joint.first].T @ own).tolist(),
            "rotationMarker1": (axes[joint.second].T @ own).tolist(),
        })  # fmt: skip
    for spring in model.springs.values():
        ends = [marker(spring.first, spring.start), marker(spring.second, spring.end)]
        mbs.AddObject({"objectType": "ConnectorSpringDamper", "markerNumbers": ends, "stiffness": spring.stiffness,
                       "damping": spring.damping, "referenceLength": spring.length})  # fmt: skip
    for load in model.loads.values():
        where = marker(load.body, centre[load.body])
        mbs.AddLoad(Force(markerNumber=where, loadVector=list(load.force)))
        mbs.AddLoad(Torque(markerNumber=where, loadVector=list(load.torque)))
    names = list(dict.fromkeys(output.body for output in model.outputs.values()))
    sensors = [mbs.AddSensor(SensorBody(bodyNumber=body[name], storeInternal=True,
                                        outputVariableType=exu.OutputVariableType.Displacement)) for name in names]
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime = float(TIMES[-1])
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.newton.relativeTolerance = 1e-12
    settings.timeIntegration.newton.absoluteTolerance = 1e-13
    settings.timeIntegration.verboseMode = 0
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = float(TIMES[1])
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    columns = [mbs.GetSensorStoredData(sensor)[:, 1:4] for sensor in sensors]
    return np.concatenate(columns, axis=1)


def main():
    result = {}
    for name, build in SCENES.items():
        rough, middle, fine = (simulated(build(), steps, name == "four_bar") for steps in STEPS)
        once = [(4.0 * b - a) / 3.0 for a, b in ((rough, middle), (middle, fine))]
        best = (16.0 * once[1] - once[0]) / 15.0
        error = float(np.abs(best - once[1]).max())
        print(f"{name}: moves {np.abs(best).max():.3f} m, last correction {error:.1e} m")
        result[name] = {"outputs": list(build().outputs), "times": TIMES.tolist(), "error": error,
                        "values": [[float(f"{value:.12g}") for value in row] for row in best.T]}  # fmt: skip
    path = Path(__file__).parents[1] / "data" / "large_motion.json"
    path.write_text(json.dumps(result, indent=0) + "\n")


if __name__ == "__main__":
    main()
