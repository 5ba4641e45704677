#!/bin/bash
# slurm.sh NAME OUT COMMAND ARG...: one step of the scenes' rules as a job of Slurm's (on.mk calls it).
#
# The job has the working folder and the environment of its caller, one task, and what SLURM holds of options (-p short --time=20).  Inside an
# allocation (salloc) it is a step of that.  Standard output is passed on as it comes, error output at the end.  A job that fails says its number,
# Slurm's word for how it ended and its last lines; what it left beside OUT of half outputs is removed.  A signal cancels it.
set -u
name=$1 out=$2
shift 2
inside=${SLURM_JOB_ID:-}
job=ilf.$name.$(hostname -s).$$
said=$(mktemp)
child=

cancel() {
    trap '' INT TERM HUP
    [ -n "$inside" ] || scancel --quiet --user="$(id -u)" --name="$job" 2>/dev/null
    [ -z "$child" ] || { kill -TERM "$child" 2>/dev/null; wait "$child" 2>/dev/null; }
    swept
    rm -f "$said"
    exit 130
}
# what our programs (base/outfile: .NAME.XXXXXX), timed.py (NAME.PID.tmp) and redirections (NAME.part) write before they rename it
swept() {
    local folder=${out%/*} file=${out##*/}
    [ "$folder" != "$out" ] || folder=.
    rm -f "$folder/.$file".?????? "$out".*.tmp "$out".part
    case $out in (*.part) rm -f "$out";; esac
}
# a name in a folder that another machine has written may be seen late (NFS): looking into the folder asks anew
arrived() {
    local k
    for k in {1..100}; do
        ls "$(dirname "$out")" >/dev/null 2>&1
        [ ! -e "$out" ] || return 0
        sleep .1
    done
    return 1
}
# "17 TIMEOUT" of the job, when its node has tidied up after it
ended() {
    local k found
    for k in {1..50}; do
        found=$(squeue --noheader --states=all --user="$(id -u)" --name="$job" --format='%A %T' 2>/dev/null | head -n 1)
        case $found in (*COMPLETING) sleep .2;; (*) break;; esac
    done
    echo "${found:-? nothing of it}"
}

trap cancel INT TERM HUP
# as many threads as the job has processors; make's own words to its children are not the job's
srun --quiet ${SLURM:-} --job-name="$job" --nodes=1 --ntasks=1 ${inside:+--exact} --input=none --mpi=none --kill-on-bad-exit=1 \
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL bash -c 'export OMP_NUM_THREADS=${OMP_NUM_THREADS:-${SLURM_CPUS_PER_TASK:-1}}; exec "$@"' "$name" "$@" 2>"$said" &
child=$!
wait "$child"
status=$?
child=
if [ $status = 0 ] && ! arrived; then
    status=1
    echo "slurm.sh: $out: expected the job to have written it, found nothing after 10 s: is the folder on a file system that the nodes share?" >>"$said"
fi
if [ $status = 0 ]; then
    cat "$said" >&2
else
    if [ -n "$inside" ]; then found="$inside (a step of it)"; else found=$(ended); fi
    { tail -n 20 "$said"; echo "slurm.sh: $name: $out: expected job ${found%% *} to end well, found ${found#* }, exit status $status"; } >&2
    swept
fi
rm -f "$said"
exit $status
