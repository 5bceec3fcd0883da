"""Intervals of the beta-binomial confidence sequence with SciPy: rows for design/src/tests/intervals.rs.

python3 -m venv v && v/bin/pip install scipy==1.17.1 && v/bin/python intervals.py
"""

import math

from scipy.optimize import brentq
from scipy.special import betaln, xlog1py, xlogy


def excess(p, count, n):
    ratio = betaln(0.5 + count, 0.5 + n - count) - betaln(0.5, 0.5)
    return ratio - xlogy(count, p) - xlog1py(n - count, -p) + math.log(0.05)


for count, n in [(0, 5), (4, 10), (29, 40), (5, 5), (1, 1000), (500, 1000)]:
    share = count / n
    low = 0.0 if count == 0 else brentq(excess, 1e-300, share, args=(count, n), xtol=1e-15)
    high = 1.0 if count == n else brentq(excess, share, 1.0 - 1e-16, args=(count, n), xtol=1e-15)
    print(f"    ({count}, {n}, {low!r}, {high!r}),")
