"""Optuna chooses gate openings and belt speeds, and the jobs of a Roost server evaluate them.

    roost up --data data --backend cpu
    python3 steady_gate.py --rounds 10

The hopper shall deliver 1.2 kg/s as evenly as possible. Optuna's ask and tell work in rounds, so that all workers have jobs.
The variables ROOST_SERVER and ROOST_TOKEN name another server. The dashboard lists the jobs by their label, `optuna=steady gate`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import optuna

from roost import Client, Scenario
from roost.client import Job

RATE_KG_S = 1.2


def loss(responses: Mapping[str, Any]) -> float | None:
    """The variation of the rate, and a penalty for a rate that is too low; None for a run that never flowed."""
    variation, rate = responses["rate_variation"], responses["mean_rate_kg_s"]
    if variation is None or rate is None:
        return None
    return float(variation) + max(0.0, RATE_KG_S - float(rate))


def main() -> None:
    """Runs the rounds, and prints the best point."""
    parser = argparse.ArgumentParser(description="Optuna chooses points, Roost evaluates them.")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--batch", type=int, default=4, help="points of a round: at least the number of cores of all workers")
    parser.add_argument("--count", type=int, default=12, help="fillets in the hopper")
    options = parser.parse_args()

    # A slice of a hopper with coarse fillets.
    hopper = Scenario(
        experiment="hopper",
        product={"count": options.count, "subparticle_radius_m": 0.009},
        equipment={"hopper_width_m": 0.15, "side_walls": "frictionless"},
        numerics={"timestep_s": "auto"},
    )
    client = Client()
    # `constant_liar` spreads the points of a round.
    study = optuna.create_study(direction="minimize", sampler=optuna.samplers.TPESampler(seed=1, constant_liar=True))
    for _ in range(options.rounds):
        trials = [study.ask() for _ in range(options.batch)]
        jobs: list[Job] = []
        for trial in trials:
            point = {
                "/equipment/gate_opening_m": trial.suggest_float("gate_opening_m", 0.03, 0.09),
                "/equipment/belt_speed_m_s": trial.suggest_float("belt_speed_m_s", 0.1, 0.4),
            }
            # Each point has another random filling.
            scenario = hopper.with_(point, seed=trial.number + 1)
            jobs.append(client.submit_job(scenario, labels={"optuna": "steady gate"}))
        for trial, job in zip(trials, jobs):
            job.wait(progress=False)
            value = loss(job.responses) if job.state == "succeeded" else None
            if value is None:
                study.tell(trial, state=optuna.trial.TrialState.FAIL)
            else:
                study.tell(trial, value)

    best = study.best_trial
    gate_m, belt_m_s = best.params["gate_opening_m"], best.params["belt_speed_m_s"]
    print(f"gate {gate_m:.4f} m, belt {belt_m_s:.3f} m/s: loss {best.value:.3f}, after {len(study.trials)} jobs")


if __name__ == "__main__":
    main()
