#!/bin/bash
# kill -9 of one rank: every worker of the job is gone within 2 s.
set -u
mpiexec=$1 program=$2
setsid "$mpiexec" --allow-run-as-root --oversubscribe -np 2 "$program" \
  --gtest_also_run_disabled_tests --gtest_filter='*DISABLED_Waits' >/dev/null 2>&1 &
job=$!
trap 'kill -9 -- -$job 2>/dev/null' EXIT

ranks=() workers=()
for _ in $(seq 100); do
  sleep 0.1
  mapfile -t ranks < <(pgrep -P "$job" -f "$program")
  workers=()
  for rank in "${ranks[@]}"; do mapfile -t -O "${#workers[@]}" workers < <(pgrep -P "$rank" -f femxdem-worker); done
  [ "${#ranks[@]}" -eq 2 ] && [ "${#workers[@]}" -eq 3 ] && break
done
[ "${#workers[@]}" -eq 3 ] || { echo "expected 2 ranks and 3 workers, found ${#ranks[@]} and ${#workers[@]}"; exit 1; }
sleep 1

gone() { [ ! -e "/proc/$1" ] || grep -q '^State:[[:space:]]*Z' "/proc/$1/status" 2>/dev/null; }
kill -9 "${ranks[1]}"
for _ in $(seq 20); do
  sleep 0.1
  left=0
  for worker in "${workers[@]}"; do gone "$worker" || left=$((left + 1)); done
  [ "$left" -eq 0 ] && { echo "all workers are gone"; exit 0; }
done
echo "$left workers outlived their rank by 2 s"
exit 1
