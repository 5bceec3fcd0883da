"""The documents of the HTTP API as types, such as `SweepSpec` of a submission and `JobView` of an answer.

Generated: write it with `python3 python/generate.py`, and change the Rust types or the field table instead.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeAlias, TypedDict

from roost.fields import ScenarioDocument
from roost.protocols import Array, HasDocument, Response

if sys.version_info >= (3, 11):
    from typing import NotRequired
else:
    from typing_extensions import NotRequired


AttemptOutcome: TypeAlias = Literal["succeeded", "invalid", "unstable", "worker", "lost", "timeout", "released", "preempted", "cancelled"]
"""How an attempt ended."""

Cache: TypeAlias = Literal["use", "bypass"]
"""Whether a cached result of an equal scenario may be used."""

DesignKind: TypeAlias = Literal["grid", "one_at_a_time", "random", "latin_hypercube", "sobol", "box_behnken", "list", "csv"]
"""How levels are combined to design points."""

Directive: TypeAlias = Literal["continue", "cancel", "preempt", "abandon"]
"""A directive for one attempt."""

Driver: TypeAlias = Literal["server", "client"]
"""The party that runs the proposals of a study."""

EndReason: TypeAlias = Literal["duration", "empty", "jammed", "done", "fill_not_at_rest", "unstable", "cancelled"]
"""Why a run ended."""

FailureClass: TypeAlias = Literal["invalid", "unstable", "worker", "lost", "timeout"]
"""Why a job failed. Retries can select a class."""

FilledBy: TypeAlias = Literal["attempt", "shared"]
"""Where the filled state of an attempt came from."""

JobState: TypeAlias = Literal["queued", "running", "succeeded", "failed", "cancelled"]
"""The state of a job."""

LearnedFrom: TypeAlias = Literal["sweep", "backend", "nothing"]
"""The finished runs that a forecast learned from."""

MeshFormat: TypeAlias = Literal["binary", "ascii"]
"""Format of an STL file."""

Pairing: TypeAlias = Literal["by_seed", "additive_model", "unpaired"]
"""How an interval uses the seeds that design points have in common."""

ParameterStatus: TypeAlias = Literal["interval", "not_published"]
"""Whether an interval is published."""

ParameterTest: TypeAlias = Literal["slide", "bend", "compress", "drop", "hopper", "density", "pull"]
"""A test of `docs/howto/kitchen-tests.md`."""

Phase: TypeAlias = Literal["fill", "process"]
"""The two phases of a run."""

Scale: TypeAlias = Literal["linear", "log"]
"""The scale of values between `low` and `high`."""

StudyEnd: TypeAlias = Literal["by_rule", "by_budget", "nothing_left"]
"""The reason why a study is finished."""

StudyState: TypeAlias = Literal["running", "paused", "finished", "cancelled"]
"""The state of a study."""

WaitReason: TypeAlias = Literal["paused", "retry_pause", "budget_used", "no_worker", "no_fitting_worker", "waiting_for_fill", "needs_idle_worker", "behind", "workers_busy", "next"]
"""Why a queued job waits."""

class Ask(TypedDict):
    """A request for runs: the study's next ones for the client to run, or jobs at points of the client."""

    count: NotRequired[int | None]
    """Maximum number of runs that the client will run itself; 1 unless given. The answer has their scenarios, so at
    most 100."""
    expires_s: NotRequired[float | None]
    """Seconds after which a run without an outcome may be handed out again; a day unless given."""
    points: NotRequired[list[AskedPoint] | None]
    """Points at which the server makes jobs, in place of `count`."""


class Asked(TypedDict):
    """The answer to a request for runs."""

    jobs: list[JobId]
    """Jobs at the points of the client."""
    runs: list[HandedOut]
    """Runs for the client. Fewer than asked when the budget has no room for more, or when further runs need the
    outcomes of these."""
    study: StudyView
    """The study."""


class AskedPoint(TypedDict):
    """A point of the client."""

    replicates: NotRequired[int]
    """Number of further runs at the point."""
    values: Mapping[str, Any]
    """Value by factor, in the unit of the factor's field, or a level. Numbers are rounded to about seven digits of the
    range."""


class AttemptBeat(TypedDict):
    """The heartbeat of one attempt."""

    attempt: int
    """Number of the attempt."""
    job_id: JobId
    """The job."""
    progress: NotRequired[Progress | None]
    samples: NotRequired[list[SeriesPart]]
    """New samples, or the first of many. The server ignores samples that it has."""
    t0_s: NotRequired[float | None]
    """Simulated time of t = 0, in seconds; null until it is known."""


class AttemptDirective(TypedDict):
    """The server's directive for one attempt."""

    attempt: int
    """Number of the attempt."""
    directive: Directive
    """The directive."""
    job_id: JobId
    """The job."""
    lease_expires_at: NotRequired[str | None]
    """End of the renewed lease; null unless `continue`."""
    missing_samples: NotRequired[Mapping[str, int]]
    """Series whose earlier samples the server lacks, with the number that it has: continue from there."""
    resend_samples: NotRequired[bool]
    """Whether `missing_samples` has entries. Older workers read this field, and send all samples again."""


class AttemptResult(TypedDict):
    """The result of one of several attempts."""

    attempt: int
    """Number of the attempt."""
    delivery: ResultDelivery
    """Its result."""
    job_id: JobId
    """The job."""


class BudgetChange(TypedDict):
    """A change of a study's budget."""

    max_runs: int
    """The new maximum number of runs; above the present one."""


class CheckpointOrder(TypedDict):
    """The checkpoints that a worker records."""

    interval_s: float
    """Wall time between checkpoints, in seconds."""
    limit_bytes: int
    """Maximum size of a checkpoint, in bytes."""


class CheckpointReceipt(TypedDict):
    """The answer to a part of an upload."""

    received: int
    """Bytes that the server has: the `offset` of the next part."""
    recorded: bool
    """Whether the checkpoint is complete and recorded."""


class CheckpointView(TypedDict):
    """The stored checkpoint of a job."""

    attempt: int
    """The attempt that recorded it."""
    backend: str
    """Its backend."""
    bytes: int
    """Its size in bytes."""
    device: str
    """Its device in words."""
    digest: str
    """BLAKE3 hash of its bytes, in hexadecimal."""
    simulated_s: float
    """Simulated time since the beginning of the run, in seconds."""
    solver_revision: int
    """`SOLVER_REVISION` of its solver. Only workers with the same revision, backend and device can continue from it."""


class ClaimReply(TypedDict):
    """The answer to a claim."""

    attempts: list[ClaimedAttempt]
    """The attempts now leased to the worker; empty when there is no work."""


