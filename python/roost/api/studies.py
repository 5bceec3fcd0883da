"""A study at a server: a question that the server answers by as many runs as it needs."""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from roost import tables
from roost.api.progress import follow
from roost.api.sweeps import Sweep
from roost.api.transport import Transport
from roost.api.units import Units
from roost.errors import RoostError
from roost.models import Asked, Forecast, HandedOut, RunOutcome, StudyAnswer, StudyState, StudyView, Told

if TYPE_CHECKING:
    import pandas


class Study:
    """A study. `view` is its last known state; `refresh()` reads it again."""

    def __init__(self, transport: Transport, units: Units, view: StudyView) -> None:
        self._transport = transport
        self._units = units
        self._path = f"/v1/studies/{view['id']}"
        self.view = view

    def __repr__(self) -> str:
        runs = self.view["runs"]
        return f"<Study {self.id} {self.name!r}, {self.state}: {runs['done']} of {runs['max_runs']} runs>"

    @property
    def id(self) -> str:
        """Its identifier, which is also that of its sweep."""
        return self.view["id"]

    @property
    def name(self) -> str:
        """Its name."""
        return self.view["name"]

    @property
    def state(self) -> StudyState:
        """Its last known state: `running`, `paused`, `finished` or `cancelled`."""
        return self.view["state"]

    @property
    def is_ended(self) -> bool:
        """Whether it is finished or cancelled."""
        return self.state in ("finished", "cancelled")

    @property
    def sentences(self) -> Sequence[str]:
        """The answer so far in sentences."""
        return self.view["answer"]

    @property
    def sweep(self) -> Sweep:
        """The sweep of its runs, with their results, frames and events."""
        return Sweep(self._transport, self._units, self._transport.get(f"/v1/sweeps/{self.id}"))

    def refresh(self) -> Study:
        """Reads its state."""
        return self._set(self._transport.get(self._path))

    def wait(self, timeout_s: float | None = None, *, progress: bool = True) -> Study:
        """Waits until it is finished or cancelled, with a progress bar. Raises `TimeoutError` after `timeout_s` seconds."""

        def describe(study: Study) -> tuple[float, str]:
            runs = study.view["runs"]
            ended = runs["done"] + runs["failed"] + runs["cancelled"]
            text = f"{ended} of at most {runs['max_runs']} runs, {study.state}"
            return (1.0 if study.state == "finished" else ended / max(runs["max_runs"], 1)), text

        return follow("study", self.refresh, describe, lambda study: study.is_ended, timeout_s=timeout_s, progress=progress)

    def answer(self) -> StudyAnswer:
        """The newest answer as numbers.

        `["answer"]["finding"]` has one member, named by the goal; `["answer"]` is null at first.
        """
        answer: StudyAnswer = self._transport.get(f"{self._path}/answer")
        return answer

    def posterior(self) -> pandas.DataFrame:
        """The samples of the parameters that a calibration has found, with short column names and units in `attrs`."""
        answer: dict[str, Any] = dict(self.answer()["answer"] or {})
        finding: dict[str, Any] = answer.get("finding") or {}
        found = finding.get("calibrate")
        if not found:
            raise RoostError("the study has no posterior: it is no calibration, or has no answer yet")
        # One of the factors of a calibration with several tests is the test, which is no parameter.
        parameters = [row["parameter"] for row in found["parameters"]]
        return tables.samples(parameters, found["samples"], self._units)

    def forecast(self) -> Forecast:
        """When it ends, as a range."""
        forecast: Forecast = self._transport.get(f"{self._path}/forecast")
        return forecast

    def pause(self) -> Study:
        """Pauses it and its jobs."""
        return self._set(self._transport.post(f"{self._path}/pause"))

    def resume(self) -> Study:
        """Resumes it and its jobs."""
        return self._set(self._transport.post(f"{self._path}/resume"))

    def cancel(self) -> Study:
        """Ends it, and cancels its jobs. Answer and results stay."""
        return self._set(self._transport.post(f"{self._path}/cancel"))

    def extend(
        self, *, max_runs: int | None = None, low: Mapping[str, float] | None = None, high: Mapping[str, float] | None = None
    ) -> Study:
        """Raises its budget to `max_runs`, and widens ranges: new ends by the pointer of the factor. A finished study goes on."""
        low, high = low or {}, high or {}
        ranges: list[dict[str, Any]] = []
        for pointer in {**low, **high}:
            ends = {name: values[pointer] for name, values in (("low", low), ("high", high)) if pointer in values}
            ranges.append({"pointer": pointer, **ends})
        if ranges:
            self._set(self._transport.post(f"{self._path}/ranges", {"ranges": ranges}))
        if max_runs is not None:
            self._set(self._transport.post(f"{self._path}/budget", {"max_runs": max_runs}))
        return self

    def ask(self, count: int = 1, *, expires_s: float | None = None, key: str | None = None) -> list[HandedOut]:
        """At most `count` (1 to 100) runs for this program. Each has its `run` number, `values`, `seed` and complete `scenario`.

        The list is empty when the study is finished, or needs outcomes first. Tell each outcome, by `tell`.
        """
        document = {"count": count} if expires_s is None else {"count": count, "expires_s": expires_s}
        return self._asked(document, key)["runs"]

    def ask_for(self, points: Sequence[Mapping[str, Any]], *, replicates: int = 1, key: str | None = None) -> list[str]:
        """Makes jobs at points of your own, each with a value by factor. Returns the ids of the jobs."""
        return self._asked({"points": [{"values": dict(point), "replicates": replicates} for point in points]}, key)["jobs"]

    def handed_out(self) -> list[HandedOut]:
        """The runs that were handed out and await their outcome."""
        runs: list[HandedOut] = self._transport.get(f"{self._path}/ask")["runs"]
        return runs

    def tell(self, outcomes: Sequence[RunOutcome]) -> Told:
        """Tells outcomes of runs, such as `{"run": 1, "responses": {"jammed": 0}}` or `{"run": 2, "given_back": True}`."""
        told: Told = self._transport.post(f"{self._path}/tell", {"outcomes": list(outcomes)})
        self._set(told["study"])
        return told

    def _asked(self, document: dict[str, Any], key: str | None) -> Asked:
        asked: Asked = self._transport.post(f"{self._path}/ask", document, key=key or str(uuid.uuid4()))
        self._set(asked["study"])
        return asked

    def _set(self, view: Any) -> Study:
        self.view = view
        return self
