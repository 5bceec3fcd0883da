"""Progress bars for waiting, in terminals and notebooks. Other outputs, such as log files, get none."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import TypeVar

View = TypeVar("View")

_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 1.0


class Bar:
    """A bar from 0 to 1 with a line of text."""

    def __init__(self, name: str, *, is_shown: bool) -> None:
        with warnings.catch_warnings():
            # In a notebook without ipywidgets tqdm warns, and draws its bar as text.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm

            self._bar = tqdm(
                total=1.0,
                desc=name,
                disable=None if is_shown else True,
                bar_format="{desc}: {percentage:3.0f}%|{bar}| {postfix} [{elapsed}]",
            )

    def update(self, fraction: float, text: str) -> None:
        """Draws the bar."""
        self._bar.set_postfix_str(text, refresh=False)
        self._bar.n = min(max(fraction, 0.0), 1.0)
        self._bar.refresh()

    def close(self) -> None:
        """Leaves the bar as it is."""
        self._bar.close()


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
