"""Measures `roost.run` beside the command `roost run`, and small runs in thread pools. It needs a machine without other load.

`python3 python/benches/overhead.py` takes about three minutes on two cores, and prints the rows of docs/performance.md. Package and command
must come from the same wheel: it takes the command of the environment of this interpreter, or that of the variable ROOST_COMMAND.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from typing import Any

import roost

Fields = dict[str, Any]

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


def spread(ratios: Sequence[float]) -> str:
    """Median and quartiles."""
    low, _, high = quantiles(ratios, n=4)
    return f"{median(ratios):.3f} ({low:.3f} to {high:.3f}), n = {len(ratios)}"


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
    ratios = [spread([a / b for a, b in zip(*column) if b]) for column in zip(zip(*package), zip(*beside))]
    name = f"{fields['product']['count']} fillets, {threads} thread{'s' if threads > 1 else ''}"
    walls = [f"{median(row[0] for row in rows):.3f}" for rows in (package, beside)]
    print(f"| {name} | {' | '.join([*walls, *ratios])} |", flush=True)


def pools(runs: int, turns: int) -> None:
    """Small runs in pools of one and two threads, in turns."""
    scenarios = [roost.Scenario(SMALL).with_(seed=seed) for seed in range(1, runs + 1)]

    def run(scenario: roost.Scenario) -> roost.Result:
        return roost.run(scenario, threads=1, progress=False)

    def wall_s(threads: int) -> float:
        with ThreadPoolExecutor(threads) as pool:
            return timed(lambda: list(pool.map(run, scenarios)))[0]

    walls = [(wall_s(1), wall_s(2)) for _ in range(turns)]
    one, two = (median(column) for column in zip(*walls))
    ratios = [first / second for first, second in walls]
    print(f"| {runs} runs of {SMALL['product']['count']} fillets | {one:.2f} | {two:.2f} | {spread(ratios)} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=21, help="pairs of the larger simulation; the small one has twice as many")
    parser.add_argument("--turns", type=int, default=7, help="turns of the thread pools")
    parser.add_argument("--runs", type=int, default=100, help="runs of a turn")
    given = parser.parse_args()
    load = f"{os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else "unknown"
    print(f"roost {roost.__version__}, solver revision {roost.SOLVER_REVISION}, {os.cpu_count()} processors, load {load}")
    print("| simulation | roost.run (s) | roost run (s) | ratio | processor time | solver alone |\n|---|---|---|---|---|---|")
    with TemporaryDirectory() as folder:
        pairs(SMALL, 1, 2 * given.pairs, Path(folder))
        pairs(SLICE, 1, given.pairs, Path(folder))
        pairs(SLICE, 2, given.pairs, Path(folder))
    print("| runs | one thread (s) | two threads (s) | ratio |\n|---|---|---|---|")
    pools(given.runs, given.turns)


if __name__ == "__main__":
    main()