class ClaimRequest(TypedDict):
    """A worker's request for jobs."""

    max_jobs: int
    """Maximum of jobs."""
    request_id: str
    """Identifier of the claim: a repeat after a lost reply returns the same attempts."""
    shares_fills: NotRequired[bool]
    """Whether the worker starts from stored fills and uploads those that it computes. Jobs with a fill that a running
    attempt computes are then passed over."""
    wait_s: float
    """Time that the server waits for work before it answers without any, in seconds."""
    worker_id: WorkerId
    """The worker."""


class ClaimedAttempt(TypedDict):
    """A leased execution of a job."""

    attempt: int
    """Number of the attempt, from 1; it fences every write."""
    checkpoint: NotRequired[CheckpointView | None]
    checkpoints: NotRequired[CheckpointOrder | None]
    fill: NotRequired[FillOrder | None]
    frames: NotRequired[FramesOrder | None]
    job_id: JobId
    """The job."""
    lease_expires_at: str
    """End of the lease, unless it is renewed."""
    max_wall_s: NotRequired[float | None]
    """Maximum wall time, in seconds."""
    scenario: Mapping[str, Any]
    """The scenario with all defaults."""
    shared_fill: NotRequired[bool]
    """Whether the run may start from a filled state that another run left, and leave its own."""


class CostForecast(TypedDict):
    """The forecast of a document that is not submitted."""

    basis: NotRequired[ForecastBasis | None]
    duration: NotRequired[DurationRange | None]
    end: NotRequired[TimeRange | None]
    no_forecast: NotRequired[str | None]
    """Why there is no duration; null with one."""
    processor: NotRequired[DurationRange | None]
    runs: RunRange
    """Number of runs."""


class Curve(TypedDict):
    """A quantity over something other than time."""

    name: str
    """Name, such as `stress`."""
    over: str
    """The quantity along the curve, such as `strain` or `fillet`."""
    over_unit: str
    """Unit of that quantity."""
    unit: str
    """Unit, such as `Pa`."""
    values: list[float]
    """The values, as many."""
    x: list[float]
    """Values of that quantity."""


class CurveRow(TypedDict):
    """A quantity over something other than time."""

    experiments: list[str]
    """Experiments that return it."""
    headline: bool
    """Whether pictures of a result show it."""
    meaning: str
    """Meaning."""
    name: str
    """Name."""
    over: str
    """Quantity along the curve."""
    over_unit: str
    """Unit of that quantity, `1` without one."""
    per_body: bool
    """Whether each point is of one body, with no value between two points."""
    unit: str
    """Unit, `1` without one."""


class Deletion(TypedDict):
    """The data that the deletion of a sweep removes."""

    attempts: int
    """Attempts of the jobs."""
    dry_run: bool
    """Whether this is a dry run, which deletes nothing."""
    frames_bytes: int
    """Size of the frames, in bytes."""
    jobs: int
    """Jobs."""
    points: int
    """Design points."""
    results: int
    """Results, which no later submission can use."""
    unended: int
    """Jobs that have not ended. While there are any, nothing is deleted."""


class Design(TypedDict):
    """How levels are combined to design points. The description of a field names the kinds that take it."""

    kind: DesignKind
    """The kind."""
    points: NotRequired[int | None]
    """Number of points: `random`, `latin_hypercube` and `sobol`."""
    rows: NotRequired[Sequence[Sequence[Any] | Array] | Array | None]
    """`list`: a row for each point, with a value for each factor in order."""
    seed: NotRequired[int | None]
    """Seed of these points, independent of the seeds of jobs; 1 unless given."""
    table: NotRequired[str | None]
    """`csv`: the text of a CSV file, with a column for each factor under its pointer, and a line for each point."""
    file: NotRequired[str]
    """`csv`: the path of a CSV file, in place of `table`."""


class DesignPoint(TypedDict):
    """A design point and its levels."""

    factors: Mapping[str, Any]
    """Levels by factor."""
    point: int
    """Its index."""


class DurationRange(TypedDict):
    """A range of a duration, in seconds."""

    longest_s: float
    """The longer one."""
    shortest_s: float
    """The shorter one."""


class Estimate(TypedDict):
    """The cost of a scenario, estimated without running it."""

    bonds: int
    """Bonds."""
    fillets: int
    """Fillets."""
    mass_kg: float
    """Mass of all fillets, in kilograms."""
    memory_bytes: int
    """Memory of the CPU backend, in bytes."""
    stable_timestep_s: float
    """Largest stable time step without damping, 2/ω_max, in seconds."""
    steps: int
    """Time steps, an upper bound."""
    subparticles: int
    """Sub-particles."""
    timestep_s: float
    """Time step that will be used, in seconds."""
    wall_s: float
    """Rough wall time on two cores, in seconds."""
    warnings: list[str]
    """Warnings."""


class Extension(TypedDict):
    """An extension of a sweep: more points of the same design, more replicates of all points, or both."""

    levels: NotRequired[Mapping[str, Sequence[Any] | Array] | None]
    """`grid` and `one_at_a_time`: further levels by factor."""
    points: NotRequired[int | None]
    """`random` and `sobol`: number of further points of the same sequence."""
    replicates: NotRequired[int | None]
    """Every design: number of further replicates of each point, with the next seeds."""
    rows: NotRequired[Sequence[Sequence[Any] | Array] | Array | None]
    """`list` and `csv`: further rows, as in the design."""
    table: NotRequired[str | None]
    """`list` and `csv`: further rows as the text of a CSV file."""


class Factor(TypedDict):
    """A factor: one field, or several fields with the same value, and its levels or range."""

    count: NotRequired[int | None]
    """Number of levels from `low` to `high` in a `grid` or `one_at_a_time`; 2 unless given."""
    high: NotRequired[float | None]
    """The highest value of the range. Values of an integer field are integers."""
    levels: NotRequired[Sequence[Any] | Array | None]
    """Its levels: numbers, words, or any value of the field."""
    low: NotRequired[float | None]
    """In place of levels: the lowest value of the range."""
    pointer: NotRequired[str | None]
    """JSON pointer of the scenario field."""
    pointers: NotRequired[list[str] | None]
    """In place of `pointer`: several fields with the same value. The first one names the factor."""
    scale: NotRequired[Scale | None]


class FactorEffect(TypedDict):
    """The effect of one factor on one response."""

    effect: NotRequired[float | None]
    """Main effect: the change of the response over the range of the factor, along the straight line of least squares
    (over logarithms on a log scale). Null for factors that are not numbers or do not vary."""
    factor: str
    """Name of the factor."""
    high_95: NotRequired[float | None]
    """Its upper end."""
    levels: list[LevelEffect]
    """Mean response at each level, for up to twelve levels."""
    low_95: NotRequired[float | None]
    """Lower end of its 95 % interval, from two replicates on: how far other seeds would move the effect at these design
    points."""
    p_value: NotRequired[float | None]
    """Two-sided p-value of the rank correlation (Student's t), from three design points on."""
    rank_correlation: NotRequired[float | None]
    """Rank correlation of factor and response (Spearman), −1 to 1. Null for factors that are not numbers or do not
    vary."""
    width_ratio: NotRequired[float | None]
    """Width of the interval divided by the width of the unpaired one; null when it is unpaired or nothing varies."""


