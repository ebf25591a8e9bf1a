#!/bin/bash
# The same on PBS (OpenPBS, PBS Professional): written by its manual, not run by us; slurm.sh has been.
#
#     qsub -J 1-8 -v CASE=mine.toml,RESULTS=/shared/results,SCRIPT=$PWD/validation/cluster/pbs.sh validation/cluster/pbs.sh
#
#PBS -N femxdem
#PBS -l select=1:ncpus=16:mpiprocs=2:ompthreads=1
#PBS -l walltime=12:00:00
#PBS -r y
#PBS -j oe
set -u
seconds=$((12 * 3600))  # of walltime above: PBS does not tell its jobs when they end
cd "$PBS_O_WORKDIR" || exit
member=${MEMBER:-${PBS_ARRAY_INDEX:-1}}
out=$RESULTS/$member
export OMP_NUM_THREADS=1

how=--overwrite
[ -e "$out/checkpoint.h5" ] && how=--restart

# SECONDS counts from this script's start; a minute is left for the end of the job.
mpirun -n 2 --map-by slot:PE=8 --bind-to core "${FEMXDEM:-femxdem}" run "$CASE" --out "$out" "$how" \
  --time-limit $((seconds - SECONDS - 60)) --set "ve.seed=$member" --set "ve.cache=\"$RESULTS/packings\"" &
job=$!
trap 'kill -USR1 "$job"' TERM  # qdel and the end of walltime; mpirun passes SIGUSR1 on to the ranks
wait "$job"
status=$?
while kill -0 "$job" 2>/dev/null; do
  wait "$job"
  status=$?
done

if [ "$status" -eq 75 ]; then  # run me again: a successor takes this member's place
  qsub -v "CASE=$CASE,RESULTS=$RESULTS,SCRIPT=$SCRIPT,MEMBER=$member" "$SCRIPT"
fi
exit "$status"
