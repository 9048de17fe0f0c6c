//! Frames of one prop with each preset, and frames in which little changes.

use std::time::Instant;

use bevy_plenoctree::{POSTERIZE_SPANS, Posterize, PropQuality, VOLUME_SPANS};

use crate::{
    PATIENCE, Result, SIZES,
    clock::{Times, milliseconds},
    files,
    frames::{LOOKS, Scene, Sways, begin, show},
};

/// Frames in which the camera moves, except in the last row.
const ROWS: [(&str, PropQuality, bool); 5] = [
    ("`EXACT`", PropQuality::EXACT, true),
    ("`HIGH`", PropQuality::HIGH, true),
    ("`BALANCED`", PropQuality::BALANCED, true),
    ("`FAST`", PropQuality::FAST, true),
    ("`EXACT`, nothing moves", PropQuality::EXACT, false),
];

pub fn measure(end: Instant) -> Result {
    let (mut headless, camera, fields) = begin(&files()[..1])?;
    println!("## Presets\n\nMilliseconds of a frame of one prop in which the camera moves.\n");
    println!(
        "| preset | pixels | look | wall | GPU | rays | posterizing | frames |\n|---|---|---|---|---|---|---|---|"
    );
    let mut left = (SIZES.len() * ROWS.len() * LOOKS.len()) as u32;
    for size in SIZES {
        headless.resize(size);
        for (name, quality, sways) in ROWS {
            for (look, is_posterized) in LOOKS {
                let share = end.saturating_duration_since(Instant::now()) / left;
                let row_end = Instant::now() + share;
                left -= 1;
                headless.app.insert_resource(Sways(sways));
                headless.app.world_mut().entity_mut(camera).insert(quality);
                show(&mut headless, camera, &fields, Scene::Whole, size, is_posterized.then(Posterize::default))?;
                headless.wait_until_ready(PATIENCE)?;
                let times = Times::measure(&mut headless, row_end)?;
                let [gpu, rays, posterizing] =
                    [times.gpu(), times.of(VOLUME_SPANS), times.of(POSTERIZE_SPANS)].map(milliseconds);
                println!(
                    "| {name} | {} x {} | {look} | {:.1} | {gpu} | {rays} | {posterizing} | {} |",
                    size.x, size.y, times.wall, times.frames
                );
            }
        }
    }
    println!();
    Ok(())
}
