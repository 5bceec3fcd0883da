"""Sweeps: tables of pandas, polars and xarray, shares, effects, extensions, files and deletion."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import numpy
import pandas
import polars
import pytest

import roost.api.sweeps
from roost import tables
from roost.client import Client, Sweep
from roost.documents import Untyped
from roost.errors import ApiError, RoostError
from roost.tables import Share, short_names

from .servers import ROOT, Document, hopper, slow_hopper

GATE, FRICTION = "gate_opening_m", "static_friction"


def test_results_have_short_names_units_and_types(sweep: Sweep) -> None:
    table = sweep.to_pandas()
    assert table.shape[0] == 8
    names: list[str] = table.columns.tolist()
    assert names[:6] == ["job_id", "point", "replicate", "seed", GATE, FRICTION]
    assert table[GATE].tolist() == [0.01] * 4 + [0.08] * 4
    assert table.attrs["units"][GATE] == "m" and table.attrs["units"]["discharged_kg"] == "kg"
    assert FRICTION not in table.attrs["units"] and "jammed" not in table.attrs["units"]
    assert table.attrs["pointers"][FRICTION] == "/contact/fillet_belt/static_friction"
    assert table.seed.tolist() == [1, 2] * 4
    assert table.discharged_kg.dtype == numpy.float64
    # Rows are selected and grouped as in any data frame.
    assert table[table.state == "succeeded"].groupby(GATE).discharged_kg.mean().shape == (2,)


def test_polars_has_the_same_table(sweep: Sweep) -> None:
    frame = sweep.to_polars()
    table = sweep.to_pandas()
    assert frame.columns == list(table.columns)
    assert frame["discharged_kg"].to_list() == table.discharged_kg.tolist()
    assert frame.schema["seed"] == polars.Int64 and frame.schema["regime"] == polars.String


def test_points_have_means_with_the_intervals_of_the_server(sweep: Sweep) -> None:
    points = sweep.to_pandas(by="point")
    assert points.shape[0] == 4 and points.trials.tolist() == [2] * 4
    jobs = sweep.to_pandas()
    means = jobs.groupby("point").discharged_kg.mean()
    assert numpy.allclose(points["discharged_kg.mean"], means)
    assert (points["discharged_kg.low_95"] <= points["discharged_kg.mean"]).all()
    assert points.attrs["units"]["discharged_kg.low_95"] == "kg" and "discharged_kg.n" not in points.attrs["units"]
    assert json.loads(points["regime.words"][0])
    for _, point in points.iterrows():
        jammed = int(jobs.loc[jobs.point == point.point, "jammed"].sum())
        share = Share.of(jammed, 2)
        expected = (point["jammed.mean"], point["jammed.low_95"], point["jammed.high_95"])
        assert (share.share, share.low_95, share.high_95) == pytest.approx(expected, abs=1e-9)
    with pytest.raises(RoostError, match="point is None; allowed in a table by point: 0 to 3"):
        sweep.results(by="point").share("jammed")


def test_shares_match_scipy() -> None:
    # The numbers of the tests of the server.
    _, *rows = (ROOT / "stats/src/shares.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 5
    for row in rows:
        count, n, low, high = map(float, row.split(","))
        share = Share.of(int(count), int(n))
        assert (share.low_95, share.high_95) == pytest.approx((low, high), abs=1e-9)
    assert str(Share.of(3, 12)) == "3 of 12 (9 to 53 %)"


def test_shares_count_indicators_and_words(sweep: Sweep) -> None:
    jobs = sweep.to_pandas()
    assert (sweep.jam_share().count, sweep.jam_share().n) == (int(jobs.jammed.sum()), 8) == (2, 8)
    word = jobs.regime[0]
    assert sweep.share("regime", word).count == int((jobs.regime == word).sum()) > 0
    assert sweep.share("no such response").n == 0


def test_the_share_of_a_point_is_that_of_the_server(sweep: Sweep) -> None:
    jobs = sweep.to_pandas()
    points = sweep.results(by="point")
    for point, row in enumerate(points):
        share = sweep.jam_share(point)
        assert (share.share, share.low_95, share.high_95) == (row["jammed.mean"], row["jammed.low_95"], row["jammed.high_95"])
        assert share.count == int(jobs.loc[jobs.point == point, "jammed"].sum()) and share.n == 2
        here = Share.of(share.count, share.n)
        assert (share.low_95, share.high_95) == pytest.approx((here.low_95, here.high_95), abs=1e-9)
    words = jobs.loc[jobs.point == 0, "regime"].tolist()
    for word in (words[0], "no such word"):
        share = points.share("regime", word, point=0)
        here = Share.of(words.count(word), 2)
        assert (share.count, share.n, share.share) == (here.count, 2, here.share)
        assert (share.low_95, share.high_95) == pytest.approx((here.low_95, here.high_95), abs=1e-9)
    assert points.share("no such response", point=0).n == 0
    with pytest.raises(RoostError, match="word is missing; allowed: "):
        points.share("regime", point=0)
    means = {name: values[0] for name, values in points.columns.items() if name.endswith(".mean") and isinstance(values[0], float)}
    number = next(name.removesuffix(".mean") for name, mean in means.items() if mean > 1)
    with pytest.raises(RoostError, match="a mean of .*; allowed: a response of 0 or 1"):
        points.share(number, point=0)
    with pytest.raises(RoostError, match="allowed in a table by point: 0 to 3"):
        sweep.jam_share(4)
    with pytest.raises(RoostError, match="by point"):
        sweep.results().share("jammed", point=0)


def test_a_sweep_says_how_many_jobs_have_warnings(sweep: Sweep) -> None:
    codes = [{warning.code for warning in job.result().warnings} for job in sweep.jobs()]
    assert "thin_fillet" in set.union(*codes)
    assert f"8 succeeded, {sum(map(bool, codes))} with warnings" in str(sweep)


def test_words_that_the_server_would_refuse_are_refused_with_a_hint(client: Client, sweep: Sweep) -> None:
    by: Any = "design_point"
    with pytest.raises(RoostError, match='"point" for a row per design point'):
        sweep.to_pandas(by=by)
    with pytest.raises(RoostError, match=r"'abc' is not the id of a sweep: client.sweeps\(\) lists them"):
        client.sweep("abc")


def test_faults_are_shown_once(client: Client, sweep_document: Document) -> None:
    with pytest.raises(ApiError) as caught:
        client.submit_sweep(Untyped({**sweep_document, "replicates": -1}))
    assert str(caught.value).count("/replicates") == 1 and "errors" not in str(caught.value)


def test_pages_are_followed(sweep: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, curves = sweep.to_pandas(), sweep.to_xarray("discharged_mass")
    monkeypatch.setattr(roost.api.sweeps, "_PAGE", 3)
    monkeypatch.setattr(roost.api.sweeps, "_SERIES_PAGE", 3)
    pandas.testing.assert_frame_equal(sweep.to_pandas(), whole)
    assert len(sweep.results(by="point")) == 4
    assert sweep.to_xarray("discharged_mass").equals(curves)
    assert len(sweep.jobs()) == 8 and len(sweep.jobs(limit=3)) == 3 and len(sweep.jobs(point=1)) == 2


def test_curves_lie_over_design_seed_and_time(sweep: Sweep) -> None:
    data = sweep.to_xarray("discharged_mass", "inside_mass")
    mass = data.discharged_mass
    assert mass.dims == ("design", "seed", "t_s") and mass.shape[:2] == (4, 2)
    assert mass.attrs["units"] == "kg" and data[GATE].attrs["units"] == "m" and data.t_s.attrs["units"] == "s"
    assert data[GATE].values.tolist() == [0.01, 0.01, 0.08, 0.08]
    assert data.seed.values.tolist() == [1, 2] and data.replicate.values.tolist() == [0, 1]
    (job,) = [job for job in sweep.jobs(point=2) if job.view.get("replicate") == 1]
    series = job.series("discharged_mass")
    ours = mass.sel(design=2, seed=2).dropna("t_s")
    assert numpy.allclose(ours.t_s, series["t_s"]) and numpy.allclose(ours, series["values"])
    coarse = sweep.to_xarray("discharged_mass", samples=4)
    assert coarse.sizes["t_s"] <= 4
    with pytest.raises(RoostError, match="discharged_mass"):
        sweep.to_xarray()
    with pytest.raises(ApiError, match="discharged_mass"):
        sweep.to_xarray("no such series")


def test_files_have_the_same_rows(sweep: Sweep, client: Client, tmp_path: Path) -> None:
    table = sweep.to_pandas()
    csv = pandas.read_csv(sweep.download(tmp_path / "results.csv"))
    assert csv["/equipment/gate_opening_m"].tolist() == table[GATE].tolist()
    lazy = sweep.scan_parquet(tmp_path / "results.parquet")
    assert isinstance(lazy, polars.LazyFrame)
    wide = lazy.filter(polars.col(GATE) > 0.05).select("seed", "discharged_kg").collect()
    assert wide["discharged_kg"].to_list() == table[table[GATE] > 0.05].discharged_kg.tolist()
    points = client.download(sweep.id, tmp_path / "points", format="json", by="point")
    assert len(json.loads(points.read_bytes())["points"]) == 4
    with pytest.raises(RoostError, match="format"):
        sweep.download(tmp_path / "results.docx")
    with pytest.raises(FileNotFoundError, match="folder of the file does not exist.*nowhere'"):
        sweep.download(tmp_path / "nowhere/results.csv")


@pytest.mark.parametrize("by", ["trial", "point"])
def test_columns_are_those_of_the_short_names_of_the_server(sweep: Sweep, tmp_path: Path, by: tables.By) -> None:
    with sweep.download(tmp_path / "short.csv", names="short", units=True, by=by).open(encoding="utf-8") as file:
        names, units = (file.readline().rstrip("\n").split(",") for _ in range(2))
    results = sweep.results(by=by)
    assert list(results.columns) == names
    assert results.units == {name: unit for name, unit in zip(names, units) if unit}


@pytest.mark.parametrize("by", ["trial", "point"])
@pytest.mark.parametrize("names", ["pointer", "short"])
def test_a_parquet_file_has_the_units(sweep: Sweep, tmp_path: Path, by: tables.By, names: roost.api.sweeps.Names) -> None:
    path = sweep.download(tmp_path / "results.parquet", by=by, names=names)
    units = sweep.results(by=by).units
    assert units[GATE] == "m"
    assert tables.units_of_parquet(path) == units
    assert set(units) <= set(tables.scan_parquet(path).collect_schema().names())
    # Without this package: pandas has them in the attributes of the frame, and other readers in the metadata of the file.
    table = pandas.read_parquet(path)
    parquet: Any = importlib.import_module("pyarrow.parquet")  # without types
    stored = json.loads(parquet.read_schema(path).metadata[b"roost.units"])
    assert table.attrs["units"] == stored and len(stored) == len(units)
    assert stored[GATE if names == "short" else "/equipment/gate_opening_m"] == "m"


def test_effects_and_differences(sweep: Sweep) -> None:
    effects = {row["response"]: row for row in sweep.effects()["responses"]}
    assert effects["discharged_kg"]["points"] == 4
    difference = {row["response"]: row for row in sweep.compare(0, 2)["responses"]}["discharged_kg"]
    means = sweep.to_pandas(by="point")["discharged_kg.mean"]
    assert difference["difference"] == pytest.approx(means[2] - means[0])


def test_a_sweep_is_extended_resubmitted_watched_and_deleted(client: Client, sweep: Sweep, tmp_path: Path) -> None:
    document = sweep.spec()
    document["name"] = "again"
    document["factors"] = [{"pointer": "/equipment/gate_opening_m", "levels": numpy.array([0.04, 0.08])}]
    path = tmp_path / "sweep.json"
    again = client.submit_sweep(document, priority=1).wait(180, progress=False)
    extended = again.extend(levels={"/equipment/gate_opening_m": [0.06]}, replicates=1)
    assert extended.view["points"] == 3 and extended.view["replicates"] == 3
    kinds = [event.kind for event in extended.watch()]
    assert kinds[0] == "sweep" and extended.is_ended
    assert sorted(set(again.to_pandas()[GATE])) == [0.04, 0.06, 0.08]
    path.write_text(json.dumps(again.spec()), encoding="utf-8")
    copy = client.submit(path)
    assert isinstance(copy, Sweep) and copy.view["points"] == 2
    copy.wait(180, progress=False)
    assert copy.delete(dry_run=True)["jobs"] == 4 and client.sweep(copy.id).id == copy.id
    assert copy.delete()["dry_run"] is False
    with pytest.raises(ApiError):
        copy.refresh()
    assert [other.id for other in client.sweeps(limit=1)] == [again.id]


def test_failed_jobs_are_warned_of(client: Client, sweep_document: Document) -> None:
    document: Document = {**sweep_document, "name": "unstable", "replicates": 1}
    base = hopper(0.4)
    base["numerics"] |= {"timestep_s": 0.02, "allow_unstable": True}
    document["base"] = base
    document["factors"] = document["factors"][:1]
    sweep = client.submit_sweep(document)
    with pytest.warns(UserWarning, match="2 jobs have failed .2 unstable"):
        sweep.wait(180, progress=False)
    assert sweep.share("jammed").n == 0


def test_jobs_are_cancelled_and_run_again(client: Client) -> None:
    def sweep_of(name: str, base: Document) -> Sweep:
        document = {"name": name, "base": base, "design": {"kind": "grid"}, "replicates": 2}
        document["factors"] = [{"pointer": "/equipment/gate_opening_m", "levels": [0.05]}]
        return client.submit_sweep(Untyped(document))

    slow = sweep_of("slow", slow_hopper()).cancel().wait(180, progress=False)
    assert slow.view["counts"]["cancelled"] == 2 and {job.state for job in slow.jobs()} == {"cancelled"}
    assert slow.retry("unstable").view["counts"]["queued"] == 0, "none of them has failed in this way"
    counts = slow.retry().view["counts"]
    assert counts["queued"] + counts["running"] == 2
    assert slow.cancel().wait(180, progress=False).view["counts"]["cancelled"] == 2


def test_names_are_as_short_as_those_of_the_command() -> None:
    assert short_names(["/equipment/gate_opening_m", "/seed"]) == ["gate_opening_m", "seed"]
    twins = ["/contact/fillet_belt/friction", "/contact/fillet_wall/friction", "/condition"]
    assert short_names(twins) == ["fillet_belt.friction", "fillet_wall.friction", "condition"]
    assert short_names(["/product/sizes_m/0/1"]) == ["sizes_m.0.1"]
    assert short_names(["/a/x", "/x"]) == ["a.x", "/x"]
    columns = ["seed", "/numerics/seed", "/seed", "discharged_kg", "/a/count"]
    assert short_names(columns) == ["seed", "numerics.seed", "/seed", "discharged_kg", "count"]
