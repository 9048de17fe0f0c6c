//! Tests that palette colors reach the screen exactly at [`PropPlacement::Display`].

use bevy::{
    camera::{CompositingSpace, Exposure, Hdr, MsaaWriteback, RenderTarget, Viewport},
    core_pipeline::{
        Core3d, Core3dSystems,
        tonemapping::{DebandDither, Tonemapping, tonemapping},
    },
    post_process::bloom::Bloom,
    prelude::*,
    render::{
        RenderApp,
        render_resource::{
            LoadOp, Operations, RenderPassColorAttachment, RenderPassDescriptor, StoreOp, TextureFormat,
        },
        renderer::{RenderContext, ViewQuery},
        view::{ColorGrading, ColorGradingGlobal, ViewTarget},
    },
};
use bevy_plenoctree::{PlenOctreePlugin, PlenOctreeRenderSystems, Posterize, PropPlacement, headless::exact_camera};
use image::imageops::crop_imm;

use super::scene::{
    COLOR, SHOWN, SIZE, SOLID, Stage, assert_near, at, is_near, middle, scene, scene_with, scene_with_meshes,
    spawn_square,
};
use crate::stage::{TONEMAPPINGS, unlit};

/// Returns all settings of Bevy that change colors, except for tonemapping.
fn effects() -> impl Bundle {
    let global = ColorGradingGlobal { exposure: 0.7, temperature: 0.02, post_saturation: 0.6, ..default() };
    (DebandDither::Enabled, Exposure::OVERCAST, ColorGrading { global, ..default() })
}

/// Makes the cube of a scene show the first of [`SHOWN`] at [`PropPlacement::Display`], in front of a brighter sky.
fn posterized(mut scene: Stage) -> Stage {
    scene.dress(Posterize { softness: 0.0, ..default() });
    scene.set_background(Color::linear_rgb(50.0, 50.0, 50.0));
    scene.set(PropPlacement::Display);
    scene
}

/// Asserts that every pixel well inside the cube has the shown color.
#[track_caller]
fn assert_exact(frame: &image::RgbaImage, what: &str) {
    let inside = frame.width() * 3 / 8..frame.width() * 5 / 8;
    for (x, y) in inside.clone().flat_map(|x| inside.clone().map(move |y| (x, y))) {
        assert_near(at(frame, x, y), SHOWN[0], 1, &format!("{what}, {x}, {y}"));
    }
}

#[test]
fn nothing_changes_palette_colors() {
    let mut scene = posterized(scene_with_meshes(SOLID));
    let with_samples = (Tonemapping::AgX, Msaa::Sample4);
    for (tonemapping, msaa) in TONEMAPPINGS.into_iter().map(|t| (t, Msaa::Off)).chain([with_samples]) {
        scene.set((effects(), tonemapping, msaa));
        scene.set_if(false, Bloom::NATURAL);
        scene.set_if(false, Hdr);
        assert_exact(&scene.capture(), &format!("{tonemapping:?}, {msaa:?}"));
        scene.set((Hdr, Bloom { intensity: 0.5, ..Bloom::NATURAL }));
        assert_exact(&scene.capture(), &format!("{tonemapping:?}, {msaa:?}, HDR, bloom"));
        // Otherwise the test would prove nothing.
        scene.set(PropPlacement::Scene);
        assert!(!is_near(middle(&scene.capture()), SHOWN[0], 8), "{tonemapping:?}, {msaa:?}: unchanged in the scene");
        scene.set(PropPlacement::Display);
    }
}

/// Colors are exact in every format and compositing space of the view's textures, posterized and as trained.
#[test]
fn compositing_spaces_are_honored() {
    let mut scene = posterized(scene(SOLID));
    for (hdr, space) in [
        (false, CompositingSpace::Linear),
        (false, CompositingSpace::Srgb),
        (true, CompositingSpace::Linear),
        (true, CompositingSpace::Srgb),
        (true, CompositingSpace::Oklab),
    ] {
        scene.set(space);
        scene.set_if(hdr, Hdr);
        for placement in [PropPlacement::Scene, PropPlacement::Display] {
            scene.set(placement);
            let what = format!("{space:?}, hdr {hdr}, {placement:?}");
            assert_exact(&scene.capture(), &what);
            let prop = scene.prop();
            let posterize = scene.world().entity_mut(prop).take::<Posterize>().unwrap();
            assert_near(middle(&scene.capture()), COLOR, 1, &format!("{what}, as trained"));
            scene.dress(posterize);
        }
    }
}

