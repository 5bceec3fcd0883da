"""Writes sobol_indices.json: Jansen's estimates and elementary effects by SALib, from the same designs and outputs.

SALib has Jansen's estimator for total indices only. Jansen's first-order index is one minus the same expression with the
matrices A and B exchanged. Run with SALib 1.6.0 and NumPy 2.4.6.
"""

import json
import pathlib

import numpy as np
from SALib.analyze import morris, sobol
from SALib.test_functions import Ishigami

generator = np.random.default_rng(7)


def numbers(array):
    return np.asarray(array).tolist()


rows, factors = 40, 3
a, b = (generator.uniform(-np.pi, np.pi, (rows, factors)) for _ in range(2))
y_a, y_b = Ishigami.evaluate(a), Ishigami.evaluate(b)
mixed = []
for factor in range(factors):
    point = a.copy()
    point[:, factor] = b[:, factor]
    mixed.append(Ishigami.evaluate(point))
mixed = np.array(mixed).T
first = [1 - sobol.total_order(y_b, mixed[:, i], y_a) for i in range(factors)]
total = [sobol.total_order(y_a, mixed[:, i], y_b) for i in range(factors)]

# Trajectories with a step of half the range, as many levels give it.
trajectories, factors = 12, 9
start = generator.random((trajectories, factors))
order = np.array([generator.permutation(factors) for _ in range(trajectories)])
weights = np.arange(1, factors + 1)
x, y = [], []
for row in range(trajectories):
    point = start[row].copy()
    x.append(point.copy())
    for factor in order[row]:
        point[factor] += 0.5 if point[factor] < 0.5 else -0.5
        x.append(point.copy())
x = np.array(x)
y = x @ weights + 3 * x[:, 0] * x[:, 1] - 2 * np.sin(5 * x[:, 8])
effects = morris._compute_elementary_effects(x, y, factors + 1, 0.5)

document = {
    "sobol": {"a": numbers(y_a), "b": numbers(y_b), "mixed": numbers(mixed), "first": numbers(first), "total": numbers(total)},
    "morris": {
        "start": numbers(start),
        "order": numbers(order),
        "values": numbers(y.reshape(trajectories, factors + 1)),
        "mu": numbers(effects.mean(axis=1)),
        "mu_star": numbers(np.abs(effects).mean(axis=1)),
        "sigma": numbers(effects.std(axis=1, ddof=1)),
    },
}
pathlib.Path(__file__).with_suffix(".json").write_text(json.dumps(document) + "\n")
