//! A sweep on a real Slurm: a controller and two nodes on this computer, of which one dies in the middle.
//!
//! The packages of Debian's `slurm-wlm` are unpacked into the target folder, without being installed: no service is started
//! on the computer, and no rights are needed.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tests::{Bench, whole_computer};

const PACKAGES: [&str; 7] =
    ["slurmctld", "slurmd", "slurm-client", "slurm-wlm-basic-plugins", "libmunge2", "liblua5.1-0", "libhwloc15"];

/// Points that take about 20 s of one core.
const PLAN: &str = "[session]\nname = \"cluster\"\n[trial]\nrun = 120\nmethod = \"trial\"\n[vary]\n\"group.stiffness\" = [0.5, 1, 2]\n\
                    \"group.spacing\" = [0.4, 1]\n[speeds]\ngrid = { w1 = [-80, 80, 40], w2 = [20, 80, 30] }\n";

/// Returns the folder with Slurm's programs, or why there is none.
fn unpacked() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("slurm");
    if folder.join("ready").exists() {
        return Ok(folder);
    }
    std::fs::create_dir_all(&folder).map_err(|error| error.to_string())?;
    let run = |command: &mut Command| {
        let output = command.current_dir(&folder).output().map_err(|error| format!("{command:?}: {error}"))?;
        match output.status.success() {
            true => Ok(()),
            false => Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr).trim())),
        }
    };
    run(Command::new("apt-get").args(["download", "-q"]).args(PACKAGES))?;
    for entry in std::fs::read_dir(&folder).map_err(|error| error.to_string())? {
        let path = entry.map_err(|error| error.to_string())?.path();
        if path.extension().is_some_and(|end| end == "deb") {
            run(Command::new("dpkg").arg("-x").arg(&path).arg("."))?;
        }
    }
    File::create(folder.join("ready")).map_err(|error| error.to_string())?;
    Ok(folder)
}

/// A controller and two nodes with one processor each.
struct Cluster {
    programs: PathBuf,
    folder: PathBuf,
    daemons: Vec<Child>,
}

impl Cluster {
    fn start(programs: PathBuf, folder: &Path) -> Self {
        let output = |program: &str, argument: &str| {
            let output = Command::new(program).arg(argument).output().expect("a program of every system");
            String::from_utf8(output.stdout).expect("text").trim().to_owned()
        };
        let (host, user) = (output("hostname", "-s"), output("id", "-un"));
        // Ports that are free now.
        let sockets = [0; 3].map(|_| std::net::TcpListener::bind("127.0.0.1:0").expect("a free port"));
        let [controller, one, two] = sockets.map(|socket| socket.local_addr().expect("an address").port());
        let (at, plugins) = (folder.display(), plugins(&programs));
        let plugins = plugins.display();
        let conf = format!(
            "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={controller}\nSlurmUser={user}\nSlurmdUser={user}\n\
             AuthType=auth/none\nAuthInfo=cred_expire=5\nCredType=cred/none\nStateSaveLocation={at}/state\n\
             SlurmdSpoolDir={at}/spool-%n\nSlurmctldPidFile={at}/slurmctld.pid\nSlurmdPidFile={at}/%n.pid\n\
             PluginDir={plugins}\nProctrackType=proctrack/pgid\nTaskPlugin=task/none\nSwitchType=switch/none\n\
             MpiDefault=none\nJobAcctGatherType=jobacct_gather/none\nSelectType=select/cons_tres\n\
             SelectTypeParameters=CR_CPU\nSchedulerParameters=sched_interval=1,batch_sched_delay=0,bf_interval=1\n\
             SlurmdTimeout=10\nKillWait=2\nInactiveLimit=0\nReturnToService=2\nJobRequeue=1\nMaxArraySize=3\n\
             NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={one} CPUs=1\n\
             NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={two} CPUs=1\n\
             PartitionName=all Nodes=n1,n2 Default=YES MaxTime=INFINITE State=UP\n"
        );
        for name in ["state", "spool-n1", "spool-n2"] {
            std::fs::create_dir_all(folder.join(name)).expect("a folder");
        }
        std::fs::write(folder.join("slurm.conf"), conf).expect("a file");
        let mut cluster = Self { programs, folder: folder.to_owned(), daemons: Vec::new() };
        cluster.wrap("scontrol");
        cluster.daemon("controller", "slurmctld", &["-D"]);
        for node in ["n1", "n2"] {
            // Steps leave the process group of their daemon: each notes its number, so that the node can be killed whole.
            let step = folder.join(format!("step-{node}"));
            let real = cluster.program("slurmstepd");
            let note = format!("#!/bin/sh\necho $$ >> '{}.steps'\nexec '{}' \"$@\"\n", step.display(), real.display());
            std::fs::write(&step, note).expect("a file");
            assert!(Command::new("chmod").arg("+x").arg(&step).status().expect("chmod").success());
            cluster.daemon(node, "slurmd", &["-D", "-N", node, "-d", step.to_str().expect("text")]);
        }
        cluster
    }

