#!/usr/bin/env python3
"""Intervals of a sweep that draws a parameter from a posterior, against a direct Monte Carlo and against a sweep without.

    docs/data/posterior_intervals.py target/debug/roost

A small hopper has an uncertain speed of its belt, which the rate follows: 200 samples, two runs each. The direct Monte Carlo has 200 other values, with four runs
each; the standard deviation of their means, less the noise of four runs, is that of the expected response. Prints both, and the widths of the
95 % intervals.
"""
import pathlib
import random
import statistics
import sys
import tempfile

ROOT = pathlib.Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "worker/benches"))
from farm import Farm  # noqa: E402

PARAMETER = "/equipment/belt_speed_m_s"
BASE = {"experiment": "hopper", "product": {"count": 16, "subparticle_radius_m": 0.012},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless", "gate_opening_m": 0.07},
        "numerics": {"timestep_s": "auto", "duration_s": 3}}
RESPONSES = ["mean_rate_kg_s"]
T_199 = 1.972  # Student's t at 97.5 % for 199 degrees of freedom


def values(seed, count):
    """Speeds that are as uncertain as a calibrated parameter: 0.3 m/s with a standard deviation of 0.03."""
    chance = random.Random(seed)
    return [chance.gauss(0.3, 0.03) for _ in range(count)]


def points(farm, sweep):
    """Responses of each design point, by name."""
    farm.wait(sweep)
    return farm.get(f"/v1/sweeps/{sweep}/results?by=point")["points"]


def main():
    with tempfile.TemporaryDirectory() as folder, Farm(sys.argv[1], folder) as farm:
        farm.workers = [farm.worker("worker")]
        common = {"base": BASE, "design": {"kind": "grid"}}
        drawn = farm.submit({**common, "name": "drawn", "factors": [], "replicates": 400,
                             "posterior": {"parameters": [PARAMETER], "samples": [[value] for value in values(1, 200)]}})
        fixed = farm.submit({**common, "name": "fixed", "factors": [], "replicates": 400,
                             "posterior": {"parameters": [PARAMETER], "samples": [[0.3]], "runs_per_sample": 400}})
        # With seeds of their own: common seeds would hide a part of the noise of the means.
        direct = farm.submit({**common, "base": {**BASE, "seed": 10_000}, "name": "direct", "factors": [], "replicates": 800,
                              "posterior": {"parameters": [PARAMETER], "samples": [[value] for value in values(2, 200)],
                                            "runs_per_sample": 4}})
        [drawn], [fixed] = points(farm, drawn), points(farm, fixed)
        farm.wait(direct)
        trials = farm.trials(direct)
        for name in RESPONSES:
            row, plain = drawn["responses"][name], fixed["responses"][name]
            groups = [[trial["responses"][name] for trial in trials if trial["replicate"] // 4 == sample] for sample in range(200)]
            noise = statistics.fmean(statistics.variance(group) for group in groups) / 4
            means = [statistics.fmean(group) for group in groups]
            between = statistics.variance(means)
            expected = max(between - noise, 0) ** 0.5
            width = row["high_95"] - row["low_95"]
            # 400 runs with 200 samples: the error of the mean is that of half of the noise above, and of the samples.
            direct_width = 2 * T_199 * (expected ** 2 + (expected ** 2 + 2 * noise) / 200) ** 0.5
            print(f"{name}: input deviation {row['input_deviation']:.4g}, direct {expected:.4g}; chance deviation "
                  f"{row['chance_deviation']:.4g}, direct {(4 * noise) ** 0.5:.4g}; interval {width:.4g} wide, direct {direct_width:.4g} "
                  f"(ratio {width / direct_width:.3f}), without the posterior {plain['high_95'] - plain['low_95']:.4g}")


if __name__ == "__main__":
    main()
