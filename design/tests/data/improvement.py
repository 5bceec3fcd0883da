"""Writes improvement.json: logarithms of expected improvement and of the normal distribution function, by mpmath.

Expected improvement of a normal value over the best: BoTorch's LogExpectedImprovement, ln(s h(z)) with h(z) = phi(z) + z Phi(z)
(Ament et al. 2023, equation 8), with 60 digits. Expected gains of area by numerical integration. Run with mpmath 1.4.1.
"""

import json
import pathlib

from mpmath import erfc, exp, inf, log, mp, mpf, pi, quad, sqrt

mp.dps = 60


def cdf(z):
    return erfc(-z / sqrt(2)) / 2


def density(z):
    return exp(-z * z / 2) / sqrt(2 * pi)


def ln_improvement(gap, deviation):
    z = gap / deviation
    return log(deviation * (density(z) + z * cdf(z)))


improvements = [
    {"gap": gap, "deviation": deviation, "ln": float(ln_improvement(mpf(gap), mpf(deviation)))}
    for gap in [-1000.0, -40.0, -10.0, -3.1, -3.0, -2.9, -1.0, -0.01, 0.0, 0.5, 3.0, 40.0]
    for deviation in [0.3, 1.0, 25.0]
]
tails = [{"z": z, "ln": float(log(cdf(mpf(z))))} for z in [-1000.0, -30.0, -8.0, -3.01, -2.99, -1.0, 0.0, 2.0, 7.0]]

# Gain of area over a front: integral over (a, b) outside the dominated region of P(X <= a) P(Y <= b).
mp.dps = 20
front, reference = [[0.1, 0.9], [0.4, 0.5], [0.8, 0.2]], [1.0, 1.0]


def integral(mean, deviation, start, end):
    """Integral of P(X <= a) in pieces of a standard deviation; it is negligible 20 deviations below its end and the mean."""
    mean, deviation, end = mpf(mean), mpf(deviation), mpf(end)
    start = max(mpf(start), min(mean, end) - 20 * deviation)
    pieces = max(1, int((end - start) / deviation) + 1)
    ends = [start + (end - start) * k / pieces for k in range(pieces + 1)]
    return quad(lambda a: cdf((a - mean) / deviation), ends)


gains = []
for means, deviations in [([0.3, 0.3], [0.2, 0.1]), ([0.9, 0.9], [0.05, 0.3]), ([1.5, 1.2], [0.1, 0.1]), ([0.0, 0.0], [0.01, 0.02])]:
    ends = [-inf] + [point[0] for point in front] + [reference[0]]
    heights = [reference[1]] + [point[1] for point in front]
    total = sum(
        integral(means[0], deviations[0], ends[k], ends[k + 1]) * integral(means[1], deviations[1], -inf, heights[k])
        for k in range(4)
    )
    gains.append({"means": means, "deviations": deviations, "ln": float(log(total))})

document = {"improvements": improvements, "tails": tails, "front": front, "reference": reference, "gains": gains}
pathlib.Path(__file__).with_suffix(".json").write_text(json.dumps(document) + "\n")
