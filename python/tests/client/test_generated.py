"""The generated types are those of the binary under test."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from .servers import ROOST, ROOT

SCRIPT = ROOT / "python/generate.py"


@pytest.fixture(scope="module")
def generate() -> Any:
    """The script as a module."""
    spec = importlib.util.spec_from_file_location("generate", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_generated_files_are_up_to_date() -> None:
    command = [sys.executable, str(SCRIPT), "--check", "--roost", ROOST]
    checked = subprocess.run(command, check=False, stderr=subprocess.PIPE, text=True)
    assert checked.returncode == 0, checked.stderr


def test_names_of_python_are_written_as_text(generate: Any) -> None:
    schema: dict[str, Any] = {
        "type": "object",
        "required": ["from"],
        "properties": {"from": {"type": "integer"}, "unit": {"type": ["string", "null"]}},
    }
    assert '"from": "int"' in generate.model("Range", schema) and '"unit": "NotRequired[str | None]"' in generate.model(
        "Range", schema
    )
    del schema["properties"]["from"]
    assert "class Range(TypedDict):" in generate.model("Range", schema)


def test_fields_have_the_defaults_of_their_experiment(generate: Any) -> None:
    text = Path(generate.PACKAGE / "fields.py").read_text(encoding="utf-8")
    drop = text[text.index("class DropProduct(") :]
    hopper = text[text.index("class HopperProduct(") :]
    assert "Default: 90." in drop[: drop.index("class ", 5)]
    assert "Default: 90." not in hopper[: hopper.index("class ", 5)]
    assert "gate_opening_m: float" in text and "Unit: m." in text
