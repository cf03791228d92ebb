//! Reads logs with other programs from PyPI: the Python packages `mcap` and `mcap-protobuf-support`, and Rerun.

use biflag_log::schema::foxglove;
use biflag_log::{Body, Reader};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tests::python::{command, newest_python};
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

/// Rewrites a log in the ways that its arguments say, with a file attached and metadata of its own.
const REWRITE: &str = r#"
import sys
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

source, target, *how = sys.argv[1:]
compression = {"lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}.get(how[0], CompressionType.NONE)
with open(source, "rb") as old, open(target, "wb") as new:
    reader = make_reader(old)
    writer = Writer(new, compression=compression, use_chunking="unchunked" not in how, enable_crcs="no-crc" not in how,
                    enable_data_crcs="no-crc" not in how, use_statistics="no-index" not in how,
                    use_summary_offsets="no-index" not in how,
                    repeat_channels="no-index" not in how, repeat_schemas="no-index" not in how,
                    index_types=IndexType.NONE if "no-index" in how else IndexType.ALL)
    writer.start(profile="", library="a laboratory's own program")
    writer.add_attachment(create_time=0, log_time=0, name="photo.jpg", media_type="image/jpeg", data=b"123")
    writer.add_metadata("laboratory", {"room": "7"})
    schemas, channels = {}, {}
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        if schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
        if channel.id not in channels:
            channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, schemas[schema.id])
        writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence)
    for metadata in reader.iter_metadata():
        writer.add_metadata(metadata.name, metadata.metadata)
    writer.finish()
"#;

/// Script that opens an archive of `biflag pack` as an RO-Crate, and checks size and sum of each file in it.
const CRATE: &str = r##"
import hashlib, json, sys
from pathlib import Path
from rocrate.model import File
from rocrate.rocrate import ROCrate

crate = ROCrate(sys.argv[1])
files = [entity for entity in crate.get_entities() if isinstance(entity, File) and entity.get("contentSize")]
for file in files:
    data = open(f"{sys.argv[1]}/{file['name']}", "rb").read()
    assert (str(len(data)), hashlib.sha256(data).hexdigest()) == (file["contentSize"], file["sha256"]), file.id
there = {str(path.relative_to(sys.argv[1])) for path in Path(sys.argv[1]).rglob("*") if path.is_file()}
assert there - {file["name"] for file in files} == {"ro-crate-metadata.json"}, there
logs = crate.dereference("#recording")["result"]
print(json.dumps({
    "name": crate.name, "licence": crate.license.id, "author": crate.root_dataset["author"]["name"], "files": len(files),
    "parts": len(crate.root_dataset["hasPart"]), "logs": [log["name"] for log in (logs if isinstance(logs, list) else [logs])],
}))
"##;

/// Script that prints Rerun's conversion of a log: its archetypes, and channels that it reads by their schema.
const RERUN: &str = r#"
import json, sys
from rerun.chunk import RrdReader

columns = {}
for chunk in RrdReader(sys.argv[1]).stream():
    batch = chunk.to_record_batch()
    for field in batch.schema:
        if field.name in ("McapMessage:data",):
            raise SystemExit(f"{chunk.entity_path} came out as bytes")
        if ":" in field.name and not field.name.startswith("Mcap"):
            rows = columns.setdefault(str(chunk.entity_path), {}).setdefault(field.name, [])
            rows.extend(zip(batch.column("message_log_time").cast("int64").to_pylist(), batch.column(field.name).to_pylist())
                        if "message_log_time" in batch.schema.names else [])
print(json.dumps({
    "attitude": {name: columns["/attitude"]["Transform3D:" + name] for name in ("parent_frame", "child_frame", "quaternion")},
    "points": {
        "frame": columns["/flagella_points"]["CoordinateFrame:frame"],
        "positions": columns["/flagella_points"]["Points3D:positions"],
        "colors": columns["/flagella_points"]["Points3D:colors"],
    },
    "lines": columns["/flagella"]["foxglove.SceneUpdate:message"],
    "yaw": [[time, rows[0]["yaw_deg"]] for time, rows in columns["/telemetry"]["biflag.Telemetry:message"]],
}))
"#;