#[test]
fn opaque_meshes_occlude_props() {
    let mut scene = posterized(scene_with_meshes(SOLID));
    scene.set((effects(), Hdr, Tonemapping::AgX));
    let opaque = spawn_square(&mut scene, Vec3::new(0.0, -0.2, 1.0), 0.4, unlit(Color::srgb(0.8, 0.6, 0.1)));
    // At 2 units from the camera, 0.2 units are about a quarter of the way to the bottom.
    let below = (SIZE / 2, SIZE * 5 / 8);
    for msaa in [Msaa::Off, Msaa::Sample4] {
        scene.set(msaa);
        let frame = scene.capture();
        scene.dress(Visibility::Hidden);
        let expected = at(&scene.capture(), below.0, below.1);
        assert_eq!(at(&frame, below.0, below.1), expected, "{msaa:?}: behind a mesh");
        scene.dress(Visibility::Visible);
    }
    scene.world().despawn(opaque);
    assert_exact(&scene.capture(), "without the mesh");
}

/// Glass in front of a prop is blended over its palette color, and does not change it elsewhere. Glass behind the prop
/// is hidden.
#[test]
fn glass_is_in_front_of_exact_colors() {
    let mut scene = posterized(scene_with_meshes(SOLID));
    let pane = Color::srgba(0.8, 0.6, 0.1, 0.5);
    // They cover the upper half and the left half of the frame's middle.
    spawn_square(&mut scene, Vec3::new(0.0, 0.2, 1.0), 0.4, unlit(pane));
    spawn_square(&mut scene, Vec3::new(-0.5, 0.0, -1.0), 1.0, unlit(Color::srgba(1.0, 0.0, 0.0, 0.9)));
    let tinted = Color::from(SHOWN[0].to_linear() * 0.5 + pane.to_linear().with_alpha(1.0) * 0.5);
    let corner = Viewport { physical_position: UVec2::new(7, 3), physical_size: UVec2::splat(40), ..default() };
    for (msaa, hdr, placements) in [
        (Msaa::Off, false, false),
        (Msaa::Off, true, false),
        (Msaa::Sample4, false, true),
        (Msaa::Sample4, true, false),
    ] {
        scene.set(msaa);
        scene.set_if(hdr, Hdr);
        let idle = scene.idle_stage();
        scene.set_if(placements, idle);
        for viewport in [None, Some(corner.clone())] {
            let what = format!("{msaa:?}, HDR {hdr}, {viewport:?}");
            let (x, y, size) = viewport.as_ref().map_or((0, 0, SIZE), |viewport| (7, 3, viewport.physical_size.x));
            scene.camera_mut().viewport = viewport;
            let frame = crop_imm(&scene.capture(), x, y, size, size).to_image();
            assert_near(at(&frame, size / 2, size * 3 / 8), tinted, 2, &format!("{what}, behind glass"));
            assert_near(at(&frame, size * 7 / 16, size * 9 / 16), SHOWN[0], 1, &format!("{what}, before glass"));
            assert_near(at(&frame, size * 9 / 16, size * 9 / 16), SHOWN[0], 1, &format!("{what}, without glass"));
        }
    }
}

/// Two cameras share their textures, which post-processing swaps.
#[test]
fn each_viewport_has_its_own_placement() {
    let mut scene = posterized(scene(SOLID));
    let (camera, target) = (scene.camera, scene.headless.target());
    let settings = || (effects(), Hdr, Tonemapping::AcesFitted, Transform::from_xyz(0.0, 0.0, 3.0));
    scene.set(settings());
    let second = scene.world().spawn((exact_camera(Color::BLACK), target)).insert(settings()).id();
    let mut camera_of_second = scene.world().get_mut::<Camera>(second).unwrap();
    // Otherwise it would start with what the first one drew.
    (camera_of_second.order, camera_of_second.msaa_writeback) = (1, MsaaWriteback::Off);
    let halves = [(camera, 0, 28), (second, 28, 20)];
    for (camera, x, width) in halves {
        let (physical_position, physical_size) = (UVec2::new(x, 8), UVec2::new(width, SIZE / 2));
        let viewport = Viewport { physical_position, physical_size, ..default() };
        scene.world().get_mut::<Camera>(camera).unwrap().viewport = Some(viewport);
    }
    let views =
        |frame: image::RgbaImage| halves.map(|(_, x, width)| crop_imm(&frame, x, 8, width, SIZE / 2).to_image());
    for (msaa, placements) in [Msaa::Off, Msaa::Sample4].into_iter().flat_map(|msaa| {
        use PropPlacement::{Display, Scene};
        [[Display, Scene], [Scene, Display]].map(|placements| (msaa, placements))
    }) {
        for ((camera, ..), placement) in halves.into_iter().zip(placements) {
            scene.world().entity_mut(camera).insert((msaa, placement));
        }
        let both = views(scene.capture());
        for (view, placement) in both.iter().zip(placements) {
            assert_eq!(
                is_near(middle(view), SHOWN[0], 1),
                placement == PropPlacement::Display,
                "{msaa:?}, {placements:?}"
            );
        }
        // Each view looks the same as alone.
        for (half, other) in [(0, second), (1, camera)] {
            scene.world().get_mut::<Camera>(other).unwrap().is_active = false;
            let alone = views(scene.capture());
            assert!(alone[half] == both[half], "{msaa:?}, {placements:?}: not the same as alone");
            scene.world().get_mut::<Camera>(other).unwrap().is_active = true;
        }
    }
}

