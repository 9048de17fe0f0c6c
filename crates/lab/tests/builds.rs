//! The demo and the tests share one build of the engine.

use std::{
    collections::{BTreeSet, HashMap},
    path::Path,
    process::Command,
};

use serde_json::Value;

/// What Cargo would build, in an order of its own: packages with all that their builds depend on.
struct Units(Vec<Value>);

impl Units {
    /// Asks Cargo what a command would build with the profile of the scripts.
    fn of(command: &[&str]) -> Self {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let output = Command::new(env!("CARGO"))
            .args(command)
            .args(["--profile", "quick", "-Z", "unstable-options", "--unit-graph"])
            .env("RUSTC_BOOTSTRAP", "1")
            .current_dir(workspace)
            .output()
            .unwrap();
        assert!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
        let mut graph: Value = serde_json::from_slice(&output.stdout).unwrap();
        let Value::Array(units) = graph["units"].take() else { panic!("no units") };
        Self(units)
    }

    /// Describes the build of each unit: equal descriptions are one build. Numbers stand for those of dependencies.
    fn builds(&self, numbers: &mut HashMap<String, usize>) -> BTreeSet<(String, usize)> {
        let mut known = vec![None; self.0.len()];
        (0..self.0.len()).map(|unit| (self.package(unit), self.number(unit, &mut known, numbers))).collect()
    }

    fn package(&self, unit: usize) -> String {
        self.0[unit]["pkg_id"].as_str().unwrap().to_owned()
    }

    fn number(&self, unit: usize, known: &mut [Option<usize>], numbers: &mut HashMap<String, usize>) -> usize {
        if let Some(number) = known[unit] {
            return number;
        }
        let content = &self.0[unit];
        let dependencies = content["dependencies"].as_array().unwrap().iter();
        let mut below: Vec<usize> = dependencies
            .map(|dependency| self.number(dependency["index"].as_u64().unwrap() as usize, known, numbers))
            .collect();
        below.sort_unstable();
        let own = ["pkg_id", "target", "profile", "platform", "mode", "features"].map(|key| &content[key]);
        let next = numbers.len();
        let number = *numbers.entry(format!("{own:?} {below:?}")).or_insert(next);
        known[unit] = Some(number);
        number
    }
}

/// Add the features that differ to `crates/engine`. The packages `bevy` and `bevy_internal` hold no code, only the names
/// of the others.
#[test]
fn the_demo_and_the_tests_share_the_engine() {
    let mut numbers = HashMap::new();
    let demo = Units::of(&["build", "-p", "headless"]).builds(&mut numbers);
    let tests = Units::of(&["test", "--workspace", "--no-run"]).builds(&mut numbers);
    assert!(demo.iter().any(|(package, _)| package.contains("#bevy_render@")), "{demo:?}");
    let is_shared = |package: &str| {
        package.starts_with("registry+") && !package.contains("#bevy@") && !package.contains("#bevy_internal@")
    };
    let twice: Vec<&String> =
        demo.difference(&tests).map(|(package, _)| package).filter(|package| is_shared(package)).collect();
    assert!(twice.is_empty(), "built once for the demo and once for the tests: {twice:#?}");
}
