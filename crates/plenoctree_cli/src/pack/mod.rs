//! `pack`: packs fields for shipping.

mod arguments;
mod measure;

pub use arguments::{Arguments, Quality, ViewArguments};
pub use measure::{Loss, Views, palette, psnr};

use std::path::Path;

use plenoctree::{LoadSettings, PackError, PackSettings, Packed, PlenOctree, sampling::Progress};
use plenoctree_fit::{FitError, FitProgress, SimplifySettings, simplify};

use crate::{console, field::FieldArguments, files, number::counted, progress, result::Result};

/// Packs the fields, writes them, and prints the loss.
pub fn run(arguments: &Arguments) -> Result {
    arguments.check()?;
    arguments.fields.iter().try_for_each(|path| pack_file(path, arguments))
}

fn pack_file(path: &Path, arguments: &Arguments) -> Result {
    let before = files::size(path)?;
    let out = arguments.out(path)?;
    let settings = arguments.settings();
    settings.validate()?;
    let field = arguments.reading.load(path, false)?;
    if field.leaves() == 0 {
        let least = LoadSettings::default().density_threshold;
        return Err(format!("{}: no leaf has a density of {least}, so there is nothing to pack", path.display()).into());
    }
    // Before it is simplified.
    let field = if arguments.record_histograms { field.recording_histograms(&Progress::default())? } else { field };
    warn_of_density(path, &field);
    let views = Views::new(&field, path, &arguments.views)?;
    let packed = pack(&field, path, &settings, arguments.simplification())?;
    let written = if arguments.npz { packed.write_npz(&out) } else { packed.write(&out) };
    written.map_err(|error| format!("{}: {error}", out.display()))?;
    if arguments.npz {
        warn_of_reading(&out, &field);
    }
    let after = files::size(&out)?;
    print_sizes(&field, &packed, [before, after]);
    if arguments.verbose {
        let sections: Vec<_> = packed.sections().iter().map(|(name, bytes)| format!("{name} {bytes}")).collect();
        console::say!("sections, in bytes: {}", sections.join(", "));
    }
    if let Some(views) = &views {
        let loss = views.compare(packed.field());
        let count = counted(views.count(), "view", "views");
        let labels = views.palette().map(|_| format!(", {:.2}% of labels changed", loss.labels)).unwrap_or_default();
        console::say!("{:.1} dB from the field in {count}{labels}", loss.psnr);
    }
    console::say!("{}", out.display());
    Ok(())
}

/// Packs the field of a file. It is simplified before, if that is wanted and the field is of the kind.
pub fn pack(
    field: &PlenOctree,
    path: &Path,
    settings: &PackSettings,
    simplification: Option<SimplifySettings>,
) -> Result<Packed> {
    let simple = match simplification {
        Some(simplification) => simplified(field, &simplification)
            .inspect_err(|error| console::complain!("warning: {}: packed as it is: {error}", path.display()))
            .ok(),
        None => None,
    };
    let packed = pack_unchanged(simple.as_ref().unwrap_or(field), settings);
    Ok(packed.map_err(|error| format!("{}: {error}", path.display()))?)
}

/// Simplifies the field and shows the progress.
fn simplified(field: &PlenOctree, settings: &SimplifySettings) -> Result<PlenOctree, FitError> {
    let bar = progress::bar("simplifying", 100, false);
    let progress = FitProgress::default();
    let show = || bar.set_position((100.0 * progress.status().fraction) as u64);
    progress::watched(&bar, || simplify(field, settings, &progress), show)
}

/// Packs the field as it is and shows the progress.
pub fn pack_unchanged(field: &PlenOctree, settings: &PackSettings) -> Result<Packed, PackError> {
    let bar = progress::bar("measuring visibility", 100, false);
    let progress = Progress::default();
    let show = || {
        bar.set_position((100.0 * progress.fraction()) as u64);
        if progress.fraction() == 1.0 {
            bar.set_message("learning the codebooks");
        }
    };
    progress::watched(&bar, || Packed::new(field, settings, &progress), show)
}

/// Warns of densities that files cut off or round where that shows.
pub fn warn_of_density(path: &Path, field: &PlenOctree) {
    field.density_losses().for_each(|loss| console::complain!("warning: {}: {loss}", path.display()));
}

/// Warns of what `.npz` files do not record, and names the flags with which to read this one.
fn warn_of_reading(path: &Path, field: &PlenOctree) {
    let flags = FieldArguments::flags_for(field);
    if !flags.is_empty() {
        console::complain!(
            "warning: {}: .npz files do not record the activation and the up axis; read it with {flags}",
            path.display()
        );
    }
}

fn print_sizes(field: &PlenOctree, packed: &Packed, [before, after]: [u64; 2]) {
    let dropped = field.leaves() - packed.field().leaves();
    let share = 100.0 * dropped as f64 / field.leaves().max(1) as f64;
    console::say!("{dropped} of {} leaves dropped, {share:.0}%", field.leaves());
    let ratio = before as f64 / after as f64;
    let (ratio, change) = if ratio < 1.0 { (1.0 / ratio, "larger") } else { (ratio, "smaller") };
    console::say!("{before} bytes before, {after} after: {ratio:.1} times {change}");
}
