# shellcheck shell=bash
# A Slurm of one node on loopback, for the scripts of this folder. Everything is in the temporary folder `$here`, and ends with the script
# that sources this file. Wants root (slurmd), and Debian's slurm-wlm and munge.

here=$(mktemp -d)
chmod 711 "$here"
daemons=()
# The script may define this: it runs before the daemons end.
before_end() { :; }
finish() {
    local status=$?
    before_end
    if ((${#daemons[@]})); then
        kill "${daemons[@]}" 2> /dev/null || true
        wait "${daemons[@]}" 2> /dev/null || true
    fi
    if ((status)); then echo "failed; logs are in $here" >&2; else rm -rf "$here"; fi
}
trap finish EXIT

# Starts munged, slurmctld and slurmd: one node of $1 processors, whatever the machine has.
start_slurm() {
    mkdir -m 755 "$here/munge" "$here/state" "$here/spool"
    head -c 1024 /dev/urandom > "$here/munge/key"
    chmod 600 "$here/munge/key"
    munged --foreground --force --key-file="$here/munge/key" --socket="$here/munge/socket" --pid-file="$here/munge/pid" \
        --log-file="$here/munge/log" --seed-file="$here/munge/seed" > "$here/munged.log" 2>&1 &
    daemons+=($!)
    export SLURM_CONF=$here/slurm.conf
    local host
    host=$(hostname -s)
    cat > "$SLURM_CONF" << END
ClusterName=roost
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=${SLURMCTLD_PORT:-26817}
SlurmdPort=${SLURMD_PORT:-26818}
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$here/munge/socket
CredType=cred/munge
ProctrackType=${PROCTRACK:-proctrack/linuxproc}
TaskPlugin=task/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=1,batch_sched_delay=0
ReturnToService=2
StateSaveLocation=$here/state
SlurmdSpoolDir=$here/spool
SlurmctldPidFile=$here/slurmctld.pid
SlurmdPidFile=$here/slurmd.pid
SlurmctldLogFile=$here/slurmctld.log
SlurmdLogFile=$here/slurmd.log
NodeName=$host NodeAddr=127.0.0.1 CPUs=$1 State=UNKNOWN
PartitionName=main Nodes=$host Default=YES MaxTime=INFINITE State=UP
END
    until [[ -S $here/munge/socket ]]; do kill -0 "${daemons[0]}"; sleep 0.1; done
    slurmctld -D > "$here/slurmctld.out" 2>&1 &
    daemons+=($!)
    slurmd -D -N "$host" > "$here/slurmd.out" 2>&1 &
    daemons+=($!)
    until sinfo --noheader --format=%t 2> /dev/null | grep --quiet idle; do
        kill -0 "${daemons[@]}"
        sleep 0.5
    done
}
