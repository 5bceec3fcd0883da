"""The posterior of a calibration by emcee: adds its moments and quantiles to calibration.json beside this file.

The table of emulators is written by `cargo test -p roost-design write_table -- --ignored`. Everything else is computed here: splines of the
table, Student's t by an integral over precisions, correlations of the points of the curve, and the discrepancy.

python3 -m venv v && v/bin/pip install numpy==2.4.6 scipy==1.17.1 emcee==3.1.6 && v/bin/python calibration.py
"""

import json
import pathlib

import emcee
import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.stats import chi2

PATH = pathlib.Path(__file__).with_name("calibration.json")
DISCREPANCY = 0.1
table = json.loads(PATH.read_text())
targets = table["targets"]
steps = int(round(len(table["grid"][0][0]) ** 0.5))
axis = np.linspace(0, 1, steps)
splines = [
    [RectBivariateSpline(axis, axis, np.reshape(values, (steps, steps))) for values in of_target]
    for of_target in table["grid"]
]
mean = np.array([target["mean"] for target in targets])
error = np.array([target["deviation"] / target["n"] ** 0.5 for target in targets])
place = [target["curve"]["at"] if "curve" in target else None for target in targets]
groups = [[0], [1, 2, 3]]


def precisions(n, count=400):
    """Equally probable values of chi-squared over its degrees of freedom."""
    return chi2.ppf((np.arange(count) + 0.5) / count, n - 1) / (n - 1)


mixtures = [precisions(min(targets[index]["n"] for index in group)) for group in groups]


def ln_density(state):
    a, b, units = state
    if not (0 <= a <= 1 and 0 <= b <= 1 and units >= 0):
        return -np.inf
    total = -0.5 * units**2
    emulated = np.array([float(of[0](a, b)[0, 0]) for of in splines])
    variance = np.array([max(float(of[1](a, b)[0, 0]), 0.0) for of in splines])
    for group, mixture in zip(groups, mixtures):
        x = np.array([place[index] or 0.0 for index in group])
        length = np.ptp(x) or 1.0
        correlation = np.exp(-np.abs(x[:, None] - x[None, :]) / length)
        inverse = np.linalg.inv(correlation)
        other = variance[group] + (DISCREPANCY * units * mean[group]) ** 2
        scale = np.sqrt(error[group] ** 2 / mixture[:, None] + other)
        z = (mean[group] - emulated[group]) / scale
        terms = -0.5 * np.einsum("ki,ij,kj->k", z, inverse, z) - np.log(scale).sum(axis=1)
        total += np.logaddexp.reduce(terms) - np.log(len(mixture))
    return total


rng = np.random.default_rng(1)
walkers = 64
start = np.column_stack([rng.uniform(0.3, 0.7, (walkers, 2)), np.abs(rng.normal(0, 1, walkers))])
sampler = emcee.EnsembleSampler(walkers, 3, ln_density)
sampler.random_state = np.random.RandomState(1).get_state()
sampler.run_mcmc(start, 20000)
samples = sampler.get_chain(discard=2000, flat=True)
samples[:, 2] *= DISCREPANCY
quantiles = np.quantile(samples, [0.025, 0.5, 0.975], axis=0)
table["emcee"] = [
    [float(samples[:, i].mean()), float(samples[:, i].std()), *map(float, quantiles[:, i])] for i in range(3)
]
table["grid"] = [[[float(f"{value:.7g}") for value in values] for values in of_target] for of_target in table["grid"]]
PATH.write_text(json.dumps(table, separators=(",", ":")) + "\n")
print(table["emcee"], "autocorrelation times", sampler.get_autocorr_time(quiet=True))
