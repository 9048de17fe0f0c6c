//! [`PropStage::Display`]: palette colors reach the screen exactly.

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
use bevy_plenoctree::{PlenOctreePlugin, Posterize, PropStage, headless::exact_camera};
use image::imageops::crop_imm;

use crate::scene::{COLOR, SHOWN, SIZE, SOLID, Scene, assert_near, at, is_near, middle};

const TONEMAPPINGS: [Tonemapping; 9] = [
    Tonemapping::None,
    Tonemapping::Reinhard,
    Tonemapping::ReinhardLuminance,
    Tonemapping::AcesFitted,
    Tonemapping::AgX,
    Tonemapping::SomewhatBoringDisplayTransform,
    Tonemapping::TonyMcMapface,
    Tonemapping::BlenderFilmic,
    Tonemapping::KhronosPbrNeutral,
];

/// Whatever Bevy does to colors, except for tonemapping.
fn effects() -> impl Bundle {
    let global = ColorGradingGlobal { exposure: 0.7, temperature: 0.02, post_saturation: 0.6, ..default() };
    (DebandDither::Enabled, Exposure::OVERCAST, ColorGrading { global, ..default() })
}

/// A cube that shows the first of [`SHOWN`] at [`PropStage::Display`], before a sky that outshines it.
fn posterized() -> Scene {
    let mut scene = Scene::new(SOLID);
    let prop = scene.prop;
    scene.world().entity_mut(prop).insert(Posterize { softness: 0.0, ..default() });
    scene.set_background(Color::linear_rgb(50.0, 50.0, 50.0));
    scene.set(PropStage::Display);
    scene
}

/// Every pixel well inside the cube.
#[track_caller]
fn assert_exact(picture: &image::RgbaImage, what: &str) {
    let inside = picture.width() * 3 / 8..picture.width() * 5 / 8;
    for (x, y) in inside.clone().flat_map(|x| inside.clone().map(move |y| (x, y))) {
        assert_near(at(picture, x, y), SHOWN[0], 1, &format!("{what}, {x}, {y}"));
    }
}

#[test]
fn nothing_changes_palette_colors() {
    let mut scene = posterized();
    for (tonemapping, msaa) in TONEMAPPINGS.into_iter().flat_map(|t| [(t, Msaa::Off), (t, Msaa::Sample4)]) {
        scene.set((effects(), tonemapping, msaa));
        scene.set_if(false, Bloom::NATURAL);
        scene.set_if(false, Hdr);
        assert_exact(&scene.picture(), &format!("{tonemapping:?}, {msaa:?}"));
        scene.set((Hdr, Bloom { intensity: 0.5, ..Bloom::NATURAL }));
        assert_exact(&scene.picture(), &format!("{tonemapping:?}, {msaa:?}, HDR, bloom"));
        // Or the test says nothing.
        scene.set(PropStage::Scene);
        assert!(!is_near(middle(&scene.picture()), SHOWN[0], 8), "{tonemapping:?}, {msaa:?}: unchanged in the scene");
        scene.set(PropStage::Display);
    }
}

/// Whatever the view's textures hold, and whatever is done in them.
#[test]
fn compositing_spaces_are_honored() {
    let mut scene = posterized();
    for (hdr, space) in [
        (false, CompositingSpace::Linear),
        (false, CompositingSpace::Srgb),
        (true, CompositingSpace::Linear),
        (true, CompositingSpace::Srgb),
        (true, CompositingSpace::Oklab),
    ] {
        scene.set(space);
        scene.set_if(hdr, Hdr);
        for stage in [PropStage::Scene, PropStage::Display] {
            scene.set(stage);
            assert_exact(&scene.picture(), &format!("{space:?}, hdr {hdr}, {stage:?}"));
        }
    }
}

#[test]
fn opaque_meshes_hide_props_and_transparent_ones_do_not() {
    let mut scene = posterized();
    let prop = scene.prop;
    scene.set((effects(), Hdr, Tonemapping::AgX));
    let opaque = scene.spawn_square(Vec3::new(0.0, -0.2, 1.0), 0.4, Color::srgb(0.8, 0.6, 0.1));
    let glass = scene.spawn_square(Vec3::new(0.0, 0.2, 1.0), 0.4, Color::srgba(0.8, 0.6, 0.1, 0.5));
    // 0.2 of 2 units before the camera are a quarter of the way up or down.
    let (above, below) = ((SIZE / 2, SIZE * 3 / 8), (SIZE / 2, SIZE * 5 / 8));
    for msaa in [Msaa::Off, Msaa::Sample4] {
        scene.set(msaa);
        let picture = scene.picture();
        assert_near(at(&picture, above.0, above.1), SHOWN[0], 1, &format!("{msaa:?}, before glass"));
        scene.world().entity_mut(prop).insert(Visibility::Hidden);
        let expected = at(&scene.picture(), below.0, below.1);
        assert_eq!(at(&picture, below.0, below.1), expected, "{msaa:?}: behind a mesh");
        scene.world().entity_mut(prop).insert(Visibility::Visible);
    }
    for mesh in [opaque, glass] {
        scene.world().despawn(mesh);
    }
    assert_exact(&scene.picture(), "alone");
}

