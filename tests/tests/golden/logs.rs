//! Channels, schemas and metadata of logs: as they are written today, and of the oldest format.

use super::recording;
use biflag_log::{Body, Reader};
use mcap::records::Record;
use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, EnumDescriptorProto, FileDescriptorSet};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;
use tests::golden::{hold, hold_keys};
use tests::{Bench, data, logs};

const PLAN: &str = "[session]\nname = \"golden\"\n[trial]\ncalibrate = 1\npreroll = 3\nrun = 1\ndecay = 0\n[speeds]\npairs = [[50, 10]]\n";

/// The content of a log, but for its messages.
#[derive(Default)]
struct Content {
    /// The message and the encoding of each channel.
    channels: BTreeMap<String, String>,
    /// The fields of each message.
    schemas: BTreeMap<String, Vec<u8>>,
    /// The keys of each metadata record.
    metadata: BTreeMap<String, BTreeSet<String>>,
}

impl Content {
    fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let mut content = Self::default();
        let mut names = BTreeMap::new();
        for record in mcap::read::ChunkFlattener::new(&bytes).unwrap() {
            match record.unwrap() {
                Record::Schema { header, data } => {
                    names.insert(header.id, format!("{} ({})", header.name, header.encoding));
                    content.schemas.insert(header.name, data.into_owned());
                }
                Record::Channel(channel) => {
                    assert!(channel.metadata.is_empty(), "{channel:?}");
                    let text = format!("{}, {}", names[&channel.schema_id], channel.message_encoding);
                    content.channels.insert(channel.topic, text);
                }
                Record::Metadata(record) => {
                    content.metadata.entry(record.name).or_default().extend(record.metadata.into_keys());
                }
                Record::Header(header) => {
                    content.metadata.insert("profile".to_owned(), BTreeSet::from([header.profile]));
                }
                _ => {}
            }
        }
        // The reader knows each of them.
        Reader::open(path).unwrap().for_each(|message| assert!(!matches!(message.unwrap().body, Body::Other(_))));
        content
    }
}

#[test]
fn channels_schemas_and_metadata_are_the_golden_ones() {
    let bench = Bench::new();
    bench.short_plan(0.5, [50.0, 10.0]);
    bench.file("t.csv", "t,yaw\n0,1\n1,2\n2,4\n3,5\n");
    let sessions = [
        ("recorded", "record plan.toml --virtual --out recorded"),
        ("modelled", "simulate plan.toml --shapes --out modelled"),
        ("solved", "simulate --speeds 50,10 --duration 30 --method steady --out solved"),
        ("steered", "steer --yaw=-67 --pitch=-4 --model --for 3 --out steered"),
    ];
    let mut all = Vec::new();
    for (name, arguments) in sessions {
        let run = bench.run(arguments.split(' ').chain(["--json"]));
        assert!(matches!(run.code, Some(0 | 3)), "{run:?}");
        if matches!(name, "recorded" | "steered") {
            hold_keys(arguments.split(' ').next().unwrap(), &run.json());
        }
        all.push((name, Content::read(&logs(&bench.path().join(name))[0])));
    }
    recording::sessions(&bench, PLAN, "model", "rested");
    all.insert(1, ("recorded after a rest", Content::read(&logs(&bench.path().join("rested"))[0])));
    let import = ["import", "t.csv", "--columns", "time=t,yaw=yaw,pitch=0,roll=0", "--speeds", "5,1", "--run", "1,3"];
    bench.run(import.into_iter().chain(["-o", "t.mcap"])).expect_unsettled();
    all.push(("imported", Content::read(&bench.path().join("t.mcap"))));
    for (name, file) in [("recorded, format 1", "recorded"), ("modelled, format 1", "modelled")] {
        all.push((name, Content::read(&data(&format!("format1/{file}.mcap")))));
    }

    let mut text = String::new();
    // Logs of one format have the same messages.
    let mut schemas: [BTreeMap<String, Vec<u8>>; 2] = Default::default();
    for (name, content) in all {
        let _ = writeln!(text, "# {name}");
        content.channels.iter().for_each(|(topic, schema)| _ = writeln!(text, "{topic}: {schema}"));
        for (record, keys) in &content.metadata {
            let _ = writeln!(text, "metadata `{record}`: {}", keys.iter().cloned().collect::<Vec<_>>().join(" "));
        }
        text.push('\n');
        let of_format = &mut schemas[usize::from(name.ends_with("format 1"))];
        for (name, schema) in content.schemas {
            let old = of_format.insert(name.clone(), schema.clone());
            assert!(old.is_none_or(|old| old == schema), "{name} is one message");
        }
    }
    let [today, oldest] = schemas;
    for (format, schemas) in [("today", today), ("format 1, where other than today", oldest)] {
        let _ = writeln!(text, "# messages, {format}");
        let mut fields = BTreeMap::new();
        for (name, schema) in schemas {
            let set = FileDescriptorSet::decode(&schema[..]).unwrap();
            assert!(set.file.iter().any(|file| name.starts_with(&format!("{}.", file.package()))), "{name}");
            for file in &set.file {
                file.message_type.iter().for_each(|message| of_message(file.package(), message, &mut fields));
                file.enum_type.iter().for_each(|kinds| of_enum(file.package(), kinds, &mut fields));
            }
        }
        for (name, lines) in fields {
            let block = format!("{name}\n{}", lines.iter().map(|line| format!("  {line}\n")).collect::<String>());
            if !text.contains(&block) {
                text += &block;
            }
        }
        text.push('\n');
    }
    hold("logs", &text);
}

fn of_message(within: &str, message: &DescriptorProto, fields: &mut BTreeMap<String, Vec<String>>) {
    let name = format!("{within}.{}", message.name());
    let lines = message.field.iter().map(|field| {
        let kind = match field.r#type() {
            Type::Message | Type::Enum => field.type_name().trim_start_matches('.').to_owned(),
            other => other.as_str_name().trim_start_matches("TYPE_").to_lowercase(),
        };
        let label = match field.label() {
            Label::Repeated => "repeated ",
            _ if field.proto3_optional() => "optional ",
            _ => "",
        };
        format!("{} {}: {label}{kind}", field.number(), field.name())
    });
    fields.insert(name.clone(), lines.collect());
    message.nested_type.iter().for_each(|inner| of_message(&name, inner, fields));
    message.enum_type.iter().for_each(|kinds| of_enum(&name, kinds, fields));
}

fn of_enum(within: &str, kinds: &EnumDescriptorProto, fields: &mut BTreeMap<String, Vec<String>>) {
    let lines = kinds.value.iter().map(|value| format!("{} {}", value.number(), value.name()));
    fields.insert(format!("{within}.{}", kinds.name()), lines.collect());
}
