#!/usr/bin/env python3
"""Silo emptying, case 1 of Dosta et al. 2024 (Comput. Phys. Commun. 296, 109066), for Roost and for LAMMPS.

Writes the silo as STL, the scenarios of Roost, and the input of LAMMPS for the same start. See README.md for the steps.

  silo.py fill DIR [--spheres N] [--diameter M] [--modulus PA] [--orifice M] [--seed S] [--step-share X]
  silo.py open DIR [--seconds S]       after `roost run DIR/fill.json -o DIR/fill`
  silo.py rate DIR [--from S] [--to S] after `roost run DIR/open.json -o DIR/open`, or LAMMPS
"""
import argparse, json, math, pathlib, random

RADIUS = 0.1  # of the silo, m
# Of the two silos by the diameter of the orifice: height of the funnel, m.
FUNNELS = {0.06: 0.07, 0.04: 0.08}
FACETS = 96
POISSON = 0.2
# Material M1: density kg/m3, restitution and friction between spheres, and on steel.
DENSITY, E_SPHERES, MU_SPHERES, E_STEEL, MU_STEEL = 2500.0, 0.5, 0.3, 0.4, 0.2


def timestep(case):
    """The benchmark's step for M1, 1.5 us at d = 4 mm and 1 GPa, in the same relation to the Rayleigh time, times a share."""
    return case["step_share"] * 1.5e-6 * case["diameter"] / 0.004 * math.sqrt(1e9 / case["modulus"])


def ring(radius, z):
    turn = [2 * math.pi * k / FACETS for k in range(FACETS)]
    return [(radius * math.cos(a), radius * math.sin(a), z) for a in turn]


def band(low, high):
    """Triangles between two rings; they face the axis."""
    for k in range(FACETS):
        a, b, c, d = low[k], low[k - 1], high[k - 1], high[k]
        yield from ((a, b, c), (a, c, d))


def write_stl(path, triangles):
    with open(path, "w") as file:
        file.write("solid silo\n")
        for triangle in triangles:
            corners = "".join(" vertex %.9g %.9g %.9g\n" % corner for corner in triangle)
            file.write(f"facet normal 0 0 0\n outer loop\n{corners} endloop\nendfacet\n")
        file.write("endsolid silo\n")


def in_blocks(places, edge):
    """Neighbours follow each other: Roost stores single spheres together in the order of the document."""
    def code(p):
        cell = [int((c + 1.0) / edge) for c in p]
        return sum(((cell[axis] >> bit) & 1) << (3 * bit + axis) for bit in range(12) for axis in range(3))
    return sorted(places, key=code)


def lattice(case, top_funnel):
    """Spheres on a loose jittered lattice, from the funnel upwards."""
    d, rng = case["diameter"], random.Random(case["seed"])
    gap, jitter, places, layer = 1.06 * d, 0.02 * d, [], 0
    while len(places) < case["spheres"]:
        z = 0.8 * d + layer * gap
        slope = (RADIUS - case["orifice"] / 2) / top_funnel
        wall = min(RADIUS, case["orifice"] / 2 + slope * z) - 1.0 * d
        half = int(RADIUS / gap) + 1
        for i in range(-half, half + 1):
            for j in range(-half, half + 1):
                x, y = (i + 0.5 * (layer % 2)) * gap, (j + 0.5 * (layer % 2)) * gap
                if math.hypot(x, y) + 0.1 * d < wall:
                    places.append(tuple(c + rng.uniform(-jitter, jitter) for c in (x, y, z)))
        layer += 1
    return places[: case["spheres"]], 0.8 * d + (layer + 4) * gap


def scenario(case, places, surfaces, seconds):
    surface = lambda e, mu: {"restitution": e, "static_friction": mu, "surface_energy_j_m2": 0.0}
    return {
        "experiment": "scene",
        "product": {"spheres": True, "subparticle_radius_m": case["diameter"] / 2, "density_kg_m3": DENSITY},
        "material": {"youngs_modulus_pa": case["modulus"], "poisson_ratio": POISSON},
        "contact": {"fillet_fillet": surface(E_SPHERES, MU_SPHERES), "fillet_equipment": surface(E_STEEL, MU_STEEL)},
        "scene": {"margin_m": case["diameter"], "bodies": [{"position_m": place} for place in places], "surfaces": surfaces},
        "numerics": {"timestep_s": timestep(case), "duration_s": seconds, "output_interval_s": 0.01,
                     "stop": {"when_empty": True}},
    }


