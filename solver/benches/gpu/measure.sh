#!/bin/sh
# Measures the GPU backend on a machine that has a graphics driver and nothing else: needs neither Rust nor this repository, but
# this file and a `roost` binary built elsewhere (cargo build --release, on a system with no newer glibc).
#
# usage: measure.sh path/to/roost [folder for parity.json and bench.json] [more for both, such as --device NAME]
set -eu
roost=$1
folder=${2:-.}
[ $# -gt 2 ] && shift 2 || shift $#
mkdir -p "$folder"
# How far the adapter strays from the plain path; it goes on when that is too far, to have the figures, and fails in the end.
parity=0
"$roost" bench parity "$@" >"$folder/parity.json" || parity=$?
cat "$folder/parity.json"
# One run and batches of 4, 16 and 64, at rest and in discharge.
"$roost" bench solver --paths gpu --beds bonded,hopper --batches 1,4,16,64 --steps 1000 --json "$@" >"$folder/bench.json"
cat "$folder/bench.json"
exit "$parity"
