"""The notebooks run from their first cell to their last, and show what their text says."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
PICTURES = {"first-run": 1, "sweep": 2, "study": 1, "calibration": 1}


def load(name: str) -> Any:
    """A notebook by its name. nbformat has no types."""
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)  # type: ignore[no-untyped-call]


def outputs(notebook: Any) -> list[Any]:
    """The outputs of all cells."""
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def shown(notebook: Any, kind: str) -> int:
    """The number of outputs of this media type."""
    return sum(kind in output.get("data", {}) for output in outputs(notebook))


def test_every_notebook_is_known_and_without_outputs() -> None:
    assert {file.stem for file in NOTEBOOKS.glob("*.ipynb")} == PICTURES.keys()
    for name in PICTURES:
        notebook = load(name)
        nbformat.validate(notebook)
        assert not outputs(notebook), f"{name} has outputs: clear them"
        assert all(cell.get("execution_count") is None for cell in notebook.cells), name


@pytest.mark.parametrize("name", PICTURES)
def test_a_notebook_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(Path(os.environ["ROOST_COMMAND"]).parent), prepend=os.pathsep)
    notebook = load(name)
    # A busy machine may be late with a kernel, and with the outputs of a cell.
    client = NotebookClient(
        notebook,
        timeout=180,
        iopub_timeout=60,
        startup_timeout=180,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    )
    # A cell that fails raises its error. The notebook with its outputs stays in the folder of pytest.
    try:
        client.execute()
    finally:
        nbformat.write(notebook, tmp_path / f"{name}.ipynb")  # type: ignore[no-untyped-call]
    assert shown(notebook, "image/png") == PICTURES[name]
    if name == "first-run":
        views = [output.data for output in outputs(notebook) if "application/vnd.jupyter.widget-view+json" in output.get("data", {})]
        assert any("Player" in data["text/plain"] for data in views)
