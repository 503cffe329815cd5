"""A Stewart platform handed to MATLAB or Octave, and what comes back compared with what went out.

``to_mat`` writes A B C D and M C K with all names and units, and a script that makes ``ss`` and ``mechss`` objects of
them. It compares their frequency response with points in the file before it hands them out. Here Octave does velocity
feedback on what it read, f = -g v of every leg, and sends the poles of the closed loop back; they must be those of the
same model with dampers of g beside the springs. Where no Octave is, scipy reads the file and plays its part.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy.io import loadmat

import mbsvib_export as mx
from mbsvib.library import stewart

GAIN = 300.0  # N s/m
model = stewart(ports="legs")
system = model.linearize()
PROGRAM = """
[plant, mech, worst] = load_stewart();
forces = strcat('leg', cellstr(num2str((1:6)')), '.f');
[~, into] = ismember(forces, plant.InputName);
[~, seen] = ismember(strcat('leg', cellstr(num2str((1:6)')), '.elongation'), plant.OutputName);
data = load('stewart.mat');
% elongation is no rate: its derivative is C A x, as the actuators do not push it at once
rates = data.C(seen, :) * data.A;
poles = eig(data.A - {gain} * data.B(:, into) * rates);
save('-mat', 'poles.mat', 'poles', 'worst');
"""


def closed_loop_poles(folder):
    """Poles of the loop as Octave computes them from the file, and the error of the response that its script found."""
    if octave := shutil.which("octave-cli"):
        code = PROGRAM.format(gain=GAIN)
        call = [octave, "--norc", "--quiet", "--eval", code]
        subprocess.run(call, cwd=folder, check=True, timeout=60, capture_output=True)
        found = loadmat(folder / "poles.mat")
        return found["poles"].ravel(), found["worst"].item()
    data = loadmat(folder / "stewart.mat", simplify_cells=True)
    into = [list(data["InputName"]).index(f"leg{i}.f") for i in range(1, 7)]
    seen = [list(data["OutputName"]).index(f"leg{i}.elongation") for i in range(1, 7)]
    loop = data["A"] - GAIN * data["B"][:, into] @ data["C"][seen] @ data["A"]
    check = mx.check_export(folder / "stewart.mat", system)
    return np.linalg.eigvals(loop), max(each.error for each in check.comparisons)


with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    mx.to_mat(system, folder / "stewart.mat")
    print(*sorted(each.name for each in folder.iterdir()), sep=", ")
    poles, worst = closed_loop_poles(folder)
damped = stewart(leg_damping=20.0 + GAIN).linearize()
truth = damped.poles()
error = max(np.abs(truth - pole).min() / abs(pole) for pole in poles)
print(f"frequency response as read: off by {worst:.1e}; closed-loop poles: off by {error:.1e}")
assert worst < 1e-9
assert error < 1e-9
assert len(poles) == len(truth)

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(layout="constrained")
    axes.plot(truth.real, truth.imag, "o", mfc="none", label="dampers in mbsvib")
    axes.plot(poles.real, poles.imag, "x", label="velocity feedback in Octave")
    axes.plot(system.poles().real, system.poles().imag, "k.", label="without")
    axes.set(xlabel="real part [1/s]", ylabel="imaginary part [1/s]")
    axes.legend()
    plt.show()
