"""Studies: by jobs of the server, by runs of the client, and calibrations with measurements from files."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import pytest

from roost.client import Client, Study
from roost.documents import Untyped
from roost.errors import RoostError, ScenarioError

from .servers import ROOT, Document, hopper, slow_hopper

GATE = "/equipment/gate_opening_m"


def question(**fields: Any) -> Document:
    """At which gate half of the hoppers jam."""
    return {
        "name": "a boundary",
        "base": hopper(0.2),
        "factors": [{"pointer": GATE, "low": 0.03, "high": 0.09}],
        "goal": {"boundary": {"of": {"probability": "jammed"}, "level": 0.5, "misclassified": 0.2}},
        "budget": {"max_runs": 4},
        **fields,
    }


def test_the_server_answers_with_jobs(client: Client) -> None:
    study = client.submit_study(question(labels={"line": "north"})).wait(180, progress=False)
    assert study.state == "finished" and study.view.get("finished") == "by_budget"
    assert study.sentences and len(study.sweep.results()) == 4
    assert study.answer()["answer"]["finding"]["boundary"]
    # The runs of a study share no seeds.
    curves = study.sweep.to_xarray("discharged_mass")
    assert curves.discharged_mass.dims == ("design", "replicate", "t_s") and curves.seed.dims == ("design", "replicate")
    seeds = {job.view["seed"] for job in study.sweep.jobs()}
    assert len(seeds) == 4 and seeds == set(curves.seed.values.flatten().tolist()) - {-1}
    with pytest.raises(RoostError, match="no calibration"):
        study.posterior()
    study.extend(max_runs=5, high={GATE: 0.1})
    assert study.view["runs"]["max_runs"] == 5
    assert study.wait(180, progress=False).view["runs"]["done"] == 5
    assert study.answer()["factors"][0].get("high") == 0.1
    assert [other.id for other in client.studies(limit=1)] == [study.id] and client.study(study.id).name == "a boundary"


def test_a_client_asks_and_tells(client: Client) -> None:
    study = client.submit(Untyped(question(driver="client", budget={"max_runs": 100})))
    assert isinstance(study, Study)
    chance = random.Random(1)
    while study.state == "running":
        runs = study.ask(10)
        study.tell(
            [
                {
                    "run": run["run"],
                    "responses": {"jammed": chance.random() < 1 / (1 + math.exp((run["values"][GATE] - 0.055) / 0.004))},
                }
                for run in runs
            ]
        )
    assert study.state == "finished" and study.view["runs"]["done"] >= 10
    assert not study.handed_out()


def test_runs_are_given_back_paused_and_cancelled(client: Client) -> None:
    study = client.submit_study(question(driver="client", name="given back"))
    (run,) = study.ask()
    assert [other["run"] for other in study.handed_out()] == [run["run"]]
    told = study.tell([{"run": run["run"], "given_back": True}, {"values": {GATE: 0.06}, "seed": 7, "responses": {"jammed": 1}}])
    assert told["recorded"] >= 1 and not study.handed_out()
    jobs = study.ask_for([{GATE: 0.05}], replicates=2)
    assert len(jobs) == 2 and client.job(jobs[0]).view.get("sweep_id") == study.id
    assert study.pause().state == "paused" and study.resume().state == "running"
    assert study.cancel().wait(180, progress=False).state == "cancelled"


def test_the_end_of_a_study_is_forecast(client: Client) -> None:
    study = client.submit_study(question(name="slow", base=slow_hopper()))
    forecast = study.forecast()
    assert 1 <= forecast["runs_left"]["least"] <= forecast["runs_left"]["most"] == 4
    # No run has ended, so that there may be no range of time yet.
    end = forecast.get("end")
    assert end["earliest"] <= end["latest"] if end else forecast.get("no_forecast"), forecast
    study.cancel().wait(180, progress=False)


def test_a_calibration_brings_its_measurements(client: Client, tmp_path: Path) -> None:
    report = client.validate(ROOT / "docs/examples/studies/paper-calibration.json")
    assert report["document"] == "study" and report["jobs"] == 150
    document: Document = {
        "name": "nothing",
        "factors": [],
        "goal": {"calibrate": {"measurements": "absent.json"}},
        "budget": {"max_runs": 9},
    }
    with pytest.raises(ScenarioError) as caught:
        client.validate(document)
    assert [fault.pointer for fault in caught.value.faults] == ["/goal/calibrate/measurements"]


def test_a_calibration_has_samples(client: Client) -> None:
    slide = {"experiment": "slide", "product": {"subparticle_radius_m": 0.009}, "numerics": {"timestep_s": "auto"}}
    measured = {"response": "critical_angle_deg", "unit": "deg", "mean": 25.0, "deviation": 1.0, "n": 5}
    tests = [{"name": "plate", "scenario": slide, "measured": {"responses": [measured]}}]
    friction = "/contact/fillet_equipment/static_friction"
    study = client.submit_study(
        {
            "name": "friction of a plate",
            "factors": [{"pointer": friction, "low": 0.2, "high": 0.8}],
            "goal": {"calibrate": {"measurements": {"schema": "roost.measurements/1", "name": "lab", "tests": tests}}},
            "budget": {"max_runs": 4},
        }
    ).wait(180, progress=False)
    samples = study.posterior()
    assert list(samples.columns) == ["static_friction"] and samples.attrs["pointers"] == {"static_friction": friction}
    assert 0.2 <= samples.static_friction.min() <= samples.static_friction.max() <= 0.8 and len(samples) > 100
    assert samples.attrs["units"] == {"static_friction": ""}