class FailureCounts(TypedDict):
    """Number of failed jobs of each class."""

    invalid: int
    """The solver refused the scenario."""
    lost: int
    """Their leases expired."""
    timeout: int
    """Stopped after `max_wall_s`."""
    unstable: int
    """The simulation diverged."""
    worker: int
    """No worker could run them."""


class FailureReport(TypedDict):
    """The report of an attempt that ended without a result. Repeating it is safe."""

    message: str
    """The reason in words."""
    outcome: AttemptOutcome
    """Outcome: `invalid`, `unstable`, `worker`, `timeout`, `released`, `preempted` or `cancelled`."""
    result: NotRequired[RunResult | None]
    worker_id: WorkerId
    """The worker that ran it."""


class FillOrder(TypedDict):
    """The fill of a claimed attempt."""

    limit_bytes: int
    """Maximum size of an uploaded fill, in bytes."""
    stored: NotRequired[StoredFill | None]


class Forecast(TypedDict):
    """The forecast of a job, a sweep or a study."""

    basis: NotRequired[ForecastBasis | None]
    end: NotRequired[TimeRange | None]
    made_at: str
    """When it was made."""
    no_forecast: NotRequired[str | None]
    """Why there is no forecast; null with one."""
    runs_left: RunRange
    """Runs that are left: of a study a range, since its rule may end it early."""
    start: NotRequired[TimeRange | None]
    waiting: list[WaitCount]
    """Queued jobs by the reason why they wait."""


class ForecastBasis(TypedDict):
    """The facts that a forecast rests on."""

    finished_runs: int
    """Number of finished runs that it learned from."""
    learned_from: LearnedFrom
    """Kind of these runs."""
    share: float
    """Share of forecasts whose range holds the true time."""
    slots: int
    """Jobs that these workers run at the same time."""
    time_ratio: float
    """Measured wall time over the estimate of the check: the median of these runs."""
    workers: int
    """Online workers that can take the jobs."""


class FramesOrder(TypedDict):
    """The frames that a worker records."""

    interval_s: float
    """Simulated time between frames, in seconds."""
    limit_bytes: int
    """Maximum size of the stream, in bytes."""


class FramesView(TypedDict):
    """The stored frames of a job."""

    bytes: int
    """Bytes of the stream."""
    count: int
    """Number of frames."""
    stopped: NotRequired[str | None]
    """Why recording stopped before the end of the job, if it did."""


class HandedOut(TypedDict):
    """A run that a client was given."""

    expires_at: str
    """When it may be handed out again."""
    replicate: int
    """Its replicate at the point."""
    run: int
    """Its number within the study, by which its outcome is told."""
    scenario: ScenarioDocument
    """Its complete scenario."""
    seed: int
    """Its seed."""
    values: Mapping[str, Any]
    """Value by factor, in the unit of the factor's field."""


class Health(TypedDict):
    """A healthy server."""

    status: str
    """Always `ok`."""


class HeartbeatReply(TypedDict):
    """The answer to a heartbeat."""

    attempts: list[AttemptDirective]
    """A directive for each attempt, in the order of the request."""
    drain: bool
    """Whether the worker must claim no more jobs."""


class HeartbeatRequest(TypedDict):
    """The heartbeat of a worker, for all its attempts."""

    attempts: list[AttemptBeat]
    """Every attempt that the worker holds."""


class Instability(TypedDict):
    """Where and why the physics diverged."""

    reason: str
    """The reason, in words."""
    step: int
    """Step number, counted from the start of the fill."""
    time_s: float
    """Belt time, in seconds."""


class JobEnvelope(TypedDict):
    """A submitted job. The scenario is a field of its own, so that its digest covers the physics alone."""

    cache: NotRequired[Cache]
    """Whether a cached result may be used."""
    frame_interval_s: NotRequired[float | None]
    """Simulated time between recorded frames, in seconds; no frames unless given."""
    labels: NotRequired[Mapping[str, str]]
    """Free labels, at most 64 with keys and values of at most 256 bytes."""
    max_wall_s: NotRequired[float | None]
    """Maximum wall time of an attempt, in seconds."""
    needs: NotRequired[Needs]
    """Requirements on the worker."""
    priority: NotRequired[int]
    """Jobs of higher priority are claimed first. Values outside -100 to 100 need a token with the scope `admin`."""
    scenario: ScenarioDocument | HasDocument
    """The scenario document."""
    shared_fill: NotRequired[bool]
    """Whether the run may start from a filled state that another run left, and leave its own. No result depends on it.
    """


JobId: TypeAlias = "str"
"""A job: one scenario to run."""

class JobSeries(TypedDict):
    """The series of one job, with a limited number of samples."""

    job_id: JobId
    """The job."""
    partial: bool
    """Whether the job is still running."""
    point: int
    """Design point."""
    replicate: int
    """Replicate."""
    state: JobState
    """State of the job."""
    t_s: list[float]
    """Belt times, in seconds."""
    values: list[float]
    """The samples, as many."""


class JobView(TypedDict):
    """A job as the API shows it."""

    alone: bool
    """Whether it runs alone on a worker, because it was lost together with other jobs."""
    attempt: int
    """Number of its newest attempt; 0 before the first."""
    cancelling: bool
    """Whether its cancellation was requested and is not complete."""
    checkpoint: NotRequired[CheckpointView | None]
    ended_at: NotRequired[str | None]
    """When it ended."""
    factors: Mapping[str, Any]
    """Levels of the factors at its design point, by JSON pointer."""
    failure_class: NotRequired[FailureClass | None]
    failure_message: NotRequired[str | None]
    """Why it failed, in words."""
    filled_by: NotRequired[FilledBy | None]
    frames: NotRequired[FramesView | None]
    from_cache: bool
    """Whether the result is a cached one, without an attempt."""
    id: JobId
    """Its identifier."""
    labels: Mapping[str, str]
    """Its labels, or those of its sweep."""
    paused: NotRequired[bool]
    """Whether it is paused: no worker claims it. A running job is still being stopped."""
    point: NotRequired[int | None]
    """Index of its design point in the sweep."""
    priority: int
    """Jobs of higher priority are claimed first."""
    progress: NotRequired[Progress | None]
    project: NotRequired[str]
    """The project of this token."""
    replicate: NotRequired[int | None]
    """Replicate of the design point."""
    responses: Mapping[str, Response]
    """Scalar results, once succeeded."""
    resumed_from_s: NotRequired[float | None]
    """Simulated time from which its newest attempt continues, in seconds; null if it began at zero."""
    retry_at: NotRequired[str | None]
    """Earliest time of the next attempt of a failed job that is queued again."""
    scenario_digest: str
    """Digest of its scenario."""
    seed: int
    """Seed of its scenario."""
    shared_fill: NotRequired[bool]
    """Whether its run may start from a filled state that another run left, and leave its own."""
    started_at: NotRequired[str | None]
    """When its newest attempt was claimed."""
    state: JobState
    """Its state."""
    submitted_at: str
    """When it was submitted."""
    sweep_id: NotRequired[SweepId | None]
    user: NotRequired[str | None]
    """The user whose token created it; null if unknown, as without tokens."""
    waiting: NotRequired[Waiting | None]
    worker_id: NotRequired[WorkerId | None]


