"""The notebooks run from their first cell to their last, with bars of progress, and plots that have data."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
PICTURES = {"first-run": 1, "sweep": 2, "study": 1, "calibration": 1}
# The text of the bar of each notebook.
BARS = {"first-run": "simulating", "sweep": "sweep:", "study": "study:", "calibration": "study:"}

# The first cell of each run: counts the points of every artist before a figure is shown. Of lines and collections only those
# count whose x and y are data: the line of `axhline` is none.
COUNTER = """
def _count():
    import json
    import numpy
    import matplotlib.pyplot as pyplot

    def finite(points):
        points = numpy.ma.filled(numpy.asarray(points, dtype=float), numpy.nan).reshape(-1, 2)
        return points[numpy.isfinite(points).all(axis=1)]

    def points(axes):
        lines = [line for line in axes.lines if line.get_transform().contains_branch_seperately(axes.transData) == (True, True)]
        yield from (finite(line.get_xydata()) for line in lines)
        for of in axes.collections:
            dots = type(of).__name__ == "PathCollection"
            yield finite(of.get_offsets()) if dots else finite(numpy.concatenate([path.vertices for path in of.get_paths()] or [[]]))

    with open("plots.jsonl", "a") as file:
        for number in pyplot.get_fignums():
            counts = [[len(numpy.unique(artist, axis=0)) for artist in points(axes)] for axes in pyplot.figure(number).axes]
            print(json.dumps(counts), file=file)

get_ipython().events.register("post_execute", _count)
"""


def load(name: str) -> Any:
    """A notebook by its name. nbformat has no types."""
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)  # type: ignore[no-untyped-call]


def outputs(notebook: Any) -> list[Any]:
    """The outputs of all cells."""
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def shown(notebook: Any, kind: str) -> int:
    """The number of outputs of this media type."""
    return sum(kind in output.get("data", {}) for output in outputs(notebook))


def execute(notebook: Any, folder: Path) -> None:
    """Runs a notebook in a folder. A cell that fails raises its error."""
    # A busy machine may be late with a kernel, and with the outputs of a cell.
    client = NotebookClient(
        notebook,
        timeout=180,
        iopub_timeout=60,
        startup_timeout=180,
        kernel_name="python3",
        resources={"metadata": {"path": str(folder)}},
    )
    client.execute()


def widgets(notebook: Any) -> list[dict[str, Any]]:
    """The states of all widgets at the end."""
    models = notebook.metadata.widgets["application/vnd.jupyter.widget-state+json"]["state"].values()
    return [model["state"] for model in models]


def plots(folder: Path) -> list[list[list[int]]]:
    """The points of every artist, by plot and axes."""
    return [json.loads(line) for line in (folder / "plots.jsonl").read_text(encoding="utf-8").splitlines()]


def has_data(plot: list[list[int]]) -> bool:
    """Whether all axes of a plot have several points, and every line and set of dots at least one."""
    return bool(plot) and all(sum(axes) > 3 and all(axes) for axes in plot)


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
    notebook.cells.insert(0, nbformat.v4.new_code_cell(COUNTER))  # type: ignore[no-untyped-call]
    # The notebook with its outputs stays in the folder of pytest.
    try:
        execute(notebook, tmp_path)
    finally:
        nbformat.write(notebook, tmp_path / f"{name}.ipynb")  # type: ignore[no-untyped-call]
    assert shown(notebook, "image/png") == PICTURES[name]
    assert len(plots(tmp_path)) == PICTURES[name] and all(map(has_data, plots(tmp_path))), plots(tmp_path)
    bars = [state for state in widgets(notebook) if state.get("_model_name") == "FloatProgressModel"]
    texts = [str(state["value"]) for state in widgets(notebook) if state.get("_model_name") == "HTMLModel"]
    assert [bar["value"] for bar in bars] == [1.0] and any(text.startswith(BARS[name]) for text in texts), (bars, texts)
    if name == "first-run":
        views = [output.data for output in outputs(notebook) if "application/vnd.jupyter.widget-view+json" in output.get("data", {})]
        assert any("Player" in data["text/plain"] for data in views)


PLAIN = """
import sys

sys.modules["ipywidgets"] = None

import warnings

warnings.filterwarnings("error", message="IProgress")
import roost
from roost.api.progress import Bar

bar = Bar("sweep", is_shown=True)
bar.update(0.5, "1 of 2 jobs done")
bar.close()
Bar("hidden", is_shown=False).close()
fields = {"product": {"subparticle_radius_m": 0.009}, "numerics": {"timestep_s": "auto"}}
roost.run(roost.Scenario(experiment="bend", **fields))
"""


def test_a_notebook_without_widgets_has_bars_of_text(tmp_path: Path) -> None:
    notebook: Any = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(PLAIN)])  # type: ignore[no-untyped-call]
    execute(notebook, tmp_path)
    text = "".join(output.text for output in outputs(notebook) if output.output_type == "stream")
    assert "| 1 of 2 jobs done [" in text and "hidden" not in text, text
    assert "simulating" in text and "of wall time" in text and "100%" in text, text


PLOT = """
%matplotlib inline
import matplotlib.pyplot as plt

figure, axes = plt.subplots()
axes.plot(VALUES, VALUES, label="line")
axes.axhline(1.0)
axes.legend();
"""


def test_an_empty_plot_is_reported(tmp_path: Path) -> None:
    codes = [PLOT.replace("VALUES", values) for values in ("[0.0, 1.0, 2.0, 3.0]", "[]", "[float('nan')] * 5")]
    cells = [nbformat.v4.new_code_cell(code) for code in (COUNTER, *codes)]  # type: ignore[no-untyped-call]
    notebook: Any = nbformat.v4.new_notebook(cells=cells)  # type: ignore[no-untyped-call]
    execute(notebook, tmp_path)
    assert shown(notebook, "image/png") == 3
    assert list(map(has_data, plots(tmp_path))) == [True, False, False]
