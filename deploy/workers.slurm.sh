#!/usr/bin/env bash
#SBATCH --job-name=roost-work
#SBATCH --array=1-16
#SBATCH --cpus-per-task=8
#SBATCH --mem=8G
#SBATCH --time=24:00:00
#SBATCH --signal=B:TERM@60
#SBATCH --requeue
#
# Workers of a Roost server on a Slurm cluster: each task of the array is one worker.
#
#   ROOST_SERVER=http://head:7373 sbatch --export=ALL,ROOST_SERVER deploy/workers.slurm.sh
#
# Slurm sends SIGTERM a minute before the time limit, and on scancel or preemption. The worker then claims no more jobs, lets its jobs
# run for ROOST_GRACE_S seconds, and releases unfinished jobs to other workers. Slurm kills the task after its KillWait, 30 s by default:
# keep ROOST_GRACE_S at least 8 s below `scontrol show config | grep KillWait`. The jobs of a killed worker return to the queue when their
# leases end, and each has lost one attempt.
# The state directory keeps finished results until the server has confirmed them. It must outlive the task.
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

# Replaces the shell: B:TERM signals the batch process only, which must be the worker.
exec roost "${arguments[@]}"
