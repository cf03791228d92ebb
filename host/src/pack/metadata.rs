//! The archive's description for programs: RO-Crate 1.1 metadata, and the manifest of the sums.

use super::archive::Sum;
use super::content::Content;
use super::readme::About;
use crate::plan::Plan;
use crate::program::{GIT_HASH, VERSION, timestamp};
use crate::session::Session;
use crate::text;
use serde_json::{Value, json};
use std::time::SystemTime;

const NAME: &str = "ro-crate-metadata.json";

/// Adds both files. `sums`: the sums of the files so far.
pub(super) fn add(content: &mut Content, session: &Session, about: &About, sums: &[Sum]) -> miette::Result<()> {
    let manifest: String =
        content.entries.iter().zip(sums).map(|(entry, sum)| format!("{}  {}\n", sum.sha256, entry.name)).collect();
    content.add_text("manifest-sha256.txt", &manifest, "SHA-256 of each file")?;
    // The metadata lists the manifest, too.
    let sums = [sums, &[Sum::of(manifest.as_bytes())]].concat();
    let metadata = format!("{:#}\n", crate_of(content, session, about, &sums));
    content.add_text(NAME, &metadata, "This archive for programs")
}

fn description(plan: &Plan) -> String {
    let trials = text::count(plan.trials.len(), "trial");
    format!(
        "{trials} of a robot with two soft helical flagella in glycerin: attitude, speeds of both motors, and steady angles with \
         their uncertainties. {}",
        text::line(plan.note.trim())
    )
}

fn crate_of(content: &Content, session: &Session, about: &About, sums: &[Sum]) -> Value {
    let license = match about.license.as_str() {
        "" => json!("The authors state no licence."),
        id => json!({ "@id": format!("https://spdx.org/licenses/{id}") }),
    };
    let has_author = !about.author.trim().is_empty();
    let files: Vec<_> = content.entries.iter().map(|entry| json!({ "@id": address(&entry.name) })).collect();
    let is_log = |name: &str| name.starts_with("session/") && name.ends_with(".mcap");
    let logs = content.entries.iter().filter(|entry| is_log(&entry.name));
    let mut logs: Vec<_> = logs.map(|entry| json!({ "@id": address(&entry.name) })).collect();
    // A single value is not a list, as RO-Crate recommends.
    let logs = if logs.len() == 1 { logs.remove(0) } else { Value::from(logs) };
    let mut root = json!({
        "@id": "./",
        "@type": "Dataset",
        "name": format!("Biflag session {}", text::line(&session.plan().name)),
        "description": description(session.plan()).trim_end(),
        "datePublished": timestamp(SystemTime::now()),
        "license": license,
        "hasPart": files,
        "mentions": { "@id": "#recording" },
    });
    if has_author {
        root["author"] = json!({ "@id": "#author" });
    }
    let mut graph = vec![
        json!({
            "@id": NAME,
            "@type": "CreativeWork",
            "about": { "@id": "./" },
            "conformsTo": { "@id": "https://w3id.org/ro/crate/1.1" },
        }),
        root,
        json!({
            "@id": "#biflag",
            "@type": "SoftwareApplication",
            "name": "biflag",
            "version": VERSION,
            "softwareVersion": format!("{VERSION} ({GIT_HASH})"),
        }),
        json!({
            "@id": "#recording",
            "@type": "CreateAction",
            "name": "The recording of the session",
            "instrument": { "@id": "#biflag" },
            "object": [{ "@id": "plan.toml" }, { "@id": "robot.toml" }],
            "result": logs,
            "startTime": session.created,
        }),
    ];
    if has_author {
        graph.push(json!({ "@id": "#author", "@type": "Person", "name": text::line(about.author.trim()) }));
    }
    if !about.license.is_empty() {
        graph.push(json!({
            "@id": format!("https://spdx.org/licenses/{}", about.license),
            "@type": "CreativeWork",
            "name": about.license,
        }));
    }
    graph.extend(content.entries.iter().zip(sums).map(|(entry, sum)| {
        json!({
            "@id": address(&entry.name),
            "@type": "File",
            "name": entry.name,
            "description": entry.about,
            "encodingFormat": entry.media_type(),
            "contentSize": sum.size.to_string(),
            "sha256": sum.sha256,
        })
    }));
    json!({
        "@context": ["https://w3id.org/ro/crate/1.1/context", { "sha256": "https://schema.org/sha256" }],
        "@graph": graph,
    })
}

/// Returns the name of a file as a relative address: with `%` before the codes of characters that an address cannot contain.
fn address(name: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~/+=,@".contains(&byte);
    name.bytes().map(|byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") }).collect()
}
