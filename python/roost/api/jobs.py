"""A job at a server: one scenario, from its submission to its result."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from roost.api.events import Event
from roost.api.progress import follow
from roost.api.transport import Transport, quoted
from roost.models import FailureClass, Forecast, JobState, JobView
from roost.protocols import Response

if TYPE_CHECKING:
    from roost.result import Result

_ENDED = ("succeeded", "failed", "cancelled")


class Job:
    """A job. `view` is its last known state; `refresh()` reads it again."""

    def __init__(self, transport: Transport, view: JobView) -> None:
        self._transport = transport
        self._path = f"/v1/jobs/{view['id']}"
        self._etag: str | None = None
        self.view = view

    def __repr__(self) -> str:
        message = self.view.get("failure_message")
        reason = f": {message}" if message else ""
        return f"<Job {self.id}, {self.state}{reason}>"

    @property
    def id(self) -> str:
        """Its identifier."""
        return self.view["id"]

    @property
    def state(self) -> JobState:
        """Its last known state: `queued`, `running`, `succeeded`, `failed` or `cancelled`."""
        return self.view["state"]

    @property
    def is_ended(self) -> bool:
        """Whether it has ended; only a retry changes it again."""
        return self.state in _ENDED

    @property
    def responses(self) -> Mapping[str, Response]:
        """Its scalar results by name; empty before it has succeeded."""
        return self.view["responses"]

    def refresh(self) -> Job:
        """Reads its state."""
        view, self._etag = self._transport.poll(self._path, self._etag)
        self.view = view or self.view
        return self

    def wait(self, timeout_s: float | None = None, *, progress: bool = True) -> Job:
        """Waits for its end, with a progress bar.

        Raises `TimeoutError` after `timeout_s` seconds. Ctrl-C ends only the waiting.
        """

        def describe(job: Job) -> tuple[float, str]:
            if job.is_ended:
                return float(job.state == "succeeded"), job.state
            waiting, made = job.view.get("waiting"), job.view.get("progress")
            return (made["fraction"] if made else 0.0), (f"queued: {waiting['detail']}" if waiting else job.state)

        return follow("job", self.refresh, describe, lambda job: job.is_ended, timeout_s=timeout_s, progress=progress)

    def watch(self) -> Iterator[Event]:
        """Its events until its end, as they happen. An interrupted connection continues where it was cut."""
        for event in self._transport.events(f"{self._path}/events"):
            if event.kind in ("job", "progress"):
                self._set(event.data)
            elif event.kind == "resumed":
                self.refresh()
            yield event
            if self.is_ended:
                return

    def cancel(self) -> Job:
        """Cancels it. A running job stops after the next heartbeat of its worker; its series so far are kept."""
        return self._act("cancel")

    def pause(self) -> Job:
        """Pauses it: no worker claims it, and a running one is preempted with a checkpoint."""
        return self._act("pause")

    def resume(self) -> Job:
        """Ends its pause."""
        return self._act("resume")

    def retry(self, failure: FailureClass | None = None) -> Job:
        """Queues it again after it has failed or was cancelled, or only if its failure has this class."""
        self._set(self._transport.post(f"{self._path}/retry", params={"class": failure}, is_repeatable=False))
        return self

    def document(self) -> dict[str, Any]:
        """Its result document: responses, series, curves, solver, cost, and the scenario as run.

        That of a failed job is partial.
        """
        document: dict[str, Any] = self._transport.get(f"{self._path}/result", timeout_s=120.0)
        return document

    def result(self) -> Result:
        """Its result with tables of its curves, as `roost.run` returns it."""
        from roost.result import Result

        return Result(self.document())

    def series(self, name: str) -> dict[str, Any]:
        """A series such as `discharged_mass`, also of a running job: `name`, `unit`, belt times `t_s` in seconds,
        `values`, `partial`."""
        series: dict[str, Any] = self._transport.get(f"{self._path}/series/{quoted(name)}")
        return series

    def frames(self, path: str | os.PathLike[str]) -> Path:
        """Downloads its frames, if it was submitted with `frame_interval_s`. `roost results --frames` does the same."""
        return self._transport.download(f"{self._path}/frames", Path(path))

    def forecast(self) -> Forecast:
        """When it starts and ends, as ranges."""
        forecast: Forecast = self._transport.get(f"{self._path}/forecast")
        return forecast

    def _act(self, action: str) -> Job:
        self._set(self._transport.post(f"{self._path}/{action}"))
        return self

    def _set(self, view: Any) -> None:
        self.view = view
        self._etag = None