class LevelEffect(TypedDict):
    """The response at one level of a factor."""

    effect: float
    """This mean minus the mean over all points."""
    high_95: NotRequired[float | None]
    """Its upper end."""
    level: Any
    """The level."""
    low_95: NotRequired[float | None]
    """Lower end of the 95 % interval of the effect, from two replicates on."""
    mean: float
    """Mean response over these points."""
    points: int
    """Number of design points with this level."""


class MeshReport(TypedDict):
    """A mesh as a scenario reads it."""

    closed: bool
    """Whether it encloses a volume, without open edges."""
    degenerate: int
    """Triangles without an area, which have no effect."""
    digest: str
    """Digest of the file."""
    open_edges: int
    """Edges of an odd number of triangles, as at holes."""
    placed_m: NotRequired[list[list[float]] | None]
    """Lowest and highest corner of its box in the axes of the scenario, in metres, after `orientation_deg` and
    `position_m` of the first surface that names it. Rounded to a micrometre. Null for the shape of a product."""
    pointer: str
    """Pointer of the first field that names it."""
    size_m: list[float]
    """Size of its bounding box in x, y and z, in metres."""
    triangles: int
    """Number of triangles."""
    turned_edges: int
    """Edges between triangles of opposite orientation."""
    units: str
    """Unit of its numbers by the scenario: `mm` or `m`."""


class MeshView(TypedDict):
    """A mesh as the API shows it. Its lengths have the unit that a scenario states, in single precision as in binary
    files. `degenerate` and the counts of edges hold after welding in millimetres, or in metres where the size is too
    small for millimetres."""

    bytes: int
    """Size of the file, in bytes."""
    closed: bool
    """Whether it encloses a volume, without open edges."""
    degenerate: int
    """Triangles without an area, which have no effect."""
    digest: str
    """BLAKE3 of the file, in hexadecimal."""
    format: MeshFormat
    """Its format."""
    high: list[float]
    """Maximum x, y and z."""
    low: list[float]
    """Minimum x, y and z."""
    open_edges: int
    """Edges of an odd number of triangles, as at holes."""
    size: list[float]
    """Size of its bounding box in x, y and z."""
    triangles: int
    """Number of triangles."""
    turned_edges: int
    """Edges between triangles of opposite orientation."""
    uploaded_at: str
    """When it was uploaded."""


class Needs(TypedDict):
    """Requirements of a job on its worker."""

    backend: NotRequired[str | None]
    """Name of the backend, such as `cpu`, of at most 256 bytes; any when null."""
    memory_mib: NotRequired[int | None]
    """Memory of the device, in MiB; any when null."""


class NeedsDepth(TypedDict):
    """The queued jobs with the same needs, and the workers that could claim them."""

    finished_runs: int
    """Number of finished runs that the expectation rests on; 0 for the check's rough estimate."""
    free_slots: int
    """Slots without a job."""
    job_time: DurationRange
    """Expected wall time of one of the jobs: true in about 80 % of the cases."""
    jobs: int
    """Number of queued jobs; an estimate for sweeps of more than 1,000 jobs."""
    needs: Needs
    """Requirements of the jobs on a worker."""
    slots: int
    """Jobs that these workers run at the same time."""
    workers: int
    """Online workers that have what they need."""


class OutputTable(TypedDict):
    """The results of all experiments. One row serves all experiments that show a result alike; a row is unique by name
    and experiment."""

    curves: list[CurveRow]
    """Curves."""
    responses: list[ResponseRow]
    """Responses."""
    series: list[SeriesRow]
    """Series."""


class Page_JobView(TypedDict):
    """One page of a listing."""

    items: list[Mapping[str, Any]]
    """The rows, newest first."""
    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the rows after these; null on the last page."""


class Page_MeshView(TypedDict):
    """One page of a listing."""

    items: list[Mapping[str, Any]]
    """The rows, newest first."""
    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the rows after these; null on the last page."""


class Page_ProjectView(TypedDict):
    """One page of a listing."""

    items: list[Mapping[str, Any]]
    """The rows, newest first."""
    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the rows after these; null on the last page."""


class Page_StudyView(TypedDict):
    """One page of a listing."""

    items: list[Mapping[str, Any]]
    """The rows, newest first."""
    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the rows after these; null on the last page."""


class Page_SweepView(TypedDict):
    """One page of a listing."""

    items: list[Mapping[str, Any]]
    """The rows, newest first."""
    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the rows after these; null on the last page."""


class Page_WorkerView(TypedDict):
    """One page of a listing."""

    items: list[Mapping[str, Any]]
    """The rows, newest first."""
    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the rows after these; null on the last page."""


class PairingGain(TypedDict):
    """How much narrower intervals are by pairing."""

    intervals: int
    """Number of paired intervals."""
    median_width_ratio: NotRequired[float | None]
    """Median of the widths of paired intervals, each divided by the width of the unpaired interval (Welch). Null
    without a paired interval."""
    sentence: str
    """The same in words."""


class ParameterEntry(TypedDict):
    """A property of a product: an interval, or the test that would measure it."""

    conditions: str
    """Conditions of the measurement, and how the interval follows from the published numbers."""
    counterpart: str
    """Surface or product that it touches; empty without one."""
    deviation: NotRequired[float | None]
    """Published deviation of the replicates."""
    fields: list[str]
    """JSON pointers of the scenario's fields."""
    high: NotRequired[float | None]
    """Upper end."""
    low: NotRequired[float | None]
    """Lower end."""
    mapping: str
    """Relation of the property to the parameter of the model."""
    n: NotRequired[int | None]
    """Published number of replicates."""
    place: str
    """Section, table or figure of the source."""
    product: str
    """Product."""
    single_value: NotRequired[float | None]
    """Without an interval: a value that was published without a deviation."""
    source: str
    """Key of the source."""
    status: ParameterStatus
    """Whether the entry has an interval."""
    test: ParameterTest
    """Test that measures the property."""
    unit: str
    """Unit of the numbers: that of the fields."""


