//! The script that runs a sweep's shards on a cluster with Slurm.

use std::path::Path;

/// Returns a shell script that submits a job array over the shards and, after it, the merge.
///
/// All paths are absolute, and seen by all nodes. The script asks the cluster for its `MaxArraySize`: where there are more
/// shards than that, a job of the array computes several, one after the other.
pub fn script(program: &Path, plan: &Path, folder: &Path, shards: u64, name: &str) -> String {
    let [program, plan, folder] = [program, plan, folder].map(|path| quoted(&path.to_string_lossy()));
    let name = quoted(name);
    format!(
        r##"#!/bin/bash
# Runs a sweep on a cluster with Slurm: bash THIS_FILE, on a node that may submit jobs.
# Options of sbatch for both jobs: the variables SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_TIMELIMIT; see `man sbatch`.
set -euo pipefail

export BIFLAG={program} PLAN={plan} FOLDER={folder} SHARDS={shards}
name={name}
largest=$(scontrol show config | sed -n 's/^MaxArraySize *= *//p')
export JOBS=$(( SHARDS < largest ? SHARDS : largest - 1 ))
mkdir -p "$FOLDER"

# Two minutes before the time limit Slurm sends USR1: the points that are done are kept, and the job queues again.
# A job whose node fails queues again by itself. Exit code 3 is a table with points that failed.
array=$(sbatch --parsable --job-name="$name" --array="1-$JOBS" --requeue --signal=B:USR1@120 --open-mode=append \
    --output="$FOLDER/slurm-%A_%a.log" --cpus-per-task="${{SBATCH_CPUS_PER_TASK:-1}}" <<'JOB'
#!/bin/bash
again() {{
    kill -TERM "$worker"
    wait "$worker"
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}"
    exit
}}
trap again USR1
for (( shard = SLURM_ARRAY_TASK_ID; shard <= SHARDS; shard += JOBS )); do
    "$BIFLAG" sweep "$PLAN" --shard "$shard/$SHARDS" --resume --out "$FOLDER" --jobs "${{SLURM_CPUS_PER_TASK:-1}}" &
    worker=$!
    wait "$worker"
    code=$?
    [ "$code" = 0 ] || [ "$code" = 3 ] || exit "$code"
done
JOB
)
merge=$(sbatch --parsable --job-name="$name-merge" --dependency="afterany:$array" --requeue \
    --output="$FOLDER/slurm-%j.log" <<'JOB'
#!/bin/bash
"$BIFLAG" sweep merge "$FOLDER"
JOB
)
echo "jobs $array (shards) and $merge (merge); see how far they are with: $BIFLAG sweep status $FOLDER"
"##
    )
}

/// Quotes text for a shell.
fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    /// A shell gets the same text back, whatever is in it.
    #[test]
    fn text_is_quoted_for_a_shell() {
        for text in ["plain", "two words", "it's $HOME `date` \"x\" \\ *", "line\nend"] {
            let output = Command::new("sh").args(["-c", &format!("printf %s {}", quoted(text))]).output().unwrap();
            assert_eq!(String::from_utf8_lossy(&output.stdout), text);
        }
    }
}
