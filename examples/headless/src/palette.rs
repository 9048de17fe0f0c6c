//! Extracts the palette of a field, and prints how.

use std::{
    io::{IsTerminal, Write, stderr, stdout},
    time::Duration,
};

use bevy::prelude::*;
use bevy_plenoctree::{
    Palette, PaletteExtraction, SampleOrigin,
    headless::{Headless, HeadlessError},
    prelude::*,
};

use crate::{Result, colors};

/// The width of the progress bar, in characters.
const BAR: usize = 40;

/// Updates the app until the palette of a posterized field is extracted and the field can be drawn. Returns the
/// palette.
pub fn extract(headless: &mut Headless, field: &Handle<PlenOctree>) -> Result<Palette> {
    while let Err(error) = headless.wait_until_ready(Duration::from_millis(50)) {
        let HeadlessError::TimedOut { .. } = error else { return Err(error.into()) };
        show_progress(headless.app.world().resource::<PaletteExtraction>().progress(field));
    }
    show_progress(None);
    let world = headless.app.world();
    let samples = world.resource::<PaletteExtraction>().sampled(field).ok_or("the field was not sampled")?;
    let found = world.resource::<Palettes>().get(field).ok_or("the field has no palette")?;
    let (palette, report) = (found.palette(), found.extraction().ok_or("the palette was not extracted")?);
    let place = match samples.origin {
        SampleOrigin::Gpu => "in compute shaders",
        SampleOrigin::Cpu => "on background threads",
        SampleOrigin::Recorded => "when the field was packed",
    };
    let seconds = report.seconds;
    println!("Took {} radiance samples {place} in {:.2} s", report.radiance_samples, seconds.sampling);
    let fitting = seconds.filtering + seconds.hull + seconds.fitting;
    println!("Fitted {} colors in {} ramps to them in {fitting:.2} s:", palette.colors.len(), palette.ramps.len());
    for (name, tones) in colors::groups(palette) {
        println!("  {name:10}{}", tones.iter().map(|&tone| swatch(palette.colors[tone])).collect::<String>());
    }
    Ok(palette.clone())
}

/// Draws a bar, or removes it.
fn show_progress(progress: Option<f32>) {
    let mut terminal = stderr();
    if !terminal.is_terminal() {
        return;
    }
    let line = progress.map(|done| {
        let full = (done * BAR as f32) as usize;
        format!("Extracting the palette [{:BAR$}] {:3.0} %", "#".repeat(full), 100.0 * done)
    });
    // A bar that cannot be written is not shown.
    let _ = write!(terminal, "\r\x1b[K{}", line.unwrap_or_default()).and_then(|()| terminal.flush());
}

/// Returns a color's hex code, next to the color if it can be shown.
fn swatch(color: [f64; 3]) -> String {
    let [red, green, blue] = color.map(|channel| (255.0 * channel).round() as u8);
    let block =
        if stdout().is_terminal() { format!("\x1b[48;2;{red};{green};{blue}m  \x1b[0m ") } else { String::new() };
    format!("{block}#{red:02x}{green:02x}{blue:02x}  ")
}
