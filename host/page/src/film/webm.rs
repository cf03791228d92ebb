//! A film as WebM, which FFmpeg encodes: VP9, which all browsers show.

use super::palette::bytes;
use super::{FRAME_S, Frames};
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::process::{Child, Command, Stdio};
use system::file::output_path;

/// The program that encodes.
pub(super) const ENCODER: &str = "ffmpeg";

/// Quality of VP9 from 0 (best) to 63. The film of a minute of 720 pixels' width has some megabytes.
const QUALITY: &str = "30";

/// Writes the frames to a file.
///
/// # Errors
/// [`ErrorKind::Unsupported`] if the encoder is not installed; the encoder's message; the error of writing the file.
pub(super) fn encode(frames: &Frames, file: &File) -> io::Result<()> {
    let mut encoder = start(frames.scene.size(), file).map_err(|error| match error.kind() {
        ErrorKind::NotFound => io::Error::from(ErrorKind::Unsupported),
        _ => error,
    })?;
    let fed = feed(&mut encoder, frames);
    // An encoder that fails closes its end of the pipe. Then its own message is more informative than the error of the pipe.
    let ended = encoder.wait_with_output()?;
    if !ended.status.success() {
        let said = String::from_utf8_lossy(&ended.stderr);
        let last = said.lines().last().unwrap_or("it gives no reason");
        return Err(io::Error::other(format!("{ENCODER} failed ({}): {last}", ended.status)));
    }
    fed
}

/// Starts the encoder. Its output is a file, not a pipe: at the end it writes duration and index to the beginning of the file.
fn start([width, height]: [u16; 2], file: &File) -> io::Result<Child> {
    let rate = format!("{}", 1.0 / FRAME_S);
    Command::new(ENCODER)
        .args(["-loglevel", "error", "-f", "rawvideo", "-pixel_format", "rgb24", "-framerate", &rate])
        .args(["-video_size", &format!("{width}x{height}"), "-i", "pipe:0"])
        .args("-c:v libvpx-vp9 -pix_fmt yuv420p -b:v 0 -row-mt 1 -cpu-used 4".split(' '))
        .args(["-crf", QUALITY])
        .args(["-f", "webm", "-y", &format!("file:{}", output_path(file)?.display())])
        .stdin(Stdio::piped())
        .stdout(file.try_clone()?)
        .stderr(Stdio::piped())
        .spawn()
}

/// Gives all frames to the encoder, and closes its input.
fn feed(encoder: &mut Child, frames: &Frames) -> io::Result<()> {
    let Some(mut input) = encoder.stdin.take() else { return Ok(()) };
    frames.each(
        |image| image.iter().flat_map(|pixel| bytes(*pixel)).collect::<Vec<u8>>(),
        |image| input.write_all(&image),
    )
}
