//! Speed of trials.

fn main() {
    divan::main();
}
