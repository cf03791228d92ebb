//! The options of `biflag doctor`.

use std::path::PathBuf;

/// Check toolchain, avrdude, ports, permissions and boards, the wiring of the motors, or a session; suggest fixes.
#[derive(clap::Args, Debug)]
#[command(after_help = "Examples:\n  biflag doctor\n  biflag doctor --motors\n  biflag doctor glycerin\n\n\
    --motors turns each motor in both directions, at up to full duty: keep the flagella clear. It finds swapped and\n\
    cut wires, says what to change, and saves settings that correct the error where possible.")]
pub struct Args {
    /// Check that the logs of this session are intact, instead of tools and boards.
    #[arg(value_name = "SESSION", conflicts_with_all = ["port", "motors"])]
    pub session: Option<PathBuf>,
    /// Check only this port instead of all ports.
    #[arg(long)]
    pub port: Option<String>,
    /// Turn the motors to test them, the encoders and their wiring.
    #[arg(long)]
    pub motors: bool,
    /// Ask nothing: take the motors' directions for correct, and save the settings that the test found.
    #[arg(long, requires = "motors")]
    pub yes: bool,
    /// Test the motors of the emulated board.
    #[arg(long = "virtual", requires = "motors", conflicts_with = "port")]
    pub r#virtual: bool,
    /// The emulated rig: `encoders`, `duty`, `in-in` or `duty-in-in`.
    #[arg(long, value_name = "RIG", requires = "virtual", conflicts_with = "port", default_value = "encoders")]
    pub rig: String,
    /// Simulate a fault of the emulated board, such as `encoder-swapped=2`; may be repeated. `help` lists the faults.
    #[arg(long = "fault", value_name = "NAME[=VALUE][@SECONDS]", requires = "virtual")]
    pub faults: Vec<String>,
}