class ParameterLibrary(TypedDict):
    """Properties by field, with their sources."""

    entries: list[ParameterEntry]
    """The entries."""
    schema: str
    """Format: `roost.parameters/1`."""
    sources: list[ParameterSource]
    """Sources, which entries name by `key`."""


class ParameterSource(TypedDict):
    """A publication."""

    citation: str
    """Authors, year, title and journal, as far as the page that was read states them."""
    key: str
    """Name by which entries refer to the source."""
    read: str
    """Part of the publication that was read."""
    short: str
    """Short name, such as authors and year."""
    url: str
    """Address of the page that was read, or its DOI."""


class Performance(TypedDict):
    """The cost of a run."""

    ns_per_particle_step: float
    """Wall time per particle-step, in nanoseconds."""
    particle_steps: int
    """Sub-particle updates really done (the bed empties)."""
    steps: int
    """Time steps done."""
    subparticles: int
    """Sub-particles at the start."""
    wall_s: float
    """Wall time, in seconds."""


class PointRow(TypedDict):
    """The results of one design point over its replicates."""

    counts: StateCounts
    """Its trials by state."""
    factors: Mapping[str, Any]
    """Levels by factor."""
    point: int
    """Design point."""
    responses: Mapping[str, Summary]
    """Responses of the successful trials, by name."""
    unstable: int
    """Number of unstable trials, which no mean includes."""


class PosteriorDraws(TypedDict):
    """Parameters that runs draw from samples of a posterior: either of a study, or given as `parameters` and `samples`.
    """

    parameters: NotRequired[list[str] | None]
    """JSON pointers of the parameters."""
    runs_per_sample: NotRequired[int | None]
    """Replicates in a row that have the same sample, with different seeds; 2 unless given. Runs of a study choose
    theirs by their seeds."""
    samples: NotRequired[list[list[float]] | None]
    """Samples: a value for each parameter, in the units of the fields."""
    study: NotRequired[SweepId | None]
    file: NotRequired[str]
    """The path of the answer of a calibration, in place of `parameters` and `samples`."""


class Problem(TypedDict):
    """An error answer."""

    detail: str
    """The cause, and what to do."""
    errors: NotRequired[list[Mapping[str, Any]]]
    """Every fault of the document, if it is invalid."""
    status: int
    """The HTTP status."""
    title: str
    """The problem type in words."""
    type: str
    """Stable name of the problem type, such as `/problems/invalid-scenario`."""


class Progress(TypedDict):
    """The progress of a run."""

    discharged_kg: float
    """Mass that has passed the gate, in kilograms."""
    fraction: float
    """Estimated share of the run that is done, 0 to 1."""
    particle_steps: int
    """Sub-particle updates done."""
    phase: Phase
    """Filling the hopper (t < 0) or running the belt."""
    simulated_s: float
    """Simulated seconds so far, fill included."""
    subparticles: int
    """Sub-particles still in the simulation."""
    time_s: float
    """Belt time, in seconds; negative while filling, counted from the longest fill allowed."""
    wall_s: float
    """Wall time so far, in seconds."""


class ProjectView(TypedDict):
    """A project as the API shows it."""

    budget_core_hours: NotRequired[float | None]
    """Its budget, in core-hours; null without a limit."""
    name: str
    """Its name."""
    queued: int
    """Number of its queued jobs."""
    running: int
    """Number of its running jobs."""
    share: int
    """Jobs of the project per round of claims, while several projects have queued jobs."""
    used_core_hours: float
    """Core-hours that its ended attempts have used: wall time times threads."""


class PrunedSweep(TypedDict):
    """A deleted sweep."""

    ended_at: str
    """When the last job ended."""
    id: SweepId
    """Its identifier."""
    jobs: int
    """Number of its jobs, which are deleted with their attempts and results."""
    name: str
    """Its name."""


class Pruning(TypedDict):
    """The sweeps, jobs and meshes that are deleted."""

    dry_run: bool
    """Whether this is a dry run, which deletes nothing."""
    ended_before: str
    """Sweeps and jobs that ended before this time are deleted."""
    jobs: int
    """Number of jobs without a sweep."""
    meshes: list[str]
    """Digests of meshes that were uploaded before and that no remaining job names."""
    sweeps: list[PrunedSweep]
    """Sweeps whose jobs all ended before, oldest first."""


class QueueDepth(TypedDict):
    """The depth of the queue."""

    by_needs: list[NeedsDepth]
    """The queued jobs by their needs, the largest number first."""
    made_at: str
    """When the server read the queue and the workers. It may be some seconds ago: workers that have registered since
    are not counted."""
    queued: int
    """Queued jobs that a worker could claim now: neither paused nor in a pause after a failure."""
    running: int
    """Running jobs."""
    total: int
    """Both together: a target for scalers that count workers by jobs."""


class RangeChange(TypedDict):
    """A change of a study's ranges."""

    ranges: list[WiderRange]
    """The factors whose ranges grow."""


class Receipt(TypedDict):
    """The answer to a delivery."""

    recorded: bool
    """Whether this delivery was recorded; false if it repeats a recorded one."""


class ResponseDifference(TypedDict):
    """The difference of one response between two design points."""

    difference: float
    """Mean of the second point minus mean of the first."""
    from_mean: float
    """Their mean."""
    from_n: int
    """Number of trials of the first point with a value."""
    high_95: NotRequired[float | None]
    """Its upper end."""
    low_95: NotRequired[float | None]
    """Lower end of the 95 % interval of the difference; null when a point has a single value."""
    pairing: Pairing
    """How the interval uses common seeds."""
    response: str
    """Name of the response."""
    to_mean: float
    """Their mean."""
    to_n: int
    """Number of trials of the second point with a value."""
    width_ratio: NotRequired[float | None]
    """Width of the interval divided by the width of the unpaired one; null when it is unpaired or nothing varies."""


class ResponseEffects(TypedDict):
    """The effects of all factors on one response. Each design point counts once, with the mean of its replicates."""

    factors: list[FactorEffect]
    """An entry for each factor, in the order of the sweep."""
    mean: float
    """Mean over them."""
    pairing: Pairing
    """How intervals use common seeds."""
    points: int
    """Number of design points with a value."""
    response: str
    """Name of the response."""
    seeds: NotRequired[int | None]
    """Number of seeds, if all these points have the same."""


class ResponseRow(TypedDict):
    """A response: a number, an indicator, a word, or true or false."""

    experiments: list[str]
    """Experiments that return it."""
    headline: bool
    """Whether short tables show it."""
    meaning: str
    """Meaning."""
    name: str
    """Name, with its unit last."""
    type: str
    """`number`, `indicator` (1 if an event happened, else 0), `word` or `boolean`."""
    unit: str
    """Unit; empty without one."""


class ResultAnswer(TypedDict):
    """The answer to the result of one attempt."""

    attempt: int
    """Number of the attempt."""
    job_id: JobId
    """The job."""
    problem: NotRequired[Problem | None]
    recorded: bool
    """Whether this request recorded it; false for a repeat of a recorded result, and for a refused one."""


