"""The last step of the Snakefile: results become a table of mean rates, and a picture with 95 % intervals.

    python3 table.py rates.csv rates.png results/*/result.json
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import pandas as pd

from roost import Result

# Two-sided 95 % quantiles of Student's t for 1 to 9 degrees of freedom; from 10 on, 2.2 is an upper bound.
T_95 = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262]


def row(result: Result) -> dict[str, float]:
    """The gate opening, the seed and the mean rate of a simulation; the rate of one that never flowed is NaN."""
    scenario, rate = result.document["scenario"], result.responses["mean_rate_kg_s"]
    return {
        "gate_opening_m": scenario["equipment"]["gate_opening_m"],
        "seed": scenario["seed"],
        "mean_rate_kg_s": rate if isinstance(rate, float) else float("nan"),
    }


def half_width(rates: pd.Series[float]) -> float:
    """Half of the 95 % interval of the mean; NaN for a single value."""
    n = int(rates.count())
    t = float("nan") if n < 2 else T_95[n - 2] if n - 2 < len(T_95) else 2.2
    return t * float(rates.std()) / math.sqrt(n)


def main(table: Path, picture: Path, results: list[Path]) -> None:
    """Writes the table and the picture."""
    jobs = pd.DataFrame([row(Result.load(path)) for path in results])
    groups = jobs.groupby("gate_opening_m")["mean_rate_kg_s"]
    means = pd.DataFrame({"n": groups.count(), "mean_rate_kg_s": groups.mean(), "half_width_95_kg_s": groups.apply(half_width)})
    means.to_csv(table)
    figure, axes = plt.subplots(layout="constrained")
    axes.scatter(jobs["gate_opening_m"], jobs["mean_rate_kg_s"], s=18, color="gray", label="simulations")
    axes.errorbar(means.index, means["mean_rate_kg_s"], means["half_width_95_kg_s"], fmt="o-", capsize=4, label="mean, 95 % interval")
    axes.set_xlabel("gate opening (m)")
    axes.set_ylabel("mean rate (kg/s)")
    axes.set_ylim(bottom=0)
    axes.legend()
    figure.savefig(picture, dpi=150)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), [Path(name) for name in sys.argv[3:]])