    fn program(&self, name: &str) -> PathBuf {
        let [plain, debian] =
            [name.to_owned(), format!("{name}-wlm")].map(|name| self.programs.join("usr/sbin").join(name));
        if debian.exists() { debian } else { plain }
    }

    /// Makes a command of Slurm that finds this cluster by itself, as one that is installed does: jobs without variables use
    /// it.
    fn wrap(&self, name: &str) {
        let real = self.programs.join("usr/bin").join(name);
        let command = self.command(&real);
        let variables = command.get_envs().filter(|(key, _)| *key != "PATH");
        let variables: Vec<_> = variables
            .map(|(key, value)| format!("{}='{}'", key.display(), value.unwrap_or_default().display()))
            .collect();
        let text = format!("#!/bin/sh\n{} exec '{}' \"$@\"\n", variables.join(" "), real.display());
        let path = self.folder.join(name);
        std::fs::write(&path, text).expect("a file");
        assert!(Command::new("chmod").arg("+x").arg(&path).status().expect("chmod").success());
    }

    fn daemon(&mut self, log: &str, program: &str, arguments: &[&str]) {
        let log = File::create(self.folder.join(format!("{log}.log"))).expect("a file");
        let mut command = self.command(&self.program(program));
        command.args(arguments).stdout(log.try_clone().expect("a file")).stderr(log);
        self.daemons.push(command.spawn().expect("a daemon"));
    }

    /// Returns a command that finds this cluster and its programs.
    fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        let lib = self.programs.join("usr/lib/x86_64-linux-gnu");
        let path = std::env::var("PATH").unwrap_or_default();
        command.env("SLURM_CONF", self.folder.join("slurm.conf"));
        command.env("LD_LIBRARY_PATH", format!("{}:{}", lib.display(), plugins(&self.programs).display()));
        let programs = self.programs.join("usr/bin");
        command.env("PATH", format!("{}:{}:{path}", self.folder.display(), programs.display())).stdin(Stdio::null());
        command
    }

    fn output(&self, program: &str, arguments: &[&str]) -> String {
        let output = self.command(Path::new(program)).args(arguments).output().expect("a program of Slurm");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    fn logs(&self) -> String {
        let logs =
            ["controller", "n1", "n2"].map(|log| std::fs::read_to_string(self.folder.join(format!("{log}.log"))));
        logs.map(Result::unwrap_or_default).join("\n---\n")
    }

    /// Kills a node with all that runs on it; returns how many processes that were.
    fn kill(&mut self, node: usize) -> usize {
        let steps = std::fs::read_to_string(self.folder.join(format!("step-n{node}.steps"))).unwrap_or_default();
        let mut processes = vec![self.daemons[node].id()];
        // A number whose step has ended may be another program's by now.
        let is_step = |step: &u32| {
            std::fs::read_to_string(format!("/proc/{step}/comm")).is_ok_and(|name| name.starts_with("slurmstepd"))
        };
        let steps = steps.lines().filter_map(|line| line.parse().ok()).filter(is_step);
        steps.for_each(|step| add_tree(step, &mut processes));
        for process in &processes {
            // A step that has ended is gone.
            let _ = Command::new("kill").args(["-9", &process.to_string()]).stderr(Stdio::null()).status();
        }
        self.daemons[node].wait().expect("the daemon is gone");
        processes.len()
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for node in [1, 2] {
            self.kill(node);
        }
        let _ = self.daemons[0].kill();
        let _ = self.daemons[0].wait();
    }
}

