// Types that the modules of the dashboard name in their comments. Those of the API come from its OpenAPI document.

import type { Schemas } from "../../target/dashboard/openapi";

declare global {
  // The API.
  type CostForecast = Schemas["CostForecast"];
  type DurationRange = Schemas["DurationRange"];
  type FailureClass = Schemas["FailureClass"];
  type ForecastBasis = Schemas["ForecastBasis"];
  type JobState = Schemas["JobState"];
  type JobView = Schemas["JobView"];
  type OutputTable = Schemas["OutputTable"];
  type ParameterEntry = Schemas["ParameterEntry"];
  type ParameterLibrary = Schemas["ParameterLibrary"];
  type PairingGain = Schemas["PairingGain"];
  type PointRow = Schemas["PointRow"];
  type ProjectView = Schemas["ProjectView"];
  type ResponseEffects = Schemas["ResponseEffects"];
  type SeriesPart = Schemas["SeriesPart"];
  type SeriesRow = Schemas["SeriesRow"];
  type StateCounts = Schemas["StateCounts"];
  type StudyAnswer = Schemas["StudyAnswer"];
  type StudyView = Schemas["StudyView"];
  type SweepEffects = Schemas["SweepEffects"];
  type SweepPoints = Schemas["SweepPoints"];
  type SweepResults = Schemas["SweepResults"];
  type SweepSeries = Schemas["SweepSeries"];
  type JobSeries = Schemas["JobSeries"];
  type SweepSpec = Schemas["SweepSpec"];
  type SweepView = Schemas["SweepView"];
  type TimeForecast = Schemas["Forecast"];
  type TimeRange = Schemas["TimeRange"];
  type TrialRow = Schemas["TrialRow"];
  type ValidationReport = Schemas["ValidationReport"];
  type WorkerView = Schemas["WorkerView"];
  type ProblemDocument = Omit<Schemas["Problem"], "errors"> & { errors?: Fault[] };
  type Page<Row> = { items: Row[]; next_cursor?: string | null };

  // Documents of the solver.
  type Fault = { pointer: string; detail: string; allowed?: string };
  type Progress = Schemas["Progress"];
  type Estimate = Schemas["Estimate"];
  type RunResult = Schemas["RunResult"];
  type Series = Schemas["Series"];
  type Curve = Schemas["Curve"];
  /** A part of the JSON schema of scenarios. */
  type Schema = {
    type?: string | string[]; title?: string; description?: string; properties?: Record<string, Schema>; items?: Schema; enum?: string[]; default?: unknown;
    minimum?: number; exclusiveMinimum?: number; maximum?: number; exclusiveMaximum?: number; "x-experiments"?: string[]; "x-unit"?: string;
  };

  // Answers of studies, as `design/src/goals/` makes them: the API has no schema of goals.
  /** A value with its 95 % interval from n runs; null ends with too few runs. */
  type Estimated = { n: number; value: number; low: number | null; high: number | null };
  type StudyMeasure = { probability: string } | { mean: string };
  type MapPoint = { values: number[]; estimate: number; low: number; high: number; side: "below" | "above" | "band" };
  type Crossing = { low: number; high: number; estimates: number[]; is_certain: boolean };
  type BoundaryFinding = { level: number; crossings: Crossing[]; map: MapPoint[]; observed: { values: number[]; estimated: Estimated }[] };
  /** The value of a factor: a number, or a level. */
  type StudyValue = number | string | boolean;
  type PointEstimate = { values: StudyValue[]; measures: { of: StudyMeasure; estimated: Estimated | null; is_narrow: boolean }[]; is_excluded: boolean };
  type Forecast = { of: StudyMeasure; value: number; low: number; high: number };
  type Recommendation = {
    values: StudyValue[]; runs: number; objectives: Forecast[]; constraints: Forecast[];
    confirmation: { state: "open" | "confirmed" | "refuted" | "undecided"; objectives: (Estimated | null)[]; constraints: (Estimated | null)[] } | null;
  };
  type OptimiseFinding = { recommended: Recommendation[]; rejected: Recommendation[] };
  type SobolIndices = { factor: string; first_order: Estimated; total: Estimated };
  type MorrisEffects = { factor: string; mu: number; mu_star: Estimated; sigma: number; noise_floor: number | null; has_effect: boolean | null };
  type SensitivityFinding = { measures: { of: StudyMeasure; effects: { sobol: SobolIndices[] } | { morris: MorrisEffects[] } | null }[] };
  type CalibrateInterval = { mean: number; low: number; high: number };
  type ParameterEstimate = { parameter: string; estimate: CalibrateInterval; best: number; remaining: number };
  type TargetAgreement = { target: { test: string; of: StudyMeasure; mean: number; deviation: number; n: number; curve?: { name: string; at: number } }; simulated: CalibrateInterval | null; distance: number | null };
  type CalibrateFinding = { parameters: ParameterEstimate[]; samples: number[][]; targets: TargetAgreement[] };
  type Finding = { calibrate: CalibrateFinding } | { estimate: { points: PointEstimate[] } } | { boundary: BoundaryFinding } | { optimise: OptimiseFinding } | { sensitivity: SensitivityFinding };
  /** A factor of a study; `pointer` is that of its first field. */
  type StudyFactor = { pointer: string; label: string; low: number; high: number; is_log: boolean; levels: StudyValue[] | null };

  // Elements and tables.
  type Child = Node | string | number | boolean | null | undefined | Child[];
  type Attributes = { [name: string]: string | number | boolean | null | undefined | Record<string, string> | ((event: any) => unknown) };
  type Column<Row> = { title: string; cell: (row: Row) => Child; value?: (row: Row) => unknown; is_number?: boolean; is_text?: boolean };
  type Sort = { by: number; down: boolean };
  type Option = string | [value: string, title: string];

  // Plots.
  /** The value of a factor as it is shown and compared. */
  type Level = number | string;
  /** Mean over n trials with its 95 % interval; `count` of a share. */
  type Interval = { n: number; mean: number; low: number | null; high: number | null; count?: number };
  type Measure = { name: string; label: string; is_share: boolean; of: (row: PointRow) => Interval | null; ofTrial: (trial: TrialRow) => number | null };
  type TrialCurve = { trial: TrialRow; curve: Curve | undefined };
  /** Data of a sweep's plots; `path` leads from a design point to its jobs. */
  type SweepData = { points: PointRow[]; trials: TrialRow[]; effects: ResponseEffects[]; curves: TrialCurve[]; factors: string[]; path: (row: PointRow) => string | null };
  type PlotInput = SweepData & { measure: Measure; x: string };
  type MapInput = PlotInput & { y: string };
  /** Traces and layout as plotly.js takes them, the table beneath the plot, and a sentence between them. */
  type Plot = { traces: any[]; layout: any; table: () => Node | string; note?: string };
  type Line = { name: string; data: Series | Curve; path?: string };
  type Replicate = Pick<JobSeries, "t_s" | "values" | "partial"> & { job_id?: string };
  type Group = { name: string; replicates: Replicate[]; path?: string | null };

  // Playback; docs/frames.md describes the stream.
  type Vector = [number, number, number];
  type Triangle = [Vector, Vector, Vector];
  type FrameSurface = {
    kind: string; presence: string; triangles_m: Triangle[];
    motion: { kind: string; velocity_m_s?: number[]; spin_rad_s?: number[]; pivot_m?: number[] };
  };
  type FrameHeader = { low_m: number[]; high_m: number[]; radius_m: number; bodies: number[]; kinds: { subparticles: number }[]; surfaces: FrameSurface[] };
  type FrameIndexEntry = { at: number; end: number; simulated_s: number; t_s: number };
  type Frame = {
    simulated_s: number; t_s: number; count: number; top_m_s: number; positions: Float32Array; speeds: Float32Array; bodies: Uint32Array; broken: Float32Array;
  };

  interface Window {
    /** plotly.js has no types here. */
    Plotly: any;
  }
}
