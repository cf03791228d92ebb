//! Options shared by several commands.

use sim::body::closure::Closure;

#[derive(clap::ValueEnum, Clone, Copy, Debug)]
pub enum ClosureName {
    Full,
    Lumped,
    Paper,
}

impl From<ClosureName> for Closure {
    fn from(name: ClosureName) -> Self {
        match name {
            ClosureName::Full => Self::Full,
            ClosureName::Lumped => Self::Lumped,
            ClosureName::Paper => Self::Paper,
        }
    }
}

/// Returns the default number of parallel trials.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
