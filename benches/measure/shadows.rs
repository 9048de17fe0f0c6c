//! Shadows that props cast, and lights that fall on them.

use std::time::Instant;

use bevy::{light::NotShadowCaster, prelude::*, render::diagnostic::RenderDiagnosticsPlugin};
use bevy_plenoctree::{
    LIGHTING_SPANS, LoadSettings, POSTERIZE_SPANS, PlenOctree, PlenOctreePlugin, Posterize, Prop, PropLighting,
    SHADOW_SPANS, VOLUME_SPANS,
    headless::{Headless, LitMeshPlugins, exact_camera, pinhole_view},
};
use plenoctree::camera::PinholeCamera;

use crate::{
    PATIENCE, Result, SIZES,
    clock::{Times, WARM_UP, milliseconds},
    files,
};

const VARIANTS: [&str; 5] =
    ["without a shadow", "with its shadow", "lit, too", "lit like a cartoon", "by the point light, too"];

/// Turns the prop in every frame, so that its shadow is drawn again.
fn turn(mut props: Query<&mut Transform, With<Prop>>) {
    props.iter_mut().for_each(|mut prop| prop.rotate_y(0.02));
}

pub fn measure(end: Instant) -> Result {
    println!(
        "## Shadows\n\nMilliseconds of a frame in which a posterized prop turns on a floor, under a directional light of \
         four cascades, and in the last row under a point light too, both with shadows.\n"
    );
    println!(
        "| prop | pixels | wall | GPU | its shadow | its light | rays and posterizing | frames |\n\
         |---|---|---|---|---|---|---|---|"
    );
    let field = PlenOctree::read(&files()[0], &LoadSettings::default())?;
    let up = field.up();
    let views = SIZES.map(|size| PinholeCamera::around(&field, size.x, size.y, 0.5, 0.4));
    let mut headless = Headless::new(SIZES[0], |app| {
        app.add_plugins((LitMeshPlugins, PlenOctreePlugin, RenderDiagnosticsPlugin)).add_systems(Update, turn);
    })?;
    let target = headless.target();
    let world = headless.app.world_mut();
    let handle = world.resource_mut::<Assets<PlenOctree>>().add(field);
    let prop = world.spawn((Prop(handle), Posterize::default())).id();
    let camera = world.spawn((exact_camera(Color::WHITE), target)).id();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Plane3d::default().mesh().size(20.0, 20.0));
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_xyz(0.0, -1.0, 0.0)));
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    world.spawn((light, Transform::default().looking_to(Vec3::new(-0.5, -1.0, -0.4), Vec3::Y)));
    let lamp = PointLight { shadow_maps_enabled: true, ..default() };
    let lamp = world.spawn((lamp, Transform::from_xyz(-1.5, 1.5, 1.5))).id();
    for (index, (size, view)) in SIZES.into_iter().zip(views).enumerate() {
        headless.resize(size);
        let view = pinhole_view(&view.ok_or("the field is empty")?, up);
        headless.app.world_mut().entity_mut(camera).insert(view);
        for (variant, name) in VARIANTS.into_iter().enumerate() {
            let row = format!("| {name} | {} x {}", size.x, size.y);
            let now = Instant::now();
            if now > end {
                println!("{row} | not measured: the time was up | | | | | |");
                continue;
            }
            let share = end.duration_since(now) / ((SIZES.len() - index) * VARIANTS.len() - variant) as u32;
            let is_last = variant + 1 == VARIANTS.len();
            let visibility = if is_last { Visibility::Visible } else { Visibility::Hidden };
            headless.app.world_mut().entity_mut(lamp).insert(visibility);
            let mut prop = headless.app.world_mut().entity_mut(prop);
            prop.remove::<(NotShadowCaster, PropLighting)>();
            match variant {
                0 => _ = prop.insert(NotShadowCaster),
                1 => {}
                2 => _ = prop.insert(PropLighting::default()),
                _ => _ = prop.insert(PropLighting::toon(2.0)),
            }
            headless.wait_until_ready(PATIENCE)?;
            let times = Times::measure(&mut headless, WARM_UP, now + share)?;
            let spans = [VOLUME_SPANS, POSTERIZE_SPANS].concat();
            let [gpu, shadows, lights, drawing] =
                [times.gpu(), times.of(SHADOW_SPANS), times.of(LIGHTING_SPANS), times.of(&spans)].map(milliseconds);
            println!("{row} | {:.1} | {gpu} | {shadows} | {lights} | {drawing} | {} |", times.wall, times.frames);
        }
    }
    println!();
    Ok(())
}