/// Script that reads the table of a sweep in pandas, polars and xarray, and prints what each has found.
const SWEEP: &str = r##"
import json, sys
import pandas, polars, pyarrow.parquet, xarray

folder = sys.argv[1]
columns = json.loads(pyarrow.parquet.read_schema(f"{folder}/table.parquet").metadata[b"columns"])
pd = pandas.read_parquet(f"{folder}/table.parquet")
csv = pandas.read_csv(f"{folder}/table.csv", comment="#")
pl = polars.read_parquet(f"{folder}/table.parquet")
pl_csv = polars.read_csv(f"{folder}/table.csv", comment_prefix="#")
numbers = pd.select_dtypes("number").columns
assert list(pd.columns) == list(csv.columns) == pl.columns == pl_csv.columns and set(pd.columns) == set(columns)
pandas.testing.assert_frame_equal(pd[numbers], csv[numbers], check_exact=True, check_dtype=False)
assert pl.select("yaw_deg").to_series().to_list() == pl_csv.select("yaw_deg").to_series().to_list()
ok = pd[pd.status == "ok"]
grid = xarray.Dataset.from_dataframe(ok.set_index(["w1_rpm", "w2_rpm", "group_stiffness_relative"])[["yaw_deg", "tilt_deg"]])
for name in grid:
    grid[name].attrs.update(columns[name])
point = grid.sel(w1_rpm=50, w2_rpm=10, group_stiffness_relative=2)
print(json.dumps({
    "rows": len(pl), "failed": pl.filter(polars.col("status") == "failed").height, "null": int(pd.yaw_deg.isna().sum()),
    "sizes": dict(grid.sizes), "units": grid.yaw_deg.attrs["unit"], "yaw": point.yaw_deg.item(), "unit": columns["force1_z_n"],
}))
"##;

