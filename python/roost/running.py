"""Runs a scenario in this process. The interpreter's lock is released, so that several threads compute at once."""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from . import _native
from .api.progress import draw_bar
from .documents import ScenarioInput
from .errors import Interrupted, RoostError
from .recording import FrameFormat, FrameOptions, frame_options
from .result import Result
from .scenario import Scenario, _scenario_error

CHECKPOINT_NAME = "checkpoint.roost"
"""Name of the checkpoint in the output folder of `roost run`."""


@dataclass(frozen=True)
class Progress:
    """Progress of a run."""

    phase: str
    """`fill` before the belt starts, `process` from then on."""
    time_s: float
    """Belt time in seconds, negative before the belt starts."""
    simulated_s: float
    """Simulated time so far, in seconds."""
    fraction: float
    """Estimated share that is done, 0 to 1."""
    subparticles: int
    """Sub-particles still in the simulation."""
    particle_steps: int
    """Updates of sub-particles so far."""
    wall_s: float
    """Wall time so far, in seconds."""
    discharged_kg: float
    """Mass that has passed the gate, in kilograms."""

    @property
    def left_s(self) -> float | None:
        """Wall time left in seconds; None while it is too early for an estimate."""
        if self.fraction < 0.005 or self.wall_s < 0.5:
            return None
        return self.wall_s * (1 - self.fraction) / self.fraction

    def __str__(self) -> str:
        if self.phase == "fill":
            text = f"filling and settling, {self.simulated_s:.2f} s"
        else:
            text = f"t = {self.time_s:.2f} s" + (f", {self.discharged_kg:.2f} kg out" if self.discharged_kg else "")
        left = self.left_s
        return text if left is None else f"{text} · {tqdm.format_interval(round(left))} left"


def run(
    scenario: ScenarioInput,
    *,
    seed: int | None = None,
    threads: int = 0,
    device: str = "cpu",
    progress: bool | Callable[[Progress], object] = True,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_every: float = 30.0,
    from_start: bool = False,
    frames: str | os.PathLike[str] | None = None,
    frame_interval: float = 0.05,
    frame_format: FrameFormat = "both",
    frame_limit_mb: int = 2000,
) -> Result:
    """Simulates a scenario here, without a server. The result has the bits of `roost run`.

    `seed` takes the place of the scenario's. `threads` counts threads of the CPU: 0 is one per processor, and 1 is best where several
    runs go on at once. `device` is `"cpu"`, `"gpu"`, or `"gpu:"` with a part of an adapter's name.

    `progress` shows a bar, or is called with the `Progress` about ten times a second. An exception of the function stops the run.

    `checkpoint` is a file, or a folder in which it is called `checkpoint.roost`. The run continues from it if it exists and
    `from_start` is False. It is written every `checkpoint_every` seconds and at Ctrl-C, and deleted at the end of the run.
    `roost run --checkpoint-every` uses the same file.

    `frames` is a folder for frames: the files of `roost run --frames`, with the same bytes. Frames of an earlier run in it are removed.
    `frame_interval` is the simulated time between frames in seconds, rounded to a multiple of `numerics.output_interval_s`.
    `frame_format` is `"vtk"` for ParaView, `"web"` for `roost.playback.Player`, or `"both"`. `frame_limit_mb` is the maximum size of all
    frames. A run with frames has no checkpoint. `Result.frames` is the folder, also after Ctrl-C.

    Raises `ScenarioError` for a scenario with faults, `Interrupted` (a `KeyboardInterrupt`) with the result so far at Ctrl-C, and
    `RoostError` if the device, the checkpoint or the folder of frames cannot be used. A run that diverges is a result: its `end_reason` is `unstable`.
    """
    if not isinstance(scenario, Scenario):
        scenario = Scenario(scenario)
    if seed is not None:
        scenario = scenario.with_(seed=seed)
    if not (checkpoint_every > 0 and math.isfinite(checkpoint_every)):
        raise ValueError(f"checkpoint_every is {checkpoint_every!r}; allowed: a number of seconds above 0")
    recording = None if frames is None else frame_options(frames, frame_interval, frame_format, frame_limit_mb)
    if recording and checkpoint is not None:
        raise ValueError("frames and checkpoint are both given; allowed: one of them, since a continued run has no earlier frames")

    def simulate(report: Callable[[Progress], object] | None) -> Result:
        return _run(scenario, threads, device, report, checkpoint, checkpoint_every, from_start, recording)

    if not isinstance(progress, bool):
        return simulate(progress)
    if not progress:
        return simulate(None)
    with closing(_Bar()) as bar:
        result = simulate(bar.update)
        bar.finish(result)
        return result


def _run(
    scenario: Scenario,
    threads: int,
    device: str,
    report: Callable[[Progress], object] | None,
    checkpoint: str | os.PathLike[str] | None,
    checkpoint_every: float,
    from_start: bool,
    recording: FrameOptions | None,
) -> Result:
    file = None if checkpoint is None else _file(Path(checkpoint))

    def tell(document: str) -> None:
        if report is not None:
            report(Progress(**json.loads(document)))

    try:
        text, stopped_by, problems = scenario._native.run(
            threads=threads,
            device=device,
            report=None if report is None else tell,
            checkpoint=file,
            checkpoint_every_s=checkpoint_every,
            from_start=from_start,
            frames=recording,
        )
    except _native.Faults as error:
        raise _scenario_error(error) from None
    except _native.Refused as error:
        raise RoostError(*error.args) from None
    for problem in problems:
        warnings.warn(problem, RuntimeWarning, stacklevel=4)
    result = Result(json.loads(text), recording.folder if recording else None)
    if type(stopped_by) is KeyboardInterrupt:
        raise Interrupted(result) from None
    if stopped_by is not None:
        raise stopped_by
    return result


def _file(path: Path) -> Path:
    """The checkpoint file, in a folder that exists."""
    if path.is_dir():
        return path / CHECKPOINT_NAME
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


class _Bar:
    """A progress bar in a terminal or a notebook. Elsewhere, as in a log, it is invisible."""

    def __init__(self) -> None:
        self._bar = draw_bar("simulating", "{desc} {percentage:3.0f}%|{bar}| {unit}", is_shown=True)

    def update(self, progress: Progress) -> None:
        self._show(progress.fraction, str(progress))

    def finish(self, result: Result) -> None:
        self._show(1.0, f"{tqdm.format_interval(round(result.document['performance']['wall_s']))} of wall time")

    def close(self) -> None:
        self._bar.close()

    def _show(self, fraction: float, text: str) -> None:
        self._bar.n = fraction
        self._bar.unit = text
        self._bar.refresh()
