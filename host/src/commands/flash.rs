//! `biflag flash`: writes the firmware to the board.

use super::answer::{Answer, Outcome};
use super::virtual_board;
use crate::image;
use crate::link::{self, Link};
use crate::run::rig::{self, Image, VirtualNano, commit_text};
use indicatif::{ProgressBar, ProgressDrawTarget};
use miette::miette;
use serde_json::json;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Duration;

/// Write the firmware through the board's bootloader and check that it runs. In the repository, it is built first if its
/// source has changed.
#[derive(clap::Args, Debug)]
#[command(after_help = "Example: biflag flash --port /dev/ttyUSB0")]
pub struct Args {
    /// The board's serial port; not needed if only one board is plugged in.
    #[arg(long, conflicts_with = "virtual")]
    port: Option<String>,
    /// Write it to an emulated board, as practice: a board with the old bootloader and no firmware.
    #[arg(long = "virtual")]
    r#virtual: bool,
    /// Write this ELF image instead of the firmware inside biflag.
    #[arg(long, value_name = "ELF")]
    firmware: Option<PathBuf>,
}

pub fn run(args: &Args) -> miette::Result<Answer> {
    let new = || VirtualNano::start(&VirtualNano::program()?, ["--bootloader", "old"]);
    let nano = args.r#virtual.then(new).transpose()?;
    let port = virtual_board::port(nano.as_ref(), args.port.as_deref())?;
    // A wrong or busy port fails here, not after a build of minutes.
    link::probe_port(&port)?;
    let claim = link::claim_port(&port)?;
    let image = args.firmware.as_deref().map_or_else(image::of_program, Image::read)?;
    let progress = spinner();
    progress.set_message(format!("writing {}", image.commit));
    let (baud, chip) = rig::flash(&port, &image.elf, |baud| {
        progress.set_message(format!("writing {} at {baud} bit/s", image.commit));
    })?;
    progress.set_message("waiting for the firmware to start");
    drop(claim);
    let link = Link::open(&port)?;
    progress.finish_and_clear();
    let info = link.info();
    let running = commit_text(info.git_hash, info.git_dirty);
    if running != image.commit {
        return Err(miette!(
            help = "unplug and replug the board, then flash again",
            "the board on {port} was written with {} but runs {running}",
            image.commit
        ));
    }
    let text = format!("{port} runs firmware {running}, protocol {}, written at {baud} bit/s to {chip}", info.protocol);
    let body = json!({ "port": port, "baud": baud, "firmware": running, "protocol": info.protocol });
    Answer::new(Outcome::Done, &body, text)
}

fn spinner() -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    if std::io::stderr().is_terminal() {
        bar.enable_steady_tick(Duration::from_millis(100));
    } else {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    bar
}
