//! The `biflag` program. Its code is in the library, so that tests can use it.

use std::process::ExitCode;

fn main() -> ExitCode {
    host::commands::run()
}