/// Two cameras share their textures, whose places post-processing swaps.
#[test]
fn each_viewport_has_its_own_stage() {
    let mut scene = posterized();
    let (camera, target) = (scene.camera, scene.headless.target());
    let settings = || (effects(), Hdr, Tonemapping::AcesFitted, Transform::from_xyz(0.0, 0.0, 3.0));
    scene.set(settings());
    let second = scene.world().spawn((exact_camera(Color::BLACK), target)).insert(settings()).id();
    let mut camera_of_second = scene.world().get_mut::<Camera>(second).unwrap();
    // Or it would begin with what the first one drew.
    (camera_of_second.order, camera_of_second.msaa_writeback) = (1, MsaaWriteback::Off);
    let halves = [(camera, 0, 28), (second, 28, 20)];
    for (camera, x, width) in halves {
        let (physical_position, physical_size) = (UVec2::new(x, 8), UVec2::new(width, SIZE / 2));
        let viewport = Viewport { physical_position, physical_size, ..default() };
        scene.world().get_mut::<Camera>(camera).unwrap().viewport = Some(viewport);
    }
    let views =
        |picture: image::RgbaImage| halves.map(|(_, x, width)| crop_imm(&picture, x, 8, width, SIZE / 2).to_image());
    for (msaa, stages) in [Msaa::Off, Msaa::Sample4].into_iter().flat_map(|msaa| {
        use PropStage::{Display, Scene};
        [[Display, Scene], [Scene, Display]].map(|stages| (msaa, stages))
    }) {
        for ((camera, ..), stage) in halves.into_iter().zip(stages) {
            scene.world().entity_mut(camera).insert((msaa, stage));
        }
        let both = views(scene.picture());
        for (view, stage) in both.iter().zip(stages) {
            assert_eq!(is_near(middle(view), SHOWN[0], 1), stage == PropStage::Display, "{msaa:?}, {stages:?}");
        }
        // Each view is what it is alone.
        for (half, other) in [(0, second), (1, camera)] {
            scene.world().get_mut::<Camera>(other).unwrap().is_active = false;
            let alone = views(scene.picture());
            assert!(alone[half] == both[half], "{msaa:?}, {stages:?}: another picture than alone");
            scene.world().get_mut::<Camera>(other).unwrap().is_active = true;
        }
    }
}

/// A camera draws into a texture, which hangs in the scene of another.
#[test]
fn a_texture_holds_palette_colors() {
    for format in [TextureFormat::Rgba8UnormSrgb, TextureFormat::Bgra8UnormSrgb, TextureFormat::Rgba16Float] {
        let mut scene = posterized();
        let (prop, camera, target) = (scene.prop, scene.camera, scene.headless.target());
        let world = scene.world();
        let texture = world.resource_mut::<Assets<Image>>().add(Image::new_target_texture(32, 32, format, None));
        world.entity_mut(camera).insert((
            RenderTarget::Image(texture.clone().into()),
            effects(),
            Hdr,
            Tonemapping::TonyMcMapface,
        ));
        world.get_mut::<Camera>(camera).unwrap().order = -1;
        world.get_mut::<Transform>(prop).unwrap().scale = Vec3::splat(3.0);
        world.get_mut::<Transform>(prop).unwrap().translation.x = 100.0;
        world.get_mut::<Transform>(camera).unwrap().translation.x = 100.0;
        world.spawn((exact_camera(Color::BLACK), target, Transform::from_xyz(0.0, 0.0, 3.0)));
        let material = StandardMaterial { base_color_texture: Some(texture), unlit: true, ..default() };
        scene.spawn_material(0.5 * Vec3::Z, 3.0, material);
        assert_exact(&scene.picture(), &format!("{format:?}"));
    }
}

/// Paints the view, as an effect that leaves nothing of it.
fn paint(color: wgpu::Color) -> impl Fn(ViewQuery<&ViewTarget>, RenderContext) {
    move |view, mut ctx| {
        let ops = Operations { load: LoadOp::Clear(color), store: StoreOp::Store };
        let view = view.into_inner().post_process_write().destination;
        let attachment = RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops };
        ctx.begin_tracked_render_pass(RenderPassDescriptor { color_attachments: &[Some(attachment)], ..default() });
    }
}

/// Effects that other plugins put after tonemapping come before the props, whichever plugin is added first.
#[test]
fn other_effects_come_first() {
    #[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
    struct Red;
    let mut scene = Scene::with(SOLID, |app| {
        let red = paint(wgpu::Color::RED).in_set(Red).in_set(Core3dSystems::PostProcess).after(tonemapping);
        let white = paint(wgpu::Color::WHITE).in_set(Core3dSystems::PostProcess).after(Red);
        app.sub_app_mut(RenderApp).add_systems(Core3d, red);
        app.add_plugins(PlenOctreePlugin).sub_app_mut(RenderApp).add_systems(Core3d, white);
    });
    for hdr in [false, true] {
        scene.set_if(hdr, Hdr);
        scene.set(PropStage::Display);
        let picture = scene.picture();
        assert_near(middle(&picture), COLOR, 1, "the prop");
        assert_near(at(&picture, 1, 1), Color::WHITE, 0, "the sky");
        scene.set(PropStage::Scene);
        assert_near(middle(&scene.picture()), Color::WHITE, 0, "the prop in the scene");
    }
}
