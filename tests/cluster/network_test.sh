#!/usr/bin/env bash
# Two network namespaces for two machines: the same run as on one, and a cable that is cut.  network_test.sh CNERF FOLDER
. "$(dirname "$0")/common.sh"
need ip
a="cnerf-a-$$" b="cnerf-b-$$"
ip netns add "$a" 2> "$work/ip.log" || skip "no network namespaces: $(cat "$work/ip.log")"
trap 'ip netns del "$a"; ip netns del "$b" 2> /dev/null || true; rm -rf "/etc/netns/$a" "/etc/netns/$b"' EXIT
ip netns add "$b"
# As Debian has it: the first machine's name is its loopback to itself. Gloo lets the lower address listen, so that theirs
# have to be above 127.
mkdir -p "/etc/netns/$a" "/etc/netns/$b"
echo "127.0.1.1 first-machine" > "/etc/netns/$a/hosts"
echo "192.168.77.1 first-machine" > "/etc/netns/$b/hosts"
ip -n "$a" link add cable type veth peer name cable netns "$b" || skip "no virtual network devices"
for end in "$a 192.168.77.1" "$b 192.168.77.2"; do
  read -r space address <<< "$end"
  ip -n "$space" address add "$address/24" dev cable
  ip -n "$space" link set cable up
  ip -n "$space" link set lo up
done
# on SPACE RANK WORDS: as a rank on one of the machines
on() {
  local space=$1 rank=$2
  shift 2
  as_rank "$rank" first-machine 29511 env LOCAL_RANK=0 LOCAL_WORLD_SIZE=1 ip netns exec "$space" "$@"
}

mapfile -d '' -t words < <(run_words "$work/two")
on "$b" 1 "${words[@]}" > "$work/two.rank1.log" 2>&1 &
other=$!
on "$a" 0 "${words[@]}" > "$work/two.log" 2>&1 || fail "rank 0: $(cat "$work/two.log")"
wait "$other" || fail "rank 1: $(cat "$work/two.rank1.log")"
by_hand "$work/hand"
same_run "$work/hand" "$work/two"
echo "two machines: the same run as on one"

# The cable is cut while both train.
long=("$cnerf" train "$capture" -o "$work/cut" "${settings[@]}" --set stage1.steps=1000000)
on "$a" 0 "${long[@]}" > "$work/cut.log" 2>&1 &
first=$!
on "$b" 1 "${long[@]}" > "$work/cut.rank1.log" 2>&1 &
second=$!
has_checkpoint() { [ -e "$work/cut/stage1.snapshot" ]; }
until_true 120 "a checkpoint" has_checkpoint
start=$SECONDS
ip -n "$a" link set cable down
status=0
wait "$first" || status=$?
[ $status = 74 ] || fail "rank 0 ended with $status: $(cat "$work/cut.log")"
status=0
wait "$second" || status=$?
[ $status = 74 ] || fail "rank 1 ended with $status: $(cat "$work/cut.rank1.log")"
took=$((SECONDS - start))
((took <= 30)) || fail "it took $took s to end"
grep -q "rank 1 (pid [0-9]* on .*) has shown no sign of life" "$work/cut.log" || fail "$(cat "$work/cut.log")"
grep -q "rank 0 (pid [0-9]* on .*) cannot be reached" "$work/cut.rank1.log" || fail "$(cat "$work/cut.rank1.log")"
find "$work/cut" -name '*.partial-*' | grep . && fail "a file is half written"
ip -n "$a" link set cable up
more=("${long[@]}" --set stage1.max_seconds=1 --resume)
on "$b" 1 "${more[@]}" > "$work/more.rank1.log" 2>&1 &
other=$!
on "$a" 0 "${more[@]}" > "$work/more.log" 2>&1 || fail "resume: $(cat "$work/more.log")"
wait "$other" || fail "resume of rank 1: $(cat "$work/more.rank1.log")"
echo "a cut cable: both ended after $took s, and went on"
