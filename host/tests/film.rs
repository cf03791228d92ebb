//! `biflag film`: the moving robot as an animated GIF, and as the frames that FFmpeg gets for WebM.

use crate::program::{biflag, code, json};
use gif::{ColorOutput, DecodeOptions};
use serde_json::Value;
use std::fs::{File, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

/// Returns width and height, and the images of all frames, as red, green, blue and opacity of each pixel.
fn decode(path: &Path) -> (usize, usize, Vec<Vec<[u8; 4]>>) {
    let mut options = DecodeOptions::new();
    options.set_color_output(ColorOutput::RGBA);
    let mut decoder = options.read_info(File::open(path).unwrap()).unwrap();
    let [width, height] = [decoder.width(), decoder.height()].map(usize::from);
    let (mut image, mut images) = (vec![[0; 4]; width * height], Vec::new());
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert_eq!(frame.delay, 4, "hundredths of a second");
        let pixels = frame.buffer.as_chunks::<4>().0;
        for (row, line) in pixels.chunks_exact(frame.width.into()).enumerate() {
            let start = (usize::from(frame.top) + row) * width + usize::from(frame.left);
            for (old, new) in image[start..].iter_mut().zip(line).filter(|(_, new)| new[3] != 0) {
                *old = *new;
            }
        }
        images.push(image.clone());
    }
    (width, height, images)
}

/// Returns the mean column of the pixels that a colour test accepts.
fn middle(image: &[[u8; 4]], width: usize, is_it: impl Fn([i32; 3]) -> bool) -> f64 {
    let pixels = image.iter().enumerate().filter(|(_, pixel)| is_it([0, 1, 2].map(|k| pixel[k].into())));
    let columns: Vec<f64> = pixels.map(|(i, _)| (i % width) as f64).collect();
    assert!(columns.len() > 100, "{} pixels", columns.len());
    columns.iter().sum::<f64>() / columns.len() as f64
}

/// Motor 1 is on the robot's x axis, which begins to the right in front of the camera. At -83.1 and -61.9 rpm the robot
/// turns by about half a turn, and its orange flagellum gets to the other side of the blue one.
#[test]
fn the_robot_turns_as_its_yaw_says() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let simulate = ["simulate", "--speeds=-83.1,-61.9", "--duration", "30", "--shapes", "--out", "session", "--json"];
    let run = biflag(folder, &simulate);
    let trial = serde_json::from_slice::<Value>(&run.stdout).unwrap()["trials"][0].clone();
    let log = trial["log"].as_str().unwrap();
    let film = biflag(folder, &["film", log, "-o", "film.gif", "--width", "150", "--speed", "10", "--json"]);
    assert!(matches!(code(&film), Some(0 | 3)), "{film:?}");
    let film: Value = serde_json::from_slice(&film.stdout).unwrap();
    let (width, height, images) = decode(&folder.join("film.gif"));
    assert_eq!((width, height), (150, 225));
    assert_eq!((film["frames"].as_u64(), images.len(), &film["shapes"]), (Some(75), 75, &true.into()), "30 s");
    let orange = |[red, _, blue]: [i32; 3]| red > blue + 60;
    let blue = |[red, _, blue]: [i32; 3]| blue > red + 60;
    let side = |image: &[[u8; 4]]| middle(image, width, orange) - middle(image, width, blue);
    let yaw = trial["yaw_deg"].as_f64().unwrap();
    // The camera looks from x = -0.55, y = -1, so the x axis of the world points to the right, and backwards a little.
    let right = |yaw_deg: f64| (yaw_deg - 28.8).to_radians().cos();
    println!("yaw {yaw}: sides {} {}", side(&images[0]), side(images.last().unwrap()));
    assert!(yaw.abs() > 90.0, "{yaw}");
    assert!(side(&images[0]) > 10.0 && side(images.last().unwrap()) / side(&images[0]) < 0.5);
    assert_eq!(right(yaw) > 0.0, side(images.last().unwrap()) > 0.0);
}

