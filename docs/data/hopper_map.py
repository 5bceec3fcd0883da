#!/usr/bin/env python3
"""The jam probability of a slice of a hopper, over gate opening and friction of the belt: a table and a picture.

    cargo build
    docs/data/hopper_map.py target/debug/roost [SEEDS]

Simulates every design point with 24 seeds (about half an hour on two cores), and writes docs/data/hopper-map.csv and
docs/images/hopper-map.svg. `--draw` only draws the table again. `design/src/tests/boundary/hopper.rs` holds studies to the table.
"""
import collections
import csv
import io
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).parents[2]
TABLE, PICTURE = ROOT / "docs/data/hopper-map.csv", ROOT / "docs/images/hopper-map.svg"
sys.path.insert(0, str(ROOT / "worker/benches"))
from farm import Farm  # noqa: E402

GATE, FRICTION = "/equipment/gate_opening_m", "/contact/fillet_belt/static_friction"
GATES = [round(0.03 + 0.01 * step, 2) for step in range(8)]
FRICTIONS = [round(0.1 + 0.1 * step, 1) for step in range(8)]
BASE = {"experiment": "hopper",
        "product": {"count": 48, "subparticle_radius_m": 0.008},
        "equipment": {"hopper_width_m": 0.15, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "stop": {"when_jammed_s": 1}}}


def simulate(roost, seeds):
    """Number of jammed runs and of all runs with a result, by gate opening and friction."""
    with tempfile.TemporaryDirectory() as folder, Farm(roost, folder) as farm:
        sweep = farm.submit({"name": "map of jams", "base": BASE, "design": {"kind": "grid"}, "replicates": seeds,
                             "factors": [{"pointer": GATE, "levels": GATES}, {"pointer": FRICTION, "levels": FRICTIONS}]})
        farm.workers = [farm.worker("worker")]
        farm.wait(sweep)
        table = subprocess.run([roost, "results", sweep, "--format", "csv"], env=farm.environment, check=True,
                               stdout=subprocess.PIPE, text=True).stdout
    counts = collections.defaultdict(lambda: [0, 0])
    for row in csv.DictReader(io.StringIO(table)):
        if row["jammed"] != "":
            entry = counts[float(row[GATE]), float(row[FRICTION])]
            entry[0] += row["jammed"] in ("1", "true")
            entry[1] += 1
    return counts


def write(counts):
    with TABLE.open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["gate_opening_m", "belt_friction", "jammed", "runs"])
        rows.writerows([*point, *counts[point]] for point in sorted(counts))


def draw():
    """Squares by share of jams, with the number of jams in each."""
    with TABLE.open() as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    size, left, top = 48, 76, 34
    height = top + size * len(FRICTIONS)
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {left + size * len(GATES) + 20} {height + 56}" '
             'font-family="sans-serif" font-size="13" text-anchor="middle">',
             '<rect width="100%" height="100%" fill="white"/>',
             f'<text x="{left + size * len(GATES) / 2}" y="20">jammed runs of {rows[0]["runs"]:.0f} seeds</text>']
    for row in rows:
        column, line = GATES.index(row["gate_opening_m"]), FRICTIONS.index(row["belt_friction"])
        x, y, share = left + size * column, height - size * (line + 1), row["jammed"] / row["runs"]
        red, green, blue = (round(255 + share * (end - 255)) for end in (31, 79, 138))
        parts.append(f'<rect x="{x}" y="{y}" width="{size}" height="{size}" fill="rgb({red},{green},{blue})" stroke="#ccc"/>'
                     f'<text x="{x + size / 2}" y="{y + size / 2 + 5}" fill="{"white" if share > 0.5 else "black"}">'
                     f'{row["jammed"]:.0f}</text>')
    for column, gate in enumerate(GATES):
        parts.append(f'<text x="{left + size * (column + 0.5)}" y="{height + 18}">{gate:.2f}</text>')
    for line, friction in enumerate(FRICTIONS):
        parts.append(f'<text x="{left - 18}" y="{height - size * (line + 0.5) + 5}">{friction:.1f}</text>')
    middle = top + size * len(FRICTIONS) / 2
    parts += [f'<text x="{left + size * len(GATES) / 2}" y="{height + 42}">gate opening (m)</text>',
              f'<text transform="translate(22 {middle}) rotate(-90)">friction of the belt</text>', "</svg>"]
    PICTURE.write_text("\n".join(parts) + "\n")


def main():
    if sys.argv[1:] != ["--draw"]:
        seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 24
        write(simulate(os.path.abspath(sys.argv[1]), seeds))
    draw()


if __name__ == "__main__":
    main()
