//! Workers of a sweep that start together, and merges that run together, as on the nodes of a cluster: with equal process
//! numbers, as containers have, and with locks that other computers do not see, as on many parallel file systems.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use tests::{Bench, Run};

/// Workers at once, each with a shard.
const WORKERS: usize = 40;

/// Merges at once.
const MERGES: usize = 9;

/// 400 points that are impossible, and therefore cheap.
const PLAN: &str = "[session]\nname = \"together\"\n[vary]\n\"group.spacing\" = { from = 0.1, to = 0.4, count = 400 }\n\
                    [speeds]\npairs = [[50, 10]]\n";

/// Compiles a library that takes the place of a function of the system, by the linker's compiler, which Rust needs anyway.
fn library(bench: &Bench, name: &str, code: &str) -> PathBuf {
    let (source, library) = (bench.file(&format!("{name}.c"), code), bench.path().join(format!("{name}.so")));
    let built = Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&library, &source]).status().expect("cc");
    assert!(built.success());
    library
}

/// Returns the results of programs that were started together.
fn ends(children: impl Iterator<Item = Child>) -> Vec<Run> {
    // All are started before the first is waited for.
    let children: Vec<Child> = children.collect();
    children.into_iter().map(Run::of).collect()
}

/// Points that failed are exit code 3; a shard may have none.
fn failures(runs: &[Run]) -> Vec<&Run> {
    runs.iter().filter(|run| !matches!(run.code, Some(0 | 3))).collect()
}

fn tables(folder: &Path) -> Vec<Vec<u8>> {
    ["table.parquet", "table.csv"].map(|name| std::fs::read(folder.join(name)).expect("a table")).to_vec()
}

#[test]
fn workers_and_merges_do_not_harm_each_other() {
    let rounds: usize = std::env::var("ROUNDS").ok().and_then(|rounds| rounds.parse().ok()).unwrap_or(1);
    let bench = Bench::new();
    bench.file("plan.toml", PLAN);
    let cases = [
        ("as they are", None),
        ("equal process numbers", Some(library(&bench, "pid", "int getpid(void) { return 42; }\n"))),
        ("locks of one computer", Some(library(&bench, "lock", "int flock(int file, int how) { return 0; }\n"))),
    ];
    let mut seen = BTreeSet::new();
    for (case, library) in cases {
        let start = |arguments: &[&str]| {
            let mut command = bench.command(arguments);
            if let Some(library) = &library {
                command.env("LD_PRELOAD", library);
            }
            command.spawn().expect("biflag starts")
        };
        for round in 0..rounds {
            let out = format!("{case}-{round}");
            let workers = ends((1..=WORKERS).map(|shard| {
                let shard = format!("{shard}/{WORKERS}");
                start(&["sweep", "plan.toml", "--shard", &shard, "--resume", "--jobs", "1", "--out", &out])
            }));
            assert!(failures(&workers).is_empty(), "{case}, round {round}: {:?}", failures(&workers));
            let merges = ends((0..MERGES).map(|_| start(&["sweep", "merge", &out, "--json"])));
            assert!(failures(&merges).is_empty(), "{case}, round {round}: {:?}", failures(&merges));
            assert!(merges.iter().all(|merge| merge.json()["missing"] == 0));
            let folder = bench.path().join(&out);
            seen.insert(tables(&folder));
            let left = std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("a file").file_name());
            let left: Vec<_> = left.filter(|name| name.to_string_lossy().ends_with("partial")).collect();
            assert!(left.is_empty(), "drafts are left: {left:?}");
            std::fs::remove_dir_all(folder).expect("the folder is removed");
        }
        println!("{case}: {rounds} rounds of {WORKERS} workers and {MERGES} merges at once, no failure");
    }
    assert_eq!(seen.len(), 1, "all tables have the same bytes");
}
