#!/usr/bin/env bash
# Runs the batch scripts on a Slurm of this machine alone, and compares their images and frames with those rendered
# without it: the same bits, also when jobs are requeued in the middle. Usage: slurm.sh PATH/TO/beamfarm
#
# Needs root, and slurmctld, slurmd, the client commands and munge. Where they are missing it prints a note and exits
# with 77, as automake's skipped tests do, or with 1 if BEAMFARM_NEED_SLURM=1.
set -euo pipefail
repository=$(cd "$(dirname "$0")/../.." && pwd)
BEAMFARM=$(realpath "$1")
export BEAMFARM

for program in slurmctld slurmd munged sbatch srun scontrol sinfo; do
    if ! command -v "$program" >/dev/null || ((EUID != 0)); then
        echo "SKIPPED: the test of the Slurm script needs root, and $program" >&2
        [[ ${BEAMFARM_NEED_SLURM:-0} == 0 ]] || exit 1
        exit 77
    fi
done

folder=$(mktemp -d)
export SLURM_CONF=$folder/slurm.conf
daemons=()

# Clients try for minutes to reach a missing controller.
ask() {
    local code=0
    timeout --kill-after=5 60 "$@" || code=$?
    ((code < 124)) || echo "no answer to $1: $code" >&2
    return "$code"
}
for client in sbatch scancel scontrol sinfo; do
    eval "$client() { ask $client \"\$@\"; }"
done

# What is left of this Slurm: its daemons, and what they have started, whatever parent that has by now.
left() {
    local process
    for process in /proc/[0-9]*; do
        if tr '\0' '\n' 2>/dev/null <"$process/environ" | grep -qxF "SLURM_CONF=$SLURM_CONF"; then
            echo "${process#/proc/}"
        fi
    done 2>/dev/null
}
finish() {
    local code=$?
    trap '' TERM INT
    if ((code != 0)); then
        tail -n 40 "$folder"/*.log >&2 || true
    fi
    if ((${#daemons[@]} != 0)); then
        timeout --kill-after=5 10 scancel --user=root >/dev/null 2>&1 || true
        kill "${daemons[@]}" 2>/dev/null || true
        # Not all of them end on their own, for instance a stopped one.
        local tries process
        for ((tries = 0; tries < 50; ++tries)); do
            kill -0 "${daemons[@]}" 2>/dev/null || break
            sleep 0.1
        done
        # Twice, to catch what was started in the meantime.
        for tries in 1 2; do
            for process in $(left); do
                kill -KILL "$process" 2>/dev/null || true
            done
        done
        wait || true
    fi
    rm -rf "$folder" || true
    exit "$code"
}
trap finish EXIT
trap 'exit 143' TERM
trap 'exit 130' INT

# wait_for SECONDS WHAT COMMAND... Limits are for a machine that is busy with other things.
wait_for() {
    local until=$((SECONDS + $1)) what=$2 daemon
    shift 2
    until "$@"; do
        for daemon in "${daemons[@]}"; do
            kill -0 "$daemon" 2>/dev/null || {
                echo "a daemon of Slurm ended while $what was waited for" >&2
                return 1
            }
        done
        if ((SECONDS >= until)); then
            echo "waited too long for $what" >&2
            return 1
        fi
        sleep 0.2
    done
}

# COUNT ports that nobody listens on, and that no connection of another program gets by chance.
free_ports() {
    python3 - "$1" <<'PYTHON'
import random, socket, sys
kept = []
for port in random.sample(range(10000, 20000), 1000):
    one = socket.socket()
    try:
        one.bind(("", port))
    except OSError:
        continue
    kept.append(one)
    if len(kept) == int(sys.argv[1]):
        break
print(*(one.getsockname()[1] for one in kept))
PYTHON
}

host=$(hostname -s)
read -r controller_port node_port < <(free_ports 2)
mkdir "$folder/state" "$folder/spool" "$folder/munge"
chmod 755 "$folder" "$folder/munge"
head -c 1024 /dev/urandom >"$folder/munge/key"
chmod 400 "$folder/munge/key"
cat >"$SLURM_CONF" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
SlurmctldPort=$controller_port
SlurmdPort=$node_port
AuthType=auth/munge
# A requeued job waits until its credential has expired.
AuthInfo=socket=$folder/munge/socket,cred_expire=10
CredType=cred/munge
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
JobRequeue=1
ReturnToService=2
SchedulerParameters=sched_interval=1,sched_min_interval=0
KillWait=15
NodeName=$host NodeAddr=127.0.0.1 CPUs=8 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF

munged --foreground --force --key-file="$folder/munge/key" --socket="$folder/munge/socket" \
    --pid-file="$folder/munge/pid" --seed-file="$folder/munge/seed" --log-file="$folder/munged.log" \
    >"$folder/munged.log" 2>&1 &
daemons+=($!)
wait_for 60 munged test -S "$folder/munge/socket"
slurmctld -D >"$folder/slurmctld.out.log" 2>&1 &
daemons+=($!)
slurmd -D >"$folder/slurmd.out.log" 2>&1 &
daemons+=($!)
is_idle() { [[ $(sinfo --noheader --format=%t 2>/dev/null) == idle ]]; }
wait_for 60 "the node" is_idle

cd "$folder"
cp -r "$repository/scenes/sphere-caustic.toml" "$repository/scenes/meshes" . 2>/dev/null ||
    cp "$repository/scenes/sphere-caustic.toml" .
pixels() { grep -h '^pixels ' "$1" | tail -n 1; }
state() { scontrol show job "$1" 2>/dev/null | sed -n 's/.*JobState=\([A-Z]*\).*/\1/p'; }
completed() {
    case $(state "$1") in
    COMPLETED) return 0 ;;
    FAILED | TIMEOUT | CANCELLED | NODE_FAIL)
        echo "job $1: $(state "$1")" >&2
        exit 1
        ;;
    *) return 1 ;;
    esac
}
# submit NAME PASSES
submit() {
    BEAMFARM_HOST=127.0.0.1 sbatch --parsable --ntasks=3 --ntasks-per-node=3 --cpus-per-task=1 --output="$1.log" \
        "$repository/deploy/slurm/beamfarm.sbatch" sphere-caustic.toml "$1.exr" --passes "$2"
}
same() {
    [[ -n $(pixels "$1.log") && $(pixels "$1.log") == $(pixels "$2.log") ]] || {
        echo "$1 and $2 have different pixels: '$(pixels "$1.log")', '$(pixels "$2.log")'" >&2
        exit 1
    }
}

