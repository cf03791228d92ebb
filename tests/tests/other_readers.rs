//! Another program reads the log: the Python packages `mcap` and `mcap-protobuf-support` from PyPI.

use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{Bench, nano};

const DECODE: &str = r#"
import collections, json, sys
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

counts = collections.Counter()
yaw = []
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    for schema, channel, message, decoded in reader.iter_decoded_messages():
        counts[channel.topic] += 1
        if channel.topic == "/attitude":
            yaw.append(decoded.rotation.w)
    metadata = sorted({record.name for record in reader.iter_metadata()})
print(json.dumps({"counts": counts, "metadata": metadata, "first_w": yaw[0]}))
"#;

/// A virtual environment with the two packages, kept between runs.
fn python() -> PathBuf {
    let venv = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python");
    let python = venv.join("bin/python");
    let ready = venv.join("ready");
    if !ready.is_file() {
        let run = |command: &mut Command| assert!(command.status().unwrap().success(), "{command:?}");
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&venv));
        run(Command::new(&python).args(["-m", "pip", "install", "-q", "mcap==1.6.0", "mcap-protobuf-support==0.6.0"]));
        std::fs::write(ready, "").unwrap();
    }
    python
}

#[test]
fn python_lists_the_channels_and_decodes_every_message() {
    let bench = Bench::new();
    let plan = bench.short_plan(5.0, [50.0, 10.0]);
    let nano = nano(["--speed", "max"]);
    let run = bench
        .run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--json"])
        .expect_code(0);
    let log = run.json()["trials"][0]["log"].as_str().unwrap().to_owned();
    let output = Command::new(python()).args(["-c", DECODE, &log]).current_dir(bench.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let decoded: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{decoded}");
    assert_eq!(decoded["counts"]["/telemetry"], 1000);
    assert_eq!(decoded["counts"]["/attitude"], 1000);
    for channel in ["/raw", "/command", "/event"] {
        assert!(decoded["counts"][channel].as_u64().unwrap() > 0, "{channel}");
    }
    assert!(decoded["metadata"].as_array().unwrap().len() >= 4);
}
