//! The Python module: the simulator and the content of logs for Python.
//!
//! The package `biflag` (`python/biflag`) has the classes that users see; this library computes for them, with the
//! interpreter's lock released, and hands over numpy arrays. Arrays are not copied on their way to Python.

mod aim;
mod batch;
mod failure;
mod figure;
mod imported;
mod interrupt;
mod json;
mod log;
mod names;
mod picture;
mod robot;
mod simulate;
mod simulator;
mod speeds;
mod sweep;
mod table;
mod threads;
mod twin;

use pyo3::prelude::*;

#[pymodule]
mod _biflag {
    #[pymodule_export]
    use crate::{
        aim::{Answer, aim},
        batch::simulate_batch,
        figure::{Figure, draw},
        imported::write_states,
        log::{html, read_log, read_session, session_repeats, session_table},
        picture::picture,
        robot::Robot,
        simulate::{Simulated, simulate},
        simulator::Simulators,
        speeds::check_speeds,
        sweep::{read_sweep, sweep},
        twin::{calibrate, compare},
    };

    use protocol::units::CentiRpm;
    use pyo3::prelude::*;
    use study::program::{GIT_HASH, VERSION};

    /// Returns the index of the ending that the name of a file has.
    #[pyfunction]
    fn ending(path: std::path::PathBuf, endings: Vec<String>) -> Result<usize, crate::failure::Failure> {
        Ok(study::output::ending(&path, &endings)?)
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        std::sync::LazyLock::force(&crate::threads::IMPORTED_IN);
        module.add("MAX_SPEED_RPM", CentiRpm::LIMIT.rpm())?;
        module.add("__version__", VERSION)?;
        module.add("__commit__", GIT_HASH)?;
        module.add("STEADY_MAP", study::aim::MAP)
    }
}
