"""The tables of ``benchmarks/README.md`` from what ``compare.py`` measured: ``compare.md``."""

# Scenes whose stages are shown one by one.
CLOSE = ("C200", "L20", "stewart")


def milliseconds(seconds):
    """Three digits, as one reads them; nothing for None."""
    if seconds is None:
        return ""
    value = 1e3 * seconds
    return f"{value:.0f}" if value >= 99.5 else f"{value:.3g}"


def size(error):
    """An error with one digit; "too few" where a method did not find all eigenvalues."""
    return "too few" if error is None else f"{error:.0e}"


def total(label, answer):
    """Time from the model to the eigenvalues [s]; of the floor, which is handed its matrices, that of these alone."""
    start = 0.0 if label == "LAPACK floor" else answer["build"] + answer["linearise"]
    return start + answer["modes"]


def rows(header, lines):
    """Return a table, first column to the left and the others to the right."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (
        header, ["---", *["---:"] * (len(header) - 1)], *lines)) + "\n"  # fmt: skip


def across(results, cell):
    """Return a table of methods against scenes."""
    labels = list(dict.fromkeys(label for answers in results.values() for label in answers))
    lines = [[label, *(cell(label, answers[label]) if "version" in answers.get(label, {}) else ""
                       for answers in results.values())] for label in labels]  # fmt: skip
    return rows(["method", *results], lines)


def closely(answers):
    """Return a table of the stages of one scene."""
    header = ["method", "build", "linearise", "modes", "error", "undamped only", "error", "peak MB", "imports MB"]
    lines = []
    for label, a in answers.items():
        if "version" not in a:
            continue
        stages = [None, None] if label == "LAPACK floor" else [a["build"], a["linearise"]]
        lines.append([label, *map(milliseconds, stages), milliseconds(a["modes"]), size(a["error"]),
                      milliseconds(a.get("undamped")), size(a["undamped_error"]) if "undamped_error" in a else "",
                      f"{a['peak_mb']:.0f}", f"{a['base_mb']:.0f}"])  # fmt: skip
    return rows(header, lines)


def report(results, titles):
    """Return all tables as Markdown."""
    parts = ["CPU time in ms, model to damped eigenvalues\n",
             across(results, lambda label, answer: milliseconds(total(label, answer))),
             "Largest relative error of a damped eigenvalue\n",
             across(results, lambda _, answer: size(answer["error"]))]  # fmt: skip
    for scene in CLOSE:
        if scene in results:
            parts += [f"{scene}: {titles[scene]}. CPU time in ms\n", closely(results[scene])]
    return "\n".join(parts)
