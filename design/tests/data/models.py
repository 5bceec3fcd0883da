"""Posterior means, variances and log marginal likelihoods for fixed hyperparameters: writes models.json beside this file.

Gaussian values come from scikit-learn's GaussianProcessRegressor on all values, one row per run. Values of single trials come
from its GaussianProcessClassifier. A factor with levels is a column for each of them there, 1/√2 at the level of the point. Values of counts come from the equations of Rasmussen and Williams 2006 (algorithms 3.1 and
3.2) in NumPy, which are held to the classifier here. The last case is hetgpy's homGP with
replicates and one factor: its kernel of several factors is a product, ours is radial.

python3 -m venv v && v/bin/pip install numpy==2.4.6 scipy==1.17.1 scikit-learn==1.9.1 hetgpy==1.0.6 && v/bin/python models.py
"""

import json
import pathlib

import numpy as np
from sklearn.gaussian_process import GaussianProcessClassifier, GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

rng = np.random.default_rng(20260101)


def kernel(lengths, variance, constant):
    fixed = "fixed"
    return ConstantKernel(variance, fixed) * Matern(lengths, fixed, nu=2.5) + ConstantKernel(constant, fixed)


def gaussian(factors, n, lengths, variance, constant):
    points = rng.random((n, factors))
    noise = 0.02 + 0.1 * rng.random(n)
    values = [
        (np.sin(3 * x.sum()) + np.sqrt(r) * rng.standard_normal(rng.integers(1, 6))).tolist()
        for x, r in zip(points, noise)
    ]
    repeats = [len(v) for v in values]
    model = GaussianProcessRegressor(
        kernel(lengths, variance, constant), alpha=np.repeat(noise, repeats), optimizer=None
    ).fit(np.repeat(points, repeats, axis=0), np.concatenate(values))
    at = rng.random((5, factors))
    mean, deviation = model.predict(at, return_std=True)
    return {
        "lengths": lengths, "variance": variance, "constant": constant,
        "points": points.tolist(), "noise": noise.tolist(), "values": values,
        "log_likelihood": model.log_marginal_likelihood_value_,
        "at": at.tolist(), "means": mean.tolist(), "variances": (deviation**2).tolist(),
    }


def laplace(k, counts, n, cross, diagonal):
    """Algorithms 3.1 and 3.2 for counts, without the binomial coefficient."""
    f = np.zeros(len(n))
    for _ in range(100):
        p = 1 / (1 + np.exp(-f))
        w = n * p * (1 - p)
        root = np.sqrt(w)
        low = np.linalg.cholesky(np.eye(len(n)) + root[:, None] * k * root)
        b = w * f + counts - n * p
        a = b - root * np.linalg.solve(low.T, np.linalg.solve(low, root * (k @ b)))
        f = k @ a
    p = 1 / (1 + np.exp(-f))
    w = n * p * (1 - p)
    root = np.sqrt(w)
    low = np.linalg.cholesky(np.eye(len(n)) + root[:, None] * k * root)
    value = -0.5 * a @ f + (counts * f - n * np.logaddexp(0, f)).sum() - np.log(np.diag(low)).sum()
    v = np.linalg.solve(low, root[:, None] * cross)
    return value, cross.T @ (counts - n * p), diagonal - (v**2).sum(axis=0)


def counts(factors, n, lengths, variance, constant, trials):
    points = rng.random((n, factors))
    runs = rng.integers(1, trials + 1, n)
    truth = 1 / (1 + np.exp(-8 * (points.sum(axis=1) - factors / 2)))
    hits = rng.binomial(runs, truth)
    k = kernel(lengths, variance, constant)
    at = rng.random((5, factors))
    value, mean, var = laplace(k(points), hits, runs, k(points, at), k.diag(at))
    if trials == 1:
        other = GaussianProcessClassifier(k, optimizer=None, max_iter_predict=1000).fit(points, hits)
        assert abs(other.log_marginal_likelihood_value_ - value) < 1e-8
        inner = other.base_estimator_
        assert np.allclose(k(at, points) @ (inner.y_train_ - inner.pi_), mean, atol=1e-5)
    return {
        "lengths": lengths, "variance": variance, "constant": constant,
        "points": points.tolist(), "runs": runs.tolist(), "hits": hits.tolist(),
        "log_likelihood": float(value), "at": at.tolist(), "means": mean.tolist(), "variances": var.tolist(),
    }


