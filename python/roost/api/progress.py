"""Progress bars for waiting, in terminals and notebooks. Other outputs, such as log files, get a plain line now and then."""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable
from typing import TypeVar

View = TypeVar("View")

_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 1.0
# Between plain lines.
_LINE_S = 30.0


class Bar:
    """A bar from 0 to 1 with a line of text, or plain lines where there is no terminal."""

    def __init__(self, name: str, *, is_shown: bool) -> None:
        self._name = name
        self._last_line = time.monotonic()
        with warnings.catch_warnings():
            # In a notebook without ipywidgets tqdm warns, and draws its bar as text.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm

            self._bar = tqdm(
                total=1.0,
                desc=name,
                unit="",
                ncols=width(),
                nrows=20 if width() else None,
                disable=None if is_shown else True,
                # The text is the unit: tqdm writes a comma before a postfix.
                bar_format="{desc}: {percentage:3.0f}%|{bar}| {unit} [{elapsed}, {remaining} left]",
            )
        self._has_lines = is_shown and bool(self._bar.disable)

    def update(self, fraction: float, text: str) -> None:
        """Draws the bar."""
        if self._has_lines and time.monotonic() - self._last_line >= _LINE_S:
            self._last_line = time.monotonic()
            print(f"{self._name}: {100 * fraction:.0f} %, {text}", file=sys.stderr, flush=True)
        self._bar.unit = text
        self._bar.n = min(max(fraction, 0.0), 1.0)
        self._bar.refresh()

    def close(self) -> None:
        """Leaves the bar as it is."""
        self._bar.close()


def width() -> int | None:
    """The width of bars in a terminal that does not know its own; None leaves it to tqdm."""
    try:
        return 80 if os.get_terminal_size(sys.stderr.fileno()).columns == 0 else None
    except (OSError, ValueError):
        return None


def follow(
    name: str,
    poll: Callable[[], View],
    describe: Callable[[View], tuple[float, str]],
    is_over: Callable[[View], bool],
    *,
    timeout_s: float | None,
    progress: bool,
) -> View:
    """Polls until a view is over. Raises `TimeoutError` after `timeout_s` seconds; the work goes on at the server."""
    end = None if timeout_s is None else time.monotonic() + timeout_s
    pause_s = _FIRST_PAUSE_S
    bar = Bar(name, is_shown=progress)
    try:
        while True:
            view = poll()
            bar.update(*describe(view))
            if is_over(view):
                return view
            if end is not None and time.monotonic() + pause_s > end:
                raise TimeoutError(f"the {name} has not ended after {timeout_s:g} s; it goes on at the server")
            time.sleep(pause_s)
            pause_s = min(1.5 * pause_s, _LONGEST_PAUSE_S)
    finally:
        bar.close()
