//! Helpers for the tests: a tiny field, a folder for each test, and the program.
#![allow(dead_code, reason = "no test uses everything")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

/// Creates an empty folder for one test.
pub fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Writes a ball whose octants have eight colors, and returns its path.
pub fn ball(folder: &Path) -> PathBuf {
    let settings = BakeSettings { depth: 4, basis: Basis::Rgba, directions: 8, ..Default::default() };
    let density = |at: DVec3| if at.length() < 0.8 { 50.0 } else { 0.0 };
    let color = |at: DVec3| DVec3::select(at.cmpgt(DVec3::ZERO), DVec3::splat(0.9), DVec3::splat(0.1));
    let field = bake(&settings, density, |at| move |_| color(at)).unwrap();
    let path = folder.join("ball.npz");
    field.write(&path).unwrap();
    path
}

/// Runs the program.
pub fn run(arguments: &[&str]) -> Output {
    // `lab` has the same tests.
    let program = option_env!("CARGO_BIN_EXE_plenoctree").or(option_env!("CARGO_BIN_EXE_lab")).unwrap();
    Command::new(program).args(arguments).output().unwrap()
}

/// Runs the program, asserts that it succeeds, and returns what it prints.
pub fn succeed(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs the program, asserts that it rejects its input, and returns the message.
pub fn fail(arguments: &[&str]) -> String {
    let output = run(arguments);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
    assert!(message.starts_with("error: "), "{arguments:?}: {message}");
    message
}

/// Returns a path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
