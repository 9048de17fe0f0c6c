//! Tests the frames that the plugin draws, against the float64 reference and known colors.

use std::time::Duration;

use bevy::{
    camera::Viewport,
    prelude::*,
    render::{
        RenderApp,
        error_handler::{RenderErrorHandler, RenderErrorPolicy},
        render_asset::RenderAssets,
        renderer::RenderDevice,
    },
};
use bevy_plenoctree::{
    Activation, EdgeSmoothing, FieldPalette, GpuField, Palette, Palettes, PlenOctree, PlenOctreePlugin, Posterize,
    Prop, UpAxis,
    headless::{Headless, LitMeshPlugins, exact_camera, pinhole_view},
};
use glam::{DMat4, DVec3};
use image::RgbaImage;
use plenoctree::{
    BakeSettings, Basis, Cell, Frame, PackSettings, Packed, bake, camera::PinholeCamera, reference, sampling::Progress,
};

const SIZE: u32 = 96;

/// Bakes a soft ball whose color depends on position and direction.
fn ball(basis: Basis) -> PlenOctree {
    let settings = BakeSettings {
        depth: 5,
        min: DVec3::new(-1.0, -1.5, -1.0),
        max: DVec3::new(1.0, 1.0, 1.2),
        basis,
        ..Default::default()
    };
    bake(
        &settings,
        |at| (30.0 * (0.8 - at.length())).clamp(0.0, 12.0),
        |at| {
            move |direction: DVec3| {
                let tint = 0.5 + 0.4 * (7.0 * at).map(f64::sin);
                tint + 0.2 * direction.dot(at.normalize_or_zero()) * DVec3::new(1.0, -0.5, 0.3)
            }
        },
    )
    .unwrap()
}

/// Bakes an opaque box of one color.
fn solid(color: DVec3) -> PlenOctree {
    let settings = BakeSettings { depth: 3, basis: Basis::Rgba, ..Default::default() };
    bake(&settings, |at| if at.abs().max_element() < 0.5 { 1e4 } else { 0.0 }, |_| move |_| color).unwrap()
}

fn with_activation(field: &PlenOctree, activation: Activation) -> PlenOctree {
    PlenOctree::new(
        field.frame(),
        field.basis(),
        activation,
        field.up(),
        field.nodes().to_vec(),
        field.densities().to_vec(),
        field.coefficients().to_vec(),
    )
    .unwrap()
}

fn pinhole() -> PinholeCamera {
    PinholeCamera::new(SIZE, SIZE, 0.7, DMat4::IDENTITY).looking_at(DVec3::new(2.0, -2.2, 1.4), DVec3::ZERO, DVec3::Z)
}

fn palette() -> Palette {
    Palette::new(vec![[0.9, 0.1, 0.1], [0.1, 0.8, 0.2], [0.15, 0.2, 0.9], [0.95, 0.9, 0.85], [0.05, 0.05, 0.1]])
        .unwrap()
}

struct Scene {
    headless: Headless,
    prop: Entity,
    camera: Entity,
    field: Handle<PlenOctree>,
}

impl Scene {
    fn new(field: &PlenOctree) -> Self {
        let plugins = |app: &mut App| {
            app.add_plugins((LitMeshPlugins, PlenOctreePlugin));
        };
        Self::in_app(field, Headless::new(UVec2::splat(SIZE), plugins).unwrap())
    }

    fn in_app(field: &PlenOctree, mut headless: Headless) -> Self {
        let target = headless.target();
        let world = headless.app.world_mut();
        let handle = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
        world.resource_mut::<Palettes>().insert(&handle, FieldPalette::new(palette()));
        let prop = world.spawn(Prop(handle.clone())).id();
        let view = pinhole_view(&pinhole(), field.up());
        let camera = world.spawn((exact_camera(Color::WHITE), target, view)).id();
        headless.wait_until_ready(Duration::from_secs(120)).unwrap();
        Self { headless, prop, camera, field: handle }
    }

    fn world(&mut self) -> &mut World {
        self.headless.app.world_mut()
    }

