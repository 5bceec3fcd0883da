"""Settings of the frames that a run writes, as the options of `roost run --frames`."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

FrameFormat = Literal["vtk", "web", "both"]
"""Files of frames: for ParaView, a stream for the player, or both."""

_MOST_MB = 1_000_000_000


@dataclass(frozen=True)
class FrameOptions:
    """Settings in the form that the native module reads."""

    folder: Path
    interval_s: float
    vtk: bool
    web: bool
    limit_mb: int


def frame_options(folder: str | os.PathLike[str], interval: float, format: FrameFormat, limit_mb: int) -> FrameOptions:
    """Checks settings. Raises `ValueError` with the name of the argument, its value, and what is allowed."""
    if not (interval > 0 and math.isfinite(interval)):
        raise ValueError(f"frame_interval is {interval!r}; allowed: a number of seconds above 0")
    if format not in get_args(FrameFormat):
        allowed = ", ".join(f'"{name}"' for name in get_args(FrameFormat))
        raise ValueError(f"frame_format is {format!r}; allowed: {allowed}")
    if not (1 <= limit_mb <= _MOST_MB and int(limit_mb) == limit_mb):
        raise ValueError(f"frame_limit_mb is {limit_mb!r}; allowed: whole numbers from 1 to {_MOST_MB}")
    return FrameOptions(Path(folder), float(interval), format != "web", format != "vtk", int(limit_mb))
