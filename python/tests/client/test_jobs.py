"""Jobs: submission, waiting, events, results, changes, and faults."""

from __future__ import annotations

import time
import uuid
from pathlib import Path

import pytest

from roost.client import Client, Job, Unreachable
from roost.documents import Untyped
from roost.errors import ApiError, RoostError

from .servers import Farm, hopper, slow_hopper


def test_a_scenario_becomes_a_result(client: Client, tmp_path: Path) -> None:
    job = client.submit_job(hopper(), frame_interval_s=0.1, labels={"line": "north"}, cache="bypass").wait(180, progress=False)
    assert job.state == "succeeded", job
    discharged = job.responses["discharged_kg"]
    assert isinstance(discharged, float) and discharged >= 0
    assert job.view["labels"] == {"line": "north"}
    assert job.document()["responses"] == job.responses
    series = job.series("discharged_mass")
    assert series["unit"] == "kg" and len(series["t_s"]) == len(series["values"]) > 5 and not series["partial"]
    frames = job.view.get("frames")
    assert frames is not None
    assert job.frames(tmp_path / "run.roostframes").stat().st_size == frames["bytes"]
    assert not list(tmp_path.glob("*.part"))


def test_a_result_has_tables_of_its_curves(client: Client) -> None:
    result = client.submit_job(hopper()).wait(180, progress=False).result()
    assert result.end_reason == "duration" and result.to_pandas().attrs["units"]["discharged_mass"] == "kg"


def test_an_equal_scenario_gets_the_stored_result(client: Client) -> None:
    scenario = hopper(seed=77)
    first = client.submit_job(scenario).wait(180, progress=False)
    again = client.submit_job(scenario)
    assert again.state == "succeeded" and again.view["from_cache"] and again.id != first.id
    assert client.job(again.id).responses == first.responses


def test_every_fault_is_reported_by_its_place_in_the_scenario(client: Client) -> None:
    scenario = hopper()
    scenario["equipment"]["gate_openning_m"] = 0.06
    scenario["product"]["count"] = -1
    with pytest.raises(ApiError) as caught:
        client.submit_job(scenario)
    faults = {fault.pointer: fault for fault in caught.value.faults}
    assert set(faults) == {"/equipment/gate_openning_m", "/product/count"}
    assert "gate_opening_m" in faults["/equipment/gate_openning_m"].detail
    assert faults["/product/count"].value == -1
    assert caught.value.status == 422 and caught.value.request_id
    assert "/product/count" in str(caught.value)
    with pytest.raises(ApiError) as caught:
        client.submit_job({"scenario": scenario})
    assert {fault.pointer for fault in caught.value.faults} == {f"/scenario{pointer}" for pointer in faults}


def test_a_repeat_with_the_same_key_creates_nothing(client: Client) -> None:
    key = str(uuid.uuid4())
    first = client.submit_job(hopper(seed=5), key=key)
    assert client.submit_job(hopper(seed=5), key=key).id == first.id
    assert client.submit_job(hopper(seed=5)).id != first.id
    with pytest.raises(ApiError) as caught:
        client.submit_job(hopper(seed=6), key=key)
    assert caught.value.status == 422


def test_a_job_pauses_resumes_cancels_and_retries(client: Client) -> None:
    job = client.submit_job(slow_hopper())
    assert job.pause().view.get("paused")
    assert not job.resume().view.get("paused")
    with pytest.raises(TimeoutError, match="goes on"):
        job.wait(0.3, progress=False)
    job.cancel().wait(180, progress=False)
    assert job.state == "cancelled"
    assert job.retry().state in ("queued", "running")
    assert job.cancel().wait(180, progress=False).state == "cancelled"
    assert any(other.id == job.id for other in client.jobs(state="cancelled", limit=5))


def test_events_follow_a_job_to_its_end(client: Client) -> None:
    job = client.submit_job(hopper(), cache="bypass")
    events = list(job.watch())
    assert events[0].kind == "job"
    # A job that ends before the stream begins has no change.
    changes = [event.data["state"] for event in events if event.kind in ("job", "change")]
    assert changes[-1] == "succeeded"
    assert job.state == "succeeded"
    assert job.responses == client.job(job.id).responses


def test_a_document_of_another_kind_is_refused_here(client: Client) -> None:
    with pytest.raises(TypeError, match="a scenario, which submit_sweep does not take"):
        client.submit_sweep(hopper())
    with pytest.raises(TypeError, match="measurements"):
        client.submit(Untyped({"tests": []}))
    assert isinstance(client.submit(hopper()), Job)


def test_validation_gives_the_cost_and_stores_nothing(client: Client) -> None:
    before = len(client.jobs(limit=None))
    report = client.validate(hopper())
    assert report["jobs"] == 1 and report["estimate"]["steps"] > 0
    assert report["scenario"]["material"]
    assert len(client.jobs(limit=None)) == before


def test_the_server_describes_itself(client: Client) -> None:
    deadline = time.monotonic() + 20
    while not client.workers() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert [worker["backend"] for worker in client.workers()] == ["cpu"]
    assert client.queue_depth()["total"] >= 0
    assert client.version()["api_version"] == "v1"
    assert any(row["name"] == "jammed" for row in client.outputs()["responses"])
    assert client.parameters()["entries"]


def test_an_unknown_id_and_a_wrong_address_are_errors(client: Client, own_farm: Farm) -> None:
    with pytest.raises(ApiError) as caught:
        client.job(uuid.uuid4())
    assert caught.value.status == 404
    with pytest.raises(RoostError, match="not the address"):
        Client("127.0.0.1:7373")
    with pytest.raises(Unreachable, match="roost up"):
        own_farm.client(patience_s=0.2).jobs()