    fn capture(&mut self) -> RgbaImage {
        self.headless.capture().unwrap()
    }

    fn show(&mut self, index: usize, color: Color) {
        let field = self.field.clone();
        self.world().resource_mut::<Palettes>().get_mut(&field).unwrap().set(index, color);
    }

    /// Spawns an unlit square of `size` at `position` that faces the camera.
    fn spawn_square(&mut self, position: DVec3, size: f32, color: Color) -> Entity {
        let world = self.headless.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(size, size));
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
            base_color: color,
            unlit: true,
            alpha_mode: if color.is_fully_opaque() { AlphaMode::Opaque } else { AlphaMode::Blend },
            ..default()
        });
        let camera = *world.get::<Transform>(self.camera).unwrap();
        // Up is z in the field, and y in the scene.
        let position = DVec3::new(position.x, position.z, -position.y).as_vec3();
        let transform = Transform::from_translation(position).with_rotation(camera.rotation);
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material), transform)).id()
    }
}

/// Returns the root mean square difference from colors of the reference, in 8-bit steps.
fn difference(frame: &RgbaImage, expected: &[DVec3]) -> f64 {
    let squares = frame.pixels().zip(expected).map(|(pixel, color)| {
        let seen = DVec3::new(pixel[0].into(), pixel[1].into(), pixel[2].into());
        (seen - 255.0 * color.clamp(DVec3::ZERO, DVec3::ONE)).length_squared() / 3.0
    });
    (squares.sum::<f64>() / expected.len() as f64).sqrt()
}

#[test]
fn every_basis_matches_the_reference() {
    for basis in Basis::ALL {
        for activation in [Activation::Sigmoid, Activation::ShiftedRelu, Activation::Identity] {
            let field = with_activation(&ball(basis), activation);
            let expected = reference::render(&field, &pinhole()).over(DVec3::ONE);
            let difference = difference(&Scene::new(&field).capture(), &expected);
            // Rounding to 8 bits alone makes a difference of 0.29; 50 dB is a difference of 0.8.
            assert!(difference < 0.4, "{basis:?} {activation:?}: {difference}");
        }
    }
}

/// The codebooks of a packed field are on the GPU too, where a leaf takes 10 bytes.
#[test]
fn packed_fields_match_the_reference() {
    for basis in [Basis::Sh1, Basis::Sh9, Basis::Sh25] {
        let settings = PackSettings { rows: 300, ..default() };
        let packed = Packed::new(&ball(basis), &settings, &Progress::default()).unwrap();
        let field = packed.field();
        let expected = reference::render(field, &pinhole()).over(DVec3::ONE);
        let mut scene = Scene::new(field);
        let difference = difference(&scene.capture(), &expected);
        assert!(difference < 0.4, "{basis:?}: {difference}");
        let codebook = field.codebook().unwrap();
        let render = scene.headless.app.sub_app(RenderApp).world();
        let bytes = render.resource::<RenderAssets<GpuField>>().get(&scene.field).unwrap().bytes();
        assert!(bytes <= GpuField::byte_size(field) + (1 << 17), "{bytes}");
        // The table, whole rows of textures, and rows of codebooks that are padded to texels.
        let table = 16 << (3 * (field.depth() - 2));
        let rows = codebook.luma.len() + codebook.chroma.len();
        let most = table + 10 * field.leaves() + rows + (1 << 17);
        assert!(bytes <= most as u64, "{basis:?}: {bytes} of {most}");
    }
}

