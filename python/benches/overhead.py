"""Measures `roost.run` beside the command `roost run`, and small runs in thread pools. It needs a machine without other load.

`python3 python/benches/overhead.py` takes about six minutes on two cores, and prints the rows of docs/performance.md. Package and command
must come from the same wheel: it takes the command of the environment of this interpreter, or that of the variable ROOST_COMMAND.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import fmean, median, stdev
from tempfile import TemporaryDirectory
from typing import Any

import roost

Fields = Any

SMALL: Fields = {
    "experiment": "hopper",
    "product": {"count": 2, "subparticle_radius_m": 0.009},
    "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
    "numerics": {"timestep_s": "auto", "duration_s": 0.5, "stop": {"when_empty": False}},
}
SLICE: Fields = {
    "experiment": "hopper",
    "product": {"count": 24, "subparticle_radius_m": 0.008},
    "equipment": {"hopper_width_m": 0.15, "side_walls": "frictionless", "gate_opening_m": 0.06},
    "numerics": {"timestep_s": "auto"},
}


def command() -> str:
    """Path of the command."""
    here = Path(sys.executable).parent / ("roost.exe" if os.name == "nt" else "roost")
    path = os.environ.get("ROOST_COMMAND", str(here))
    shown = subprocess.run([path, "--version"], capture_output=True, text=True, check=True).stdout
    if shown.split()[1] != roost.__version__:
        raise SystemExit(f"{path} is {shown.strip()}, and the package is {roost.__version__}: allowed: the same version")
    return path


def timed(call: Callable[[], Any]) -> tuple[float, float, Any]:
    """Wall time and processor time of a call in seconds, with that of the processes that it starts, and its value."""
    wall_s, processor_s = time.perf_counter(), sum(os.times()[:4])
    value = call()
    return time.perf_counter() - wall_s, sum(os.times()[:4]) - processor_s, value


def mean(ratios: Sequence[float]) -> str:
    """Geometric mean and its 95 % interval, for enough ratios that the normal distribution holds."""
    logs = [math.log(ratio) for ratio in ratios]
    centre, half = fmean(logs), 1.96 * stdev(logs) / math.sqrt(len(logs))
    return f"{math.exp(centre):.3f} ({math.exp(centre - half):.3f} to {math.exp(centre + half):.3f}), n = {len(ratios)}"


def pairs(fields: Fields, threads: int, count: int, folder: Path) -> None:
    """Package and command in turns; every second pair begins with the other one."""
    file = folder / "scenario.json"
    file.write_text(json.dumps(fields), encoding="utf-8")
    arguments = [command(), "run", str(file), "--output", str(folder / "out"), "--backend", "cpu"]
    arguments += ["--threads", str(threads), "--no-shared-fill"]

    def here() -> tuple[float, float, float]:
        wall_s, processor_s, result = timed(lambda: roost.run(file, threads=threads, progress=False))
        return wall_s, processor_s, result.wall_s

    def there() -> tuple[float, float, float]:
        wall_s, processor_s, _ = timed(lambda: subprocess.run(arguments, capture_output=True, check=True))
        return wall_s, processor_s, roost.Result.load(folder / "out/result.json").wall_s

    here()
    package: list[tuple[float, float, float]] = []
    beside: list[tuple[float, float, float]] = []
    for pair in range(count):
        turns = [(package, here), (beside, there)]
        for times, measure in reversed(turns) if pair % 2 else turns:
            times.append(measure())
    # Wall time, processor time, and the wall time of the solver alone. The system counts processor time in hundredths of a second.
    ratios = [mean([a / b for a, b in zip(*column) if a and b]) for column in zip(zip(*package), zip(*beside))]
    outside = [f"{100 * median((wall - solver) / wall for wall, _, solver in rows):.2f} %" for rows in (package, beside)]
    name = f"{fields['product']['count']} fillets, {threads} thread{'s' if threads > 1 else ''}"
    walls = [f"{median(row[0] for row in rows):.3f}" for rows in (package, beside)]
    print(f"| {name} | {' | '.join([*walls, *ratios, *outside])} |", flush=True)


def pools(runs: int, turns: int) -> None:
    """Small runs in pools of one and two threads, in turns."""
    scenarios = [roost.Scenario(SMALL).with_(seed=seed) for seed in range(1, runs + 1)]

    def run(scenario: roost.Scenario) -> roost.Result:
        return roost.run(scenario, threads=1, progress=False)

    def times(threads: int) -> tuple[float, float]:
        with ThreadPoolExecutor(threads) as pool:
            return timed(lambda: list(pool.map(run, scenarios)))[:2]

    measured = [tuple(times(threads) for threads in (1, 2)) if turn % 2 else tuple(reversed([times(2), times(1)])) for turn in range(turns)]
    walls = [f"{median(turn[pool][0] for turn in measured):.2f}" for pool in (0, 1)]
    # How many cores the pool kept busy.
    busy = [f"{median(turn[pool][1] / turn[pool][0] for turn in measured):.2f}" for pool in (0, 1)]
    ratio = mean([one[0] / two[0] for one, two in measured])
    name = f"{runs} runs of {SMALL['product']['count']} fillets"
    print(f"| {name} | {' | '.join([*walls, ratio, *busy])} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100, help="pairs of each simulation")
    parser.add_argument("--turns", type=int, default=20, help="turns of the thread pools")
    parser.add_argument("--runs", type=int, default=100, help="runs of a turn")
    given = parser.parse_args()
    load = f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown"
    print(f"roost {roost.__version__}, solver revision {roost.SOLVER_REVISION}, {os.cpu_count()} processors, load {load}")
    print("| simulation | roost.run (s) | roost run (s) | ratio | processor time | solver alone | outside the solver, roost.run | the same, roost run |")
    print("|---" * 8 + "|")
    with TemporaryDirectory() as folder:
        pairs(SMALL, 1, given.pairs, Path(folder))
        pairs(SLICE, 1, given.pairs, Path(folder))
        pairs(SLICE, 2, given.pairs, Path(folder))
    print("| runs | one thread (s) | two threads (s) | ratio | cores busy, one thread | cores busy, two threads |\n" + "|---" * 6 + "|")
    pools(given.runs, given.turns)


if __name__ == "__main__":
    main()
