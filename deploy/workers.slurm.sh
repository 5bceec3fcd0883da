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
# Slurm sends SIGTERM a minute before the time limit, and on scancel or preemption. The worker then claims nothing more, lets its jobs
# run for ROOST_GRACE_S seconds, and hands back what has not finished; other workers run it again. Slurm kills what is left after its
# KillWait, 30 s by default: keep ROOST_GRACE_S at least 8 s below `scontrol show config | grep KillWait`. A killed worker loses its
# leases: its jobs return to the queue too, but each costs one of a job's attempts.
# The state directory keeps finished results that the server does not have yet. It must outlive the task.
set -euo pipefail

: "${ROOST_SERVER:?set it to the address of the server, such as http://head:7373}"
token_file=${ROOST_TOKEN_FILE:-$HOME/.config/roost/token}
state=${ROOST_STATE:-$HOME/.local/state/roost}
grace_s=${ROOST_GRACE_S:-20}

arguments=(work --server "$ROOST_SERVER" --threads "${SLURM_CPUS_PER_TASK:-0}" --grace "$grace_s"
    --state "$state" --name "${SLURMD_NODENAME:-$(hostname)}-${SLURM_ARRAY_TASK_ID:-0}")
if [[ -r $token_file ]]; then
    arguments+=(--token-file "$token_file")
fi

# In place of the shell: B:TERM reaches the batch process alone, and that is the worker itself.
exec roost "${arguments[@]}"
