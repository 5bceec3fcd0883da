#!/usr/bin/env bash
# The files for ParaView, read by VTK's own reader: runs some fillets with frames, and holds every file to docs/frames.md.
#
#   tests/vtk/run.sh            another scenario, and frames of the same run that another version wrote:
#   tests/vtk/run.sh scenario.json OTHER
#
# Wants Python 3 with venv, and the network once: VTK comes from PyPI into target/vtk.
set -euo pipefail
cd "$(dirname "$0")/../.."
version=9.7.2
venv=$PWD/target/vtk/venv
[ -x "$venv/bin/pip" ] || python3 -m venv "$venv"
"$venv/bin/pip" install --quiet --disable-pip-version-check "vtk==$version" numpy

scenario=${1:-target/vtk/scenario.json}
[ $# -gt 0 ] || cat > "$scenario" << 'END'
{"experiment": "hopper", "product": {"count": 60, "subparticle_radius_m": 0.004},
 "equipment": {"hopper_width_m": 0.3, "belt_speed_m_s": 1.5},
 "numerics": {"timestep_s": "auto", "duration_s": 0.06, "stop": {"when_empty": false}}}
END
cargo run --bin roost -- run "$scenario" -o target/vtk/out --frames target/vtk/frames --frame-interval 0.5
"$venv/bin/python" tests/vtk/read.py target/vtk/frames "${@:2}"
