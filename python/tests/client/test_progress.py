"""Progress of waiting: a bar in terminals, lines elsewhere."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest

from roost.api import progress

PROGRAM = """
from roost.api.progress import Bar
bar = Bar("sweep", is_shown=True)
bar.update(0.5, "1 of 2 jobs done")
bar.close()
"""


def test_a_bar_is_shown_in_a_terminal_without_a_size(tmp_path: Path) -> None:
    own, other = pty.openpty()
    subprocess.run([sys.executable, "-c", PROGRAM], stderr=other, check=True, cwd=tmp_path)
    os.close(other)
    shown = os.read(own, 10_000).decode()
    os.close(own)
    assert re.search(r"\| 1 of 2 jobs done \[00:\d\d", shown) and "left]" in shown, shown


def test_other_outputs_get_a_line_now_and_then(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_LINE_S", 0.0)
    for is_shown in (True, False):
        bar = progress.Bar("sweep", is_shown=is_shown)
        bar.update(0.5, "1 of 2 jobs done")
        bar.close()
    assert capsys.readouterr().err == "sweep: 50 %, 1 of 2 jobs done\n"