fn plugins(programs: &Path) -> PathBuf {
    programs.join("usr/lib/x86_64-linux-gnu/slurm-wlm")
}

/// Adds a process and its descendants.
fn add_tree(process: u32, processes: &mut Vec<u32>) {
    processes.push(process);
    let children = std::fs::read_to_string(format!("/proc/{process}/task/{process}/children")).unwrap_or_default();
    children.split_whitespace().filter_map(|child| child.parse().ok()).for_each(|child| add_tree(child, processes));
}

fn wait_for(what: &str, cluster: &Cluster, seconds: u64, mut is_true: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_true() {
        assert!(begun.elapsed() < Duration::from_secs(seconds), "{what}: not in {seconds} s\n{}", cluster.logs());
        std::thread::sleep(Duration::from_millis(200));
    }
}

/// Three shards on two nodes, in an array of two jobs. While they compute, the job on the first node is warned of its time
/// limit, and the second node dies: both queue again, and the merged table has the same bytes as that of one program. The jobs
/// get no variable of their submission.
#[test]
#[ignore = "a minute of both cores, after a download"]
fn a_node_that_dies_changes_no_byte() {
    let programs = match unpacked() {
        Ok(programs) => programs,
        Err(reason) => return println!("skipped, Slurm cannot be unpacked here: {reason}"),
    };
    let _computer = whole_computer();
    let bench = Bench::new();
    bench.file("plan.toml", PLAN);
    bench.run(["sweep", "plan.toml", "--out", "serial", "--jobs", "2"]).expect_code(3);
    let script = bench.run(["sweep", "slurm", "plan.toml", "--shards", "3", "--out", "shared"]).expect_code(0).stdout;
    let script = bench.file("sweep.sh", &script);

    let folder = bench.path().join("slurm");
    std::fs::create_dir(&folder).unwrap();
    let mut cluster = Cluster::start(programs, &folder);
    wait_for("two idle nodes", &cluster, 30, || cluster.output("sinfo", &["-h", "-o", "%D %t"]).trim() == "2 idle");
    // The rule of many centres: a job gets no variable of its submission.
    let mut submission = cluster.command(Path::new("bash"));
    let submitted = submission.arg(&script).current_dir(bench.path()).env("SBATCH_EXPORT", "NONE").output().unwrap();
    assert!(submitted.status.success(), "{}", String::from_utf8_lossy(&submitted.stderr));
    println!("{}", String::from_utf8_lossy(&submitted.stdout).trim());
    let status = || bench.run(["sweep", "status", "shared", "--json"]);
    let steps = folder.join("step-n2.steps");
    wait_for("points on both nodes", &cluster, 60, || {
        let parts = std::fs::read_dir(bench.path().join("shared")).into_iter().flatten().flatten();
        let parts = parts.filter(|entry| entry.path().extension().is_some_and(|end| end == "open")).count();
        steps.exists() && parts == 2 && status().json()["done"].as_u64() > Some(4)
    });
    let before = status().json()["done"].as_u64().unwrap();
    let killed = cluster.kill(2);
    let warned = cluster.output("squeue", &["-h", "-t", "R", "-w", "n1", "-o", "%i"]).trim().to_owned();
    cluster.output("scancel", &["--batch", "--signal=USR1", &warned]);
    println!(
        "after {before} of 90 points node 2 is killed with {killed} processes, and job {warned} on node 1 is warned"
    );
    assert!(killed >= 3 && before < 90, "the daemon, its step and the worker: {killed}");
    wait_for("the warned job to queue again", &cluster, 60, || {
        cluster.output("squeue", &["-h", "-j", &warned, "-o", "%t"]).trim() == "PD"
    });
    let table = bench.path().join("shared/table.parquet");
    let begun = Instant::now();
    wait_for("the merged table", &cluster, 600, || cluster.output("squeue", &["-h"]).is_empty() && table.exists());
    println!("the array is done and merged {:.0} s later", begun.elapsed().as_secs_f64());
    for name in ["table.parquet", "table.csv"] {
        let [serial, shared] =
            ["serial", "shared"].map(|out| std::fs::read(bench.path().join(out).join(name)).unwrap());
        assert!(serial == shared, "{name}");
    }
}
