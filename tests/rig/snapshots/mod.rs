//! Measurements of rigs, digit by digit: calibrations, photos, products and findings of virtual rigs whose noise is seeded, compared with
//! what an earlier version of the program found.
//!
//! These tests tell that a number has changed. They do not tell which of the two is right: the other tests of rigs compare with the known
//! properties of devices. After a change that is meant to change numbers, look at each difference, and accept them:
//!
//! ```sh
//! INSTA_UPDATE=always cargo test --release --test library rig::snapshots
//! git diff tests/rig/snapshots
//! ```

mod bench;
mod calibrations;
mod digits;
mod findings;
mod products;

/// Compares a text with the file of this name.
fn compare(name: &str, text: &str) {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path("files");
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!(name, text));
}
