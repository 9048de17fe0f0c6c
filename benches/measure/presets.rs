//! Frames with each preset, and frames in which little changes.

use std::time::Instant;

use bevy::prelude::*;
use bevy_plenoctree::{POSTERIZE_SPANS, Posterize, PropQuality, VOLUME_SPANS};

use crate::{
    PATIENCE, Result, SIZES,
    clock::{COME_TO_REST, Times, WARM_UP, milliseconds},
    files,
    frames::{LOOKS, Scene, Sways, begin, show},
};

const SCENES: [(&str, Scene, UVec2); 4] = [
    ("1", Scene::Whole, SIZES[0]),
    ("1", Scene::Whole, SIZES[1]),
    ("30", Scene::Many(30), SIZES[0]),
    ("1,000", Scene::Many(1000), SIZES[0]),
];
/// Frames in which the camera moves, except in the last row.
const ROWS: [(&str, PropQuality, bool); 5] = [
    ("`EXACT`", PropQuality::EXACT, true),
    ("`HIGH`", PropQuality::HIGH, true),
    ("`BALANCED`", PropQuality::BALANCED, true),
    ("`FAST`", PropQuality::FAST, true),
    ("`EXACT`, nothing moves", PropQuality::EXACT, false),
];

pub fn measure(end: Instant) -> Result {
    let (mut headless, camera, fields) = begin(files())?;
    println!("## Presets\n\nMilliseconds of a frame in which the camera moves.\n");
    println!(
        "| props | preset | pixels | look | wall | GPU | rays | posterizing | frames |\n\
         |---|---|---|---|---|---|---|---|---|"
    );
    // Many props take too long to come to rest.
    let rows = SCENES.into_iter().flat_map(|scene| ROWS.map(|row| (scene, row)));
    let rows: Vec<_> = rows.filter(|((_, scene, _), (.., sways))| *sways || *scene == Scene::Whole).collect();
    let mut left = (rows.len() * LOOKS.len()) as u32;
    for ((props, scene, size), (preset, quality, sways)) in rows {
        headless.resize(size);
        for (look, is_posterized) in LOOKS {
            let row = format!("| {props} | {preset} | {} x {} | {look}", size.x, size.y);
            let now = Instant::now();
            if now > end {
                println!("{row} | not measured: the time was up | | | | |");
                continue;
            }
            let share = end.duration_since(now) / left;
            left -= 1;
            headless.app.insert_resource(Sways(sways));
            headless.app.world_mut().entity_mut(camera).insert(quality);
            show(&mut headless, camera, &fields, scene, size, is_posterized.then(Posterize::default))?;
            headless.wait_until_ready(PATIENCE)?;
            let warm_up = if sways { WARM_UP } else { COME_TO_REST };
            let times = Times::measure(&mut headless, warm_up, now + share)?;
            let [gpu, rays, posterizing] =
                [times.gpu(), times.of(VOLUME_SPANS), times.of(POSTERIZE_SPANS)].map(milliseconds);
            println!("{row} | {:.1} | {gpu} | {rays} | {posterizing} | {} |", times.wall, times.frames);
        }
    }
    println!();
    Ok(())
}
