"""Results of a sweep as tables: short column names, units as metadata, shares with intervals, and curves over time.

The names are those of `roost results`: the last part of a factor's JSON pointer, with more parts where two factors end alike.
pandas, polars and xarray are imported when they are used, so the client works without them.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, Literal

from roost.errors import RoostError

if TYPE_CHECKING:
    import numpy
    import pandas
    import polars
    import xarray

    from roost.api.units import Units
    from roost.models import Summary, SweepView

By = Literal["trial", "point"]

# Decimals of times that count as equal.
_DECIMALS = 9
_STATISTICS = ("mean", "standard_deviation", "low_95", "high_95")
# Of sweeps whose replicates drew parameters from a posterior.
_OF_DRAWN = ("input_deviation", "chance_deviation")


@dataclass(frozen=True)
class Share:
    """A share of jobs, with its 95 % interval (Wilson). The interval takes the jobs for independent."""

    count: int
    """Jobs with the property."""
    n: int
    """Succeeded jobs with a value."""
    share: float
    """`count / n`; NaN without jobs."""
    low_95: float
    """Lower end of the interval."""
    high_95: float
    """Its upper end."""

    @classmethod
    def of(cls, count: int, n: int) -> Share:
        """The share of `count` in `n` jobs, computed here: for runs of this process, and for selections that the server does not know."""
        if n == 0:
            return cls(count, n, math.nan, 0.0, 1.0)
        share, z2_n = count / n, NormalDist().inv_cdf(0.975) ** 2 / n
        centre = (share + z2_n / 2) / (1 + z2_n)
        half = math.sqrt(share * (1 - share) * z2_n + z2_n**2 / 4) / (1 + z2_n)
        # Rounding would move the ends at 0 and 1.
        return cls(count, n, share, centre - half if count else 0.0, centre + half if count < n else 1.0)

    def __str__(self) -> str:
        return f"{self.count} of {self.n} ({100 * self.low_95:.0f} to {100 * self.high_95:.0f} %)"


class Results:
    """The results of a sweep: a row per job, or per design point.

    `rows` has the rows as the API sends them, `columns` the values by short name, `units` the units by short name,
    and `pointers` the JSON pointers by short name. Columns without a unit are not in `units`.
    """

    def __init__(self, sweep: SweepView, by: By, rows: Sequence[dict[str, Any]], units: Units) -> None:
        self.sweep = sweep
        self.by = by
        self.rows = list(rows)
        columns, column_units = (
            _trial_columns(sweep, self.rows, units) if by == "trial" else _point_columns(sweep, self.rows, units)
        )
        names = short_names(list(columns))
        self.columns: dict[str, list[Any]] = dict(zip(names, columns.values()))
        self.pointers: dict[str, str] = {name: column for name, column in zip(names, columns) if column.startswith("/")}
        self.units: dict[str, str] = {
            name: column_units[column] for name, column in zip(names, columns) if column_units.get(column)
        }
        self.factors: list[str] = [name for name, pointer in self.pointers.items() if pointer in sweep["factors"]]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """The rows by short name."""
        return (dict(zip(self.columns, values)) for values in zip(*self.columns.values()))

    def __repr__(self) -> str:
        return f"<Results of {self.sweep['name']!r}: {len(self)} rows by {self.by}, columns {', '.join(self.columns)}>"

    def to_pandas(self) -> pandas.DataFrame:
        """A data frame of pandas. `attrs` has `units` and `pointers` by column, and the id of the `sweep`."""
        import pandas

        frame: pandas.DataFrame = pandas.DataFrame(self.columns)
        frame.attrs = {"units": self.units, "pointers": self.pointers, "sweep": self.sweep["id"]}
        return frame

    def to_polars(self) -> polars.DataFrame:
        """A data frame of polars, which has no place for units: they are in `units`."""
        import polars

        return polars.DataFrame({name: _alike(values) for name, values in self.columns.items()}, strict=False)

    def share(self, response: str, word: str | None = None, *, point: int | None = None) -> Share:
        """The share of succeeded jobs in which an indicator such as `jammed` is 1, or a response is the word.

        A table by job gives it over all its rows, a table by point as the server has computed it for one `point`.
        """
        if self.by == "point":
            rows = [row for row in self.rows if row["point"] == point]
            if not rows:
                last = max((row["point"] for row in self.rows), default=-1)
                raise RoostError(f"point is {point}; allowed in a table by point: 0 to {last}")
            return _share_of_point(rows[0]["responses"].get(response, {"n": 0}), word)
        if point is not None:
            raise RoostError("a table by job has the share over all its rows: take the results by point")
        values = [row["responses"].get(response) for row in self.rows if row["state"] == "succeeded"]
        values = [value for value in values if value is not None]
        wanted: tuple[Any, ...] = (1, True) if word is None else (word,)
        return Share.of(sum(value in wanted for value in values), len(values))


def _share_of_point(summary: Summary, word: str | None) -> Share:
    """The share that the server has computed for a design point."""
    n = summary["n"]
    if word is None:
        words = summary.get("words")
        if words:
            raise RoostError(f"word is missing; allowed: {', '.join(sorted(words))}")
        share, low, high = summary.get("mean"), summary.get("low_95"), summary.get("high_95")
        if share is None or low is None or high is None:
            return Share.of(0, 0)
        if not 0 <= share <= 1:
            raise RoostError(f"the response has a mean of {share}; allowed: a response of 0 or 1")
        return Share(round(share * n), n, share, low, high)
    count = (summary.get("words") or {}).get(word, 0)
    if count == 0:
        high = summary.get("unseen_high_95")
        return Share(0, n, 0.0 if n else math.nan, 0.0, 1.0 if high is None else high)
    interval = (summary.get("shares") or {})[word]
    return Share(count, n, count / n, interval["low_95"], interval["high_95"])


def short_names(columns: Sequence[str]) -> list[str]:
    """Short names of columns. Names that begin with `/` are JSON pointers; all others stay.

    The short name of a pointer is its last parts, joined by `.`: as few as possible, so that the first begins with a
    letter, no other pointer ends with them, and no other column has the name.
    """
    pointers = [name for name in columns if name.startswith("/")]
    others = set(columns) - set(pointers)

    def ending(pointer: str, parts: int) -> str:
        return ".".join(pointer.split("/")[1:][-parts:])

    def short(pointer: str) -> str:
        for parts in range(1, pointer.count("/") + 1):
            name = ending(pointer, parts)
            twins = (other for other in pointers if other != pointer)
            if name[:1].isalpha() and name not in others and all(ending(other, parts) != name for other in twins):
                return name
        return pointer

    return [short(name) if name.startswith("/") else name for name in columns]


def scan_parquet(path: str | os.PathLike[str]) -> polars.LazyFrame:
    """Results in a Parquet file as a lazy frame of polars, with short column names. `units_of_parquet` has the units."""
    import polars

    frame = polars.scan_parquet(os.fspath(path))
    names = frame.collect_schema().names()
    return frame.rename(dict(zip(names, short_names(names))))


def units_of_parquet(path: str | os.PathLike[str]) -> dict[str, str]:
    """The units of the columns of a Parquet file of results, by short name. Columns without a unit are not among them."""
    import polars

    units: dict[str, str] = json.loads(polars.read_parquet_metadata(os.fspath(path)).get("roost.units", "{}"))
    names = polars.read_parquet_schema(os.fspath(path))
    return {short: units[name] for name, short in zip(names, short_names(list(names))) if name in units}


def curves(answers: Sequence[tuple[str, str, Sequence[Any]]], results: Results, samples: int) -> xarray.Dataset:
    """Series of jobs as a dataset over `design`, `seed` and belt time `t_s`.

    Where design points have different seeds, the second dimension is `replicate`, and `seed` is a coordinate of both. An answer has
    name, unit and the series of the jobs.
    """
    import numpy
    import xarray

    designs = sorted({row["point"] for row in results.rows})
    replicates = sorted({row["replicate"] for row in results.rows})
    seeds = _common_seeds(results, replicates)
    second = "replicate" if seeds is None else "seed"
    places = {(design, replicate): (i, j) for i, design in enumerate(designs) for j, replicate in enumerate(replicates)}
    items = [item for _, _, of_jobs in answers for item in of_jobs]
    times = _common_times([item["t_s"] for item in items], samples)
    variables: dict[str, Any] = {}
    for name, unit, of_jobs in answers:
        values = numpy.full((len(designs), len(replicates), len(times)), numpy.nan)
        for item in of_jobs:
            if item["t_s"]:
                own_times = numpy.round(numpy.asarray(item["t_s"], dtype=float), _DECIMALS)
                place = places[item["point"], item["replicate"]]
                values[place] = numpy.interp(times, own_times, item["values"], left=math.nan, right=math.nan)
        variables[name] = (("design", second, "t_s"), values, {"units": unit})
    coordinates: dict[str, Any] = {
        "design": designs,
        "replicate": (second, replicates),
        "t_s": ("t_s", times, {"units": "s", "long_name": "belt time"}),
    }
    if seeds is None:
        coordinates["seed"] = (("design", "replicate"), _seeds(results, places, (len(designs), len(replicates))))
    else:
        coordinates["seed"] = seeds
    for name in results.factors:
        levels = dict(zip(results.columns["point"], results.columns[name]))
        column = [levels[design] for design in designs]
        plain = [json.dumps(level) if isinstance(level, (dict, list)) else level for level in column]
        coordinates[name] = ("design", plain, {"units": results.units.get(name, "")})
    return xarray.Dataset(variables, coords=coordinates, attrs={"sweep": results.sweep["id"], "name": results.sweep["name"]})


def samples(factors: Sequence[str], rows: Sequence[Sequence[float]], units: Units) -> pandas.DataFrame:
    """Samples of parameters as a data frame of pandas with a column per factor."""
    import pandas

    names = short_names(factors)
    frame: pandas.DataFrame = pandas.DataFrame(list(rows), columns=pandas.Index(names))
    frame.attrs = {
        "units": {name: units.of_field(pointer) for name, pointer in zip(names, factors)},
        "pointers": dict(zip(names, factors)),
    }
    return frame


def _trial_columns(sweep: SweepView, rows: Sequence[dict[str, Any]], units: Units) -> tuple[dict[str, list[Any]], dict[str, str]]:
    """The columns of a table by job under their full names, and their units."""
    columns: dict[str, list[Any]] = {name: [row[name] for row in rows] for name in ("job_id", "point", "replicate", "seed")}
    parameters = _names(rows, "parameters")
    columns |= {name: [row["factors"].get(name) for row in rows] for name in sweep["factors"]}
    columns |= {name: [row["parameters"].get(name) for row in rows] for name in parameters}
    columns |= {name: [row[name] for row in rows] for name in ("state", "failure_class", "backend", "solver_revision")}
    responses = _names(rows, "responses")
    columns |= {name: [row["responses"].get(name) for row in rows] for name in responses}
    known = {name: units.of_field(name) for name in [*sweep["factors"], *parameters]}
    return columns, known | {name: units.of_response(name) for name in responses}


def _point_columns(sweep: SweepView, rows: Sequence[dict[str, Any]], units: Units) -> tuple[dict[str, list[Any]], dict[str, str]]:
    """The columns of a table by design point under their full names, and their units."""
    columns: dict[str, list[Any]] = {"point": [row["point"] for row in rows]}
    columns |= {name: [row["factors"].get(name) for row in rows] for name in sweep["factors"]}
    columns["trials"] = [sum(row["counts"].values()) for row in rows]
    columns["succeeded"] = [row["counts"]["succeeded"] for row in rows]
    columns["failed"] = [row["counts"]["failed"] for row in rows]
    columns["unstable"] = [row["unstable"] for row in rows]
    known = {name: units.of_field(name) for name in sweep["factors"]}
    statistics = _STATISTICS if sweep.get("runs_per_sample") is None else (*_STATISTICS, *_OF_DRAWN)
    for response in _names(rows, "responses"):
        summaries = [row["responses"].get(response, {}) for row in rows]
        has_words = any("words" in summary for summary in summaries)
        has_numbers = not has_words or any("mean" in summary for summary in summaries)
        present = statistics if has_numbers else ()
        columns[f"{response}.n"] = [summary.get("n", 0) for summary in summaries]
        columns |= {f"{response}.{name}": [summary.get(name) for summary in summaries] for name in present}
        known |= {f"{response}.{name}": units.of_response(response) for name in present}
        if has_words:
            columns[f"{response}.words"] = [json.dumps(summary["words"]) if "words" in summary else None for summary in summaries]
    return columns, known


def _names(rows: Sequence[dict[str, Any]], member: str) -> list[str]:
    """The names in a member of the rows, in alphabetical order as everywhere."""
    return sorted({name for row in rows for name in row.get(member, {})})


def _alike(values: list[Any]) -> list[Any]:
    """Values of one type: numbers as they are, lists and objects as JSON, and everything as text where words and numbers mix."""
    plain = [json.dumps(value) if isinstance(value, (dict, list)) else value for value in values]
    kinds = {str if isinstance(value, str) else float for value in plain if value is not None}
    return plain if len(kinds) < 2 else [None if value is None else str(value) for value in plain]


def _common_times(all_times: Sequence[Sequence[float]], samples: int) -> numpy.ndarray[Any, numpy.dtype[Any]]:
    """The times of all series, if they share them; otherwise as many equal steps as there are samples."""
    import numpy

    if not any(all_times):
        return numpy.empty(0)
    together = numpy.concatenate([numpy.asarray(of_job, dtype=numpy.float64) for of_job in all_times])
    times: numpy.ndarray[Any, numpy.dtype[Any]] = numpy.unique(numpy.round(together, _DECIMALS))
    if len(times) > samples:
        times = numpy.linspace(float(times[0]), float(times[-1]), samples)
    return times


def _common_seeds(results: Results, replicates: Sequence[int]) -> list[int] | None:
    """The seed of each replicate, if all design points have the same seeds, and different replicates have different ones."""
    found = {(row["replicate"], row["seed"]) for row in results.rows}
    seeds = dict(found)
    is_common = len(found) == len(replicates) == len(set(seeds.values()))
    return [seeds[replicate] for replicate in replicates] if is_common else None


def _seeds(
    results: Results, places: dict[tuple[int, int], tuple[int, int]], shape: tuple[int, int]
) -> numpy.ndarray[Any, numpy.dtype[Any]]:
    """The seed of each job; -1 where a design point has no such replicate."""
    import numpy

    seeds = numpy.full(shape, -1, dtype=numpy.int64)
    for row in results.rows:
        seeds[places[row["point"], row["replicate"]]] = row["seed"]
    return seeds
