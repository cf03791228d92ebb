//! The script that runs a sweep's shards on a cluster with Slurm.

use std::path::Path;
use system::shell::quoted_for_sh as quoted;

/// Returns a shell script that submits a job array over the shards and, after it, the merge.
///
/// All paths are absolute, and visible on all nodes. They are written into the jobs themselves, because many centres do
/// not pass the submission's variables to a job (`SBATCH_EXPORT=NONE`). The script asks the cluster for its
/// `MaxArraySize`. If there are more shards, each job of the array computes several, one after the other.
pub fn script(program: &Path, plan: &Path, folder: &Path, shards: u64, name: &str) -> String {
    let [program, plan, folder] = [program, plan, folder].map(|path| quoted(&path.to_string_lossy()));
    let name = quoted(name);
    format!(
        r##"#!/bin/bash
# Runs a sweep on a cluster with Slurm: bash THIS_FILE, on a node that may submit jobs.
# Options of sbatch for both jobs: the variables SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_TIMELIMIT; see `man sbatch`.
set -euo pipefail

program={program}
folder={folder}
name={name}
largest=$(scontrol show config | sed -n 's/^MaxArraySize *= *//p')
jobs=$(( {shards} < largest ? {shards} : largest - 1 ))
mkdir -p "$folder"

# Two minutes before the time limit Slurm sends USR1: the points that are done are kept, and the job queues again.
# A job whose node fails queues again by itself.
array=$({{ printf '#!/bin/bash\njobs=%s scontrol=%q\n' "$jobs" "$(command -v scontrol)"; cat <<'JOB'
program={program}
plan={plan}
folder={folder}
again() {{
    kill -TERM "$worker"
    wait "$worker"
    "$scontrol" requeue "${{SLURM_ARRAY_JOB_ID}}_${{SLURM_ARRAY_TASK_ID}}"
    exit
}}
trap again USR1
for (( shard = SLURM_ARRAY_TASK_ID; shard <= {shards}; shard += jobs )); do
    "$program" sweep "$plan" --shard "$shard/{shards}" --resume --out "$folder" --jobs "${{SLURM_CPUS_PER_TASK:-1}}" &
    worker=$!
    wait "$worker"
    code=$?
    # 3: some points cannot be computed, which the table says.
    [ "$code" = 0 ] || [ "$code" = 3 ] || exit "$code"
done
JOB
}} | sbatch --parsable --job-name="$name" --array="1-$jobs" --requeue --signal=B:USR1@120 --open-mode=append \
    --output="$folder/slurm-%A_%a.log" --cpus-per-task="${{SBATCH_CPUS_PER_TASK:-1}}")
array=${{array%%;*}}
merge=$(sbatch --parsable --job-name="$name-merge" --dependency="afterany:$array" --requeue \
    --output="$folder/slurm-%j.log" <<'JOB'
#!/bin/bash
program={program}
folder={folder}
"$program" sweep merge "$folder"
code=$?
# 3: the table is whole, and some of its points cannot be computed. A table that would lack points is not written.
[ "$code" = 3 ] || exit "$code"
JOB
)
echo "jobs $array (shards) and ${{merge%%;*}} (merge); see how far they are with: $program sweep status $folder"
"##
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    /// Runs the script with stand-ins for Slurm's commands. `sbatch` starts each job with only its own variables, as
    /// with `SBATCH_EXPORT=NONE`; six shards become two jobs, because the array allows three numbers.
    #[test]
    fn jobs_need_nothing_from_the_submission() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, format!("#!/bin/bash\n{text}")).unwrap();
            assert!(Command::new("chmod").arg("+x").arg(&path).status().unwrap().success());
            path
        };
        let at = folder.path().display();
        write("scontrol", "echo 'MaxArraySize            = 3'");
        write(
            "sbatch",
            &format!(
                "cat > '{at}/job'\nlast=1\nfor option; do [[ $option != --array=1-* ]] || last=${{option#--array=1-}}; done\n\
                 for (( task = 1; task <= last; task++ )); do\n    \
                 env -i SLURM_ARRAY_TASK_ID=$task SLURM_CPUS_PER_TASK=4 bash '{at}/job'\n    \
                 echo \"$task ended with $?\" >> '{at}/said'\ndone\necho '17;cluster'\n"
            ),
        );
        // The table has failed points, but neither job has failed.
        let program = write("it's biflag", &format!("echo \"$*\" >> '{at}/said'\nexit 3\n"));
        let (plan, out) = (folder.path().join("my plan.toml"), folder.path().join("$out"));
        let script = write("sweep.sh", &script(&program, &plan, &out, 6, "a name"));
        let path = format!("{at}:{}", std::env::var("PATH").unwrap());
        let output = Command::new("bash").arg(script).env("PATH", path).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let (plan, out) = (plan.display(), out.display());
        let shard = |shard: u64| format!("sweep {plan} --shard {shard}/6 --resume --out {out} --jobs 4\n");
        let task = |shards: [u64; 3]| shards.map(shard).concat();
        let wanted = format!(
            "{}1 ended with 0\n{}2 ended with 0\nsweep merge {out}\n1 ended with 0\n",
            task([1, 3, 5]),
            task([2, 4, 6])
        );
        assert_eq!(std::fs::read_to_string(folder.path().join("said")).unwrap(), wanted);
    }
}
