"""Results: files, tables of their curves, and what they say of themselves."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import roost
from conftest import hopper


@pytest.fixture(scope="module")
def hopper_result() -> roost.Result:
    return roost.run(hopper(0.5), progress=False)


def test_a_result_is_saved_and_loaded(hopper_result: roost.Result, tmp_path: Path) -> None:
    hopper_result.save(tmp_path / "result.json")
    assert roost.Result.load(tmp_path / "result.json").document == hopper_result.document


def test_a_result_shows_its_responses(hopper_result: roost.Result) -> None:
    shown = repr(hopper_result)
    assert shown.startswith("<Result, end reason: duration>") and "discharged_kg" in shown
    assert all(str(warning) in shown for warning in hopper_result.warnings)
    assert repr(hopper_result.series["discharged_mass"]) == "<Curve discharged_mass in kg over t: 26 values>"


def test_tables_have_short_names_and_units_as_metadata(hopper_result: roost.Result) -> None:
    pandas, polars, xarray = hopper_result.to_pandas(), hopper_result.to_polars(), hopper_result.to_xarray()
    mass = hopper_result.series["discharged_mass"]
    assert list(pandas.columns) == list(hopper_result.series) == polars.columns[1:]
    assert pandas.attrs["units"]["discharged_mass"] == hopper_result.units["discharged_mass"] == "kg"
    assert xarray["discharged_mass"].attrs["units"] == "kg" and xarray["t_s"].attrs["units"] == "s"
    times = np.round(mass.x, 9)
    assert pandas["discharged_mass"].reindex(times).tolist() == mass.values.tolist()
    assert xarray["discharged_mass"].sel(t_s=times).values.tolist() == mass.values.tolist()
    # All series begin at the fill or at the belt's start, and have common times.
    assert len(pandas) == max(len(series.x) for series in hopper_result.series.values())
    assert polars["t_s"].to_list() == list(pandas.index)


def test_series_with_other_times_leave_gaps() -> None:
    row = {"unit": "kg", "t_s": [0.0, 1.0], "values": [1.0, 2.0]}
    # 1 s in other last bits: it is the same time.
    other = {"unit": "1", "t_s": [0.5, 1.0 + 3e-16], "values": [3.0, 4.0]}
    curve = {"name": "stress", "unit": "Pa", "over": "strain", "over_unit": "1", "x": [0.0, 0.1], "values": [0.0, 5.0]}
    document = {"series": [{"name": "mass", **row}, {"name": "share", **other}], "curves": [curve]}
    result = roost.Result({**document, "end_reason": "done", "scenario_digest": ""})
    table = result.to_pandas()
    assert list(table.index) == [0.0, 0.5, 1.0]
    assert np.array_equal(table.to_numpy(), [[1.0, np.nan], [np.nan, 3.0], [2.0, 4.0]], equal_nan=True)
    assert result.to_polars()["share"].to_list() == [None, 3.0, 4.0]
    stress = result.to_xarray()["stress"]
    assert stress.dims == ("strain",) and stress.sel(strain=0.1) == 5.0


def test_a_missing_module_names_the_extra(hopper_result: roost.Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'roost\[polars\]'"):
        hopper_result.to_polars()