#[test]
fn python_lists_the_channels_and_decodes_every_message() {
    let bench = Bench::new();
    let plan = bench.short_plan(5.0, [50.0, 10.0]);
    let nano = nano(["--speed", "max"]);
    let run = bench
        .run(["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--json"])
        .expect_code(3);
    let log = run.json()["trials"][0]["log"].as_str().unwrap().to_owned();
    let output = command(&newest_python()).args(["-c", DECODE, &log]).current_dir(bench.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let decoded: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{decoded}");
    assert_eq!(decoded["counts"]["/telemetry"], 1000);
    assert_eq!(decoded["counts"]["/attitude"], 1000);
    // The robot as its encoders say, twenty times a second.
    assert_eq!(decoded["counts"]["/flagella"], 100);
    for channel in ["/raw", "/command", "/event"] {
        assert!(decoded["counts"][channel].as_u64().unwrap() > 0, "{channel}");
    }
    assert!(decoded["metadata"].as_array().unwrap().len() >= 4);
}

/// A log that another program has rewritten gives the same results, and its trial is not repeated.
#[test]
fn log_rewritten_in_python_is_whole() {
    let bench = Bench::new();
    let plan = bench.short_plan(5.0, [50.0, 10.0]);
    let nano = nano(["--speed", "max"]);
    let record = ["record", plan.to_str().unwrap(), "--port", nano.port(), "--out", "session", "--resume", "--json"];
    let run = bench.run(record).expect_code(3);
    let log = bench.path().join(run.json()["trials"][0]["log"].as_str().unwrap());
    let info = |log: &Path| bench.run(["info", log.to_str().unwrap(), "--json"]).expect_code(3).json();
    let ours = info(&log);
    assert_eq!((&ours["clean"], &ours["rewritten_by"]), (&true.into(), &Value::Null));
    let python = newest_python();
    for how in [
        &["zstd"][..],
        &["lz4", "no-index", "no-crc"],
        &["none", "unchunked"],
        &["none", "unchunked", "no-index", "no-crc"],
    ] {
        let theirs = bench.path().join("theirs.mcap");
        let mut rewrite = command(&python);
        rewrite.args(["-c", REWRITE]).args([&log, &theirs]).args(how);
        let output = rewrite.output().unwrap();
        assert!(output.status.success(), "{how:?}: {}", String::from_utf8_lossy(&output.stderr));
        let info = info(&theirs);
        assert_eq!(info["clean"], true, "{how:?}: {info}");
        assert!(info["rewritten_by"].as_str().unwrap().contains("a laboratory's own program"), "{how:?}: {info}");
        for key in ["samples", "lost", "angles", "trial", "end", "duration_s"] {
            assert_eq!(info[key], ours[key], "{how:?}");
        }
        let text = bench.run(["info", theirs.to_str().unwrap()]).stdout;
        assert!(text.contains("a laboratory's own program, whole"), "{text}");
        bench.run(["recover", theirs.to_str().unwrap()]).expect_code(0);
        std::fs::rename(&theirs, &log).unwrap();
        let run = bench.run(record).expect_code(3);
        assert_eq!(run.json()["trials"][0]["complete"], true, "{how:?}");
        assert_eq!(tests::logs(&bench.path().join("session")).len(), 1, "{how:?}: the trial is repeated");
    }
}

/// Rerun converts the attitude to transforms and the flagella to coloured points with the same values, and reads every
/// other channel by its schema.
#[test]
fn rerun_reads_attitude_and_flagella() {
    let bench = Bench::new();
    let simulate = ["simulate", "--speeds=50,10", "--duration", "2", "--shapes", "--out", "session", "--json"];
    let run = bench.run(simulate);
    let log = bench.path().join(run.json()["trials"][0]["log"].as_str().unwrap());
    let python = newest_python();
    let run = |command: &mut Command| {
        // Rerun writes its settings to the user's home folder.
        let home = ["HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME"].map(|name| (name, bench.path()));
        let output = command.envs(home).current_dir(bench.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    run(command(&python.with_file_name("rerun")).args(["mcap", "convert", "-o", "log.rrd"]).arg(&log));
    let rerun: Value = serde_json::from_slice(&run(command(&python).args(["-c", RERUN, "log.rrd"]))).unwrap();

    let (mut attitudes, mut clouds, mut scenes, mut yaws) = (0, 0, 0, 0);
    for message in Reader::open(&log).unwrap().map(Result::unwrap) {
        let row = |columns: &Value, i: usize| {
            assert_eq!(columns[i][0], message.log_time_ns, "the time of message {i}");
            columns[i][1].clone()
        };
        match message.body {
            Body::Attitude(transform) => {
                let theirs = &rerun["attitude"];
                assert_eq!(row(&theirs["parent_frame"], attitudes), serde_json::json!(["world"]));
                assert_eq!(row(&theirs["child_frame"], attitudes), serde_json::json!(["body"]));
                let foxglove::Quaternion { x, y, z, w } = transform.rotation.unwrap();
                assert_near(&row(&theirs["quaternion"], attitudes)[0], &[x, y, z, w]);
                attitudes += 1;
            }
            Body::FlagellaPoints(cloud) => {
                let theirs = &rerun["points"];
                assert_eq!(row(&theirs["frame"], clouds), serde_json::json!(["body"]));
                let positions = row(&theirs["positions"], clouds);
                let points: Vec<&[u8]> = cloud.data.chunks(cloud.point_stride as usize).collect();
                assert_eq!(positions.as_array().unwrap().len(), points.len());
                for (position, point) in positions.as_array().unwrap().iter().zip(&points) {
                    let part = |i: usize| f64::from(f32::from_le_bytes(point[4 * i..4 * i + 4].try_into().unwrap()));
                    assert_near(position, &[part(0), part(1), part(2)]);
                }
                let colours = row(&theirs["colors"], clouds);
                let colour = |point: &[u8]| Value::from(u32::from_be_bytes(point[16..20].try_into().unwrap()));
                assert!(
                    colours.as_array().unwrap().iter().zip(&points).all(|(theirs, point)| *theirs == colour(point))
                );
                clouds += 1;
            }
            Body::Flagella(scene) => {
                let theirs = &row(&rerun["lines"], scenes)[0]["entities"][0];
                let entity = &scene.entities[0];
                assert_eq!((&theirs["id"], &theirs["frame_id"]), (&"flagella".into(), &"body".into()));
                let last = entity.lines[1].points.last().unwrap();
                let their_points = theirs["lines"][1]["points"].as_array().unwrap();
                let theirs = their_points.last().unwrap();
                assert_eq!((theirs["x"].as_f64(), theirs["z"].as_f64()), (Some(last.x), Some(last.z)));
                scenes += 1;
            }
            Body::Telemetry(telemetry) => {
                assert_eq!(row(&rerun["yaw"], yaws).as_f64(), Some(telemetry.yaw_deg));
                yaws += 1;
            }
            _ => {}
        }
    }
    println!("{attitudes} transforms, {clouds} clouds, {scenes} scenes and {yaws} states are the same in Rerun");
    assert_eq!((attitudes, clouds, scenes, yaws), (41, 41, 41, 41));
}

/// The table of a sweep has the same numbers, units and missing values in each of the usual readers.
#[test]
fn python_reads_the_table_of_a_sweep() {
    let bench = Bench::new();
    let plan = "[trial]\nrun = 0.4\nmethod = \"trial\"\n[vary]\n\"group.stiffness\" = [1, 2]\n\"group.spacing\" = [0.4, 1]\n\
                [speeds]\ngrid = { w1 = [-50, 50, 50], w2 = [10, 20, 10] }\n";
    bench.file("plan.toml", plan);
    bench.run(["sweep", "plan.toml"]).expect_code(3);
    let python = newest_python();
    let output = command(&python).args(["-c", SWEEP, "sweep"]).current_dir(bench.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read: Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{read}");
    assert_eq!((&read["rows"], &read["failed"], &read["null"]), (&24.into(), &12.into(), &12.into()));
    assert_eq!(read["sizes"], serde_json::json!({ "w1_rpm": 3, "w2_rpm": 2, "group_stiffness_relative": 2 }));
    assert_eq!((&read["units"], &read["unit"]["unit"]), (&"deg".into(), &"N".into()));
    assert!(read["yaw"].as_f64().unwrap().abs() > 1e-3, "{read}");
}

/// Compares with single precision, which Rerun uses for coordinates.
#[track_caller]
fn assert_near(theirs: &Value, ours: &[f64]) {
    let theirs: Vec<f64> = theirs.as_array().unwrap().iter().map(|part| part.as_f64().unwrap()).collect();
    let near = theirs.len() == ours.len() && theirs.iter().zip(ours).all(|(a, b)| (a - b).abs() <= 1e-6);
    assert!(near, "{theirs:?} is not {ours:?}");
}

/// Unpacked by Python, an archive is an RO-Crate whose files have the sums and sizes that it states.
#[test]
fn rocrate_reads_an_archive() {
    let bench = Bench::new();
    let simulated = bench.run(["simulate", "--speeds=-37.3,12.9", "--duration", "1.5", "--out", "session"]);
    assert_eq!(simulated.code, Some(3), "not settled");
    let pack = ["pack", "session", "-o", "odd.zip", "--author", "A. Writer", "--license", "CC0-1.0"];
    assert_eq!(bench.run(pack).code, Some(3));
    let python = newest_python();
    let run = |arguments: &[&str]| {
        let output = command(&python).current_dir(bench.path()).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    run(&["-m", "zipfile", "-e", "odd.zip", "crate"]);
    let found: Value = serde_json::from_slice(&run(&["-c", CRATE, "crate"])).unwrap();
    let expected = serde_json::json!({
        "name": "Biflag session w1-37.3_w2+12.9", "licence": "https://spdx.org/licenses/CC0-1.0", "author": "A. Writer",
        "files": 11, "parts": 11, "logs": ["session/001_w1-37.3_w2+12.9.mcap"],
    });
    assert_eq!(found, expected);
}