short=${BEAMFARM_SLURM_PASSES:-6}
long=$((short * 4))
"$BEAMFARM" render sphere-caustic.toml --passes "$short" -o local.exr >local.log
"$BEAMFARM" render sphere-caustic.toml --passes "$long" -o local-long.exr >local-long.log

job=$(submit plain "$short")
wait_for 300 "job $job" completed "$job"
same plain local
echo "slurm: the batch script's image has the bits of a local one"

# A small scene with a moving light: three frames, as tasks of an array and with one coordinator.
sed -e 's/^width = .*/width = 64/; s/^height = .*/height = 48/' \
    -e 's/^target = \[-0.1, 1.2, 0.0\]/target = { keys = [[1, [-0.1, 1.2, 0]], [3, [0.1, 1, 0]]] }/' \
    sphere-caustic.toml >moving.toml
printf '\n[animation]\nframes = [1, 3]\n' >>moving.toml

# Requeued jobs wait for a while: all three at the same time.
job=$(submit requeued "$long")
# Some passes are done and some are not.
begun() { [[ -s requeued.job/checkpoint-0 && -s requeued.job/checkpoint-1 ]]; }
wait_for 300 "the first passes" begun
scontrol requeue "$job"

farm=$(BEAMFARM_HOST=127.0.0.1 sbatch --parsable --ntasks=2 --ntasks-per-node=2 --cpus-per-task=1 --output=farm.log \
    "$repository/deploy/slurm/beamfarm.sbatch" moving.toml farm/f.##.exr --frames 1-3 --passes "$long")
array=$(sbatch --parsable --array=1-3%3 --cpus-per-task=1 --output=array-%a.log \
    "$repository/deploy/slurm/frames.sbatch" moving.toml array/f.##.exr --passes "$long")
wait_for 300 "the second task" test -s array/f.02.job/checkpoint-0
scontrol requeue "${array}_2"
wait_for 300 "the first frame" test -s farm/f.01.exr
scontrol requeue "$farm"

for frame in 1 2 3; do
    "$BEAMFARM" render moving.toml -D "animation.frame=$frame" --passes "$long" -o "local-$frame.exr" \
        >"local-$frame.log"
    pixels "local-$frame.log"
done >frames
[[ $(sort -u frames | wc -l) == 3 ]] || {
    echo "three frames that differ were expected" >&2
    exit 1
}

wait_for 300 "job $job after it was requeued" completed "$job"
grep -q 'start number 2' requeued.log || {
    echo "the job was not requeued in mid-job" >&2
    exit 1
}
same requeued local-long
echo "slurm: requeued in mid-job, the image has the same bits"

# All tasks of the array have the state of one.
each_completed() { [[ -n $(state "$1") ]] && [[ $(state "$1" | sort -u) == COMPLETED ]]; }
wait_for 300 "array $array" each_completed "$array"
for frame in 1 2 3; do
    pixels "array-$frame.log"
done | cmp frames - || {
    echo "the array's frames have other pixels" >&2
    exit 1
}
resumed=$(sed -n 's|^resuming array/f.02.job with \([0-9]*\) passes|\1|p' array-2.log)
((${resumed:-0} > 0 && resumed < long)) || {
    echo "the array's second task was not requeued in mid-job: it went on from '$resumed' passes" >&2
    exit 1
}
echo "slurm: the frames of an array have the bits of local ones, one requeued in mid-job"

wait_for 300 "job $farm after it was requeued" completed "$farm"
# A stopped start also writes what it has of the current frame.
sed -n "s/^frame .*: wrote .*, $long passes .* pixels /pixels /p" farm.log | cmp frames - || {
    echo "the farm's frames have other pixels" >&2
    exit 1
}
grep -q 'farm/f.01.exr is there already' farm.log || {
    echo "the farm that was requeued did not keep its first frame" >&2
    exit 1
}
echo "slurm: the frames of one coordinator have the bits of local ones, requeued after the first"

# Workers wait for minutes for a coordinator, but not for one that will never come.
job=$(BEAMFARM_HOST=127.0.0.1 sbatch --parsable --ntasks=3 --ntasks-per-node=3 --cpus-per-task=1 --output=misspelt.log \
    "$repository/deploy/slurm/beamfarm.sbatch" misspelt.toml misspelt.exr)
failed() { [[ $(state "$1") == FAILED ]]; }
wait_for 120 "job $job, whose scene is misspelt, to fail" failed "$job"
scontrol show job "$job" | grep -q 'ExitCode=2:0' || {
    scontrol show job "$job" >&2
    cat misspelt.log >&2
    exit 1
}
echo "slurm: a misspelt scene ends the job at once, with its own exit code"