class ResultDelivery(TypedDict):
    """The result of an attempt. Repeating the delivery is safe."""

    filled_by: NotRequired[FilledBy | None]
    result: RunResult
    """The result document."""
    worker_id: WorkerId
    """The worker that ran it."""


class ResultsDelivery(TypedDict):
    """Results of several attempts in one request. Each is recorded or refused on its own."""

    results: list[AttemptResult]
    """The results, from 1 to 64."""


class ResultsReply(TypedDict):
    """The answer to results of several attempts."""

    answers: list[ResultAnswer]
    """An answer for each result, in the order of the request."""


class RunOutcome(TypedDict):
    """The outcome of a run: of one that was handed out (`run`), or of one at a point of the client (`values` and
    `seed`). It has responses, has failed, or is given back."""

    failed: NotRequired[bool]
    """Whether the run ended without a usable result."""
    given_back: NotRequired[bool]
    """Whether the client will not run it: it may then be handed out again."""
    responses: NotRequired[Mapping[str, Response] | None]
    """Responses by name, each one that a measure of the goal uses: a number, true or false; null where the run has
    none."""
    run: NotRequired[int | None]
    """Number of the run that was handed out."""
    seed: NotRequired[int | None]
    """Seed of a run at a point of the client. It tells runs at one point apart."""
    values: NotRequired[Mapping[str, Any] | None]
    """Value by factor of a point of the client."""


class RunRange(TypedDict):
    """A range of a number of runs."""

    least: int
    """At least so many."""
    most: int
    """At most so many."""


class RunResult(TypedDict):
    """The outcome of one simulation."""

    curves: NotRequired[list[Curve]]
    """Quantities over something other than time, such as stress over strain."""
    end_reason: EndReason
    """Why the run ended."""
    instability: NotRequired[Instability | None]
    performance: Performance
    """The cost of the run."""
    responses: Mapping[str, Response]
    """Scalar results by name, units last in the name; null where not reached. Empty for a cancelled run."""
    scenario: Mapping[str, Any]
    """The scenario as run, every default written out."""
    scenario_digest: str
    """blake3 of the canonical JSON of `scenario`, in hex."""
    schema: str
    """Always `roost.result/1`."""
    series: list[Series]
    """Sampled quantities."""
    solver: SolverInfo
    """The solver and its device."""
    warnings: NotRequired[list[Warning]]
    """Conditions under which the result may mislead. Results of solver revision 14 and before lack them."""


class SeedingSweep(TypedDict):
    """A sweep that a study began with, and the number of its runs by use."""

    copied: int
    """Runs that were copied. Those outside the ranges are used once the ranges are wide enough."""
    first_difference: NotRequired[str | None]
    """The first field in which the first of these differs."""
    first_other_level: NotRequired[str | None]
    """The factor and the level of the first of these, such as `/equipment/side_walls = "rough"`."""
    name: str
    """Its name."""
    other_levels: NotRequired[int]
    """Runs left out because a factor lacks their level, or because their value is no number. Wider ranges cannot
    include them."""
    other_revisions: int
    """Runs left out because another revision of the solver made their results."""
    other_scenarios: int
    """Runs left out because their scenario differs from the base in more than the factors and the seed."""
    repeated: int
    """Runs left out because a run with the same values of the factors and the same seed was copied before."""
    shares_seeds: bool
    """Whether copied runs at different points have a seed in common. Intervals take their deviations for independent.
    """
    sweep: SweepId
    """The sweep."""
    without_result: int
    """Runs left out because they have no result."""


class Series(TypedDict):
    """A sampled quantity over belt time."""

    name: str
    """Name, such as `discharged_mass`."""
    t_s: list[float]
    """Belt times of the samples, in seconds."""
    unit: str
    """Unit, such as `kg`."""
    values: list[float]
    """The samples, as many as times."""


SeriesPart = TypedDict(
    "SeriesPart",
    {
        "from": "int",
        "name": "str",
        "t_s": "list[float]",
        "unit": "str",
        "values": "list[float]",
    },
)
"""Consecutive samples of one series. Samples are only appended: a recorded sample never changes."""

class SeriesRow(TypedDict):
    """A quantity sampled over belt time."""

    constant_after_end: bool
    """Whether the last value holds after the end of the simulation."""
    experiments: list[str]
    """Experiments that return it."""
    headline: bool
    """Whether pictures of a result show it."""
    meaning: str
    """Meaning."""
    name: str
    """Name; `<name>` in it stands for the name of a surface."""
    unit: str
    """Unit, `1` without one."""


class ShareInterval(TypedDict):
    """The 95 % interval of a share (Wilson)."""

    high_95: float
    """Upper end."""
    low_95: float
    """Lower end."""


class SolverInfo(TypedDict):
    """The solver and device of a result."""

    backend: str
    """Name of the backend, such as `cpu`."""
    device: str
    """The device, in words: processor and instruction set, or graphics adapter."""
    revision: int
    """Its `SOLVER_REVISION`."""
    threads: int
    """Threads used."""
    timestep_s: float
    """Time step used, in seconds."""
    version: str
    """Version of the solver crate."""


class StateCounts(TypedDict):
    """Number of jobs in each state."""

    cancelled: int
    """Cancelled."""
    failed: int
    """Failed."""
    queued: int
    """Waiting."""
    running: int
    """Running."""
    succeeded: int
    """With a result."""


class StoredFill(TypedDict):
    """A fill that the server has."""

    bytes: int
    """Its size in bytes."""
    digest: str
    """BLAKE3 hash of its bytes, in hexadecimal."""


class StudyAnswer(TypedDict):
    """The answer of a study with its evidence."""

    answer: Mapping[str, Any]
    """Numbers of the answer: `runs`, `excluded` and `finding`, an object with one member named by the goal. Null before
    the first decision."""
    factors: list[Factor]
    """The factors with their present ranges."""
    goal: Mapping[str, Any]
    """The goal, as submitted."""
    seeded_by: NotRequired[list[SeedingSweep]]
    """The sweeps that it began with."""
    study: StudyView
    """The study."""


class StudyBudget(TypedDict):
    """Limits of the number of runs of a study."""

    max_failures: NotRequired[int | None]
    """A point is left out when this many of its runs have failed, and they are at least half of its ended runs; 3
    unless given."""
    max_replicates: NotRequired[int | None]
    """Maximum number of runs at one point; 1,000 unless given."""
    max_runs: int
    """Maximum number of runs in all, failed ones included."""


class StudyRuns(TypedDict):
    """Number of runs of a study by state."""

    cancelled: int
    """Cancelled."""
    done: int
    """With a result."""
    failed: int
    """Failed."""
    max_runs: int
    """The budget."""
    outside_budget: NotRequired[int]
    """Ended runs that the budget does not count: those of the sweeps that it began with, and those at points of
    clients."""
    pending: int
    """Queued, running, or handed out to clients."""


