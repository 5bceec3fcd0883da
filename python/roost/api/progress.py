"""Progress bars for waiting, in terminals and notebooks. Other outputs, such as log files, get a plain line now and then.

A notebook without ipywidgets has a bar of text.
"""

from __future__ import annotations

import importlib
import os
import sys
import threading
import time
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, NoReturn, TypeVar

if TYPE_CHECKING:
    from tqdm import tqdm

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
        form = "{desc}: {percentage:3.0f}%|{bar}| {unit} [{elapsed}, {remaining} left]"
        self._bar = draw_bar(name, form, is_shown=is_shown)
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


def draw_bar(name: str, form: str, *, is_shown: bool) -> tqdm[NoReturn]:
    """A bar of tqdm from 0 to 1. Its text is its `unit`, since tqdm writes a comma before a postfix.

    In a notebook it is a widget, or a line of text without ipywidgets. It is disabled where the output is neither a notebook nor
    a terminal.
    """
    columns = width()
    rows = 20 if columns else None
    if not is_notebook():
        from tqdm import tqdm

        # With None, tqdm disables the bar where the output is no terminal.
        disabled = None if is_shown else True
        return tqdm(total=1.0, desc=name, unit="", bar_format=form, ncols=columns, nrows=rows, disable=disabled)
    _import_widget()
    from tqdm.auto import tqdm as widget

    # The output of a notebook is no terminal.
    return widget(total=1.0, desc=name, unit="", bar_format=form, ncols=columns, nrows=rows, disable=not is_shown)


_importing = threading.Lock()


def _import_widget() -> None:
    """Imports the bar of notebooks without the warning of tqdm where ipywidgets is missing."""
    with _importing:
        if "tqdm.auto" not in sys.modules:
            # Only at the first import, and one thread at a time: the filter is one for all threads.
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                importlib.import_module("tqdm.auto")


def width() -> int | None:
    """The width of bars in a terminal that does not know its own; None leaves it to tqdm."""
    try:
        return 80 if os.get_terminal_size(sys.stderr.fileno()).columns == 0 else None
    except (OSError, ValueError):
        return None


def is_notebook() -> bool:
    """Whether this is the process of a notebook. Widgets import ipykernel in scripts too."""
    kernel = sys.modules.get("ipykernel.kernelapp")
    return kernel is not None and bool(kernel.IPKernelApp.initialized())


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
