#!/usr/bin/env bash
# `roost pool slurm` on a Slurm of one node: a sweep of 200 jobs on allocations of one minute, half of which are cancelled while they run.
# All 200 results must be there, and no simulated second may be computed twice but those after the last checkpoint.
#
#   tests/slurm/pool.sh          200 jobs; some ten minutes on two cores
#   JOBS=30 DURATION_S=3 ROOST=… tests/slurm/pool.sh     fewer and shorter jobs, another binary
#
# Wants root (slurmd), Debian's slurm-wlm and munge, curl and Python 3. Everything is in a temporary folder, and ends with the script.
set -euo pipefail
cd "$(dirname "$0")/../.."
roost=${ROOST:-}
if [[ -z $roost ]]; then
    cargo build --bin roost
    roost=$PWD/target/debug/roost
fi

source tests/slurm/cluster.sh
before_end() { scancel --quiet --user=root 2>> "$here/scancel.log" || true; }
start_slurm "${CPUS:-4}"

export ROOST_SERVER=http://127.0.0.1:${PORT:-7396}
umask 077
"$roost" token create --data "$here/data" --scope admin --name me > "$here/admin.token" 2>> "$here/token.log"
"$roost" token create --data "$here/data" --scope read --scope worker --name pool > "$here/pool.token" 2>> "$here/token.log"
"$roost" serve --listen "${ROOST_SERVER#http://}" --data "$here/data" --checkpoint-interval 10s > "$here/serve.log" 2>&1 &
daemons+=($!)
until curl --silent --fail --output /dev/null "$ROOST_SERVER/healthz"; do kill -0 "${daemons[-1]}"; sleep 0.2; done

python3 tests/slurm/pool.py "$roost" "$here" "${JOBS:-200}"
