"""Computes reference numbers for the tests of designs, effects and intervals, with SciPy and statsmodels (pip install scipy statsmodels):

    python make.py > scipy.json

Made with SciPy 1.17.1, NumPy 2.4.6 and statsmodels 0.15.0.
"""

import json

import numpy as np
import statsmodels.api as sm
from scipy import stats
from scipy.stats import qmc

# The Sobol sequence without scrambling.
sobol = qmc.Sobol(d=8, scramble=False).random_base2(4).tolist()

# Centred L2 discrepancies of drawn designs: 64 points in 3 factors under 400 seeds.
seeds = range(400)
discrepancies = {
    "sobol": [qmc.discrepancy(qmc.Sobol(d=3, scramble=True, rng=s).random_base2(6)) for s in seeds],
    "latin_hypercube": [qmc.discrepancy(qmc.LatinHypercube(d=3, rng=s).random(64)) for s in seeds],
    "random": [qmc.discrepancy(np.random.default_rng(s).random((64, 3))) for s in seeds],
}
quantiles = {kind: np.quantile(of, [0.001, 0.5, 0.999]).tolist() for kind, of in discrepancies.items()}

# A few responses over three factors, one of them on a logarithmic scale, with ties.
rng = np.random.default_rng(7)
a = np.repeat([0.0, 1.0, 2.0, 3.0], 5)
b = np.tile(np.logspace(-2, 2, 5), 4)
c = rng.random(20)
y = 3.0 * a - np.log(b) + rng.normal(size=20)
z = np.round(c + rng.random(20), 1)


def effect(x, y):
    """Least squares over the range, and Spearman's correlation with its p-value."""
    fit, rank = stats.linregress(x, y), stats.spearmanr(x, y)
    return {"effect": fit.slope * (max(x) - min(x)), "rank_correlation": rank.statistic, "p_value": rank.pvalue}


effects = {
    "a": a.tolist(), "b": b.tolist(), "c": c.tolist(), "y": y.tolist(), "z": z.tolist(),
    "of_y": {"a": effect(a, y), "b": effect(np.log(b), y), "c": effect(c, y)},
    "of_z": {"a": effect(a, z), "b": effect(np.log(b), z), "c": effect(c, z)},
}

# Means with their 95 % intervals.
intervals = []
for values in ([1.5, 2.5], [0.1, 0.2, 0.4, 0.3], rng.normal(5.0, 2.0, 9).tolist()):
    low, high = stats.t.interval(0.95, len(values) - 1, loc=np.mean(values), scale=stats.sem(values))
    intervals.append({"values": values, "mean": np.mean(values), "standard_deviation": np.std(values, ddof=1),
                      "low_95": low, "high_95": high})

# Contrasts of four points with common seeds: the effect along a line, and the difference of two points.
x = np.array([0.0, 1.0, 2.0, 5.0])
by_seed = np.random.default_rng(11)
values = 3.0 + 0.8 * x[:, None] + by_seed.normal(size=6) + by_seed.normal(scale=0.4, size=(4, 6))


def line(values):
    """The contrast that is the slope times the range, for each seed."""
    return np.array([stats.linregress(x, column).slope for column in values.T]) * (x.max() - x.min())


def additive(values):
    """The interval of the same contrast by the additive model of points and seeds."""
    points, seeds = values.shape
    columns = [np.eye(points)[np.repeat(range(points), seeds)], np.eye(seeds)[np.tile(range(seeds), points)][:, 1:]]
    weights = (x - x.mean()) / ((x - x.mean()) ** 2).sum() * (x.max() - x.min())
    fit = sm.OLS(values.ravel(), np.hstack(columns)).fit()
    return fit.t_test(np.concatenate([weights, np.zeros(seeds - 1)])).conf_int()[0].tolist()


paired = stats.ttest_rel(values[3], values[1]).confidence_interval()
welch = stats.ttest_ind(values[3], values[1], equal_var=False).confidence_interval()
contrasts = {
    "x": x.tolist(), "values": values.tolist(), "effect": line(values).mean(),
    "by_seed": list(stats.ttest_1samp(line(values), 0.0).confidence_interval()),
    "additive_model": additive(values[:, :3]),
    "difference": list(paired), "unpaired": list(welch),
}

points = [[0.1, 0.7], [0.35, 0.2], [0.9, 0.55], [0.6, 0.95]]
document = {
    "sobol": sobol,
    "discrepancy": {"points": points, "value": qmc.discrepancy(np.array(points)), "quantiles": quantiles},
    "effects": effects,
    "intervals": intervals,
    "contrasts": contrasts,
}
print("{\n" + ",\n".join(f"{json.dumps(name)}: {json.dumps(value)}" for name, value in document.items()) + "\n}")