/// One camera draws to a texture, which another camera sees on a mesh.
#[test]
fn textures_hold_palette_colors() {
    let mut scene = posterized(scene_with_meshes(SOLID));
    let target = scene.headless.target();
    scene.dress(Transform::from_xyz(100.0, 0.0, 0.0).with_scale(Vec3::splat(3.0)));
    scene.set((effects(), Hdr, Tonemapping::TonyMcMapface, Transform::from_xyz(100.0, 0.0, 3.0)));
    scene.camera_mut().order = -1;
    scene.spawn((exact_camera(Color::BLACK), target, Transform::from_xyz(0.0, 0.0, 3.0)));
    for format in [TextureFormat::Rgba8UnormSrgb, TextureFormat::Bgra8UnormSrgb, TextureFormat::Rgba16Float] {
        let texture: Handle<Image> = scene.add(Image::new_target_texture(32, 32, format, None));
        // Cameras whose projection changes look at the size of their target.
        scene.set((RenderTarget::Image(texture.clone().into()), Projection::default()));
        let material = StandardMaterial { base_color_texture: Some(texture), unlit: true, ..default() };
        let square = spawn_square(&mut scene, 0.5 * Vec3::Z, 3.0, material);
        assert_exact(&scene.capture(), &format!("{format:?}"));
        scene.world().despawn(square);
    }
}

/// Returns an effect that fills the whole view with a color.
fn paint(color: wgpu::Color) -> impl Fn(ViewQuery<&ViewTarget>, RenderContext) {
    move |view, mut ctx| {
        let ops = Operations { load: LoadOp::Clear(color), store: StoreOp::Store };
        let view = view.into_inner().post_process_write().destination;
        let attachment = RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops };
        ctx.begin_tracked_render_pass(RenderPassDescriptor { color_attachments: &[Some(attachment)], ..default() });
    }
}

/// Effects that other plugins run after tonemapping come before the props, whichever plugin is added first.
#[test]
fn effects_of_other_plugins_run_first() {
    #[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
    struct Red;
    let mut scene = scene_with(SOLID, |app| {
        let red = paint(wgpu::Color::RED).in_set(Red).in_set(Core3dSystems::PostProcess).after(tonemapping);
        let white = paint(wgpu::Color::WHITE).in_set(Core3dSystems::PostProcess).after(Red);
        app.sub_app_mut(RenderApp).add_systems(Core3d, red);
        app.add_plugins(PlenOctreePlugin).sub_app_mut(RenderApp).add_systems(Core3d, white);
    });
    for hdr in [false, true] {
        scene.set_if(hdr, Hdr);
        scene.set(PropPlacement::Display);
        let frame = scene.capture();
        assert_near(middle(&frame), COLOR, 1, "the prop");
        assert_near(at(&frame, 1, 1), Color::WHITE, 0, "the sky");
        scene.set(PropPlacement::Scene);
        assert_near(middle(&scene.capture()), Color::WHITE, 0, "the prop in the scene");
    }
}

/// Unless somebody orders them after props.
#[test]
fn effects_that_are_ordered_after_props_run_last() {
    let mut scene = scene_with(SOLID, |app| {
        let props = PlenOctreeRenderSystems::Present(PropPlacement::Display);
        let white = paint(wgpu::Color::WHITE).in_set(Core3dSystems::PostProcess).after(props);
        app.add_plugins(PlenOctreePlugin).sub_app_mut(RenderApp).add_systems(Core3d, white);
    });
    scene.set(PropPlacement::Display);
    assert_near(middle(&scene.capture()), Color::WHITE, 0, "the prop");
}
