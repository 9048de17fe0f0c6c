//! Measures the CPU time of shadows and lights: `cargo bench --bench shadows -- [FIELD] [ROUNDS] [LAMPS]`.
//!
//! Renders a view of 800 x 800 pixels, with a floor and a directional light of four cascades, Bevy's default: without
//! the prop, with it, with its shadow, with the shadow of a mesh that falls on it (`PropLighting`), and lit like a
//! cartoon (`PropLighting::toon`), while nothing moves, the camera turns, the prop spins, or the light moves; as
//! trained, and posterized. LAMPS is the number of point lights with shadows besides the directional light, 0 by
//! default. Variants alternate, and the minimum of five rounds counts. It includes reading the frame back. With a GPU,
//! it is the CPU time of the driver.

use std::{path::PathBuf, time::Duration};

use bevy::{camera::visibility::RenderLayers, light::NotShadowCaster, prelude::*};
use bevy_plenoctree::{
    LoadSettings, PlenOctree, PlenOctreePlugin, Posterize, Prop, PropLighting,
    headless::{Headless, LitMeshPlugins, exact_camera, pinhole_view},
};
use cpu_time::ProcessTime;
use plenoctree::camera::PinholeCamera;

const SIZE: u32 = 800;
const ROUNDS: usize = 5;
const FRAMES: u32 = 4;
const PATIENCE: Duration = Duration::from_secs(600);

/// What moves from frame to frame.
#[derive(Resource, Clone, Copy, PartialEq, Eq)]
enum Moves {
    Nothing,
    Camera,
    Prop,
    Light,
}

/// Turns what moves by a little more than a degree per frame, around the origin.
fn turn(
    moves: Res<Moves>,
    mut places: Query<(&mut Transform, Has<Camera3d>, Has<Prop>, Has<DirectionalLight>)>,
    mut frame: Local<u32>,
) {
    *frame += 1;
    // Back and forth, so that every variant sees the same.
    let angle = if *frame % 8 < 4 { 0.02 } else { -0.02 };
    for (mut place, is_camera, is_prop, is_light) in &mut places {
        let turns = match *moves {
            Moves::Nothing => false,
            Moves::Camera => is_camera,
            Moves::Prop => is_prop,
            Moves::Light => is_light,
        };
        if turns {
            place.rotate_around(Vec3::ZERO, Quat::from_rotation_y(angle));
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Cargo adds `--bench`.
    let mut arguments = std::env::args_os().skip(1).filter(|argument| argument != "--bench").map(PathBuf::from);
    let own = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/toadstool.plenoctree");
    let field = PlenOctree::read(arguments.next().unwrap_or_else(own), &LoadSettings::default())?;
    let rounds = arguments.next().and_then(|rounds| rounds.to_str()?.parse().ok()).unwrap_or(ROUNDS);
    let lamps: u8 = arguments.next().and_then(|lamps| lamps.to_str()?.parse().ok()).unwrap_or(0);
    let (low, high) = field.dense_bounds().ok_or("the field is empty")?;
    let floor = [low, high].map(|corner| (field.up().to_y_up() * corner).y as f32).into_iter().reduce(f32::min);
    let camera = PinholeCamera::around(&field, SIZE, SIZE, 0.5, 0.4).ok_or("the field is empty")?;
    let mut headless = Headless::new(UVec2::splat(SIZE), |app| {
        app.add_plugins((LitMeshPlugins, PlenOctreePlugin)).insert_resource(Moves::Nothing).add_systems(Update, turn);
    })?;
    let (target, up) = (headless.target(), field.up());
    let world = headless.app.world_mut();
    let handle = world.resource_mut::<Assets<PlenOctree>>().add(field);
    let prop = world.spawn(Prop(handle)).id();
    world.spawn((exact_camera(Color::WHITE), target, pinhole_view(&camera, up)));
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Plane3d::default().mesh().size(20.0, 20.0));
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material.clone()), Transform::from_xyz(0.0, floor.unwrap_or(0.0), 0.0)));
    let (toward, unseen) = (Vec3::new(0.5, 1.0, 0.4), RenderLayers::layer(1));
    world.spawn((
        DirectionalLight { shadow_maps_enabled: true, ..default() },
        Transform::default().looking_to(-toward, Vec3::Y),
        RenderLayers::from_layers(&[0, 1]),
    ));
    for lamp in 0..lamps {
        let place = Transform::from_xyz(-1.5, 1.5, 1.5 - f32::from(lamp));
        world.spawn((PointLight { shadow_maps_enabled: true, ..default() }, place));
    }
    // Only the light sees this bar, whose shadow falls on the prop.
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.2, 0.2, 4.0));
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_translation(4.0 * toward), unseen));
    headless.wait_until_ready(PATIENCE)?;

    let rows = [
        ("nothing", Moves::Nothing),
        ("the camera", Moves::Camera),
        ("the prop", Moves::Prop),
        ("the light", Moves::Light),
    ];
    for style in ["as trained", "posterized"] {
        let mut entity = headless.app.world_mut().entity_mut(prop);
        if style == "posterized" {
            entity.insert(Posterize::default());
        }
        headless.wait_until_ready(PATIENCE)?;
        let mut frames: [Option<image::RgbaImage>; 5] = default();
        let mut least = [[f64::INFINITY; 5]; 4];
        for _ in 0..rounds {
            for ((_, moves), least) in rows.iter().zip(&mut least) {
                headless.app.insert_resource(*moves);
                for (variant, least) in least.iter_mut().enumerate() {
                    let mut prop = headless.app.world_mut().entity_mut(prop);
                    prop.remove::<(NotShadowCaster, PropLighting)>();
                    prop.insert(if variant == 0 { Visibility::Hidden } else { Visibility::Visible });
                    if variant < 2 {
                        prop.insert(NotShadowCaster);
                    } else if variant == 3 {
                        prop.insert(PropLighting::default());
                    } else if variant == 4 {
                        prop.insert(PropLighting::toon(2.0));
                    }
                    // What is at rest is drawn, and kept from the next frame on.
                    headless.capture()?;
                    headless.capture()?;
                    frames[variant] = Some(headless.capture()?);
                    let start = ProcessTime::now();
                    for _ in 0..FRAMES {
                        headless.capture()?;
                    }
                    *least = least.min(1e3 * start.elapsed().as_secs_f64() / f64::from(FRAMES));
                }
                if *moves == Moves::Nothing && frames.windows(2).any(|pair| pair[0] == pair[1]) {
                    return Err("a variant looks like the one before".into());
                }
            }
        }
        // The cost of the prop while it is redrawn in every frame.
        let drawing = least[1][1] - least[1][0];
        println!("{style}; drawing the prop costs {drawing:.1} ms");
        let columns = "without the prop, ms | with it | with its shadow | of drawing | lit | of drawing | brighter";
        println!("| what moves | {columns} | of drawing | of the frame |");
        println!("|---|---|---|---|---|---|---|---|---|---|");
        for ((what, _), [none, plain, shadowed, lit, brighter]) in rows.iter().zip(least) {
            let [shadow, light, bright] = [shadowed - plain, lit - shadowed, brighter - shadowed].map(|t| t / drawing);
            let share = (brighter - shadowed) / shadowed;
            print!("| {what} | {none:.1} | {plain:.1} | {shadowed:.1} | {shadow:.2} | {lit:.1} | {light:.2} ");
            println!("| {brighter:.1} | {bright:.2} | {share:.2} |");
        }
    }
    Ok(())
}
