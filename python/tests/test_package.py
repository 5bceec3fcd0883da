"""The package as a whole: its version, and the interpreters that can read it."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

import roost

PYTHON = Path(__file__).parents[1]


def test_the_version_is_that_of_the_command(command: str) -> None:
    shown = subprocess.run([command, "--version"], capture_output=True, text=True, check=True).stdout
    assert shown.split()[1] == roost.__version__


def test_every_module_is_readable_for_the_oldest_interpreter_and_says_its_purpose() -> None:
    oldest = re.search(r'requires-python = ">=3\.(\d+)"', (PYTHON / "pyproject.toml").read_text())
    assert oldest is not None
    files = sorted((PYTHON / "roost").rglob("*.py"))
    assert len(files) > 4
    for file in files:
        tree = ast.parse(file.read_text(), file.name, feature_version=(3, int(oldest[1])))
        assert ast.get_docstring(tree), f"{file.name} has no docstring"
