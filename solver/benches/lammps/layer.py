#!/usr/bin/env python3
"""Makes a bed for compare.py: 191 bodies of 216 bonded spheres that have come to rest in a layer, in a box 0.64 m wide.

    solver/benches/lammps/layer.py folder     # layer.csv (id x y z), layer_bonds.csv (i j)

Bodies are lattices of 4 mm spheres within a flat ellipsoid of exponent 1.6, 0.15 by 0.072 by 0.038 m. LAMMPS lets them settle, with a drag and with bonds
of tissue (0.5 MPa), so that they keep their form: 9,000 steps, some minutes on two cores.
"""

import itertools
import math
import random
import subprocess
import sys
from pathlib import Path

RADIUS_M = 4e-3
DENSITY_KG_M3 = 2200.0
BODIES = 191
BOX_M = (0.64, 0.64, 0.5)
SEMI_AXES_M = (0.071, 0.032, 0.015)  # of the centres
CELL_M = (0.159, 0.0795, 0.042)
COLUMNS, ROWS = 4, 8
STEPS = 9_000


def lattice():
    """The spheres of a body, and which of them are neighbours."""
    step = 2 * RADIUS_M
    cells = itertools.product(range(-9, 10), range(-5, 5), range(-2, 3))
    points = [(i * step, (j + 0.5) * step, k * step) for i, j, k in cells]
    points = [p for p in points if sum(abs(x / a) ** 1.6 for x, a in zip(p, SEMI_AXES_M)) <= 1]
    number = {tuple(round(x / step * 2) for x in p): n for n, p in enumerate(points)}
    ahead = [(2, 0, 0), (0, 2, 0), (0, 0, 2)]
    pairs = [(n, number.get(tuple(a + b for a, b in zip(at, by)))) for at, n in number.items() for by in ahead]
    return points, [(i, j) for i, j in pairs if j is not None]


def tilted(points, draw):
    """The points about an axis at random, by two degrees at most."""
    axis = [draw.gauss(0, 1) for _ in range(3)]
    size = math.hypot(*axis)
    x, y, z = (a / size for a in axis)
    angle = math.radians(draw.uniform(-2, 2))
    c, s = math.cos(angle), math.sin(angle)
    rows = [
        (c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s),
        (y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s),
        (z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)),
    ]
    return [tuple(sum(a * b for a, b in zip(row, p)) for row in rows) for p in points]


def placed():
    """All bodies, one to a cell of a loose grid, and their bonds."""
    draw = random.Random(1)
    points, pairs = lattice()
    spheres, bonds = [], []
    for body in range(BODIES):
        layer, rest = divmod(body, COLUMNS * ROWS)
        row, column = divmod(rest, COLUMNS)
        turned = tilted(points, draw)
        low = [min(p[k] for p in turned) - RADIUS_M for k in range(3)]
        high = [max(p[k] for p in turned) + RADIUS_M for k in range(3)]
        room = [max(c - (h - l), 0.0) for c, h, l in zip(CELL_M, high, low)]
        corner = (column * CELL_M[0], row * CELL_M[1], 0.002 + layer * CELL_M[2])
        by = [c - l + draw.random() * r for c, l, r in zip(corner, low, room)]
        bonds += [(i + len(spheres) + 1, j + len(spheres) + 1) for i, j in pairs]
        spheres += [tuple(x + d for x, d in zip(p, by)) for p in turned]
    return spheres, bonds


def write_data(path, spheres, bonds):
    with open(path, "w") as file:
        print(f"layer\n\n{len(spheres)} atoms\n{len(bonds)} bonds\n1 atom types\n1 bond types", file=file)
        print("6 extra bond per atom\n60 extra special per atom", file=file)
        for axis, width in zip("xyz", BOX_M):
            print(f"0 {width} {axis}lo {axis}hi", file=file)
        print("\nAtoms # bpm/sphere\n", file=file)
        for n, (x, y, z) in enumerate(spheres, 1):
            print(f"{n} 1 1 {2 * RADIUS_M} {DENSITY_KG_M3} {x} {y} {z}", file=file)
        print("\nBonds\n", file=file)
        for n, (i, j) in enumerate(bonds, 1):
            print(f"{n} 1 {i} {j}", file=file)


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    spheres, bonds = placed()
    write_data(folder / "layer.data", spheres, bonds)
    command = ["mpiexec", "-n", "2", "lmp", "-in", str(Path(__file__).parent / "in.layer"), "-log", "none"]
    command += ["-var", "folder", str(folder), "-var", "steps", str(STEPS)]
    subprocess.run(command, check=True)
    rows = (folder / "layer.dump").read_text().splitlines()[9:]
    (folder / "layer.csv").write_text("\n".join(rows) + "\n")
    (folder / "layer_bonds.csv").write_text("".join(f"{i} {j}\n" for i, j in bonds))


if __name__ == "__main__":
    main()
