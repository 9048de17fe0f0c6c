//! Finds and reads the field that a command works on.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use plenoctree::{Activation, LoadSettings, PlenOctree, UpAxis};

use crate::{capture, progress, result::Result};

/// The default field, relative to the root of the workspace.
const DEFAULT: &str = "assets/toadstool.plenoctree";

/// Returns the given path, or by default the path of the toadstool: in the workspace in which this program was built
/// or, if that no longer exists, under the current directory.
pub fn or_default(path: Option<&Path>) -> PathBuf {
    let in_workspace = || {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2)?;
        Some(workspace.join(DEFAULT)).filter(|path| path.exists())
    };
    path.map(Path::to_path_buf).or_else(in_workspace).unwrap_or_else(|| DEFAULT.into())
}

/// How to read a field whose file does not record it.
#[derive(Args, Clone, Copy, Default)]
pub struct FieldArguments {
    /// How the numbers in the field's file become colors. By default, as a packed field records; otherwise sigmoid, or
    /// identity for RGBA. RGBA fields that svox optimized or sxyu/plenoctree extracted need sigmoid.
    #[arg(long, value_enum)]
    activation: Option<Curve>,
    /// The axis that points up in the field. By default, the one that a packed field records; otherwise z.
    #[arg(long, value_enum)]
    up: Option<Up>,
}

/// What maps numbers to colors.
#[derive(Clone, Copy, ValueEnum)]
enum Curve {
    /// For fields that were trained as PlenOctrees.
    Sigmoid,
    /// For fields that were trained as Plenoxels (svox2) and converted.
    ShiftedRelu,
    /// For fields that store colors as they are.
    Identity,
}

/// An axis that points up.
#[derive(Clone, Copy, ValueEnum)]
enum Up {
    Y,
    Z,
}

impl FieldArguments {
    /// Returns whether any is given.
    pub fn are_given(self) -> bool {
        self.activation.is_some() || self.up.is_some()
    }

    /// Returns the flags with which a field is read from a file that does not record its activation and up axis, as on
    /// the command line.
    pub fn flags_for(field: &PlenOctree) -> String {
        let activation = match field.activation() {
            activation if activation == field.basis().default_activation() => None,
            Activation::Sigmoid => Some("--activation sigmoid"),
            Activation::ShiftedRelu => Some("--activation shifted-relu"),
            Activation::Identity => Some("--activation identity"),
        };
        let up = (field.up() == UpAxis::Y).then_some("--up y");
        activation.into_iter().chain(up).collect::<Vec<_>>().join(" ")
    }

    /// Reads a field, with a spinner unless `quiet`.
    pub fn load(self, path: &Path, quiet: bool) -> Result<PlenOctree> {
        let activation = self.activation.map(|curve| match curve {
            Curve::Sigmoid => Activation::Sigmoid,
            Curve::ShiftedRelu => Activation::ShiftedRelu,
            Curve::Identity => Activation::Identity,
        });
        let up = self.up.map(|up| match up {
            Up::Y => UpAxis::Y,
            Up::Z => UpAxis::Z,
        });
        capture::refuse(path)?;
        let spinner = progress::spinner("loading", quiet);
        let field = PlenOctree::read(path, &LoadSettings { activation, up, ..LoadSettings::default() })?;
        spinner.finish_and_clear();
        Ok(field)
    }
}

/// Reads a field with the default settings, with a spinner unless `quiet`.
pub fn load(path: &Path, quiet: bool) -> Result<PlenOctree> {
    FieldArguments::default().load(path, quiet)
}
