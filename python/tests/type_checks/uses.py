"""Right and wrong uses of the package, for type checkers: nothing here runs.

Each wrong use has a comment `type: ignore`. mypy reports a comment without an error, and so does pyright in this file. A wrong use
that a checker accepts is therefore an error.
"""
# pyright: reportUnnecessaryTypeIgnoreComment=true

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import roost
from roost.fields import HopperScenario
from roost.models import SweepSpec

client = roost.Client()
known = roost.Scenario("hopper.json")
unknown: dict[str, Any] = json.loads("{}")


def right_uses() -> None:
    """Neither checker reports anything."""
    roost.Scenario(experiment="hopper", seed=2, equipment={"gate_opening_m": 0.06}, numerics={"timestep_s": "auto"})
    roost.Scenario(experiment="drop", drop={"speed_m_s": 2.0})
    roost.Scenario(experiment="bend", bend={"support": "clamped"})
    roost.Scenario(experiment="slide", slide={"max_tilt_deg": 60})
    roost.Scenario(experiment="compress", compress={"lattice": (10, 10, 3)})
    roost.Scenario(experiment="scene", scene={"bodies": [{"position_m": np.zeros(3)}]})
    roost.Scenario({"experiment": "hopper", "product": {"sizes_m": np.array([[0.144, 0.072, 0.04]])}})
    roost.Scenario(roost.Untyped(unknown), folder="meshes")
    roost.Scenario(**unknown)
    known.with_({"/equipment/gate_opening_m": 0.06}, seed=2, product={"count": 12})

    roost.run({"experiment": "bend"})
    roost.run(known, progress=False)
    roost.run(Path("hopper.json"))
    rate = roost.run(roost.Untyped(unknown)).responses["mean_rate_kg_s"]
    if isinstance(rate, float):
        print(2 * rate)

    base: HopperScenario = {"experiment": "hopper"}
    spec: SweepSpec = {"name": "gates", "base": base, "design": {"kind": "grid"}}
    print(client.submit(spec).is_ended, client.submit(base).responses, client.submit("hopper.json"))
    client.submit_job({"scenario": base, "priority": 1}, labels={"line": "north"})
    client.submit_sweep({"name": "gates", "base": known, "design": {"kind": "random", "points": 3}})
    levels = np.linspace(0.04, 0.08, 3)
    factors = [{"pointer": "/equipment/gate_opening_m", "levels": levels}]
    client.submit_sweep({**spec, "factors": [{"pointer": "/equipment/gate_opening_m", "levels": levels}]})
    client.submit_sweep(roost.Untyped({"name": "gates", "base": unknown, "factors": factors}))
    study = client.submit_study({"name": "a", "base": base, "factors": [], "goal": {}, "budget": {"max_runs": 9}})
    for handed in study.ask(2):
        responses = roost.run(handed["scenario"]).responses
        study.tell([{"run": handed["run"], "responses": {"jammed": responses["jammed"]}}])
    again = client.sweep("1").spec()
    again["replicates"] = 4
    client.submit_sweep(again)


def wrong_uses() -> None:
    """Each checker reports each line."""
    # Fields that do not exist, or that another experiment has.
    roost.Scenario(experiment="hopper", equipment={"gate_openning_m": 0.06})  # type: ignore
    roost.Scenario(experiment="hopper", equipmnt={"gate_opening_m": 0.06})  # type: ignore
    roost.Scenario(experiment="bend", equipment={"gate_opening_m": 0.06})  # type: ignore
    roost.Scenario({"experiment": "hopper", "equipment": {"gate_openning_m": 0.06}})  # type: ignore
    roost.Scenario({"experiment": "hopper", "numerics": {"stop": {"when_emtpy": True}}})  # type: ignore
    roost.run({"experiment": "hopper", "sed": 2})  # type: ignore
    known.with_(sed=2)  # type: ignore
    client.submit({"experiment": "hopper", "sed": 2})  # type: ignore
    client.submit_job({"scenario": {"experiment": "hopper", "sed": 2}})  # type: ignore
    client.submit_job({"experiment": "hopper"}, lables={"line": "north"})  # type: ignore
    client.submit_sweep({"name": "a", "base": {"experiment": "hopper", "sed": 2}, "design": {"kind": "grid"}})  # type: ignore
    client.validate({"name": "a", "base": {"experiment": "hopper"}, "desing": {"kind": "grid"}})  # type: ignore

    # Wrong types and words.
    roost.Scenario(experiment="hopper", product={"count": "12"})  # type: ignore
    roost.Scenario(experiment="hopper", numerics={"timestep_s": "automatic"})  # type: ignore
    roost.Scenario(experiment="hoper")  # type: ignore
    roost.Scenario({"experiment": "drop", "drop": {"speed_m_s": None}})  # type: ignore
    roost.run({"experiment": "slide", "slide": {"max_tilt_deg": [60]}})  # type: ignore
    known.with_(product={"count": "12"})  # type: ignore
    client.submit_sweep({"name": "a", "base": {"experiment": "hopper"}, "design": {"kind": "gird"}})  # type: ignore
    client.submit_study({"name": "a", "base": {"experiment": "hopper"}, "factors": [], "goal": {}, "budget": 9})  # type: ignore

    # Fields that are missing.
    roost.Scenario(equipment={"gate_opening_m": 0.06})  # type: ignore
    roost.run({"seed": 2})  # type: ignore
    client.submit_sweep({"base": {"experiment": "hopper"}, "design": {"kind": "grid"}})  # type: ignore

    # Documents of another kind, and dictionaries of an unknown type.
    client.submit_sweep({"experiment": "hopper"})  # type: ignore
    client.submit_job({"name": "a", "base": {"experiment": "hopper"}, "design": {"kind": "grid"}})  # type: ignore
    roost.run(unknown)  # type: ignore
    client.submit_sweep(unknown)  # type: ignore

    # A response may be missing, or a word.
    print(2 * roost.run(known).responses["mean_rate_kg_s"])  # type: ignore
    print(client.job("1").responses["regime"].upper())  # type: ignore
