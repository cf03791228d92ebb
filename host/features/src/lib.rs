//! No code. Cargo compiles a library once for each set of features, and the sets follow from the packages that a command
//! names. This crate asks for the union, so that `make build`, `make test` and `pip install` share what is
//! compiled. `cargo tree --edges features` shows who asks for what.
