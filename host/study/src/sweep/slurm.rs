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
    let script = include_str!("slurm.sh").replace("@shards@", &shards.to_string()).replace("@name@", &quoted(name));
    script.replace("@program@", &program).replace("@plan@", &plan).replace("@folder@", &folder)
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
