"""A client of a Roost server: submit, watch, change, and read results.

    from roost import Client

    client = Client()                        # http://127.0.0.1:7373, or ROOST_SERVER and ROOST_TOKEN
    sweep = client.submit_sweep("sweep.json").wait()
    table = sweep.to_pandas(by="point")

Everything goes through the HTTP API, so the package of any version understands servers of other versions as far as
their routes agree.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, TypedDict, Union, overload

from roost import tables
from roost.api import documents
from roost.api.events import Event
from roost.api.jobs import Job
from roost.api.studies import Study
from roost.api.sweeps import Format, Names, Sweep
from roost.api.transport import Params, Transport, Unreachable, quoted
from roost.api.units import Units
from roost.documents import Document, JobInput, Stored, StudyInput, SweepInput
from roost.errors import ApiError, Fault, RoostError
from roost.models import (
    FailureClass,
    JobEnvelope,
    JobState,
    MeshView,
    Needs,
    OutputTable,
    ParameterLibrary,
    QueueDepth,
    StudySpec,
    SweepSpec,
    ValidationReport,
    VersionView,
    WorkerView,
)

if TYPE_CHECKING:
    # Part of typing from Python 3.11 on; type checkers know it in any case.
    from typing_extensions import Unpack

    from roost.fields import ScenarioDocument
    from roost.scenario import Scenario

__all__ = ["Client", "Event", "Format", "Job", "Options", "Study", "Sweep", "Unreachable"]

Id = Union[str, uuid.UUID]


class Options(TypedDict, total=False):
    """Options of a submission. Each takes the place of the field of its name in the document."""

    key: str
    """Idempotency key of 1 to 255 characters: a repeat within a day with the same key and document creates nothing.
    Random unless given."""
    priority: int
    """Jobs of higher priority are claimed first; -100 to 100."""
    labels: Mapping[str, str]
    """Texts by key, for filters."""
    needs: Needs
    """Needs of the jobs, such as `{"backend": "gpu"}`."""
    max_wall_s: float
    """Maximum wall time of an attempt, in seconds."""
    frame_interval_s: float
    """Simulated time between recorded frames, in seconds. Studies record none."""
    cache: Literal["use", "bypass"]
    """`bypass` runs jobs even if equal scenarios have results."""
    shared_fill: bool
    """Whether runs may start from filled states of other runs. No result depends on it."""


class Client:
    """A server. Threads may share a client.

    Args:
        url: Its address. The default is the variable ROOST_SERVER, then http://127.0.0.1:7373.
        token: An access token. The default is the variable ROOST_TOKEN. A server without tokens needs none.
        ca: A file with certificates (PEM) of the authorities to trust over https. The default is ROOST_CA, then the system's.
        patience_s: How long a request is repeated, in seconds, while the server does not answer or is busy.
    """

    def __init__(
        self,
        url: str | None = None,
        token: str | None = None,
        *,
        ca: str | os.PathLike[str] | None = None,
        patience_s: float = 30.0,
    ) -> None:
        self._transport = Transport(url, token, ca=ca, patience_s=patience_s)
        self._units = Units(self._transport)

    def __repr__(self) -> str:
        return f"<Client of {self.url}>"

    def __enter__(self) -> Client:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections."""
        self._transport.close()

    @property
    def url(self) -> str:
        """The address of the server."""
        return self._transport.url

    # Submissions

    @overload
    def submit(self, document: SweepSpec, **options: Unpack[Options]) -> Sweep: ...
    @overload
    def submit(self, document: StudySpec, **options: Unpack[Options]) -> Study: ...
    @overload
    def submit(self, document: JobEnvelope | ScenarioDocument | Scenario, **options: Unpack[Options]) -> Job: ...
    @overload
    def submit(self, document: Stored, **options: Unpack[Options]) -> Job | Sweep | Study: ...
    def submit(self, document: Document, **options: Unpack[Options]) -> Job | Sweep | Study:
        """Submits a scenario, a job, a sweep or a study: a dictionary, a `Scenario`, or the path of a JSON file. Editors and type
        checkers know the fields of a dictionary, and `roost.Untyped(fields)` takes one of a type that they do not know.

        Files that it names, such as `{"file": "hopper.stl", "units": "mm"}`, go with it. Their folder is that of the
        file, or the working folder.

        Raises:
            ApiError: The server refuses it; `faults` lists all faults.
            ScenarioError: A file that it names cannot be used; `faults` lists all of them.
        """
        return self._submit(document, None, options)

    def submit_job(self, document: JobInput, **options: Unpack[Options]) -> Job:
        """Submits a scenario, or a job, which has it as `scenario`. See `submit`."""
        job = self._submit(document, "job", options)
        assert isinstance(job, Job)
        return job

    def submit_sweep(self, document: SweepInput, **options: Unpack[Options]) -> Sweep:
        """Submits a sweep. See `submit`."""
        sweep = self._submit(document, "sweep", options)
        assert isinstance(sweep, Sweep)
        return sweep

    def submit_study(self, document: StudyInput, **options: Unpack[Options]) -> Study:
        """Submits a study, also a calibration, whose measurements may be the path of their file. See `submit`."""
        study = self._submit(document, "study", options)
        assert isinstance(study, Study)
        return study

    def validate(self, document: Document) -> ValidationReport:
        """Checks a document, and estimates its cost, without storing it. The meshes that it names are uploaded.

        Raises the errors of `submit`.
        """
        plain, folder = documents.load(document)
        kind = documents.kind_of(plain)
        complete = documents.complete(plain, folder, self._upload)
        path = "/v1/studies/validate" if kind == "study" else "/v1/validate"
        report: ValidationReport = self._transport.post(path, complete, timeout_s=300.0)
        return report

    def _submit(self, document: Any, expected: str | None, options: Options) -> Job | Sweep | Study:
        plain, folder = documents.load(document)
        kind = documents.kind_of(plain)
        if kind == "measurements" or expected not in (None, "job" if kind == "scenario" else kind):
            raise TypeError(f"the document is a {kind}, which submit_{expected or 'job'} does not take")
        if kind == "scenario":
            plain = {"scenario": plain}
        fields = dict(options)
        key = str(fields.pop("key", uuid.uuid4()))
        complete = documents.complete({**plain, **fields}, folder, self._upload)
        try:
            if kind == "study":
                return Study(
                    self._transport, self._units, self._transport.post("/v1/studies", complete, key=key, timeout_s=300.0)
                )
            if kind == "sweep":
                return Sweep(self._transport, self._units, self._transport.post("/v1/sweeps", complete, key=key, timeout_s=900.0))
            return Job(self._transport, self._transport.post("/v1/jobs", complete, key=key))
        except ApiError as error:
            raise (_without_envelope(error) if kind == "scenario" else error) from None

    # Jobs, sweeps and studies that exist

    def job(self, id: Id) -> Job:
        """A job by its id."""
        return Job(self._transport, self._transport.get(f"/v1/jobs/{_known(id, 'job')}"))

    def jobs(
        self,
        *,
        state: JobState | None = None,
        failure: FailureClass | None = None,
        label: str | None = None,
        limit: int | None = 100,
    ) -> list[Job]:
        """Jobs, newest first; all of them with `limit=None`. A `label` is `key` or `key=value`."""
        filters: Params = {"state": state, "failure": failure, "label": label}
        return [Job(self._transport, view) for view in self._transport.items("/v1/jobs", filters, limit=limit)]

    def sweep(self, id: Id) -> Sweep:
        """A sweep by its id."""
        return Sweep(self._transport, self._units, self._transport.get(f"/v1/sweeps/{_known(id, 'sweep')}"))

    def sweeps(self, *, label: str | None = None, limit: int | None = 100) -> list[Sweep]:
        """Sweeps, newest first; all of them with `limit=None`."""
        views = self._transport.items("/v1/sweeps", {"label": label}, limit=limit)
        return [Sweep(self._transport, self._units, view) for view in views]

    def study(self, id: Id) -> Study:
        """A study by its id."""
        return Study(self._transport, self._units, self._transport.get(f"/v1/studies/{_known(id, 'study')}"))

    def studies(self, *, limit: int | None = 100) -> list[Study]:
        """Studies, newest first; all of them with `limit=None`."""
        return [Study(self._transport, self._units, view) for view in self._transport.items("/v1/studies", limit=limit)]

    def download(
        self,
        sweep: Id,
        path: str | os.PathLike[str],
        *,
        format: Format | None = None,
        by: tables.By = "trial",
        names: Names | None = None,
        units: bool = False,
    ) -> Path:
        """Writes the results of a sweep to a file: CSV, Parquet, Excel or JSON. See `Sweep.download`."""
        return self.sweep(sweep).download(path, format=format, by=by, names=names, units=units)

    # The server

    def workers(self) -> list[WorkerView]:
        """All registered workers, newest first."""
        return list(self._transport.items("/v1/workers"))

    def drain(self, worker: Id) -> None:
        """Asks a worker to finish its jobs and exit."""
        self._transport.post(f"/v1/workers/{quoted(worker)}/drain")

    def queue_depth(self) -> QueueDepth:
        """How many jobs a worker could claim now."""
        depth: QueueDepth = self._transport.get("/v1/queue/depth")
        return depth

    def version(self) -> VersionView:
        """The versions of server, API and solver."""
        version: VersionView = self._transport.get("/v1/version")
        return version

    def outputs(self) -> OutputTable:
        """The table of results: every response, series and curve with unit, meaning and experiments."""
        return self._units.outputs

    def parameters(self) -> ParameterLibrary:
        """Published properties of meat, poultry and fish, with their sources."""
        library: ParameterLibrary = self._transport.get("/v1/parameters")
        return library

    def upload_mesh(self, path: str | os.PathLike[str]) -> MeshView:
        """Uploads an STL file. Documents name it by the `digest` of the answer; `submit` does all this by itself."""
        return self._upload_mesh(Path(path).read_bytes())

    def meshes(self) -> Iterator[MeshView]:
        """The stored meshes, newest first."""
        yield from self._transport.items("/v1/meshes")

    def _upload(self, content: bytes) -> str:
        return self._upload_mesh(content)["digest"]

    def _upload_mesh(self, content: bytes) -> MeshView:
        answer = self._transport.send(
            "POST", "/v1/meshes", content=content, headers={"content-type": "model/stl"}, timeout_s=300.0
        )
        mesh: MeshView = answer.json()
        return mesh


def _known(id: Id, kind: Literal["job", "sweep", "study"]) -> str:
    """An identifier as a part of a path."""
    try:
        return str(uuid.UUID(str(id)))
    except ValueError:
        lists = "studies" if kind == "study" else f"{kind}s"
        raise RoostError(f"{id!r} is not the id of a {kind}: client.{lists}() lists them") from None


def _without_envelope(error: ApiError) -> ApiError:
    """The error with pointers into the scenario, which the caller gave without an envelope."""
    faults = [Fault(fault.pointer.removeprefix("/scenario"), fault.value, fault.detail, fault.allowed) for fault in error.faults]
    return ApiError(error.status, error.title, error.detail, faults, error.request_id)
