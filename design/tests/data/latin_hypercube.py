"""Share of the range on the wrong side of a boundary found the common way: a Latin hypercube with replicates, and linear interpolation
of the means (as scipy.interpolate.griddata does; the nearest point outside its hull). Of 10, 20, 40 and 80 replicates the best
number counts. For docs/accuracy.md.

The truths are those of two factors in design/src/tests/boundary/truths.rs.

python3 -m venv v && v/bin/pip install numpy==2.4.6 scipy==1.17.1 && v/bin/python latin_hypercube.py
"""

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.special import expit
from scipy.stats import qmc

# Name, function of log odds or mean, level, noise (none for a probability).
TRUTHS = [
    ("tilted, probability 0.5", lambda x, y: expit(14 * (0.55 - 0.8 * x - 0.35 * (y - 0.5))), 0.5, None),
    ("curved, probability 0.2", lambda x, y: expit(16 * (0.25 + 0.5 * y * y - x)), 0.2, None),
    ("closed, mean, even noise", lambda x, y: 1 - 6 * ((x - 0.55) ** 2 + 1.5 * (y - 0.45) ** 2), 0.5, lambda x: 0.3 + 0 * x),
    ("wavy, mean, uneven noise", lambda x, y: 3 * (y - 0.5 - 0.2 * np.sin(6 * x)), 0.0, lambda x: 0.1 + 0.9 * x),
]
REPETITIONS = 40
axis = np.linspace(0, 1, 33)
map_x, map_y = (values.ravel() for values in np.meshgrid(axis, axis))

for name, function, level, noise in TRUTHS:
    shares = []
    for runs in [200, 400, 800, 1600, 3200, 6400]:
        best = 1.0
        for replicates in [10, 20, 40, 80]:
            if runs // replicates < 8:
                continue
            wrong = 0.0
            for repetition in range(REPETITIONS):
                rng = np.random.default_rng(repetition)
                x, y = qmc.LatinHypercube(2, rng=rng).random(runs // replicates).T
                mean = function(x, y)
                if noise is None:
                    found = rng.binomial(replicates, mean) / replicates
                else:
                    found = mean + noise(x) * rng.standard_normal(len(x)) / np.sqrt(replicates)
                at = np.column_stack([x, y])
                surface = LinearNDInterpolator(at, found)(map_x, map_y)
                outside = np.isnan(surface)
                surface[outside] = NearestNDInterpolator(at, found)(map_x[outside], map_y[outside])
                wrong += np.mean((surface > level) != (function(map_x, map_y) > level))
            best = min(best, wrong / REPETITIONS)
        shares.append(f"{runs}: {100 * best:.2f} %")
    print(name, "|", ", ".join(shares), flush=True)