def fill(case, folder):
    funnel, orifice = FUNNELS[case["orifice"]], case["orifice"] / 2
    places, top = lattice(case, funnel)
    case["top"] = max(top, funnel + 0.05)
    low, high, rim = ring(orifice, 0.0), ring(RADIUS, funnel), ring(RADIUS, case["top"])
    write_stl(folder / "silo.stl", [*band(low, high), *band(high, rim)])
    silo = {"name": "silo", "mesh": {"file": "silo.stl", "units": "m"}}
    lid = {"name": "lid", "plate_m": [[-orifice, -orifice, 0], [2 * orifice, 0, 0], [0, 2 * orifice, 0]]}
    (folder / "case.json").write_text(json.dumps(case))
    places = in_blocks(places, case["diameter"])
    (folder / "fill.json").write_text(json.dumps(scenario(case, places, [silo, lid], case["fill_s"])))


def open_lid(case, folder, seconds):
    curves = {c["name"]: c["values"] for c in json.loads((folder / "fill/result.json").read_text())["curves"]}
    places = in_blocks(list(zip(*(curves[f"position_{axis}"] for axis in "xyz"))), case["diameter"])
    silo = {"name": "silo", "mesh": {"file": "silo.stl", "units": "m"}}
    (folder / "open.json").write_text(json.dumps(scenario(case, places, [silo], seconds)))
    d, funnel = case["diameter"], FUNNELS[case["orifice"]]
    with open(folder / "open.data", "w") as file:
        file.write(f"spheres at rest in a silo\n\n{len(places)} atoms\n1 atom types\n\n")
        file.write(f"-0.11 0.11 xlo xhi\n-0.11 0.11 ylo yhi\n-0.1 {case['top'] + 0.05} zlo zhi\n\nAtoms # sphere\n\n")
        for k, place in enumerate(places):
            file.write("%d 1 %.9g %.9g %.12g %.12g %.12g\n" % (k + 1, d, DENSITY, *place))
    variables = {"E": case["modulus"], "nu": POISSON, "ee": E_SPHERES, "mu": MU_SPHERES, "ew": E_STEEL, "muw": MU_STEEL,
                 # LAMMPS gives a wall the modulus of the sphere; a rigid wall is twice as stiff.
                 # The dashpot across n that has the restitution's share of critical damping, as along n.
                 "xt": math.sqrt(2 * (1 - POISSON) / (2 - POISSON)), "Ew": 2 * case["modulus"], "d": d, "rs": RADIUS, "ro": case["orifice"] / 2, "hf": funnel,
                 "top": case["top"], "dt": timestep(case), "every": round(0.01 / timestep(case)),
                 "steps": round(seconds / timestep(case))}
    (folder / "open.in").write_text("".join(f"variable {k} index {v!r}\n" for k, v in variables.items())
                                    + pathlib.Path(__file__).with_name("in.silo").read_text())


def fit(points, start, end):
    points = [(t, n) for t, n in points if start <= t <= end]
    t0, n0 = (sum(p[k] for p in points) / len(points) for k in (0, 1))
    return sum((t - t0) * (n - n0) for t, n in points) / sum((t - t0) ** 2 for t, _ in points)


def rate(case, folder, start, end):
    mass = DENSITY * math.pi / 6 * case["diameter"] ** 3
    result = folder / "open/result.json"
    if result.exists():
        series = json.loads(result.read_text())["series"]
        one = next(s for s in series if s["name"] == "mass") if isinstance(series, list) else series["mass"]
        points = [(t, m / mass) for t, m in zip(one["t_s"], one["values"])]
        print(f"Roost  {-fit(points, start, end):9.1f} spheres/s")
    log = folder / "lammps.dat"
    if log.exists():
        rows = [line.split() for line in log.read_text().splitlines() if not line.startswith("#")]
        points = [(int(step) * timestep(case), float(left)) for step, left in rows]
        if points[-1][0] < end:
            return print("LAMMPS has not come so far")
        print(f"LAMMPS {-fit(points, start, end):9.1f} spheres/s")


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("step", choices=["fill", "open", "rate"])
parser.add_argument("folder", type=pathlib.Path)
parser.add_argument("--spheres", type=int, default=50_000)
parser.add_argument("--diameter", type=float, default=0.004)
parser.add_argument("--modulus", type=float, default=1e7)
parser.add_argument("--orifice", type=float, default=0.06, choices=sorted(FUNNELS))
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--step-share", type=float, default=1.0, help="of the benchmark's time step")
parser.add_argument("--fill-seconds", type=float, default=0.4)
parser.add_argument("--seconds", type=float, default=0.7)
parser.add_argument("--from", type=float, default=0.2, dest="start")
parser.add_argument("--to", type=float, default=0.6, dest="end")
args = parser.parse_args()
if args.step == "fill":
    args.folder.mkdir(parents=True, exist_ok=True)
    fill({"spheres": args.spheres, "diameter": args.diameter, "modulus": args.modulus, "orifice": args.orifice,
          "seed": args.seed, "step_share": args.step_share, "fill_s": args.fill_seconds}, args.folder)
else:
    case = json.loads((args.folder / "case.json").read_text())
    if args.step == "open":
        open_lid(case, args.folder, args.seconds)
    else:
        rate(case, args.folder, args.start, args.end)
