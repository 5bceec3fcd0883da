"""The result of a simulation, and its curves as tables. Names are short; units are metadata beside them.

pandas, polars and xarray are imported only when a table is asked for: none of them is needed to run a simulation.
"""

from __future__ import annotations

import json
import os
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .documents import Untyped
from .protocols import Response
from .scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import xarray as xr

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A quantity over time, or over something else such as strain."""

    name: str
    """Its name, such as `mass_rate`."""
    unit: str
    """Its unit, such as `kg/s`; empty for numbers without one."""
    over: str
    """The quantity along the curve: `t` for belt time, or a name such as `strain`."""
    over_unit: str
    """Unit of that quantity."""
    x: Floats
    """Values of that quantity."""
    values: Floats
    """The values, as many."""

    def __repr__(self) -> str:
        unit = f" in {self.unit}" if self.unit else ""
        return f"<Curve {self.name}{unit} over {self.over}: {len(self.x)} values>"


@dataclass(frozen=True)
class RunWarning:
    """A condition under which the result may mislead."""

    code: str
    """Stable code, such as `escaped_mass`."""
    message: str
    """The finding, with figures, and the advised action."""

    def __str__(self) -> str:
        return f"[{self.code}] {self.message}"


class Result:
    """The result of a simulation, from `roost.run`, a server, or the `result.json` of `roost run`."""

    def __init__(self, document: Mapping[str, Any], frames: Path | None = None) -> None:
        self.document: dict[str, Any] = dict(document)
        """The whole result document, as `roost run` writes it."""
        self.frames = frames
        """The folder of its frames, which `roost.run(frames=…)` has written. `roost.playback.Player` plays it, or this result."""
        self.series: dict[str, Curve] = {
            row["name"]: Curve(row["name"], row["unit"], "t", "s", _floats(row["t_s"]), _floats(row["values"]))
            for row in document["series"]
        }
        """Quantities over belt time, by name."""
        self.curves: dict[str, Curve] = {
            row["name"]: Curve(
                row["name"], row["unit"], row["over"], row["over_unit"], _floats(row["x"]), _floats(row["values"])
            )
            for row in document.get("curves", [])
        }
        """Quantities over something other than time, such as stress over strain."""

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Result:
        """Reads a `result.json`."""
        return cls(json.loads(Path(path).read_text(encoding="utf-8")))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes it as a `result.json`."""
        text = json.dumps(self.document, indent=2, ensure_ascii=False)
        Path(path).write_text(f"{text}\n", encoding="utf-8")

    @property
    def responses(self) -> dict[str, Response]:
        """Scalar results by name: numbers, words, or true and false. Units are last in names, as in `mean_rate_kg_s`. A response
        that was not reached is None."""
        responses: dict[str, Response] = self.document["responses"]
        return responses

    @property
    def warnings(self) -> list[RunWarning]:
        """Conditions under which the result may mislead."""
        return [RunWarning(**warning) for warning in self.document.get("warnings", [])]

    @property
    def end_reason(self) -> str:
        """Why the run ended: `duration`, `empty`, `jammed`, `done`, `fill_not_at_rest`, `unstable` or `cancelled`."""
        return str(self.document["end_reason"])

    @property
    def wall_s(self) -> float:
        """Wall time of the run, in seconds."""
        return float(self.document["performance"]["wall_s"])

    @property
    def scenario(self) -> Scenario:
        """The scenario as run. One with meshes cannot be read again, since the result holds only their digests."""
        return Scenario(Untyped(self.document["scenario"]))

    @property
    def units(self) -> dict[str, str]:
        """Units of all series, by name."""
        return {name: series.unit for name, series in self.series.items()}

    def to_pandas(self) -> pd.DataFrame:
        """All series as columns over the belt time `t_s`, the index. `attrs["units"]` has their units."""
        with extra("pandas"):
            import pandas as pd
        times, columns = _aligned(self.series.values())
        table: pd.DataFrame = pd.DataFrame(columns, index=pd.Index(times, name="t_s"))
        table.attrs["units"] = self.units
        return table

    def to_polars(self) -> pl.DataFrame:
        """All series as columns beside the belt time `t_s`. polars keeps no metadata: the units are in `units`."""
        with extra("polars"):
            import polars as pl
        times, columns = _aligned(self.series.values())
        return pl.DataFrame({"t_s": times, **columns}, nan_to_null=True)

    def to_xarray(self) -> xr.Dataset:
        """All series over the belt time `t_s`, and all curves over their own dimensions. Each has its unit in `attrs`."""
        with extra("xarray"):
            import xarray as xr
        times, columns = _aligned(self.series.values())
        data = {name: ("t_s", values, {"units": self.series[name].unit}) for name, values in columns.items()}
        coords: dict[str, Any] = {"t_s": ("t_s", times, {"units": "s", "long_name": "belt time"})}
        for over in dict.fromkeys(curve.over for curve in self.curves.values()):
            curves = [curve for curve in self.curves.values() if curve.over == over]
            x, columns = _aligned(curves)
            coords[over] = (over, x, {"units": curves[0].over_unit})
            data |= {curve.name: (over, columns[curve.name], {"units": curve.unit}) for curve in curves}
        about = {name: self.document[name] for name in ("end_reason", "scenario_digest")}
        return xr.Dataset(data, coords=coords, attrs=about)

    def __repr__(self) -> str:
        lines = [f"<Result, end reason: {self.end_reason}>"]
        width = max(map(len, self.responses), default=0)
        lines += [f"  {name:{width}}  {_shown(value)}" for name, value in self.responses.items()]
        return "\n".join(lines + [f"  warning {warning}" for warning in self.warnings])


@contextmanager
def extra(name: str) -> Generator[None, None, None]:
    """Names the extra of this package that brings a missing module."""
    try:
        yield
    except ModuleNotFoundError as error:
        hint = f"{error.msg}: pip install 'roost[{name}]' brings it"
        raise ModuleNotFoundError(hint, name=error.name) from None


def _floats(values: Iterable[float | None]) -> Floats:
    return np.array(list(values), dtype=np.float64)


def _aligned(curves: Iterable[Curve]) -> tuple[Floats, dict[str, Floats]]:
    """Curves over one sorted axis. A curve without a value at a place has NaN there."""
    curves = list(curves)
    # Equal times of two series may differ in their last bits.
    axes: list[Floats] = [np.round(curve.x, 9) if curve.over == "t" else curve.x for curve in curves]
    places: Floats = np.unique(np.concatenate([_floats([]), *axes]))
    columns: dict[str, Floats] = {}
    for curve, axis in zip(curves, axes):
        column: Floats = np.full(len(places), np.nan)
        column[np.searchsorted(places, axis)] = curve.values
        columns[curve.name] = column
    return places, columns


def _shown(value: Any) -> str:
    """A response as a person reads it."""
    if hasattr(value, "items"):
        return ", ".join(f"{key} {_shown(inner)}" for key, inner in value.items())
    return "–" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
