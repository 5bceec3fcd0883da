#!/bin/sh
# Measures the GPU backend on a machine with a graphics driver. Needs neither Rust nor this repository: only this file and a
# `roost` binary built elsewhere (cargo build --release, on a system with no newer glibc). Takes a minute or two on a fast GPU,
# and less than ten on one a tenth as fast.
#
# usage: measure.sh path/to/roost [folder] [options for every command, such as --device NAME]
#
# Writes into the folder:
#   scenario.json  the paper's hopper, with 41,000 sub-particles
#   parity.json    deviation of the adapter from the plain path
#   bench.json     batches of 1, 4, 16 and 64 runs, at rest and in discharge
#   run.json       the scenario from fill to end; its result in run/
#   figures.txt    the figures, one per line
#
# SCENARIO (a file), SUBPARTICLES, STEPS, REPEATS and BATCHES reduce the measurement, for a trial.
set -eu
[ $# -gt 0 ] || { echo "usage: $0 path/to/roost [folder] [options for every command]" >&2; exit 2; }
roost=$1
folder=${2:-.}
[ $# -gt 2 ] && shift 2 || shift $#
mkdir -p "$folder"
began=$(date +%s)
say() { echo "$(($(date +%s) - began)) s: $1" >&2; }

# First, since it reports a missing GPU at once. A deviation beyond the limit fails at the end, after all measurements.
say "parity with the plain path"
parity=0
"$roost" bench parity "$@" >"$folder/parity.json" || parity=$?
[ "$parity" -le 1 ] || { echo "nothing was measured" >&2; exit "$parity"; }

# Half of the fillets, in a hopper as much narrower.
cat >"$folder/scenario.json" <<END
{
  "experiment": "hopper", "product": {"count": 96}, "equipment": {"hopper_width_m": 0.2965},
  "numerics": {"timestep_s": 5.75e-5, "duration_s": 6, "stop": {"when_empty": false}}
}
END
[ -z "${SCENARIO:-}" ] || cp "$SCENARIO" "$folder/scenario.json"

say "batches"
"$roost" bench solver --paths gpu --beds bonded,hopper --scenario "$folder/scenario.json" --subparticles "${SUBPARTICLES:-41000}" \
    --batches "${BATCHES:-1,4,16,64}" --steps "${STEPS:-1000}" --repeats "${REPEATS:-3}" --json "$@" >"$folder/bench.json"

say "from fill to end"
"$roost" run "$folder/scenario.json" --output "$folder/run" --backend gpu --json "$@" >"$folder/run.json"
say "done"

# The files have a field a line.
field='{ key = $1; value = $0; gsub(/[ ":]/, "", key); sub(/^[^:]*: /, "", value); gsub(/"|,$/, "", value); is[key] = value }'
{
    awk "$field"' END {
        printf "adapter: %s\nwithin tolerance of the plain path: %s (%s m apart after %s steps, the same bits until step %s)\n",
            is["device"], is["is_within_tolerance"], is["farthest_apart_m"], is["steps"], is["same_bits_until_step"]
    }' "$folder/parity.json"
    awk "$field"' END {
        printf "from fill to end: %.1f s for %d steps of %d sub-particles; at this pace %.1f s for 174,000 (aim: 10)\n",
            is["wall_s"], is["steps"], is["subparticles"], is["wall_s"] / is["steps"] * 174000
    }' "$folder/run.json"
    awk "$field"' /^  }/ {
        printf "%s %s in a batch of %d: %.3g particle-steps/s%s, %.2f us a step, 174,000 steps in %.1f s; ",
            is["backend"], is["bed"], is["batch"], is["particle_steps_per_s"], is["batch"] == 64 ? " (aim: 2e9)" : "",
            is["us_per_step"], is["us_per_step"] * 0.174
        printf "as long as copying %.0f bytes a particle-step at %.3g bytes/s\n",
            is["bytes_copied_meanwhile"], is["bytes_copied_meanwhile"] * is["particle_steps_per_s"]
    }' "$folder/bench.json"
} | tee "$folder/figures.txt"
exit "$parity"