class StudySpec(TypedDict):
    """A submitted study."""

    base: NotRequired[ScenarioDocument | HasDocument]
    """The scenario that the factors vary. Each run has a seed of its own, which the server computes from the seed of
    this scenario, the values of the factors and the replicate. Left out in a calibration, whose tests have scenarios.
    """
    budget: StudyBudget
    """Limits of the number of runs."""
    cache: NotRequired[Cache]
    """Whether cached results may be used."""
    driver: NotRequired[Driver]
    """The party that runs its proposals: the `server` by jobs, or a `client` that asks for them."""
    factors: list[Factor]
    """The factors, each with `low` and `high`, and perhaps `scale`, or with `levels`."""
    goal: Mapping[str, Any]
    """The goal: an object with one member `estimate`, `boundary`, `optimise`, `sensitivity` or `calibrate`."""
    labels: NotRequired[Mapping[str, str]]
    """Free labels, at most 64 with keys and values of at most 256 bytes."""
    max_wall_s: NotRequired[float | None]
    """Maximum wall time of an attempt, in seconds."""
    name: str
    """A name for people, of at most 256 bytes."""
    needs: NotRequired[Needs]
    """Requirements of its jobs on the worker."""
    posterior: NotRequired[PosteriorDraws | None]
    priority: NotRequired[int]
    """Jobs of higher priority are claimed first. Values outside -100 to 100 need a token with the scope `admin`."""
    schema: NotRequired[str | None]
    """`roost.study/1`, or left out."""
    seeded_by: NotRequired[list[SweepId]]
    """Sweeps whose finished runs it begins with. The runs are copied, and the budget does not count them."""


class StudyView(TypedDict):
    """A study as the API shows it."""

    answer: list[str]
    """The answer so far, in sentences, the last of which tells whether the study goes on."""
    answered_at: NotRequired[str | None]
    """When the answer was last computed; null before."""
    factors: list[str]
    """Names of its factors, each the pointer of the factor's first field."""
    finished: NotRequired[StudyEnd | None]
    id: SweepId
    """Its identifier, which is also that of its sweep."""
    name: str
    """Its name."""
    points: int
    """Number of points with runs."""
    question: str
    """The question, in words."""
    runs: StudyRuns
    """Its runs."""
    state: StudyState
    """Its state."""
    submitted_at: str
    """When it was submitted."""


class Summary(TypedDict):
    """One response over the replicates of a design point."""

    chance_deviation: NotRequired[float | None]
    """Standard deviation of runs with the same parameters, where replicates drew parameters from a posterior."""
    high_95: NotRequired[float | None]
    """Its upper end."""
    input_deviation: NotRequired[float | None]
    """Standard deviation of the expected response over the parameters that replicates drew from a posterior."""
    low_95: NotRequired[float | None]
    """Lower end of the 95 % interval of the mean: Student's t from two values on, Wilson for an indicator from one
    value on. With parameters from a posterior the interval includes what is not known of them."""
    mean: NotRequired[float | None]
    """Mean of a numeric response. That of an indicator, such as `jammed`, is the share of trials with 1."""
    n: int
    """Number of trials with a value; null is no value."""
    shares: NotRequired[Mapping[str, ShareInterval] | None]
    """95 % interval of the share of trials with each of these words (Wilson)."""
    standard_deviation: NotRequired[float | None]
    """Standard deviation with n − 1, from two values on."""
    unseen_high_95: NotRequired[float | None]
    """Upper end of that interval for a word that no trial has; its lower end is 0."""
    words: NotRequired[Mapping[str, int] | None]
    """Number of trials with each word, of a response in words."""


SweepDifferences = TypedDict(
    "SweepDifferences",
    {
        "from": "DesignPoint",
        "pairing": "PairingGain",
        "responses": "list[ResponseDifference]",
        "sweep": "SweepView",
        "to": "DesignPoint",
    },
)
"""The differences of the responses between two design points of a sweep."""

class SweepEffects(TypedDict):
    """The effects of a sweep's factors on each response."""

    pairing: PairingGain
    """Effect of pairing on the widths of the intervals of the effects."""
    responses: list[ResponseEffects]
    """An entry for each numeric response by name. A response in words has an entry `name=word` for each word: the share
    of trials with it."""
    sweep: SweepView
    """The sweep."""


SweepId: TypeAlias = "str"
"""A sweep: many jobs from one base scenario."""

class SweepPoints(TypedDict):
    """The results of a sweep by design point."""

    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the rows after these; null when these are the last."""
    points: list[PointRow]
    """A row for each design point, by index."""
    sweep: SweepView
    """The sweep."""


class SweepResults(TypedDict):
    """The result table of a sweep."""

    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the rows after these; null when these are the last."""
    sweep: SweepView
    """The sweep."""
    trials: list[TrialRow]
    """A row for each trial, by design point and replicate."""


class SweepSeries(TypedDict):
    """One series of many jobs of a sweep."""

    items: list[JobSeries]
    """An entry for each job that has the series, by design point and replicate."""
    name: str
    """Name of the series."""
    next_cursor: NotRequired[str | None]
    """Pass as `cursor` to get the jobs after these; null when these are the last."""
    unit: NotRequired[str | None]
    """Its unit; null while no job has it."""


class SweepSpec(TypedDict):
    """A submitted sweep. Replicate r of every design point runs with the seed `base.seed + r`."""

    base: ScenarioDocument | HasDocument
    """The scenario that the factors vary."""
    cache: NotRequired[Cache]
    """Whether cached results may be used."""
    design: Design
    """How levels are combined to design points."""
    factors: NotRequired[list[Factor]]
    """The factors. May be left out with `csv`: each column is then a factor."""
    frame_interval_s: NotRequired[float | None]
    """Simulated time between recorded frames, in seconds; no frames unless given."""
    labels: NotRequired[Mapping[str, str]]
    """Free labels, at most 64 with keys and values of at most 256 bytes."""
    max_wall_s: NotRequired[float | None]
    """Maximum wall time of an attempt, in seconds."""
    name: str
    """A name for people, of at most 256 bytes."""
    needs: NotRequired[Needs]
    """Requirements of its jobs on the worker."""
    posterior: NotRequired[PosteriorDraws | None]
    priority: NotRequired[int]
    """Jobs of higher priority are claimed first. Values outside -100 to 100 need a token with the scope `admin`."""
    replicates: NotRequired[int]
    """Jobs per design point, each with its own seed."""
    schema: NotRequired[str | None]
    """`roost.sweep/1`, or left out."""
    shared_fill: NotRequired[bool]
    """Whether runs may start from a filled state that another run left, and leave their own. No result depends on it.
    """