#[test]
fn what_cannot_be_filmed_is_wrong_use() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = biflag(folder, &["simulate", "--speeds", "37.3,0", "--duration", "2.5", "--out", "session"]);
    assert_eq!(code(&run), Some(3), "not settled");
    let log = "session/001_w1+37.3_w2+0.mcap";
    for (args, why) in [
        (&["film", log, "-o", "film.mp4"][..], "the name must end with .gif or .webm"),
        (&["film", log, "-o", "film.gif", "--time", "3,9"], "nothing to film"),
        (&["film", log, "-o", "film.gif", "--speed", "0"], "0.05 to 100"),
        (&["film", "session/session.toml", "-o", "film.gif"], "not an MCAP file"),
        (&["film", log, "-o", "missing/film.gif"], "no such folder"),
    ] {
        let output = biflag(folder, args);
        assert_eq!(code(&output), Some(2), "{output:?}");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(why) && !said.contains("film: frames"), "{said}");
    }
    assert!(!folder.join("film.gif").exists());
    // Without shapes, rigid helices turn; a part of the run is shown as asked.
    let output = biflag(folder, &["film", log, "-o", "film.gif", "--time", "0.5,1.5", "--speed", "0.5"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(text.contains("50 frames, 2.0 s; the log has no shapes"), "{output:?}");
    assert_eq!(String::from_utf8_lossy(&output.stderr).matches("film: frames").count(), 1, "{output:?}");
    let (width, height, images) = decode(&folder.join("film.gif"));
    assert_eq!((width, height, images.len()), (360, 540, 50));
    assert!(images[0] != images[25], "it moves");
}

/// A program named `ffmpeg` of the test's own keeps its arguments, and writes to the film what it gets.
#[test]
fn webm_is_what_ffmpeg_makes_of_the_frames() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    biflag(folder, &["simulate", "--speeds=-83.1,-61.9", "--duration", "1.1", "--out", "session"]);
    let log = "session/001_w1-83.1_w2-61.9.mcap";
    let film = |out: &str| -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_biflag"));
        command
            .args(["film", log, "--width", "121", "--speed", "1", "-o", out, "--json"])
            .env("PATH", folder.join("bin"));
        command.current_dir(folder).output().unwrap()
    };
    std::fs::create_dir(folder.join("bin")).unwrap();
    let none = film("film.webm");
    assert_eq!(code(&none), Some(1), "{none:?}");
    assert!(String::from_utf8_lossy(&none.stderr).contains("sudo apt install ffmpeg"), "{none:?}");
    let install = |script: &str| {
        let ffmpeg = folder.join("bin/ffmpeg");
        std::fs::write(&ffmpeg, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(ffmpeg, Permissions::from_mode(0o755)).unwrap();
    };
    install("echo 'warming up' >&2; echo 'no such encoder' >&2; exit 8");
    let failed = film("film.webm");
    assert_eq!(code(&failed), Some(1), "{failed:?}");
    let said = String::from_utf8_lossy(&failed.stderr);
    assert!(said.contains("no such encoder") && said.contains("exit status: 8"), "{said}");
    assert!(!folder.join("film.webm").exists(), "no part of a film is left");
    install("echo \"$@\" > arguments; exec /bin/cat");
    let written = film("film.webm");
    assert!(matches!(code(&written), Some(0 | 3)), "{written:?}");
    assert_eq!(json(&written)["frames"], 28, "1.1 s at 25 frames a second");
    let frames = std::fs::read(folder.join("film.webm")).unwrap();
    let arguments = std::fs::read_to_string(folder.join("arguments")).unwrap();
    assert!(arguments.contains("-framerate 25 -video_size 121x"), "{arguments}");
    let gif = film("film.gif");
    assert!(matches!(code(&gif), Some(0 | 3)), "{gif:?}");
    let (width, height, images) = decode(&folder.join("film.gif"));
    assert!(arguments.contains(&format!("-video_size {width}x{height} ")), "{arguments}");
    let frames: Vec<&[u8]> = frames.chunks_exact(3 * width * height).collect();
    assert_eq!((frames.len(), images.len()), (28, 28));
    for (frame, image) in frames.iter().zip(&images) {
        // A GIF has the nearest of 255 colours.
        let far = frame
            .as_chunks::<3>()
            .0
            .iter()
            .zip(image)
            .map(|(frame, image)| (0..3).map(|k| frame[k].abs_diff(image[k])).max());
        assert!(far.map(Option::unwrap).filter(|far| *far > 40).count() < width * height / 100);
    }
}
