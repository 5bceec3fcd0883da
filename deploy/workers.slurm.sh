#!/usr/bin/env bash
#SBATCH --job-name=roost-work
#SBATCH --array=1-16
#SBATCH --cpus-per-task=8
#SBATCH --mem=8G
#SBATCH --time=24:00:00
#SBATCH --signal=B:TERM@60
#SBATCH --requeue
#
# Workers of a Roost server on a cluster: every task of the array is one.
#
#   ROOST_SERVER=http://head:7373 sbatch --export=ALL,ROOST_SERVER deploy/workers.slurm.sh
#
# A minute before its time is up Slurm sends SIGTERM: the worker hands its jobs back, and others run them. One that is killed loses
# its lease instead. Finished results that the server does not have yet wait in the state directory, which must outlive the task.
set -euo pipefail

: "${ROOST_SERVER:?set it to the address of the server, such as http://head:7373}"
token_file=${ROOST_TOKEN_FILE:-$HOME/.config/roost/token}
state=${ROOST_STATE:-$HOME/.local/state/roost}
grace_s=${ROOST_GRACE_S:-30}

arguments=(work --server "$ROOST_SERVER" --threads "${SLURM_CPUS_PER_TASK:-0}" --grace "$grace_s"
    --state "$state" --name "${SLURMD_NODENAME:-$(hostname)}-${SLURM_ARRAY_TASK_ID:-0}")
if [[ -r $token_file ]]; then
    arguments+=(--token-file "$token_file")
fi

# The shell gets the signal and passes it on.
roost "${arguments[@]}" &
worker=$!
trap 'kill -TERM "$worker" 2>/dev/null || true' TERM INT
status=0
wait "$worker" || status=$?
# A signal ends the first wait; the worker is still handing back.
if kill -0 "$worker" 2>/dev/null; then
    status=0
    wait "$worker" || status=$?
fi
exit "$status"
