//! Stand-in for the Parquet module in a program built without it.

use super::table::Table;
use std::fs::File;
use std::io::{self, Write};
use std::marker::PhantomData;

const MISSING: &str = "this biflag was built without Parquet, as `make demo` does: build it with `make build`";

pub(super) fn write(_table: &Table, _target: impl Write + Send) -> io::Result<()> {
    Err(io::Error::other(MISSING))
}

/// Never constructed.
pub(crate) struct Writer<W>(PhantomData<W>);

impl<W: Write + Send> Writer<W> {
    pub fn new(_table: &Table, _target: W) -> io::Result<Self> {
        Err(io::Error::other(MISSING))
    }

    pub fn rows(&mut self, _table: &Table) -> io::Result<()> {
        Err(io::Error::other(MISSING))
    }

    pub fn close(self) -> io::Result<()> {
        Err(io::Error::other(MISSING))
    }
}

pub(crate) fn read(_file: File) -> Result<Table, String> {
    Err(MISSING.to_owned())
}
