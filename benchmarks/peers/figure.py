"""The work-precision figure: run time against error, one panel a scene."""

from math import ceil

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

COLUMNS = 3
# Errors below the last digit of the reference are drawn there.
SMALLEST = 1e-17
# label: (colour, marker); the colours keep apart for colour-blind readers too
LOOKS = {
    "mbsvib": ("#d55e00", "o"), "LAPACK floor": ("#555555", "d"), "traditional": ("#000000", "X"),
    "exudyn": ("#0072b2", "s"), "exudyn tree": ("#56b4e9", "s"), "pinocchio": ("#009e73", "^"),
    "mujoco inverse": ("#cc79a7", "v"), "mujoco step": ("#8e5ea2", "v"), "drake": ("#e6a800", "D"),
    "sympy": ("#7f9f3f", "P"),
}  # fmt: skip


def points(answer):
    """Time [s] and error of the damped and of the undamped eigenvalues, as far as there are any."""
    start = answer["build"] + answer["linearise"]  # next to nothing for the floor, which is handed its matrices
    result = []
    for stage, error, filled in (("modes", "error", True), ("undamped", "undamped_error", False)):
        if answer.get(error) is not None:
            result.append((start + answer[stage], max(answer[error], SMALLEST), filled))
    return result


def panel(axes, title, answers):
    """Draw one scene."""
    for label, answer in answers.items():
        if "skipped" in answer:
            continue
        look = "mbsvib" if label.startswith("mbsvib") else label
        colour, marker = LOOKS[look]
        size = 9 if look == "mbsvib" else 7.5
        for time, error, filled in points(answer):
            axes.loglog(1e3 * time, error, marker, color=colour, markersize=size if filled else size - 1.5,
                        markerfacecolor=colour if filled else "white", markeredgewidth=1.2,
                        markeredgecolor="white" if filled else colour, zorder=3 if look == "mbsvib" else 2)  # fmt: skip
    axes.set_title(title, fontsize=10, loc="left")
    axes.grid(True, which="major", color="#e4e4e4", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8, length=3, color="#999999")
    axes.xaxis.set_major_locator(LogLocator(numticks=12))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_locator(LogLocator(base=1000, numticks=12))
    axes.margins(x=0.08, y=0.06)


def work_precision(results, titles):
    """Return the figure for {scene: {label: answer}}."""
    rows = ceil(len(results) / COLUMNS)
    figure = Figure(figsize=(10.5, 2.75 * rows + 1.0), layout="constrained")
    grid = figure.subplots(rows, COLUMNS, squeeze=False, sharey=True)
    for axes in grid.flat[len(results) :]:
        axes.set_visible(False)
    for axes, (scene, answers) in zip(grid.flat, results.items(), strict=False):
        panel(axes, titles[scene], answers)
    for axes in grid[:, 0]:
        axes.set_ylabel("largest relative error", fontsize=8.5)
    for axes in grid[-1]:
        axes.set_xlabel("CPU time, model to eigenvalues [ms]", fontsize=8.5)
    seen = {"mbsvib" if label.startswith("mbsvib") else label for answers in results.values()
            for label, answer in answers.items() if "skipped" not in answer}  # fmt: skip
    handles = [Line2D([], [], linestyle="", color=c, marker=m, markersize=8, markeredgecolor="white", label=label)
               for label, (c, m) in LOOKS.items() if label in seen]  # fmt: skip
    for label, fill in (("damped eigenvalues", "#777777"), ("undamped frequencies", "white")):
        handles.append(Line2D([], [], linestyle="", color="#777777", marker="o", markersize=6, markerfacecolor=fill,
                              label=label))  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=6, fontsize=8.5, frameon=False)
    return figure
