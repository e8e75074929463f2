#!/usr/bin/env bash
# A real Slurm of two nodes on this machine: a run by srun, a script of sbatch, a job array over captures, and a job
# whose task dies.  slurm_test.sh CNERF FOLDER
. "$(dirname "$0")/common.sh"
need slurmctld slurmd munged srun sbatch
[ -d /sys/devices/system/cpu ] || skip "there is no /sys, which Slurm's daemons read"
[ "$(id -u)" = 0 ] || skip "Slurm's daemons need root here"
sources=$(cd "$(dirname "$0")/../.." && pwd)

# One munged serves the machine; one that is there already is left alone.
own_munge=no
if ! munge -n > /dev/null 2>&1; then
  mkdir -p /run/munge
  chown munge: /run/munge
  setpriv --reuid munge --regid munge --clear-groups munged || skip "munged does not start"
  own_munge=yes
fi
slurm=$(mktemp -d /tmp/cnerf-slurm.XXXXXX)  # paths of sockets are short
chmod 755 "$slurm"
stop() {
  local file
  for file in "$slurm"/*.pid; do [ -e "$file" ] && kill "$(cat "$file")" 2> /dev/null; done
  if [ $own_munge = yes ]; then munged --stop > /dev/null 2>&1; fi
  rm -rf "$slurm"
}
trap 'stop || true' EXIT

host=$(hostname -s)
cat > "$slurm/slurm.conf" << END
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$(free_port)
AuthType=auth/munge
CryptoType=crypto/munge
SlurmUser=root
SlurmdUser=root
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MpiDefault=none
KillWait=2
StateSaveLocation=$slurm/state
SlurmdSpoolDir=$slurm/spool-%n
SlurmctldPidFile=$slurm/slurmctld.pid
SlurmdPidFile=$slurm/slurmd-%n.pid
SlurmctldLogFile=$slurm/slurmctld.log
SlurmdLogFile=$slurm/slurmd-%n.log
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$(free_port) CPUs=2 State=UNKNOWN
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$(free_port) CPUs=2 State=UNKNOWN
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP
END
# From 23.11 on slurmd wants cgroups although nothing is to be tracked by them, and a container may have none.
version=$(slurmd -V | grep -oE '[0-9]+' | head -1)
if [ "$version" -ge 24 ]; then echo "CgroupPlugin=disabled" > "$slurm/cgroup.conf"; fi
mkdir "$slurm/state"
export SLURM_CONF="$slurm/slurm.conf"
slurmctld -f "$SLURM_CONF"
slurmd -N n1 -f "$SLURM_CONF"
slurmd -N n2 -f "$SLURM_CONF"
two_idle() { [ "$(sinfo -h -o %T -N 2> /dev/null | grep -c idle)" = 2 ]; }
until_true 60 "two idle nodes" two_idle

# The nodes' names are none of the network's here.
export MASTER_ADDR=127.0.0.1
mapfile -d '' -t words < <(run_words "$work/slurm")
srun -N2 -n2 "${words[@]}" > "$work/slurm.log" 2>&1 || fail "srun: $(cat "$work/slurm.log")"
by_hand "$work/hand"
same_run "$work/hand" "$work/slurm"
echo "srun: as by hand"

# What a script calls without srun is a program alone, whatever the job's size.
cat > "$work/alone.sh" << END
#!/bin/bash
exec "$cnerf" train "$capture" -o "$work/scripted" ${settings[*]}
END
sbatch --wait -N2 -n2 -o "$work/scripted.log" "$work/alone.sh" > /dev/null || fail "$(cat "$work/scripted.log")"
"$cnerf" train "$capture" -o "$work/alone" "${settings[@]}" > "$work/alone.log"
cmp "$work/scripted/stage1.snapshot" "$work/alone/stage1.snapshot" || fail "a script is not a program alone"
echo "sbatch: alone"

# A task that dies: the other one says so, and the same command with --resume goes on.
long=(train "$capture" -o "$work/dies" "${settings[@]}" --set stage1.steps=1000000)
srun -N2 -n2 --kill-on-bad-exit=0 "$cnerf" "${long[@]}" > "$work/dies.log" 2>&1 &
srun=$!
has_checkpoint() { [ -e "$work/dies/stage1.snapshot" ]; }
until_true 120 "a checkpoint" has_checkpoint
victim=
for process in /proc/[0-9]*; do
  if grep -qsz "^SLURM_PROCID=1" "$process/environ" && grep -qsz "^$work/dies" "$process/cmdline" &&
    [ "$(readlink "$process/exe")" = "$cnerf" ]; then
    victim=${process#/proc/}
  fi
done
[ -n "$victim" ] || fail "no rank 1 to kill"
start=$SECONDS
kill -KILL "$victim"
if wait "$srun"; then fail "srun did not fail"; fi
took=$((SECONDS - start))
((took <= 30)) || fail "it took $took s to end"
grep -q "rank 1 (pid $victim on " "$work/dies.log" || fail "nobody named rank 1: $(cat "$work/dies.log")"
srun -N2 -n2 "$cnerf" train "$capture" -o "$work/dies" "${settings[@]}" --set stage1.steps=1000000 \
  --set stage1.max_seconds=1 --resume > "$work/resumed.log" 2>&1 || fail "resume: $(cat "$work/resumed.log")"
echo "a task that dies: named after $took s, and gone on with"

# The job array of many captures, twice: what is finished stays.
cp -r "$capture" "$work/second"
for attempt in 1 2; do
  OUT="$work/many" CNERF="$cnerf" sbatch --wait --array=0-1 -o "$work/many-%a-$attempt.log" \
    "$sources/scripts/captures.sbatch" "$capture" "$work/second" -- --colorizer grey "${settings[@]}" > /dev/null ||
    fail "captures.sbatch: $(cat "$work"/many-*.log)"
done
for name in capture second; do [ -e "$work/many/$name/metrics.json" ] || fail "no run of $name"; done
"$cnerf" report "$work/many/capture" "$work/many/second" -o "$work/report" > "$work/report.log"
grep -q second "$work/report/table.md" || fail "the report does not name a run"
echo "captures.sbatch: two captures, resumed, reported"
