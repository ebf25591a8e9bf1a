#!/bin/bash
# An ensemble on Slurm: array task k runs the case with ve.seed = k; each job goes on where the last one ended, until done.
#
#     sbatch --array=1-8 validation/cluster/slurm.sh mine.toml /shared/results [--set key=value ...]
#
#SBATCH --job-name=femxdem
#SBATCH --nodes=1
#SBATCH --ntasks-per-node=2
#SBATCH --cpus-per-task=8
#SBATCH --time=12:00:00
#SBATCH --signal=B:USR1@600
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x_%A_%a.log
set -u
femxdem=${FEMXDEM:-femxdem} case=$1 results=$2
shift 2
member=${SLURM_ARRAY_TASK_ID:-1}
out=$results/$member

# Two ranks a node with eight threads each: compact cells are shared out to threads, volume elements in YADE to ranks alone.
threads=${SLURM_CPUS_PER_TASK:-1}
export OMP_NUM_THREADS=1  # OpenBLAS and CHOLMOD; the cells' threads are ve.threads
export TMPDIR=${TMPDIR:-/tmp}

# The program ends by itself before the job does; Slurm 23.02 and later tells it when, as SLURM_JOB_END_TIME.
left=$(squeue -h -j "$SLURM_JOB_ID" -O TimeLeft | tr -d ' ')
limit=()
[[ -z ${SLURM_JOB_END_TIME:-} && $left =~ ^[0-9:-]+$ ]] && limit=(--time-limit "$left")

how=--overwrite
[ -e "$out/checkpoint.h5" ] && how=--restart

mpirun -n "$SLURM_NTASKS" --map-by "slot:PE=$threads" --bind-to core \
  "$femxdem" run "$case" --out "$out" "$how" --set "ve.seed=$member" --set "ve.cache=\"$results/packings\"" "${limit[@]}" "$@" &
job=$!
trap 'kill -USR1 "$job"' USR1 TERM  # mpirun passes SIGUSR1 on to the ranks; on SIGTERM it would kill them after a second
wait "$job"
status=$?
while kill -0 "$job" 2>/dev/null; do  # the trap has interrupted the wait: they save
  wait "$job"
  status=$?
done

if [ "$status" -eq 75 ]; then  # run me again
  scontrol requeue "${SLURM_ARRAY_JOB_ID:-$SLURM_JOB_ID}${SLURM_ARRAY_TASK_ID:+_$SLURM_ARRAY_TASK_ID}"
fi
exit "$status"
