//! `scripts/demo`, with stubs in place of the programs that it builds and runs.
#![cfg(unix)]

mod common;

use std::{fs, os::unix::fs::PermissionsExt, path::Path, process::Command};

use common::folder;

/// Runs the script of the copy in `root`, in `root`. Returns the programs that it ran, and its errors if it failed.
fn demo(root: &Path, arguments: &[&str]) -> Result<String, String> {
    let (log, path) = (root.join("log"), std::env::var("PATH").unwrap());
    fs::write(&log, "").unwrap();
    let output = Command::new("bash")
        .arg(root.join("scripts/demo"))
        .args(arguments)
        .current_dir(root.join("data"))
        .env("LOG", &log)
        .env("PATH", format!("{}:{path}", root.join("bin").display()))
        .output()
        .unwrap();
    let errors = String::from_utf8(output.stderr).unwrap();
    match output.status.code() {
        Some(0) => Ok(fs::read_to_string(log).unwrap().replace(root.to_str().unwrap(), "")),
        code => {
            assert_eq!(code, Some(2), "{errors}");
            assert_eq!(fs::read_to_string(log).unwrap(), "", "nothing is built for a bad input");
            Err(errors)
        }
    }
}

/// Whatever a newcomer has becomes a field, and ends in the same pictures.
#[test]
fn the_demo_takes_whatever_there_is() {
    let root = folder("demo");
    for folder in ["scripts", "bin", "target/quick", "data/photos", "data/my.photos", "data/.hidden", "data/sog"] {
        fs::create_dir_all(root.join(folder)).unwrap();
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/demo");
    fs::copy(script, root.join("scripts/demo")).unwrap();
    fs::write(root.join("scripts/setup"), "").unwrap();
    for program in ["bin/cargo", "target/quick/headless", "target/quick/plenoctree"] {
        let program = root.join(program);
        fs::write(&program, "#!/bin/sh\necho \"$(basename \"$0\")\" \"$@\" >>\"$LOG\"\n").unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    }
    for (file, content) in [
        ("my field.npz", ""),
        ("a.ply", ""),
        (".ply", ""),
        ("b.SPZ", ""),
        ("sog/meta.json", ""),
        ("photos/transforms.json", ""),
        ("model.glb", "glTF"),
        ("splats.glb", "glTF KHR_gaussian_splatting"),
        ("notes.txt", ""),
    ] {
        fs::write(root.join("data").join(file), content).unwrap();
    }

    let headless = "cargo build --profile quick -p headless";
    assert_eq!(demo(&root, &[]), Ok(format!("{headless}\nheadless\n")));
    assert_eq!(demo(&root, &["my field.npz"]), Ok(format!("{headless}\nheadless /data/my field.npz\n")));
    for (input, command, name) in [
        ("a.ply", "convert --stand", "a"),
        ("b.SPZ", "convert --stand", "b"),
        ("sog", "convert --stand", "sog"),
        ("sog/meta.json", "convert --stand", "sog"),
        ("splats.glb", "convert --stand", "splats"),
        ("photos", "fit --stand", "photos"),
        ("photos/transforms.json", "fit --stand", "photos"),
        // A model stays where it is.
        ("model.glb", "fit --depth 7 --minutes", "model"),
    ] {
        let ran = demo(&root, &[input]).unwrap();
        let lines: Vec<_> = ran.lines().collect();
        let out = format!("out/{name}.plenoctree");
        assert_eq!(lines[0], format!("{headless} -p plenoctree_cli"), "{ran}");
        assert!(lines[1].starts_with(&format!("plenoctree {command}")), "{ran}");
        assert!(lines[1].contains(&format!("/data/{input} --out {out}")), "{ran}");
        assert_eq!(lines[2..], [format!("headless {out}")], "{ran}");
    }
    // A folder keeps its whole name, and no field is a hidden file.
    for (input, path, name) in [
        (".", "", "data"),
        ("photos/", "/photos", "photos"),
        ("my.photos", "/my.photos", "my.photos"),
        (".hidden", "/.hidden", "hidden"),
        (".ply", "/.ply", "field"),
    ] {
        let ran = demo(&root, &[input]).unwrap();
        assert!(ran.contains(&format!("/data{path} --out out/{name}.plenoctree")), "{ran}");
    }
    for bad in [&["notes.txt"][..], &["missing.npz"], &["a.ply", "b.SPZ"]] {
        let errors = demo(&root, bad).unwrap_err();
        assert!(errors.starts_with("error: ") && errors.lines().count() == 1, "{errors}");
        assert!(errors.contains("expected a field") && errors.contains("or a capture"), "{errors}");
    }
}
