//! There is nothing to do; cargo compiles build dependencies only for packages with such a program.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
}