#[test]
fn posterization_and_recoloring_match_the_reference() {
    let field = ball(Basis::Sh9);
    let rendering = reference::render(&field, &pinhole());
    let source: Vec<DVec3> = palette().colors.into_iter().map(DVec3::from).collect();
    let mut shown = source.clone();
    let mut scene = Scene::new(&field);
    for (posterize, recolored) in [
        (Posterize::paper(), false),
        (Posterize { softness: 0.0, blend_steps: 2, ..Posterize::paper() }, true),
        (Posterize { softness: 0.4, blend_steps: 1, min_opacity: 0.9, ..Posterize::paper() }, true),
    ] {
        let posterize = Posterize { edges: EdgeSmoothing::Off, ..posterize };
        if recolored {
            shown[0] = DVec3::new(0.2, 0.4, 1.0);
            scene.show(0, Color::srgb(0.2, 0.4, 1.0));
        }
        let prop = scene.prop;
        scene.world().entity_mut(prop).insert(posterize);
        let settings = reference::Posterization {
            blend_steps: posterize.blend_steps,
            softness: posterize.softness.into(),
            min_opacity: posterize.min_opacity.into(),
            ..Default::default()
        };
        let expected = reference::posterize(&rendering, DVec3::ONE, &source, &shown, &settings);
        let frame = scene.capture();
        let off = |pixel: &image::Rgba<u8>, color: &DVec3| {
            let off = (0..3).map(|c| (f64::from(pixel[c]) - 255.0 * color[c].clamp(0.0, 1.0)).abs());
            off.fold(0.0, f64::max)
        };
        let pixels = frame.pixels().zip(&expected).zip(&rendering.opacity);
        // The background is easy.
        let object = pixels.filter(|(_, opacity)| **opacity > 0.0);
        let off: Vec<_> = object.map(|((pixel, color), _)| off(pixel, color)).collect();
        let more_than = |most: f64| off.iter().filter(|off| **off > most).count();
        let (size, slightly, clearly) = (off.len(), more_than(2.0), more_than(8.0));
        // Half floats move some pixels across the border between two labels, or across the least opacity.
        let what =
            format!("{posterize:?}: of {size} pixels, {slightly} are off by more than 2, {clearly} by more than 8");
        assert!(size > 2000 && slightly * 50 < size && clearly * 100 < size, "{what}");
    }
}

#[test]
fn shown_colors_are_drawn_exactly() {
    let color = DVec3::new(0.6, 0.3, 0.8);
    let mut scene = Scene::new(&solid(color));
    let (prop, field) = (scene.prop, scene.field.clone());
    scene.world().entity_mut(prop).insert(Posterize::default());
    let single = Palette::new(vec![color.to_array(), [0.0; 3]]).unwrap();
    scene.world().resource_mut::<Palettes>().insert(&field, FieldPalette::new(single));
    for step in 0..=51u8 {
        let set = [5 * step, 255 - 5 * step, step.wrapping_mul(83)];
        scene.show(0, Color::srgb_u8(set[0], set[1], set[2]));
        let pixel = *scene.capture().get_pixel(SIZE / 2, SIZE / 2);
        let off = (0..3).map(|c| pixel[c].abs_diff(set[c])).max().unwrap();
        assert!(off <= 1, "{set:?} was drawn as {pixel:?}");
    }
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let field = ball(Basis::Sh4);
    let capture = || {
        let mut scene = Scene::new(&field);
        let prop = scene.prop;
        scene.world().entity_mut(prop).insert(Posterize::default());
        scene.capture()
    };
    assert_eq!(capture(), capture());
}

#[test]
fn opaque_meshes_and_props_occlude_each_other() {
    let red = Color::srgb_u8(200, 20, 20);
    for msaa in [Msaa::Off, Msaa::Sample4] {
        let color = DVec3::new(51.0, 128.0, 229.0) / 255.0;
        let mut scene = Scene::new(&solid(color));
        let camera = scene.camera;
        scene.world().entity_mut(camera).insert(msaa);
        let middle = |scene: &mut Scene| {
            let pixel = *scene.capture().get_pixel(SIZE / 2, SIZE / 2);
            [pixel[0], pixel[1], pixel[2]]
        };
        let blue = [51, 128, 229];
        let toward_camera = pinhole().position.normalize();
        assert_eq!(middle(&mut scene), blue, "{msaa:?}: alone");
        let square = scene.spawn_square(-1.5 * toward_camera, 6.0, red);
        assert_eq!(middle(&mut scene), blue, "{msaa:?}: in front of a mesh");
        let corner = *scene.capture().get_pixel(2, 2);
        assert_eq!([corner[0], corner[1], corner[2]], [200, 20, 20], "{msaa:?}: the mesh next to the prop");
        scene.world().entity_mut(square).despawn();
        scene.spawn_square(1.5 * toward_camera, 0.5, red);
        assert_eq!(middle(&mut scene), [200, 20, 20], "{msaa:?}: behind a mesh");
    }
}

