//! `pack`: makes fields small.

mod arguments;
mod measure;
mod report;

pub use arguments::Arguments;

use std::{fs, sync::Arc, thread, time::Duration};

use clap::ValueEnum;
use plenoctree::{PackSettings, Packed, PlenOctree, sampling::Progress};

use crate::{Result, field, progress};
use arguments::Quality;
use measure::Views;

/// Packs the field, writes it, and prints what that costs.
pub fn run(arguments: &Arguments) -> Result {
    let path = &arguments.field;
    let before = fs::metadata(path).map_err(|error| format!("{}: {error}", path.display()))?.len();
    let field = field::load(path, false)?;
    let views = Views::new(&field, arguments)?;
    let packed = pack(&field, &arguments.settings(arguments.quality))?;
    let out = arguments.out();
    if arguments.npz {
        packed.write_npz(&out)?
    } else {
        packed.write(&out)?
    }
    let after = fs::metadata(&out).map_err(|error| format!("{}: {error}", out.display()))?.len();
    print_sizes(&field, &packed, [before, after]);
    if let Some(views) = &views {
        let loss = views.compare(packed.field());
        println!("{:.1} dB from the field in {} views, {:.2}% of labels changed", loss.psnr, views.len(), loss.labels);
    }
    println!("{}", out.display());
    if let (Some(folder), Some(views)) = (&arguments.report, &views) {
        let all = Quality::value_variants().iter().map(|quality| {
            let packed = match *quality == arguments.quality {
                true => packed.clone(),
                false => pack(&field, &arguments.settings(*quality))?,
            };
            Ok(report::Row::new(*quality, &packed, views))
        });
        report::write(folder, path, before, &all.collect::<Result<Vec<_>>>()?)?;
    }
    Ok(())
}

/// Packs from another thread, so that this one can show the progress.
fn pack(field: &PlenOctree, settings: &PackSettings) -> Result<Packed> {
    let bar = progress::bar("looking from all around", 100, false);
    let progress = Arc::new(Progress::default());
    let worker = {
        let (field, settings, progress) = (field.clone(), settings.clone(), progress.clone());
        thread::spawn(move || Packed::new(&field, &settings, &progress))
    };
    while !worker.is_finished() {
        bar.set_position((100.0 * progress.fraction()) as u64);
        if progress.fraction() == 1.0 {
            bar.set_message("learning the codebooks");
        }
        thread::sleep(Duration::from_millis(20));
    }
    bar.finish_and_clear();
    Ok(worker.join().map_err(|_| "packing stopped unexpectedly")??)
}

fn print_sizes(field: &PlenOctree, packed: &Packed, [before, after]: [u64; 2]) {
    let share = 100.0 * packed.dropped() as f64 / field.leaves().max(1) as f64;
    println!("{} of {} leaves dropped, {share:.0}%", packed.dropped(), field.leaves());
    println!("{before} bytes before, {after} after, {:.1} times less", before as f64 / after as f64);
    let sections: Vec<_> = packed.sections().iter().map(|(name, bytes)| format!("{name} {bytes}")).collect();
    println!("sections: {}", sections.join(", "));
}