def hetgpy_case():
    from hetgpy import homGP

    points = np.repeat(rng.random((12, 1)), rng.integers(1, 8, 12), axis=0)
    values = np.cos(4 * points[:, 0]) + 0.2 * rng.standard_normal(len(points))
    lengths, nugget = [0.6], 0.05
    model = homGP()
    # beta0 = 0 makes the mean known; theta is the length scale of its Matérn 5/2.
    model.mle(points, values, covtype="Matern5_2", known={"theta": np.array(lengths), "g": nugget, "beta0": 0.0})
    at = rng.random((5, 1))
    found = model.predict(at)
    scale = float(np.squeeze(model.nu_hat))
    unique, inverse = np.unique(points, axis=0, return_inverse=True)
    grouped = [values[inverse.ravel() == i].tolist() for i in range(len(unique))]
    return {
        "lengths": lengths, "variance": scale, "constant": 0.0,
        "points": unique.tolist(), "noise": [nugget * scale] * len(unique), "values": grouped,
        "log_likelihood": None, "at": at.tolist(),
        "means": np.ravel(found["mean"]).tolist(), "variances": np.ravel(found["sd2"]).tolist(),
    }


def with_levels(n, lengths, levels, variance, constant):
    """As `gaussian`, but factors with a number of levels other than 0 have levels: a column for each in scikit-learn."""
    places = rng.random((n + 5, len(levels)))
    for factor, k in enumerate(levels):
        if k:
            places[:, factor] = (np.floor(places[:, factor] * k) + 0.5) / k
    columns, scales = [], []
    for factor, (k, length) in enumerate(zip(levels, lengths)):
        column = places[:, factor]
        columns += [np.where(np.floor(column * k) == level, np.sqrt(0.5), 0.0) for level in range(k)] or [column]
        scales += [length] * max(k, 1)
    embedded = np.stack(columns, axis=1)
    noise = 0.02 + 0.1 * rng.random(n)
    values = [
        (np.sin(3 * x.sum()) + np.sqrt(r) * rng.standard_normal(rng.integers(1, 6))).tolist()
        for x, r in zip(places, noise)
    ]
    repeats = [len(v) for v in values]
    model = GaussianProcessRegressor(
        kernel(scales, variance, constant), alpha=np.repeat(noise, repeats), optimizer=None
    ).fit(np.repeat(embedded[:n], repeats, axis=0), np.concatenate(values))
    mean, deviation = model.predict(embedded[n:], return_std=True)
    return {
        "lengths": lengths, "levels": levels, "variance": variance, "constant": constant,
        "points": places[:n].tolist(), "noise": noise.tolist(), "values": values,
        "log_likelihood": model.log_marginal_likelihood_value_,
        "at": places[n:].tolist(), "means": mean.tolist(), "variances": (deviation**2).tolist(),
    }


data = {
    "gaussian": [
        gaussian(1, 8, [0.4], 1.3, 0.5), gaussian(2, 15, [0.7, 0.3], 0.8, 1.0), gaussian(4, 40, [0.7, 0.3, 1.2, 2.0], 2.0, 0.1)
    ],
    "binomial": [
        counts(1, 12, [0.5], 6.0, 4.0, 1), counts(2, 25, [0.7, 0.4], 10.0, 9.0, 1),
        counts(2, 20, [0.7, 0.4], 10.0, 9.0, 12), counts(3, 40, [0.7, 0.4, 1.5], 5.0, 9.0, 30),
    ],
    "hetgpy": [hetgpy_case()],
    "levels": [with_levels(25, [0.5, 0.8], [0, 3], 1.3, 0.5), with_levels(40, [0.9, 0.4, 1.5], [2, 0, 5], 0.8, 1.0)],
}
path = pathlib.Path(__file__).with_name("models.json")
path.write_text(json.dumps(data, indent=None, separators=(",", ":")) + "\n")
print(path.stat().st_size, "bytes")
