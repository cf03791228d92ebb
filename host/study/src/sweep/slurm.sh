#!/bin/bash
# Runs a sweep on a cluster with Slurm: bash THIS_FILE, on a node that may submit jobs.
# Options of sbatch for both jobs: the variables SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_TIMELIMIT; see `man sbatch`.
set -euo pipefail

program=@program@
folder=@folder@
name=@name@
largest=$(scontrol show config | sed -n 's/^MaxArraySize *= *//p')
jobs=$(( @shards@ < largest ? @shards@ : largest - 1 ))
mkdir -p "$folder"

# Two minutes before the time limit Slurm sends USR1: the points that are done are kept, and the job queues again.
# A job whose node fails queues again by itself.
array=$({ printf '#!/bin/bash\njobs=%s scontrol=%q\n' "$jobs" "$(command -v scontrol)"; cat <<'JOB'
program=@program@
plan=@plan@
folder=@folder@
again() {
    kill -TERM "$worker"
    wait "$worker"
    "$scontrol" requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"
    exit
}
trap again USR1
for (( shard = SLURM_ARRAY_TASK_ID; shard <= @shards@; shard += jobs )); do
    "$program" sweep "$plan" --shard "$shard/@shards@" --resume --out "$folder" --jobs "${SLURM_CPUS_PER_TASK:-1}" &
    worker=$!
    wait "$worker"
    code=$?
    # 3: some points cannot be computed, which the table says.
    [ "$code" = 0 ] || [ "$code" = 3 ] || exit "$code"
done
JOB
} | sbatch --parsable --job-name="$name" --array="1-$jobs" --requeue --signal=B:USR1@120 --open-mode=append \
    --output="$folder/slurm-%A_%a.log" --cpus-per-task="${SBATCH_CPUS_PER_TASK:-1}")
array=${array%%;*}
merge=$(sbatch --parsable --job-name="$name-merge" --dependency="afterany:$array" --requeue \
    --output="$folder/slurm-%j.log" <<'JOB'
#!/bin/bash
program=@program@
folder=@folder@
"$program" sweep merge "$folder"
code=$?
# 3: the table is whole, and some of its points cannot be computed. A table that would lack points is not written.
[ "$code" = 3 ] || exit "$code"
JOB
)
echo "jobs $array (shards) and ${merge%%;*} (merge); see how far they are with: $program sweep status $folder"
