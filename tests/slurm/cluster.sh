#!/bin/bash
# cluster.sh start FOLDER | stop FOLDER: a Slurm of two nodes on this machine, all of it in FOLDER.
#
# Its own munge key and socket, configuration, spool, logs; nothing of a Slurm that is here already is read or changed.  slurm.conf
# in FOLDER is what SLURM_CONF has to name; its three ports are 17000 and the next,
# or from ILF_SLURM_PORT on.
set -eu
verb=$1 folder=$(realpath -m "$2")
first=${ILF_SLURM_PORT:-17000}
me=$(id -un)
host=$(hostname -s)
export PATH=$PATH:/usr/sbin:/sbin
export SLURM_CONF=$folder/slurm.conf

configure() {
    mkdir -p "$folder"/{munge,state,n1,n2}
    chmod 700 "$folder" "$folder/munge"
    head -c 1024 /dev/urandom > "$folder/munge/key"
    chmod 400 "$folder/munge/key"
    cat > "$SLURM_CONF" <<END
ClusterName=ilftest
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$first
SlurmUser=$me
SlurmdUser=$me
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CryptoType=crypto/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.%n.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc=$folder/jobs
ReturnToService=2
SlurmdTimeout=10
MinJobAge=30
KillWait=2
InactiveLimit=0
MessageTimeout=10
SchedulerParameters=sched_min_interval=100000,batch_sched_delay=0
NodeName=n[1-2] NodeHostname=$host NodeAddr=127.0.0.1 Port=[$((first + 1))-$((first + 2))] CPUs=1 RealMemory=1000 State=UNKNOWN
PartitionName=short Nodes=n[1-2] Default=YES MaxTime=INFINITE State=UP
END
}

# ends what a file's process id names
end() {
    for f in "$folder"/slurmd.*.pid "$folder"/slurmctld.pid "$folder"/munge/pid; do
        [ -s "$f" ] || continue
        pid=$(cat "$f")
        kill "$pid" 2>/dev/null || continue
        for _ in {1..100}; do kill -0 "$pid" 2>/dev/null || break; sleep .1; done
        kill -9 "$pid" 2>/dev/null || :
    done
}

node() {
    ( ulimit -n 4096; exec slurmd -N "$1" )
}

case $verb in
start)
    configure
    munged --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" --pid-file="$folder/munge/pid" \
        --log-file="$folder/munge/log" --seed-file="$folder/munge/seed"
    slurmctld
    node n1
    node n2
    for _ in {1..300}; do
        [ "$(sinfo -h -o %D -t idle 2>/dev/null)" = 2 ] && exit 0
        sleep .1
    done
    echo "cluster.sh: expected two idle nodes within 30 s, found:" >&2
    sinfo -N >&2 || tail -n 5 "$folder"/*.log >&2
    end
    exit 1
    ;;
node) node "$3" ;;
stop) scancel --user="$me" 2>/dev/null || :; end ;;
*) echo "cluster.sh: expected start, node or stop, found $verb" >&2; exit 2 ;;
esac
