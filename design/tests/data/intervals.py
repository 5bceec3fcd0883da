"""Intervals of the confidence sequences with SciPy: rows for design/src/tests/intervals.rs.

python3 -m venv v && v/bin/pip install scipy==1.17.1 && v/bin/python intervals.py
"""

import math

from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import betaln, xlog1py, xlogy
from scipy.stats import nct, norm, t as student


def excess(p, count, n):
    ratio = betaln(0.5 + count, 0.5 + n - count) - betaln(0.5, 0.5)
    return ratio - xlogy(count, p) - xlog1py(n - count, -p) + math.log(0.05)


for count, n in [(0, 5), (4, 10), (29, 40), (5, 5), (1, 1000), (500, 1000)]:
    share = count / n
    low = 0.0 if count == 0 else brentq(excess, 1e-300, share, args=(count, n), xtol=1e-15)
    high = 1.0 if count == n else brentq(excess, share, 1.0 - 1e-16, args=(count, n), xtol=1e-15)
    print(f"    ({count}, {n}, {low!r}, {high!r}),")


def bayes_factor(x, n):
    """Likelihood of a t statistic under the mixture of effects with deviation 1, over that without an effect."""
    null = student.pdf(x, n - 1)
    centre = x / math.sqrt(n)
    ratio = lambda effect: nct.pdf(x, n - 1, effect * math.sqrt(n)) / null * norm.pdf(effect)
    return quad(ratio, centre - 8, centre + 8, limit=500, epsabs=0, epsrel=1e-11, points=[0, centre])[0]


for n in [5, 10, 60, 150]:
    x = brentq(lambda x: math.log(0.05 * bayes_factor(x, n)), 2.0, 12.0, xtol=1e-13)
    print(f"    ({n}, {x / math.sqrt(n)!r}),")
