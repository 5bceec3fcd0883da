#!/usr/bin/env bash
# Workers under scancel: a Slurm of one node on loopback, a server, and allocations of deploy/workers.slurm.sh that are cancelled
# while they run jobs. Every job must be handed back with a checkpoint: its attempt `preempted`, the job in the queue.
#
#   tests/slurm/run.sh          20 allocations, five at a time; some three minutes
#   SCRIPT=… ROOST=… tests/slurm/run.sh     another batch script, another binary
#
# Wants root (slurmd), Debian's slurm-wlm and munge, curl and Python 3. Everything is in a temporary folder, and ends with the script.
set -euo pipefail
cd "$(dirname "$0")/../.."
rounds=${ROUNDS:-4} at_once=5
script=${SCRIPT:-deploy/workers.slurm.sh}
roost=${ROOST:-}
if [[ -z $roost ]]; then
    cargo build --bin roost
    roost=$PWD/target/debug/roost
fi

source tests/slurm/cluster.sh
arrays=()
before_end() { scancel --quiet --signal=KILL --full "${arrays[@]}" 2>> "$here/scancel.log" || true; }
start_slurm "$at_once"

# --- the server ------------------------------------------------------------------------------------------------------
export ROOST_SERVER=http://127.0.0.1:${PORT:-7395} ROOST_STATE=$here/worker
"$roost" serve --listen "${ROOST_SERVER#http://}" --data "$here/data" --max-steps 1000000000 > "$here/serve.log" 2>&1 &
daemons+=($!)
until curl --silent --fail --output /dev/null "$ROOST_SERVER/healthz"; do kill -0 "${daemons[-1]}"; sleep 0.2; done
PATH=$(dirname "$roost"):$PATH
if [[ $(command -v roost) != "$roost" ]]; then
    mkdir "$here/bin"
    ln -s "$roost" "$here/bin/roost"
    PATH=$here/bin:$PATH
fi

# A sweep of $1 long jobs with seeds from $2 on; prints its id.
submit() {
    cat > "$here/sweep.json" << END
{"name": "seeds from $2", "replicates": $1, "base": {"experiment": "hopper", "seed": $2,
 "product": {"count": 2, "subparticle_radius_m": 0.009},
 "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless", "belt_speed_m_s": 0.005},
 "numerics": {"timestep_s": 2e-6, "duration_s": 600, "stop": {"when_empty": false}}},
 "factors": [{"pointer": "/equipment/belt_speed_m_s", "levels": [0.005]}], "design": {"kind": "grid"}}
END
    "$roost" submit --json "$here/sweep.json" | python3 -c 'import json, sys; print(json.load(sys.stdin)["id"])'
}

# How many jobs of sweep $1 are in state $2.
jobs_in() {
    "$roost" status --json "$1" | python3 -c 'import json, sys; print(json.load(sys.stdin)["counts"][sys.argv[1]])' "$2"
}

# Starts $1 allocations with more options for sbatch, and waits until they run jobs of sweep $2.
start() {
    local count=$1 sweep=$2
    shift 2
    arrays+=("$(sbatch --parsable --array="1-$count" --cpus-per-task=1 --mem=0 --output="$here/task-%A-%a.log" \
        --export=ALL "$@" "$script")")
    until [[ $(jobs_in "$sweep" running) == "$count" ]]; do sleep 0.5; done
}

# Waits until no allocation is left.
empty() { while [[ -n $(squeue --noheader) ]]; do sleep 0.5; done; }

# How the attempts of all jobs ended so far.
outcomes() {
    python3 - "$here/data/roost.db" << 'END'
import sqlite3, sys
rows = sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True).execute(
    "SELECT coalesce(outcome, 'running'), count(*) FROM attempts GROUP BY 1 ORDER BY 1")
print(", ".join(f"{count} {outcome}" for outcome, count in rows))
END
}

began=$SECONDS
for ((round = 1; round <= rounds; round++)); do
    sweep=$(submit $at_once $((round * 100)))
    start $at_once "$sweep" --time=24:00:00
    cancelled=$SECONDS
    for ((task = 1; task <= at_once; task++)); do scancel "${arrays[-1]}_$task"; done
    empty
    echo "round $round: gone $((SECONDS - cancelled)) s after scancel; $(jobs_in "$sweep" queued) of $at_once jobs in the queue;" \
        "attempts: $(outcomes)"
    "$roost" cancel "$sweep" > /dev/null
done
echo "$((rounds * at_once)) allocations cancelled in $((SECONDS - began)) s; attempts: $(outcomes)"
((rounds == 0)) || [[ $(outcomes) == "$((rounds * at_once)) preempted" ]]

# The time limit: TERM comes a minute before it, at Slurm's leisure up to two.
sweep=$(submit 1 1)
start 1 "$sweep" --time=3
limited=$SECONDS
empty
echo "time limit: gone after $((SECONDS - limited)) s; $(jobs_in "$sweep" queued) of 1 job in the queue; attempts: $(outcomes)"
[[ $(outcomes) == "$((rounds * at_once + 1)) preempted" ]]
