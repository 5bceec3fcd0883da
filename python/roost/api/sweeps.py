"""A sweep at a server: many jobs of one base scenario, and the tables of their results."""

from __future__ import annotations

import os
import uuid
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from roost import tables
from roost.api.events import Event
from roost.api.jobs import Job
from roost.api.progress import follow
from roost.api.transport import Params, Transport, quoted
from roost.api.units import Units
from roost.errors import RoostError
from roost.models import FailureClass, Forecast, JobSeries, JobState, SweepDifferences, SweepEffects, SweepSpec, SweepView

if TYPE_CHECKING:
    import pandas
    import polars
    import xarray

Format = Literal["csv", "parquet", "xlsx", "json"]
Names = Literal["pointer", "short"]
_FORMATS = ("csv", "parquet", "xlsx", "json")
_PAGE = 5000
_SERIES_PAGE = 200


class Sweep:
    """A sweep. `view` is its last known state; `refresh()` reads it again."""

    def __init__(self, transport: Transport, units: Units, view: SweepView) -> None:
        self._transport = transport
        self._units = units
        self._path = f"/v1/sweeps/{view['id']}"
        self._etag: str | None = None
        self._warned = 0
        self.view = view

    def __repr__(self) -> str:
        """Its jobs by state; after `wait` also how many of them have warnings."""
        counts = [f"{count} {state}" for state, count in _counts(self).items() if count]
        warned = [f"{self._warned} with warnings"] if self._warned else []
        return f"<Sweep {self.id} {self.name!r}: {', '.join(counts + warned)}>"

    @property
    def id(self) -> str:
        """Its identifier."""
        return self.view["id"]

    @property
    def name(self) -> str:
        """Its name."""
        return self.view["name"]

    @property
    def is_ended(self) -> bool:
        """Whether no job is queued or running."""
        return self.view["counts"]["queued"] + self.view["counts"]["running"] == 0

    def refresh(self) -> Sweep:
        """Reads its state."""
        view, self._etag = self._transport.poll(self._path, self._etag)
        if view:
            self.view, self._warned = view, 0
        return self

    def wait(self, timeout_s: float | None = None, *, progress: bool = True) -> Sweep:
        """Waits until every job has ended, with a progress bar, and warns of failed jobs. Then `print(sweep)` says how many
        jobs have warnings (of sweeps with up to 5000 jobs).

        Raises `TimeoutError` after `timeout_s` seconds. Ctrl-C ends only the waiting.
        """

        def describe(sweep: Sweep) -> tuple[float, str]:
            counts = sweep.view["counts"]
            ended = counts["succeeded"] + counts["failed"] + counts["cancelled"]
            return sweep.view["fraction"], f"{ended} of {sum(_counts(sweep).values())} jobs done, {counts['running']} running"

        follow("sweep", self.refresh, describe, lambda sweep: sweep.is_ended, timeout_s=timeout_s, progress=progress)
        failures = {name: count for name, count in _items(self.view.get("failures", {})) if count}
        if failures:
            words = ", ".join(f"{count} {name}" for name, count in failures.items())
            warnings.warn(f"{self.view['counts']['failed']} jobs have failed ({words}): see .jobs(state='failed')", stacklevel=2)
        self._warned = 0
        if sum(_counts(self).values()) <= _PAGE:
            page = self._transport.get(f"{self._path}/results", {"responses": "warning_count", "limit": _PAGE})
            self._warned = sum(bool(row["responses"].get("warning_count")) for row in page["trials"])
        return self

    def watch(self) -> Iterator[Event]:
        """Its events until every job has ended, as they happen. An interrupted connection continues where it was cut."""
        for event in self._transport.events(f"{self._path}/events"):
            if event.kind in ("sweep", "progress", "extended"):
                self._set(event.data)
            elif event.kind == "resumed":
                self.refresh()
            yield event
            if event.kind == "deleted" or self.is_ended:
                return

    def jobs(
        self,
        *,
        state: JobState | None = None,
        failure: FailureClass | None = None,
        point: int | None = None,
        limit: int | None = None,
    ) -> list[Job]:
        """Its jobs, newest first."""
        filters: Params = {"state": state, "failure": failure, "point": point}
        return [Job(self._transport, view) for view in self._transport.items(f"{self._path}/jobs", filters, limit=limit)]

    def cancel(self) -> Sweep:
        """Cancels all jobs that have not ended."""
        return self._act("cancel")

    def pause(self) -> Sweep:
        """Pauses all jobs that have not ended."""
        return self._act("pause")

    def resume(self) -> Sweep:
        """Ends the pause of all jobs."""
        return self._act("resume")

    def retry(self, failure: FailureClass | None = None) -> Sweep:
        """Queues failed and cancelled jobs again, or only those whose failure has this class."""
        self._set(self._transport.post(f"{self._path}/retry", params={"class": failure}, is_repeatable=False, timeout_s=300.0))
        return self

    def extend(
        self,
        *,
        points: int | None = None,
        replicates: int | None = None,
        levels: Mapping[str, Sequence[Any]] | None = None,
        rows: Sequence[Sequence[Any]] | None = None,
        table: str | None = None,
        key: str | None = None,
    ) -> Sweep:
        """Adds points, levels, rows or replicates. A repeat with the same `key` adds nothing."""
        given = {"points": points, "replicates": replicates, "levels": levels, "rows": rows, "table": table}
        document = {name: value for name, value in given.items() if value is not None}
        self._set(self._transport.post(f"{self._path}/extend", document, key=key or str(uuid.uuid4()), timeout_s=600.0))
        return self

    def delete(self, *, dry_run: bool = False) -> dict[str, Any]:
        """Deletes it permanently, with all results; with `dry_run` it only reports how much that is. Its jobs must have ended."""
        answer = self._transport.send("DELETE", self._path, params={"dry_run": dry_run}, is_repeatable=dry_run, timeout_s=300.0)
        report: dict[str, Any] = answer.json()
        return report

    def spec(self) -> SweepSpec:
        """The submitted document, to change and submit it as another sweep."""
        document: SweepSpec = self._transport.get(f"{self._path}/spec")
        return document

    def forecast(self) -> Forecast:
        """When its first job starts and its last one ends, as ranges."""
        forecast: Forecast = self._transport.get(f"{self._path}/forecast")
        return forecast

    def effects(self) -> SweepEffects:
        """The effect of each factor on each response, with intervals and rank correlations."""
        effects: SweepEffects = self._transport.get(f"{self._path}/effects", timeout_s=600.0)
        return effects

    def compare(self, first: int, second: int) -> SweepDifferences:
        """The difference of each response between two design points: second minus first, with an interval."""
        differences: SweepDifferences = self._transport.get(
            f"{self._path}/differences", {"from": first, "to": second}, timeout_s=600.0
        )
        return differences

    def results(self, *, by: tables.By = "trial", responses: Sequence[str] | None = None) -> tables.Results:
        """Its results with a row per job, or `by="point"` with a row per design point: mean, deviation and 95 % interval.

        `responses` selects some by name. All pages are read.
        """
        query: Params = {"by": _row(by), "limit": _PAGE, "responses": None if responses is None else ",".join(responses)}
        view = self.view
        rows: list[dict[str, Any]] = []
        for page in self._transport.pages(f"{self._path}/results", query):
            rows += page["trials" if by == "trial" else "points"]
            view = page["sweep"]
        return tables.Results(view, by, rows, self._units)

    def to_pandas(self, *, by: tables.By = "trial", responses: Sequence[str] | None = None) -> pandas.DataFrame:
        """Its results as a data frame of pandas with short column names. `attrs["units"]` has the units."""
        return self.results(by=by, responses=responses).to_pandas()

    def to_polars(self, *, by: tables.By = "trial", responses: Sequence[str] | None = None) -> polars.DataFrame:
        """Its results as a data frame of polars with short column names. `results().units` has the units."""
        return self.results(by=by, responses=responses).to_polars()

    def share(self, response: str, word: str | None = None, *, point: int | None = None) -> tables.Share:
        """The share of succeeded jobs in which an indicator is 1, or a response is the word: of one design point, as the
        server computes it, or over all of them."""
        by: tables.By = "trial" if point is None else "point"
        return self.results(by=by, responses=[response]).share(response, word, point=point)

    def jam_share(self, point: int | None = None) -> tables.Share:
        """The share of jammed jobs of one design point, or over all of them, with its 95 % interval."""
        return self.share("jammed", point=point)

    def series(self, name: str, *, samples: int = 200) -> list[JobSeries]:
        """One series of every job that has it, each with at most `samples` (2 to 1000) samples."""
        query: Params = {"samples": samples, "limit": _SERIES_PAGE}
        pages = self._transport.pages(f"{self._path}/series/{quoted(name)}", query)
        return [item for page in pages for item in page["items"]]

    def to_xarray(self, *names: str, samples: int = 200) -> xarray.Dataset:
        """Series of all jobs over time, such as `to_xarray("discharged_mass")`.

        The dimensions are `design`, `seed` and the belt time `t_s`. Factors are coordinates of `design`, and the replicate is one of
        `seed`. If the seeds of the design points differ, as in studies and in sweeps with the factor `/seed`, the second dimension
        is `replicate`, and `seed` is a coordinate of `design` and `replicate`. Jobs with other times are interpolated, and have NaN
        before their first and behind their last sample.
        """
        if not names:
            known = ", ".join(sorted({row["name"] for row in self._units.outputs["series"]}))
            raise RoostError(f"name the series, such as to_xarray('discharged_mass'); there are {known}")
        answers: list[tuple[str, str, list[JobSeries]]] = []
        for name in names:
            pages = list(
                self._transport.pages(f"{self._path}/series/{quoted(name)}", {"samples": samples, "limit": _SERIES_PAGE})
            )
            answers.append((name, pages[-1]["unit"] or "", [item for page in pages for item in page["items"]]))
        return tables.curves(answers, self.results(responses=()), samples)

    def download(
        self,
        path: str | os.PathLike[str],
        *,
        format: Format | None = None,
        by: tables.By = "trial",
        responses: Sequence[str] | None = None,
        names: Names | None = None,
        units: bool = False,
    ) -> Path:
        """Writes its results to a file as CSV, Parquet, Excel or JSON. The format follows from the end of the name unless given.

        Columns of factors have their JSON pointers as names, or with `names="short"` the names of data frames. A workbook of Excel
        has short names and a sheet of units. With `units`, the second line of a CSV file has the units.
        """
        target = Path(path)
        query: dict[str, str | None] = {
            "format": format or _format_of(target),
            "by": _row(by),
            "responses": None if responses is None else ",".join(responses),
            "names": names,
            "units": "true" if units else None,
        }
        return self._transport.download(f"{self._path}/results", target, query)

    def scan_parquet(self, path: str | os.PathLike[str], *, by: tables.By = "trial") -> polars.LazyFrame:
        """Downloads its results as Parquet, and scans the file lazily with polars, with short column names.

        For sweeps that do not fit into memory. `roost.tables.units_of_parquet(path)` has the units of the columns.
        """
        return tables.scan_parquet(self.download(path, format="parquet", by=by))

    def _act(self, action: str) -> Sweep:
        self._set(self._transport.post(f"{self._path}/{action}", timeout_s=300.0))
        return self

    def _set(self, view: Any) -> None:
        self.view = view
        self._etag = None
        self._warned = 0


def _row(by: str) -> str:
    """A meaning of rows that the server knows."""
    if by not in ("trial", "point"):
        raise RoostError(f'by is {by!r}; allowed: "trial" for a row per job, "point" for a row per design point')
    return by


def _counts(sweep: Sweep) -> dict[str, int]:
    return dict(_items(sweep.view["counts"]))


def _items(counts: Any) -> list[tuple[str, int]]:
    return list(counts.items())


def _format_of(target: Path) -> Format:
    for format in _FORMATS:
        if target.suffix.lower() == f".{format}":
            return format  # type: ignore[return-value]
    raise RoostError(f"{target.name} has no known end: use .csv, .parquet, .xlsx or .json, or give the format")
