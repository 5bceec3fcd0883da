"""Runs in this process: bits, progress, the interpreter's lock, seeds, devices."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import get_args

import pytest

import roost
from conftest import Fields, hopper, physics, slow_hopper
from roost.fields import ScenarioDocument

COARSE: Fields = {"product": {"subparticle_radius_m": 0.009}, "numerics": {"timestep_s": "auto"}}
PLATE: Fields = {"name": "plate", "plate_m": [[-0.2, -0.2, 0], [0.4, 0, 0], [0, 0.4, 0]]}
SMALL: Fields = {
    "hopper": hopper(0.5),
    "drop": {"experiment": "drop", **COARSE, "product": {"count": 2, "subparticle_radius_m": 0.009}},
    "bend": {"experiment": "bend", **COARSE},
    "slide": {"experiment": "slide", **COARSE, "slide": {"tilt_rate_deg_s": 30}},
    "compress": {"experiment": "compress", **COARSE, "compress": {"lattice": [4, 4, 3], "strain_rate_1_s": 1.0}},
    "scene": {
        "experiment": "scene",
        **COARSE,
        "scene": {"bodies": [{"position_m": [0, 0, 0.05]}], "surfaces": [PLATE]},
        "numerics": {"timestep_s": "auto", "duration_s": 0.2},
    },
}


@pytest.mark.parametrize("fields", SMALL.values(), ids=SMALL)
def test_a_run_has_the_bits_of_the_command(fields: Fields, roost_run: Callable[..., Fields]) -> None:
    result = roost.run(fields, progress=False)
    assert physics(result.document) == physics(roost_run(fields))
    assert result.responses and result.scenario.digest == result.document["scenario_digest"]


def test_the_bits_of_every_experiment_are_compared() -> None:
    assert {scenario.__name__ for scenario in get_args(ScenarioDocument)} == {f"{name.capitalize()}Scenario" for name in SMALL}


def test_a_seed_takes_the_place_of_the_scenarios() -> None:
    first, second = (roost.run(hopper(0.2), seed=seed, progress=False) for seed in (1, 2))
    assert second.document["scenario"]["seed"] == 2
    assert first.document["series"] != second.document["series"]


def test_progress_is_reported_about_ten_times_a_second() -> None:
    seen: list[roost.Progress] = []
    result = roost.run(slow_hopper(8.0), threads=1, progress=seen.append)
    assert 3 <= len(seen) <= 10 * result.wall_s + 1
    assert {progress.phase for progress in seen} <= {"fill", "process"}
    fractions = [progress.fraction for progress in seen]
    assert fractions == sorted(fractions) and 0 <= fractions[0] < fractions[-1] <= 1
    assert "left" in str(seen[-1])


def test_an_exception_of_the_progress_function_stops_the_run() -> None:
    def stop(progress: roost.Progress) -> None:
        raise LookupError("enough")

    # To its end, this run would take minutes.
    with pytest.raises(LookupError, match="enough"):
        roost.run(slow_hopper(500.0), threads=1, progress=stop)


def test_other_threads_go_on_during_a_run() -> None:
    def ticks() -> int:
        count = 0
        with ThreadPoolExecutor(1) as pool:
            running = pool.submit(roost.run, slow_hopper(), threads=1, progress=False)
            while not running.done():
                time.sleep(0.005)
                count += 1
        assert running.result().end_reason == "duration"
        return count

    # With the lock held, this thread would wake once in every try. A busy machine may stop it in one try, not in all.
    assert any(ticks() > 3 for _ in range(5))


def test_runs_in_a_thread_pool_have_the_bits_of_single_runs() -> None:
    def run(seed: int) -> Fields:
        return physics(roost.run(hopper(0.1), seed=seed, threads=1, progress=False).document)

    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(run, range(8))) == [run(seed) for seed in range(8)]


def test_a_diverging_run_is_a_result() -> None:
    fields = hopper(0.5)
    fields["numerics"] |= {"timestep_s": 0.02, "allow_unstable": True}
    result = roost.run(fields, progress=False)
    assert result.end_reason == "unstable" and result.document["instability"]["step"] > 0


def test_an_unknown_device_is_refused() -> None:
    with pytest.raises(roost.RoostError, match='device is "tpu"; allowed: "cpu", "gpu"'):
        roost.run(hopper(0.1), device="tpu", progress=False)
    with pytest.raises(roost.RoostError, match="no GPU"):
        roost.run(hopper(0.1), device="gpu:no such adapter", progress=False)


def test_the_bar_shows_phase_and_time_left(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    importlib.import_module("ipykernel.kernelapp")  # as widgets do, outside of notebooks too
    roost.run(hopper(0.2), threads=1)
    assert capsys.readouterr().err == "", "a log gets no bar"
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    # The time left is known after half a second.
    roost.run(slow_hopper(8.0), threads=1)
    shown = capsys.readouterr().err
    assert "simulating" in shown and "t = " in shown and "left" in shown
    assert shown.rstrip().endswith("of wall time")
