//! `biflag pack`: a session as one archive.

use super::answer::{Answer, Outcome, are_slight, lines_of_logs, wrong_use};
use super::options::written_as;
use crate::pack::{About, pack};
use crate::progress::Progress;
use crate::session::Session;
use crate::text;
use biflag_log::similar::suggest;
use spdx::identifiers::LICENSES;
use std::path::PathBuf;
use system::file::full_path;

/// Pack a session into one archive for a data repository: logs, page, figures, tables, checksums, RO-Crate metadata.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag pack glycerin -o glycerin.zip --author \"Ada Lovelace\" --license CC-BY-4.0\n\
    The archive has a readme. Check its files with `sha256sum --check manifest-sha256.txt`.")]
pub struct Args {
    /// The session folder.
    session: PathBuf,
    /// The archive to write [default: SESSION.zip].
    #[arg(short, long = "out", alias = "output", value_name = "FILE.zip", value_parser = written_as(&["zip"]))]
    output: Option<PathBuf>,
    /// Who made the recording [default: the operator in the plan].
    #[arg(long, value_name = "NAME")]
    author: Option<String>,
    /// The data's licence, as an SPDX identifier such as CC-BY-4.0.
    #[arg(long, value_name = "SPDX", value_parser = license)]
    license: Option<String>,
}

fn license(text: &str) -> Result<String, String> {
    let known = LICENSES.iter().map(|license| license.name).find(|name| name.eq_ignore_ascii_case(text));
    let otherwise = "give an identifier of spdx.org/licenses, such as CC-BY-4.0 or CC0-1.0";
    known.map(str::to_owned).ok_or_else(|| suggest(text, LICENSES.iter().map(|license| license.name), otherwise))
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let session = Session::open(&args.session)?;
    let folder = full_path(&args.session).unwrap_or_else(|_| args.session.clone());
    let out = args.output.clone().unwrap_or_else(|| folder.with_added_extension("zip"));
    if out.parent().and_then(|parent| full_path(parent).ok()).is_some_and(|parent| parent == folder) {
        let what = format!("{}: is in the folder that is packed", out.display());
        return Err(wrong_use(what, "name a file in another folder with -o"));
    }
    let author = args.author.clone().unwrap_or_else(|| session.plan().operator.clone());
    let about = About { author, license: args.license.clone().unwrap_or_default() };
    let progress = Progress::new(0.0);
    let packed = pack(&args.session, &out, &about, &progress)?;
    progress.finish();
    let files = text::count(packed.entries.len(), "file");
    let mut text = format!("{}: {files}, {:.1} MB", out.display(), packed.bytes as f64 * 1e-6);
    packed.notes.iter().for_each(|note| text += &format!("\nnote: {note}"));
    text += &lines_of_logs(&packed.findings);
    let outcome = Outcome::of(packed.is_sound && are_slight(&packed.findings));
    Ok(Answer::new(outcome, &packed, text)?.with("file", out.to_string_lossy()))
}
