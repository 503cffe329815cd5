"""Every tolerance says why it has its value."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(path for package in ("mbsvib", "export/mbsvib_export") for path in (ROOT / package).rglob("*.py"))
LARGEST = 0.02  # tolerances are smaller; sizes and counts are larger


def tolerances(text):
    """First and last line of the constants of a module that are small, or parts of the spacing of numbers."""
    for statement in ast.parse(text).body:
        if not isinstance(statement, ast.Assign):
            continue
        names = [node.id for target in statement.targets for node in ast.walk(target) if isinstance(node, ast.Name)]
        if not all(name.isupper() for name in names):
            continue
        parts = list(ast.walk(statement.value))
        numbers = [node.value for node in parts if isinstance(node, ast.Constant) and isinstance(node.value, float)]
        if any(0.0 < number < LARGEST for number in numbers) or any(
                isinstance(node, ast.Name) and node.id == "EPS" for node in parts):  # fmt: skip
            yield statement.lineno, statement.end_lineno


def unexplained(text):
    """Lines of tolerances without a comment behind or above them."""
    lines = text.splitlines()
    return [lines[first - 1] for first, last in tolerances(text) if "#" not in lines[last - 1]
            and not lines[first - 2].startswith("#")]  # fmt: skip


@pytest.mark.slow
def test_tolerances_are_explained():
    texts = {path: path.read_text(encoding="utf-8") for path in FILES}
    assert {path: lines for path, text in texts.items() if (lines := unexplained(text))} == {}
    assert len(texts) > 300


def test_what_is_not_explained_is_found():
    text = "A = 1e-9  # why\n# why\nB = 3 * EPS\nC = 1e-12\nSIZE = 0.5\n"
    assert unexplained(text) == ["C = 1e-12"]
    assert len(list(tolerances(text))) == 3
