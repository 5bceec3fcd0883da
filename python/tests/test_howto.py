"""The Python blocks of the how-to page run in their order, with a smaller simulation."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs/howto/python.md"
MARK = "<!-- tested by python/tests/test_howto.py: {name} -->"
SMALLER = {'"count": 48, "subparticle_radius_m": 0.008': '"count": 2, "subparticle_radius_m": 0.009'}


def blocks(name: str) -> str:
    """The blocks that name a test, as one program."""
    page = PAGE.read_text(encoding="utf-8")
    found = re.findall(re.escape(MARK.format(name=name)) + r"\n```python\n(.*?)\n```", page, re.DOTALL)
    program = "\n".join(found)
    for full, small in SMALLER.items():
        assert full in program
        program = program.replace(full, small)
    return program


def test_the_blocks_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(blocks("test_the_blocks_of_the_page_run"), str(PAGE), "exec"), {})
    shown = capsys.readouterr().out
    assert "/equipment/gate_opening_m" in shown and "kg" in shown
    assert (tmp_path / "result.json").exists()


def test_every_python_block_of_the_page_names_its_test() -> None:
    page = PAGE.read_text(encoding="utf-8")
    marks = [before.splitlines()[-1] for before in page.split("\n```python\n")[:-1]]
    assert len(marks) >= 5
    for mark in marks:
        assert mark.startswith(("<!-- tested by ", "<!-- not tested: ")), mark
