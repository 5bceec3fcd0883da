"""The Python blocks of the documents: each names its test or a reason, and those that need no server run with smaller simulations."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = "docs/howto/python.md"
README = "python/README.md"
MARK = "<!-- tested by python/tests/test_howto.py: {name} -->"
SMALLER = {'"count": 48, "subparticle_radius_m": 0.008': '"count": 2, "subparticle_radius_m": 0.009'}


def blocks(page: str, name: str, smaller: dict[str, str]) -> str:
    """The blocks of a page that name a test, as one program with some words replaced."""
    text = (ROOT / page).read_text(encoding="utf-8")
    program = "\n".join(re.findall(re.escape(MARK.format(name=name)) + r"\n```python\n(.*?)\n```", text, re.DOTALL))
    for full, small in smaller.items():
        assert full in program
        program = program.replace(full, small)
    return program


def test_the_blocks_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(blocks(PAGE, "test_the_blocks_of_the_page_run", SMALLER), PAGE, "exec"), {})
    shown = capsys.readouterr().out
    assert "/equipment/gate_opening_m" in shown and "kg" in shown
    assert (tmp_path / "result.json").exists()


def test_the_block_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    smaller = {'"subparticle_radius_m": 0.006': '"count": 2, "subparticle_radius_m": 0.009'}
    exec(compile(blocks(README, "test_the_block_of_the_readme_runs", smaller), README, "exec"), {})
    assert len(capsys.readouterr().out.splitlines()) == 2


def fault(mark: str) -> str | None:
    """The fault of the line before a block, if it has one."""
    if re.fullmatch(r"<!-- not tested: .{10,} -->", mark):
        return None
    named = re.fullmatch(r"<!-- tested by (python/tests/[\w/]+\.py): (\w+) -->", mark)
    if named is None:
        return "it has neither `tested by` nor `not tested` before it"
    file = ROOT / named[1]
    if not file.exists() or f"def {named[2]}(" not in file.read_text(encoding="utf-8"):
        return f"{named[1]} has no test {named[2]}"
    return None


def test_every_python_block_names_its_test_or_a_reason() -> None:
    pages = sorted((ROOT / "docs").rglob("*.md")) + [ROOT / name for name in ("README.md", "api.md", README)]
    faults: list[str] = []
    count = 0
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for block in re.finditer(r"(?m)^ *```python$", text):
            count += 1
            mark = (text[: block.start()].splitlines() or [""])[-1].strip()
            faults += [f"{page.relative_to(ROOT)}: {mark}: {text}" for text in filter(None, [fault(mark)])]
    assert not faults, "\n".join(faults)
    assert count > 20


def test_a_wrong_mark_is_reported() -> None:
    assert fault("Text.") and fault("<!-- tested by somebody -->") and fault("<!-- not tested: -->")
    assert fault("<!-- tested by python/tests/test_howto.py: no_such_test -->")
    assert fault(MARK.format(name="test_a_wrong_mark_is_reported")) is None