class SweepView(TypedDict):
    """A sweep as the API shows it."""

    counts: StateCounts
    """Its jobs by state."""
    design: DesignKind
    """Kind of its design."""
    factors: list[str]
    """Names of its factors, each the pointer of the factor's first field."""
    failures: NotRequired[FailureCounts]
    """Its failed jobs by class."""
    fraction: float
    """Estimated share of the work that is done, with running jobs, 0 to 1."""
    id: SweepId
    """Its identifier."""
    is_study: NotRequired[bool]
    """Whether it belongs to a study, which has the same identifier."""
    name: str
    """Its name."""
    paused: NotRequired[int]
    """Its paused jobs, which also count as queued or running."""
    points: int
    """Number of design points."""
    replicates: int
    """Replicates of each design point."""
    runs_per_sample: NotRequired[int | None]
    """Replicates in a row that have the same parameters, if these come from a posterior; null in any other sweep."""
    submitted_at: str
    """When it was submitted."""


class Tell(TypedDict):
    """Outcomes of runs."""

    outcomes: list[RunOutcome]
    """The outcomes, at most 1,000. All of them are recorded, or none."""


class TimeRange(TypedDict):
    """A range of time."""

    earliest: str
    """The earlier end."""
    latest: str
    """The later end."""


class Told(TypedDict):
    """The answer to outcomes."""

    recorded: int
    """Outcomes that are new."""
    repeated: int
    """Outcomes that were told before."""
    study: StudyView
    """The study."""


class TrialRow(TypedDict):
    """One trial of a sweep's result table."""

    backend: NotRequired[str | None]
    """Backend of the result."""
    factors: Mapping[str, Any]
    """Levels by JSON pointer."""
    failure_class: NotRequired[FailureClass | None]
    job_id: JobId
    """The job."""
    parameters: NotRequired[Mapping[str, Any]]
    """Parameters that the trial drew from a posterior, by JSON pointer; left out in any other sweep, and for runs of
    studies."""
    point: int
    """Design point."""
    replicate: int
    """Replicate."""
    responses: Mapping[str, Response]
    """Scalar results."""
    seed: int
    """Seed."""
    solver_revision: NotRequired[int | None]
    """Solver revision of the result."""
    state: JobState
    """State of the job."""


class ValidationReport(TypedDict):
    """The cost of a valid document."""

    document: str
    """`scenario`, `sweep` or `study`."""
    estimate: Estimate
    """Cost of the scenario, or of the base scenario of the sweep or study."""
    forecast: NotRequired[CostForecast | None]
    jobs: int
    """Number of jobs; of a study, at most so many."""
    meshes: list[MeshReport]
    """The meshes that the document names, also in levels, each once."""
    min_jobs: NotRequired[int]
    """Number of jobs in the best case: of a study, the fewest after which its rule could end it."""
    scenario: Mapping[str, Any]
    """The scenario with all defaults."""
    shortage: NotRequired[str | None]
    """Of a study whose budget is too small for the asked confidence: the number of runs that the best case needs, in
    words."""
    wall_s: float
    """Predicted wall time of all jobs on two cores, one after another, in seconds. Cached results take no time. 0 for a
    study whose runs clients make."""


class VersionView(TypedDict):
    """Versions of a server."""

    api_version: str
    """Version of the API, such as `v1`."""
    database: NotRequired[str]
    """Name and version of the database: SQLite or PostgreSQL."""
    server: str
    """Version of the server."""
    solver_revision: int
    """`SOLVER_REVISION` of its solver. Cached results of another revision are never used."""
    sqlite: str
    """Version of the SQLite library."""


class WaitCount(TypedDict):
    """Number of queued jobs that wait for one reason."""

    detail: str
    """The reason in words, for the first of these jobs."""
    jobs: int
    """Number of jobs."""
    reason: WaitReason
    """The reason."""


class Waiting(TypedDict):
    """Why a queued job waits."""

    behind: NotRequired[int | None]
    """Number of jobs that come first, whatever the reason; an estimate above 1,000. Null where no worker could take the
    job."""
    detail: str
    """The reason in words, with numbers."""
    fill_job_id: NotRequired[JobId | None]
    reason: WaitReason
    """The reason."""
    since: str
    """When the job was queued or paused."""
    until: NotRequired[str | None]
    """The end of a pause after a failure."""


class Warning(TypedDict):
    """A condition under which the result may mislead."""

    code: str
    """Stable code, such as `escaped_mass`."""
    message: str
    """The finding, with figures, and the advised action."""


class WiderRange(TypedDict):
    """A wider range of a factor."""

    high: NotRequired[float | None]
    """The new highest value, not below the present one; as before unless given."""
    low: NotRequired[float | None]
    """The new lowest value, not above the present one; as before unless given."""
    pointer: str
    """The factor: the pointer of its first field."""


WorkerId: TypeAlias = "str"
"""One worker process; a restarted worker has a new one."""

class WorkerRegistration(TypedDict):
    """The registration of a worker."""

    api_version: str
    """Version of the API, such as `v1`."""
    backend: str
    """Its backend, such as `cpu`, as in its results."""
    device: str
    """Its device in words, as in its results."""
    memory_mib: NotRequired[int | None]
    """Memory of its device, in MiB. Without it, the worker gets no jobs that require memory."""
    name: str
    """A name for people, such as the host name; at most 256 bytes."""
    solver_revision: int
    """`SOLVER_REVISION` of its solver."""
    threads: int
    """Threads it uses."""
    worker_id: WorkerId
    """Identifier of the process."""


class WorkerView(TypedDict):
    """A worker as the API shows it."""

    backend: str
    """Its backend."""
    device: str
    """Its device in words."""
    draining: bool
    """Whether it was asked to finish its jobs and claim no more."""
    failed: int
    """Number of its attempts that failed with the class `worker`."""
    id: WorkerId
    """Its identifier."""
    last_seen_at: str
    """Time of its last heartbeat."""
    memory_mib: NotRequired[int | None]
    """Memory of its device, in MiB."""
    name: str
    """Its name."""
    particle_steps_per_s: NotRequired[float | None]
    """Sub-particle updates per second of wall time: the sum over its jobs, each averaged since its start. Null before
    the first report."""
    progress: NotRequired[list[Progress | None]]
    """Progress of these jobs in the same order; null before the first report."""
    registered_at: str
    """When it registered."""
    running: list[JobId]
    """Jobs that it holds leases of."""
    solver_revision: int
    """`SOLVER_REVISION` of its solver."""
    succeeded: int
    """Number of its attempts with a result."""
    threads: int
    """Threads it uses."""


class WorkerWelcome(TypedDict):
    """The answer to a registration."""

    heartbeat_s: float
    """Interval of heartbeats, in seconds."""
    lease_s: float
    """Length of a lease after a heartbeat, in seconds."""