/// Glass in front of the prop tints it, blended in linear light as Bevy does. Glass behind the prop is occluded.
#[test]
fn transparent_meshes_blend_over_the_prop() {
    let blue = DVec3::new(51.0, 128.0, 229.0) / 255.0;
    let glass = Color::srgba_u8(200, 20, 20, 128);
    let share = 128.0 / 255.0;
    for (distance, tinted) in [(1.5, true), (-1.5, false)] {
        let mut scene = Scene::new(&solid(blue));
        scene.spawn_square(distance * pinhole().position.normalize(), 0.5, glass);
        let pixel = *scene.capture().get_pixel(SIZE / 2, SIZE / 2);
        let prop = Color::srgb(blue.x as f32, blue.y as f32, blue.z as f32).to_linear();
        let mixed = Srgba::from(glass.to_linear().with_alpha(1.0) * share + prop * (1.0 - share)).to_u8_array();
        let expected = if tinted { mixed } else { [51, 128, 229, 255] };
        let off = (0..3).map(|c| pixel[c].abs_diff(expected[c])).max().unwrap();
        assert!(off <= 1, "at {distance}: {pixel:?}, expected {expected:?}");
    }
}

/// Scaling a prop and the camera's distance by the same factor changes nothing, because optical depth is measured in
/// the field's own units.
#[test]
fn a_scaled_prop_looks_the_same() {
    let field = ball(Basis::Sh9);
    let mut scene = Scene::new(&field);
    let before = scene.capture();
    let (prop, camera) = (scene.prop, scene.camera);
    for scale in [1e-2, 50.0] {
        let mut far = pinhole();
        far.position *= f64::from(scale);
        scene.world().entity_mut(prop).insert(Transform::from_scale(Vec3::splat(scale)));
        scene.world().entity_mut(camera).insert(pinhole_view(&far, UpAxis::Z));
        let after = scene.capture();
        let largest = before.iter().zip(after.iter()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(largest <= 1, "scaled by {scale}: {largest}");
    }
}

#[test]
fn a_viewport_shows_the_same_as_a_whole_target() {
    let field = ball(Basis::Sh1);
    let mut scene = Scene::new(&field);
    let (prop, camera) = (scene.prop, scene.camera);
    scene.world().entity_mut(prop).insert(Posterize::default());
    let half = pinhole().resized(SIZE / 2, SIZE / 2);
    let expected = {
        let mut alone = Scene::new(&field);
        let (prop, camera) = (alone.prop, alone.camera);
        alone.headless.resize(UVec2::splat(SIZE / 2));
        alone.world().entity_mut(prop).insert(Posterize::default());
        alone.world().entity_mut(camera).insert(pinhole_view(&half, UpAxis::Z));
        alone.capture()
    };
    scene.world().entity_mut(camera).insert(pinhole_view(&half, UpAxis::Z));
    scene.world().get_mut::<Camera>(camera).unwrap().viewport = Some(Viewport {
        physical_position: UVec2::new(SIZE / 2, SIZE / 4),
        physical_size: UVec2::splat(SIZE / 2),
        ..default()
    });
    let frame = scene.capture();
    let part = image::imageops::crop_imm(&frame, SIZE / 2, SIZE / 4, SIZE / 2, SIZE / 2).to_image();
    assert_eq!(part, expected);
}

#[test]
fn a_prop_without_a_palette_gets_one() {
    let mut scene = Scene::new(&ball(Basis::Sh4));
    let (prop, field) = (scene.prop, scene.field.clone());
    scene.world().resource_mut::<Palettes>().remove(&field);
    scene.world().entity_mut(prop).insert(Posterize::default());
    scene.headless.wait_until_ready(Duration::from_secs(120)).unwrap();
    let palettes = scene.world().resource::<Palettes>();
    let palette = palettes.get(&field).unwrap();
    assert!(palette.extraction().is_some());
    assert!(palette.shown().len() > 1);
}

/// Coefficients are stored in rows of a texture, as long as the device allows. Fields look the same in short rows.
#[test]
fn a_field_in_many_rows_looks_the_same() {
    let field = ball(Basis::Sh9);
    let whole = Scene::new(&field).capture();
    // Instead of 8192 texels.
    for row in [512, 256] {
        let limits = wgpu::Limits { max_texture_dimension_2d: row, ..wgpu::Limits::default() };
        let headless = Headless::with_limits(UVec2::splat(SIZE), limits, |app| {
            app.add_plugins(PlenOctreePlugin);
        });
        assert!(Scene::in_app(&field, headless.unwrap()).capture() == whole, "in rows of {row}");
    }
}

#[test]
fn a_field_that_does_not_fit_is_rejected_with_its_size() {
    let field = ball(Basis::Sh9);
    let bytes = 64 * field.leaves() as u64;
    let limits = wgpu::Limits { max_texture_dimension_2d: 64, ..wgpu::Limits::default() };
    let error = GpuField::check(&field, &limits).unwrap_err();
    assert_eq!((error.what, error.bytes, error.limit), ("coefficients", bytes, Some(64 * 64 * 16)));
    assert!(error.to_string().contains(&bytes.to_string()) && error.to_string().contains(&(64 * 64 * 16).to_string()));
    assert!(GpuField::check(&field, &wgpu::Limits::default()).is_ok());
}

/// A field with few leaves and many nodes does not fit because of the records of its nodes.
#[test]
fn a_field_with_too_many_records_is_rejected() {
    const LEVELS: u32 = 14;
    // In every cell of the first levels, a chain of nodes with a single leaf.
    let (mut nodes, mut leaves) = (vec![[Cell::EMPTY; 8]], 0);
    let mut below = vec![0];
    for level in 1..LEVELS {
        for node in std::mem::take(&mut below) {
            for cell in 0..if level < 4 { 8 } else { 1 } {
                nodes[node as usize][cell] = Cell::node(nodes.len() as u32);
                below.push(nodes.len() as u32);
                nodes.push([Cell::EMPTY; 8]);
            }
        }
    }
    for node in below {
        nodes[node as usize][5] = Cell::leaf(leaves);
        leaves += 1;
    }
    let (densities, colors) = (vec![1.0; leaves as usize], vec![half::f16::ONE; 3 * leaves as usize]);
    let frame = Frame::spanning(DVec3::NEG_ONE, DVec3::ONE);
    let field = PlenOctree::new(frame, Basis::Rgba, Activation::Identity, UpAxis::Y, nodes, densities, colors).unwrap();
    let limit = |side: u32| {
        let limits = wgpu::Limits { max_texture_dimension_2d: side, ..wgpu::Limits::default() };
        GpuField::check(&field, &limits).map_err(|error| (error.what, error.limit))
    };
    assert!(leaves <= 32 * 32);
    assert_eq!(limit(32), Err(("child records", Some(32 * 32 * 16))));
    assert_eq!(limit(256), Ok(()));
}

#[test]
fn the_app_recovers_from_a_lost_device() {
    let field = ball(Basis::Sh4);
    let headless = Headless::new(UVec2::splat(SIZE), |app| {
        app.add_plugins(PlenOctreePlugin);
    });
    let mut scene = Scene::in_app(&field, headless.unwrap());
    let prop = scene.prop;
    scene.world().entity_mut(prop).insert(Posterize::default());
    let before = scene.capture();
    scene.world().insert_resource(RenderErrorHandler(|_, _, _| RenderErrorPolicy::Recover(Default::default())));
    scene.headless.app.sub_app(RenderApp).world().resource::<RenderDevice>().wgpu_device().destroy();
    // The new device is created while the app runs.
    for _ in 0..100 {
        scene.headless.update();
        std::thread::sleep(Duration::from_millis(10));
    }
    scene.headless.wait_until_ready(Duration::from_secs(60)).unwrap();
    assert_eq!(scene.capture(), before);
}
