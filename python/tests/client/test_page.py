"""The examples of docs/howto that use a server, run in their order, with fewer and smaller simulations."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import matplotlib
import pytest

from roost.client import Client, Sweep

from .servers import ROOT, Farm

SMALLER = {
    '"points": 30': '"points": 3',
    '"count": 48': '"count": 4',
    '"replicates": 4': '"replicates": 2',
    '"max_runs": 20': '"max_runs": 3',
}


def test_the_page_runs(farm: Farm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "docs/howto/python.md").read_text(encoding="utf-8")
    section = page[page.index("## Use a server") :]
    code = "\n".join(re.findall(r"```python\n(.*?)```", section, re.DOTALL))
    for text, smaller in SMALLER.items():
        assert text in code
        code = code.replace(text, smaller)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROOST_SERVER", farm.url)
    monkeypatch.delenv("ROOST_TOKEN", raising=False)
    matplotlib.use("agg")
    names: dict[str, Any] = {}
    exec(compile(code, "docs/howto/python.md", "exec"), names)
    assert (tmp_path / "rate-against-gate.png").stat().st_size > 1000
    assert (tmp_path / "gates.xlsx").stat().st_size > 1000
    head, units = (tmp_path / "gates.csv").read_text(encoding="utf-8").splitlines()[:2]
    assert dict(zip(head.split(","), units.split(",")))["gate_opening_m"] == "m"
    assert isinstance(names["client"], Client) and names["share"].n == 6


def test_the_page_of_results_runs(
    farm: Farm, sweep: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (ROOT / "docs/howto/results.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL))
    assert code.count('"..."') == 1
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROOST_SERVER", farm.url)
    monkeypatch.delenv("ROOST_TOKEN", raising=False)
    # The commands of the page write this file.
    sweep.download("results.parquet")
    names: dict[str, Any] = {}
    exec(compile(code.replace('"..."', repr(sweep.id)), "docs/howto/results.md", "exec"), names)
    assert len(names["points"]) == 4 and names["curves"].sizes["design"] == 4 and len(names["table"]) == 8
    assert capsys.readouterr().out.splitlines()[-1] == "kg/s"
