//! Tests the edges of posterized props, against images with 16 rays per pixel that are posterized separately.

use std::{collections::BTreeMap, sync::Mutex};

use bevy::{
    camera::{Hdr, ScalingMode, visibility::RenderLayers},
    prelude::*,
};
use bevy_plenoctree::{
    EdgeSmoothing, FieldPalette, LabelStages, Palette, PaletteOverride, Palettes, PlenOctree, Posterize, PosterizeView,
    Prop, PropLighting, PropPlacement, PropQuality, SolidOpacity,
};
use glam::DVec3;
use image::RgbaImage;
use plenoctree::{
    palette::{ExtractionSettings, PaletteMethod, extract},
    sampling::{Progress, SamplingSettings},
};

use super::stage::{
    Stage,
    fields::{colored, cube, included},
    pixels::{at, differing, linear, places, steps},
    unlit,
};

/// The width and height of a frame, in pixels.
const SIZE: u32 = 96;
/// The rays per pixel of the pictures to compare with, along each axis.
const FINE: u32 = 4;

const SKY: Color = Color::srgb(0.55, 0.7, 0.9);
const WALL: Color = Color::srgb(0.75, 0.4, 0.2);
const BRIGHT: [f64; 3] = [0.95, 0.9, 0.6];
const GREEN: [f64; 3] = [0.1, 0.45, 0.2];
/// Colors that nothing else has. They identify the prop that a pixel shows.
const KEYS: [Color; 2] = [Color::srgb(1.0, 0.0, 1.0), Color::srgb(0.0, 1.0, 1.0)];

/// Bakes the inside of a surface, in one color.
fn bake_solid(color: [f64; 3], distance: impl Fn(DVec3) -> f64 + Sync) -> PlenOctree {
    colored(6, |at| if distance(at) < 0.0 { 1e4 } else { 0.0 }, |_| color.into())
}

fn ball(color: [f64; 3]) -> PlenOctree {
    bake_solid(color, |at| at.length() - 0.7)
}

type Fine = (Vec<Vec<usize>>, Vec<Vec3>);

#[derive(Deref, DerefMut)]
struct Scene {
    #[deref]
    stage: Stage,
    meshes: Vec<Entity>,
}

impl Scene {
    /// Creates a scene for props alone.
    fn new() -> Self {
        Self::around(Stage::new(SIZE))
    }

    /// Creates a scene for props, meshes and lights.
    fn with_meshes() -> Self {
        Self::around(Stage::with_meshes(SIZE))
    }

    fn around(mut stage: Stage) -> Self {
        stage.set_background(SKY);
        stage.set(Transform::from_xyz(0.3, 0.5, 3.0).looking_at(Vec3::ZERO, Vec3::Y));
        Self { stage, meshes: vec![] }
    }

    /// Spawns a posterized prop.
    fn spawn_posterized(&mut self, field: &PlenOctree, palette: Palette, place: Transform) {
        let hard = Posterize { edges: EdgeSmoothing::Off, ..Posterize::paper() };
        let prop = self.spawn_prop(field, (hard, place));
        let world = self.world();
        let field = world.get::<Prop>(prop).unwrap().0.clone();
        world.resource_mut::<Palettes>().insert(&field, FieldPalette::new(palette));
        self.wait();
    }

    fn spawn_ball(&mut self, color: [f64; 3], place: Transform) {
        self.spawn_posterized(&ball(color), Palette::new(vec![color]).unwrap(), place);
    }

    /// Spawns one of the included props.
    fn spawn_included(&mut self, name: &'static str) {
        /// The palettes of props, extracted once.
        static PALETTES: Mutex<BTreeMap<&str, Palette>> = Mutex::new(BTreeMap::new());
        let field = included(name);
        let extracted = || {
            let sampling = SamplingSettings { sample_fraction: Some(0.03), ..default() };
            let fitted = ExtractionSettings { method: PaletteMethod::Fitted, sampling, ..default() };
            extract(&field, &fitted, &Progress::default()).unwrap().palette
        };
        let palette = PALETTES.lock().unwrap().entry(name).or_insert_with(extracted).clone();
        self.spawn_posterized(&field, palette, default());
    }

    /// Spawns an unlit square of this size.
    fn spawn_wall(&mut self, size: f32, place: Transform) {
        let wall = self.spawn_mesh(Rectangle::new(size, size), unlit(WALL), place);
        self.meshes.push(wall);
    }

    fn clear(&mut self) {
        self.stage.clear();
        for mesh in self.meshes.drain(..) {
            self.stage.world().despawn(mesh);
        }
    }

    fn draw(&mut self, edges: EdgeSmoothing) -> RgbaImage {
        for prop in self.props.clone() {
            self.insert(prop, Posterize { edges, ..Posterize::paper() });
        }
        self.capture()
    }

    /// Returns which prop each pixel shows: 1 for the first, and 0 for none.
    fn owners(&mut self) -> Vec<usize> {
        let props = self.props.clone();
        let mut lightings = vec![];
        for (prop, key) in props.iter().zip(KEYS) {
            let own = (0..16).fold(PaletteOverride::default(), |own, index| own.with(index, key));
            lightings.push(self.world().entity_mut(*prop).insert(own).take::<PropLighting>());
        }
        let frame = self.draw(EdgeSmoothing::Off);
        for (prop, lighting) in props.into_iter().zip(lightings) {
            self.world().entity_mut(prop).remove::<PaletteOverride>();
            if let Some(lighting) = lighting {
                self.insert(prop, lighting);
            }
        }
        let keys = KEYS.map(|key| Srgba::from(key).to_u8_array());
        frame.pixels().map(|pixel| keys.iter().position(|key| *key == pixel.0).map_or(0, |key| key + 1)).collect()
    }

    /// Returns the owners of the rays of every pixel, and the mean of what they show in linear light.
    fn fine(&mut self) -> Fine {
        let camera = self.headless.app.world().entity(self.camera);
        let before = (*camera.get::<Msaa>().unwrap(), camera.get::<PropQuality>().copied().unwrap_or_default());
        self.headless.resize(UVec2::splat(FINE * SIZE));
        self.set((Msaa::Off, PropQuality { ray_tolerance: 0.0, ..before.1 }));
        let (owners, frame) = (self.owners(), self.draw(EdgeSmoothing::Off));
        self.headless.resize(UVec2::splat(SIZE));
        self.set(before);
        let rays = |x: u32, y: u32| (0..FINE * FINE).map(move |ray| (FINE * x + ray % FINE, FINE * y + ray / FINE));
        let owners = places(SIZE, SIZE)
            .map(|(x, y)| rays(x, y).map(|(x, y)| owners[(y * FINE * SIZE + x) as usize]).collect())
            .collect();
        let mean = |(x, y)| rays(x, y).map(|(x, y)| linear(frame.get_pixel(x, y))).sum::<Vec3>();
        let means = places(SIZE, SIZE).map(|at| mean(at) / (FINE * FINE) as f32).collect();
        (owners, means)
    }

    /// Checks that opacity replaces the rays of many pixels, and finds about what rays find.
    fn check_estimates(&mut self, fine: &Fine, what: &str) {
        let all_rays = PropQuality { estimates_edges: false, ..default() };
        let qualities = [all_rays, default(), PropQuality { edge_rays: 4, ..default() }];
        let (mut frames, mut errors) = (vec![], vec![]);
        for quality in qualities {
            self.set(quality);
            let (hard, smooth) = self.errors(what, fine);
            errors.push(smooth / hard);
            frames.push(self.draw(EdgeSmoothing::Coverage));
        }
        self.unset::<PropQuality>();
        let cut = crossed(&fine.0);
        let pixels = frames[0].pixels().zip(frames[1].pixels()).zip(&cut).filter(|(_, is_cut)| **is_cut);
        let replaced = pixels.filter(|((rays, estimated), _)| rays != estimated).count();
        let all = cut.iter().filter(|is_cut| **is_cut).count();
        println!("{what}: {replaced} of {all} pixels do not show what rays see");
        assert!(10 * replaced > all, "{what}: {replaced} of {all}");
        assert!(errors[0] < 0.3 && errors[1] < 0.32 && errors[2] < 0.32, "{what}: {errors:?}");
    }

    /// Returns the errors of hard edges and of smooth ones: root mean squares over the pixels that the edge of a prop
    /// crosses, in steps of 8-bit encoded sRGB. Prints both.
    fn errors(&mut self, what: &str, (owners, truth): &Fine) -> (f64, f64) {
        let is_edge = crossed(owners);
        let edge = is_edge.iter().filter(|is_edge| **is_edge).count();
        assert!(edge > 60, "{what}: {edge} pixels");
        self.errors_at(what, truth, &is_edge)
    }

    /// Returns the same errors, over some pixels.
    fn errors_at(&mut self, what: &str, truth: &[Vec3], are_meant: &[bool]) -> (f64, f64) {
        let count = are_meant.iter().filter(|is_meant| **is_meant).count();
        let [hard, smooth] = [EdgeSmoothing::Off, EdgeSmoothing::Coverage].map(|edges| {
            let frame = self.draw(edges);
            let squares = frame.pixels().zip(truth).zip(are_meant).filter(|(_, is_meant)| **is_meant).map(
                |((pixel, truth), _)| {
                    let truth = Srgba::from(LinearRgba::from_vec3(*truth)).to_vec3();
                    (steps(pixel) - 255.0 * truth.as_dvec3()).length_squared() / 3.0
                },
            );
            (squares.sum::<f64>() / count as f64).sqrt()
        });
        println!("{what}: {count} pixels, hard {hard:.1}, smooth {smooth:.1}, {:.2} of it", smooth / hard);
        (hard, smooth)
    }
}

/// Returns the pixels that the edge of a prop crosses, from the owners of their rays.
fn crossed(owners: &[Vec<usize>]) -> Vec<bool> {
    owners.iter().map(|rays| rays.iter().any(|ray| *ray != rays[0])).collect()
}

/// A wall that hides the right half of what is at the origin, and is tilted.
fn before() -> Transform {
    Transform::from_xyz(0.75, 0.1, 1.2).with_rotation(Quat::from_rotation_z(0.3))
}

fn behind() -> Transform {
    Transform::from_xyz(0.0, 0.0, -1.5)
}

/// The floor on which a ball at the origin lies, slightly sunk in.
fn floor() -> Transform {
    Transform::from_xyz(0.0, -0.45, 0.0).with_rotation(Quat::from_rotation_x(-1.4))
}

#[test]
fn edges_are_close_to_supersampled_ones() {
    let mut stage = Scene::with_meshes();
    let mut results = vec![];
    let mut check = |stage: &mut Scene, fine: &Fine, what: &str, most: f64| {
        let (hard, smooth) = stage.errors(what, fine);
        results.push((what.to_string(), smooth / hard, most));
    };
    let (third, usual) = (1.0 / 3.0, 0.27);
    let four_rays = PropQuality { edge_rays: 4, ..default() };
    stage.set(Transform::from_xyz(1.0, 1.2, 3.2).looking_at(Vec3::ZERO, Vec3::Y));
    // The drum has a fringe and rails that are thinner than pixels, and the gumballs are behind glass.
    for (name, most) in [("toadstool", usual), ("drum", third), ("robot", usual), ("gumballs", third)] {
        stage.spawn_included(name);
        let fine = stage.fine();
        check(&mut stage, &fine, &format!("{name} before the sky"), most);
        stage.set(Msaa::Sample4);
        check(&mut stage, &fine, &format!("{name} before the sky, with four samples"), most);
        stage.set((Msaa::Off, four_rays));
        check(&mut stage, &fine, &format!("{name} before the sky, with four rays"), most);
        stage.unset::<PropQuality>();
        stage.clear();
    }
    stage.set(Transform::from_xyz(0.3, 0.5, 3.0).looking_at(Vec3::ZERO, Vec3::Y));
    let both = [Msaa::Off, Msaa::Sample4];
    stage.spawn_ball(BRIGHT, default());
    let fine = stage.fine();
    for msaa in both {
        stage.set(msaa);
        check(&mut stage, &fine, &format!("before the sky, {msaa:?}"), usual);
    }
    stage.spawn_wall(8.0, behind());
    let fine = stage.fine();
    for msaa in both {
        stage.set(msaa);
        check(&mut stage, &fine, &format!("before a mesh, {msaa:?}"), usual);
        stage.set(PropQuality { ray_tolerance: 0.1, ..default() });
        check(&mut stage, &fine, &format!("before a mesh, with fewer rays, {msaa:?}"), usual);
        stage.set(four_rays);
        check(&mut stage, &fine, &format!("before a mesh, with four rays, {msaa:?}"), usual);
        stage.unset::<PropQuality>();
    }
    stage.spawn_ball(GREEN, Transform::from_xyz(-0.6, -0.4, -0.8));
    let fine = stage.fine();
    for msaa in both {
        stage.set(msaa);
        check(&mut stage, &fine, &format!("before another prop, {msaa:?}"), usual);
    }
    let other = stage.props[1];
    stage.world().get_mut::<Transform>(other).unwrap().translation.z = 0.1;
    let fine = stage.fine();
    for msaa in both {
        stage.set(msaa);
        check(&mut stage, &fine, &format!("through another prop, {msaa:?}"), usual);
        stage.set(four_rays);
        check(&mut stage, &fine, &format!("through another prop, with four rays, {msaa:?}"), usual);
        stage.unset::<PropQuality>();
    }
    stage.clear();
    stage.spawn_ball(BRIGHT, default());
    stage.spawn_wall(4.0, floor());
    let fine = stage.fine();
    for msaa in both {
        stage.set(msaa);
        check(&mut stage, &fine, &format!("on a mesh, {msaa:?}"), usual);
    }
    stage.clear();
    stage.set(Msaa::Off);
    // Fog, which is posterized only where rays pass through enough of it.
    let fog = colored(6, |at| if at.length() < 0.9 { 0.6 } else { 0.0 }, |_| BRIGHT.into());
    stage.spawn_posterized(&fog, Palette::new(vec![BRIGHT]).unwrap(), default());
    let fine = stage.fine();
    check(&mut stage, &fine, "fog", usual);
    stage.clear();
    // A ball whose near half, and more, is before the near plane.
    let scaling_mode = ScalingMode::Fixed { width: 2.4, height: 2.4 };
    let cut = OrthographicProjection { scaling_mode, near: 3.3, ..OrthographicProjection::default_3d() };
    stage.set(Projection::Orthographic(cut));
    stage.spawn_ball(BRIGHT, default());
    let fine = stage.fine();
    check(&mut stage, &fine, "cut by the near plane", usual);
    stage.clear();
    stage.set(Projection::default());
    // Half of it in the shadow of a wall that only the light sees.
    stage.spawn_ball(BRIGHT, default());
    let lighting = PropLighting { shadows: 0.7, ..default() };
    let (prop, unlit) = (stage.props[0], stage.draw(EdgeSmoothing::Coverage));
    stage.insert(prop, lighting);
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    let sun = (light, Transform::default().looking_to(Vec3::NEG_Z, Vec3::Y), RenderLayers::from_layers(&[0, 1]));
    let sun = stage.world().spawn(sun).id();
    stage.spawn_wall(6.0, Transform::from_xyz(3.1, 0.0, 1.5));
    let wall = stage.meshes[0];
    stage.insert(wall, RenderLayers::layer(1));
    let lit = stage.draw(EdgeSmoothing::Coverage);
    let darker = lit.pixels().zip(unlit.pixels()).filter(|(lit, unlit)| lit[0] + 20 < unlit[0]).count();
    assert!((300..3000).contains(&darker), "{darker} pixels are in shadow");
    let fine = stage.fine();
    check(&mut stage, &fine, "half in shadow", usual);
    stage.world().despawn(sun);
    stage.clear();
    // The scene's samples show how much of a pixel a mesh covers.
    stage.set(Msaa::Sample4);
    stage.spawn_ball(BRIGHT, default());
    stage.spawn_wall(1.2, before());
    let fine = stage.fine();
    for (hdr, place) in [(false, PropPlacement::Scene), (true, PropPlacement::Scene), (false, PropPlacement::Display)] {
        stage.set(place);
        stage.set_if(hdr, Hdr);
        check(&mut stage, &fine, &format!("behind a mesh, {place:?}, HDR {hdr}"), third);
        if !hdr {
            let idle = stage.idle_stage();
            stage.set(idle);
            check(&mut stage, &fine, &format!("behind a mesh, {place:?}, with stages"), third);
            stage.unset::<LabelStages>();
        }
    }
    // Without samples, the edge of the mesh is jagged.
    stage.set((Msaa::Off, PropPlacement::Scene));
    check(&mut stage, &fine, "behind a mesh, without samples", 0.75);
    stage.clear();
    let wrong: Vec<_> = results.iter().filter(|(_, found, most)| found > most).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// A camera that sees a tenth of a prop, so near that its cells are larger than pixels.
fn close(at: Vec3) -> (Projection, Transform) {
    let place = Transform::from_xyz(1.0, 1.2, 3.2).looking_at(at, Vec3::Y);
    (Projection::from(PerspectiveProjection { fov: 0.1, ..default() }), place)
}

/// Where cells are larger than pixels, opacity replaces rays.
#[test]
fn edges_between_large_cells_follow_from_opacity() {
    let mut stage = Scene::new();
    for (name, x) in [("toadstool", 0.62), ("drum", 0.62), ("robot", 0.3)] {
        stage.set(close(Vec3::new(x, 0.3, -0.2)));
        // With a single label, errors are those of silhouettes alone.
        stage.spawn_posterized(&included(name), Palette::new(vec![GREEN]).unwrap(), default());
        let fine = stage.fine();
        stage.check_estimates(&fine, name);
        stage.clear();
    }
}

/// It does so with samples, at the display, before a mesh, and beside other props, whose results are added up.
#[test]
fn opacity_replaces_rays_in_all_views() {
    let mut stage = Scene::with_meshes();
    let soft = |at: DVec3| if at.length() < 0.8 { 8.0 * (-(at.length() / 0.6).powi(8)).exp() } else { 0.0 };
    let soft = colored(6, soft, |_| GREEN.into());
    let spawn = |stage: &mut Scene, x: f32| {
        let place = Transform::from_xyz(x, 0.0, 0.0).with_scale(Vec3::splat(0.55));
        stage.spawn_posterized(&soft, Palette::new(vec![GREEN]).unwrap(), place);
    };
    stage.set(Transform::from_xyz(0.0, 0.0, 3.0));
    spawn(&mut stage, -0.6);
    let fine = stage.fine();
    stage.check_estimates(&fine, "alone");
    stage.set(Msaa::Sample4);
    stage.check_estimates(&fine, "with samples");
    stage.set((Msaa::Off, PropPlacement::Display));
    stage.check_estimates(&fine, "at the display");
    stage.set(PropPlacement::Scene);
    stage.spawn_wall(8.0, behind());
    let fine = stage.fine();
    stage.check_estimates(&fine, "before a mesh");
    spawn(&mut stage, 0.6);
    let fine = stage.fine();
    stage.check_estimates(&fine, "beside another prop");
    stage.set(Msaa::Sample4);
    stage.check_estimates(&fine, "beside another prop, with samples");
}

/// Where the opacity of another prop may be part of what pixels see, and where opacity changes at once, rays are needed.
#[test]
fn edges_do_not_follow_from_opacity_that_says_too_little() {
    let mut stage = Scene::new();
    let all_rays = PropQuality { estimates_edges: false, ..default() };
    let mut wrong = vec![];
    let mut check = |stage: &mut Scene, what: &str| {
        stage.unset::<PropQuality>();
        let found = stage.draw(EdgeSmoothing::Coverage);
        stage.set(all_rays);
        let expected = stage.draw(EdgeSmoothing::Coverage);
        assert!(found != stage.draw(EdgeSmoothing::Off), "{what}");
        let differ = differing(&found, &expected, 0);
        wrong.extend((differ > 0).then(|| format!("{what}: {differ} pixels")));
    };
    // Haze behind it, too thin to be posterized.
    stage.set(close(Vec3::new(0.62, 0.3, -0.2)));
    stage.spawn_posterized(&included("toadstool"), Palette::new(vec![GREEN]).unwrap(), default());
    let haze = colored(3, |_| 0.1, |_| BRIGHT.into());
    stage.spawn_posterized(&haze, Palette::new(vec![BRIGHT]).unwrap(), Transform::from_xyz(0.0, 0.0, -3.0));
    check(&mut stage, "before haze");
    stage.clear();
    // A pane that is barely dense enough to be posterized.
    let scaling_mode = ScalingMode::Fixed { width: 2.37, height: 2.37 };
    let flat = OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() };
    stage.set((Projection::Orthographic(flat), Transform::from_xyz(0.0, 0.0, 3.0)));
    let pane = colored(3, |at| if at.abs().max_element() < 0.5 { 0.4 } else { 0.0 }, |_| GREEN.into());
    stage.spawn_posterized(&pane, Palette::new(vec![GREEN]).unwrap(), default());
    check(&mut stage, "pane");
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// Returns the pixels whose owner differs from that of a neighbor.
fn outlines(owners: &[usize]) -> Vec<bool> {
    let owner = |x: i32, y: i32| {
        let size = SIZE as i32;
        let held = |at: i32| at.clamp(0, size - 1);
        owners[(held(y) * size + held(x)) as usize]
    };
    let ends = |x, y| (0..9).any(|at| owner(x + at % 3 - 1, y + at / 3 - 1) != owner(x, y));
    (0..SIZE * SIZE).map(|index| ends((index % SIZE) as i32, (index / SIZE) as i32)).collect()
}

/// Away from edges, nothing changes. A bright label in front of a dark background has no halo: edges only have colors
/// between the two.
#[test]
fn edges_have_colors_between_those_on_both_sides_and_others_stay() {
    let mut stage = Scene::new();
    stage.set(Transform::from_xyz(1.0, 1.2, 3.2).looking_at(Vec3::ZERO, Vec3::Y));
    stage.spawn_included("toadstool");
    for (msaa, place) in [
        (Msaa::Off, PropPlacement::Scene),
        (Msaa::Sample4, PropPlacement::Scene),
        (Msaa::Sample4, PropPlacement::Display),
    ] {
        stage.set((msaa, place));
        let is_edge = outlines(&stage.owners());
        let [hard, smooth] = [EdgeSmoothing::Off, EdgeSmoothing::Coverage].map(|edges| stage.draw(edges));
        let changed = hard.pixels().zip(smooth.pixels()).map(|(hard, smooth)| hard != smooth);
        let (on, off): (Vec<_>, Vec<_>) = changed.zip(&is_edge).partition(|(_, is_edge)| **is_edge);
        let count = |pixels: &[(bool, &bool)]| pixels.iter().filter(|(changed, _)| *changed).count();
        assert!(count(&on) * 4 > on.len(), "{msaa:?}: {} of {} edge pixels changed", count(&on), on.len());
        assert_eq!(count(&off), 0, "{msaa:?}: pixels away from edges changed");
    }
    stage.clear();
    stage.spawn_ball(BRIGHT, default());
    let [bright, dark] = [Vec3::from_array(BRIGHT.map(|channel| channel as f32)), Srgba::from(SKY).to_vec3()];
    let (mut mixed, frame) = (0, stage.draw(EdgeSmoothing::Coverage));
    for pixel in frame.pixels() {
        let shares = [0, 1, 2].map(|channel| {
            let value = linear(pixel)[channel];
            let [dark, bright] =
                [dark, bright].map(|color| LinearRgba::from(Srgba::from_vec3(color)).to_vec3()[channel]);
            (value - dark) / (bright - dark)
        });
        let (least, most) = (shares.into_iter().fold(1.0, f32::min), shares.into_iter().fold(0.0, f32::max));
        // Nearly the same share in every channel: thin parts are blended in encoded sRGB. Green is 229.5 bytes,
        // which adapters round up or down, by 0.012 of the range.
        assert!(least > -0.015 && most < 1.015 && most - least < 0.1, "{pixel:?}: {shares:?}");
        mixed += usize::from((0.05..0.95).contains(&least));
    }
    assert!(mixed > 60, "{mixed} pixels");
    // Rays hit the ball or miss it. Where they miss it, there is nothing to posterize, whatever the settings.
    let prop = stage.props[0];
    let from_none = (Posterize { min_opacity: 0.0, ..Posterize::paper() }, PropQuality::EXACT);
    let at_once = (Posterize::paper(), PropQuality { stop_transmittance: 1.0, ..default() });
    for (posterize, quality) in [from_none, at_once] {
        stage.insert(prop, posterize);
        stage.set(quality);
        let found = stage.capture();
        let differ = differing(&found, &frame, 0);
        assert!(10 * differ < mixed, "{differ} of {mixed} pixels differ with {posterize:?}, {quality:?}");
    }
}

/// Haze that ends softly looks like haze at its edges, too: neither what shows through it nor what is in front of its
/// densest part makes a line of other pixels where posterization begins. Props as trained show through it, too.
#[test]
fn smooth_edges_draw_no_line_in_haze() {
    let mut stage = Stage::new(SIZE);
    let [dark, gray] = [0.05, 0.5].map(DVec3::splat);
    let haze = colored(6, |at| 12.0 * (-6.0 * at.length_squared()).exp(), |_| dark);
    let mut palette = Palette::new(vec![dark.to_array()]).unwrap();
    palette.method = Some(PaletteMethod::Tones);
    let hazy = stage.spawn_prop(&haze, ());
    stage.paint(FieldPalette::new(palette));
    stage.set_background(Color::WHITE);
    stage.set(Transform::from_xyz(0.3, 0.5, 2.4).looking_at(Vec3::ZERO, Vec3::Y));
    for has_wall in [false, true] {
        if has_wall {
            stage.spawn_prop(&cube(1e4, gray), Transform::from_xyz(0.0, 0.0, -6.0).with_scale(Vec3::splat(8.0)));
        }
        let mut capture = |edges| {
            stage.insert(hazy, Posterize { edges, ..Posterize::toon() });
            stage.wait();
            stage.capture()
        };
        let [hard, smooth] = [EdgeSmoothing::Off, EdgeSmoothing::Coverage].map(&mut capture);
        let changed = differing(&hard, &smooth, 0);
        assert!(changed > 100, "{changed}");
        // In front of a solid prop, haze is opaque, so its edge is one between two colors.
        let reach = if has_wall { 1 } else { 0 };
        for (x, y) in places(SIZE - 2, SIZE - 2).map(|(x, y)| (x + 1, y + 1)) {
            let around =
                || places(2 * reach + 1, 2 * reach + 1).map(|(i, j)| at(&hard, x + i - reach, y + j - reach)[0]);
            let (least, most) = (around().min().unwrap(), around().max().unwrap());
            let found = at(&smooth, x, y)[0];
            let range = least.saturating_sub(12)..=most.saturating_add(12);
            assert!(range.contains(&found), "with a wall {has_wall}: {found} at {x}, {y}, expected {range:?}");
        }
    }
}

/// Slits of the drum, which the rays through the centers of pixels do not get through, show what is behind. If another
/// prop may be behind them, they show nothing.
#[test]
fn slits_show_the_scene_behind() {
    let mut stage = Scene::with_meshes();
    stage.set(Transform::from_xyz(1.0, 1.2, 3.2).looking_at(Vec3::ZERO, Vec3::Y));
    stage.spawn_included("drum");
    for has_wall in [false, true] {
        if has_wall {
            stage.spawn_wall(12.0, Transform::from_xyz(0.0, 0.0, -2.0));
        }
        let (owners, truth) = stage.fine();
        for (msaa, place) in [
            (Msaa::Off, PropPlacement::Scene),
            (Msaa::Sample4, PropPlacement::Scene),
            (Msaa::Off, PropPlacement::Display),
        ] {
            stage.set((msaa, place));
            let marked = outlines(&stage.owners());
            let slits: Vec<_> =
                crossed(&owners).iter().zip(&marked).map(|(is_crossed, is_marked)| *is_crossed && !is_marked).collect();
            let what = format!("slits, before a wall {has_wall}, {msaa:?}, {place:?}");
            let (hard, smooth) = stage.errors_at(&what, &truth, &slits);
            assert!(smooth < 0.5 * hard, "{what}: hard {hard}, smooth {smooth}");
        }
    }
    stage.spawn_ball(GREEN, Transform::from_xyz(-0.5, -0.6, -1.8));
    let marked = outlines(&stage.owners());
    let [hard, smooth] = [EdgeSmoothing::Off, EdgeSmoothing::Coverage].map(|edges| stage.draw(edges));
    let changed = hard.pixels().zip(smooth.pixels()).zip(&marked).filter(|((a, b), is_marked)| a != b && !**is_marked);
    assert_eq!(changed.count(), 0);
}

/// When the camera turns slowly, edges change less from frame to frame than hard ones.
#[test]
fn smooth_edges_are_steadier() {
    let whole = (Projection::default(), Vec3::ZERO, false);
    let close = (close(Vec3::ZERO).0, Vec3::new(0.6, 0.3, 0.0), true);
    // With a single label, what changes is the silhouette.
    for (projection, target, has_one_label) in [whole, close] {
        let mut stage = Scene::new();
        stage.set(projection);
        if has_one_label {
            stage.spawn_posterized(&included("toadstool"), Palette::new(vec![GREEN]).unwrap(), default());
        } else {
            stage.spawn_included("toadstool");
        }
        for estimates_edges in [false, true] {
            let quality = PropQuality { estimates_edges, ..default() };
            stage.set(quality);
            let [hard, smooth] = changes(&mut stage, target);
            println!("changes at edges: hard {hard:.2}, smooth {smooth:.2}");
            assert!(hard > 1.0 && smooth < 0.6 * hard, "{quality:?}: hard {hard}, smooth {smooth}");
        }
    }
}

/// Returns how much hard and smooth edges change while the camera turns around the prop with what it looks at.
fn changes(stage: &mut Scene, target: Vec3) -> [f64; 2] {
    let mut changes = [0.0; 2];
    let mut before: Option<([RgbaImage; 2], Vec<bool>)> = None;
    for step in 0..8 {
        let turn = Quat::from_rotation_y(0.6 + 0.004 * step as f32);
        let place = Transform::from_translation(turn * Vec3::new(0.0, 1.2, 3.2));
        stage.set(place.looking_at(turn * target, Vec3::Y));
        let is_edge = outlines(&stage.owners());
        let frames = [EdgeSmoothing::Off, EdgeSmoothing::Coverage].map(|edges| stage.draw(edges));
        if let Some((earlier, was_edge)) = &before {
            for (index, change) in changes.iter_mut().enumerate() {
                let pixels = frames[index].pixels().zip(earlier[index].pixels()).zip(is_edge.iter().zip(was_edge));
                let edges = pixels.filter(|(_, (is_edge, was_edge))| **is_edge || **was_edge);
                *change += edges.map(|((a, b), _)| f64::from(linear(a).distance_squared(linear(b)))).sum::<f64>();
            }
        }
        before = Some((frames, is_edge));
    }
    changes.map(f64::sqrt)
}

/// Views in which no prop is posterized, or all edges are hard, compile and draw nothing for smooth ones.
#[test]
fn only_views_with_smooth_edges_pay_for_them() {
    let mut stage = Scene::new();
    stage.spawn_ball(BRIGHT, default());
    let compiles_coverage = |stage: &Scene| stage.has_pipeline("plenoctree_coverage");
    stage.draw(EdgeSmoothing::Off);
    stage.undress::<Posterize>();
    let field = stage.field();
    // A posterized view has no edges either.
    stage.set((PosterizeView(field), Posterize::default()));
    stage.capture();
    assert!(!compiles_coverage(&stage));
    stage.draw(EdgeSmoothing::Coverage);
    assert!(compiles_coverage(&stage));
}

/// Bakes a plate at the bottom of a box, and a chip in its uppermost corner, which makes the box high.
fn plate() -> PlenOctree {
    let is_solid = |at: DVec3| at.y < -0.875 || at.min_element() > 0.875;
    // Solid within a small part of a cell, which the test makes large.
    colored(4, |at| if is_solid(at) { 1e8 } else { 0.0 }, |_| GREEN.into())
}

/// Where props meet, which of them is in front is known as exactly as depths are, no matter how high a prop's box is
/// above that, and how large the scene is.
#[test]
fn lines_of_contact_do_not_depend_on_the_size_of_a_box() {
    let mut stage = Scene::new();
    let block = bake_solid(BRIGHT, |at| at.abs().max_element() - 0.5);
    let turned = Quat::from_euler(EulerRot::XYZ, 0.6, 0.3, 0.4);
    stage.spawn_posterized(&plate(), Palette::new(vec![GREEN]).unwrap(), default());
    stage.spawn_posterized(&block, Palette::new(vec![BRIGHT]).unwrap(), default());
    let (plate, block) = (stage.props[0], stage.props[1]);
    // The top of the plate is at 0.
    let place = |stage: &mut Scene, height: f32, scale: f32| {
        let size = Vec3::new(4.0, height, 4.0);
        let of_plate = Transform::from_xyz(0.0, 0.875 * height * scale, 0.0).with_scale(scale * size);
        let of_block = Transform::from_rotation(turned).with_scale(Vec3::splat(scale));
        stage.insert(plate, of_plate);
        stage.insert(block, of_block);
    };
    let far = |tilt: f32, distance: f32| {
        Transform::from_translation(distance * Vec3::new(0.0, 1.0, tilt).normalize()).looking_at(Vec3::ZERO, Vec3::Z)
    };
    let scaling_mode = ScalingMode::Fixed { width: 3.0, height: 3.0 };
    let flat = OrthographicProjection { scaling_mode, far: 1e4, ..OrthographicProjection::default_3d() };
    let narrow = PerspectiveProjection { fov: 3.0 / 4000.0, ..default() };
    let wide = PerspectiveProjection::default();
    let mut wrong = vec![];
    for (msaa, edge_rays, solid) in [
        (Msaa::Off, 8, SolidOpacity::default()),
        (Msaa::Sample4, 8, SolidOpacity::default()),
        // No depth is known where the plate is.
        (Msaa::Off, 4, SolidOpacity::Never),
    ] {
        stage.set((msaa, PropQuality { edge_rays, ..default() }));
        stage.insert(plate, solid);
        let what = format!("{msaa:?}, {edge_rays} rays, plate {solid:?}");
        for (projection, from) in [
            (Projection::Orthographic(flat.clone()), far(0.02, 4000.0)),
            (Projection::Perspective(narrow.clone()), far(0.02, 4000.0)),
        ] {
            stage.set((projection.clone(), from));
            place(&mut stage, 1.0, 1.0);
            let (hard, low) = (stage.draw(EdgeSmoothing::Off), stage.draw(EdgeSmoothing::Coverage));
            let edges = differing(&hard, &low, 8);
            assert!(edges > 60, "{what}, {projection:?}: {edges} pixels at edges");
            place(&mut stage, 1000.0, 1.0);
            let high = stage.draw(EdgeSmoothing::Coverage);
            let count = differing(&high, &low, 8);
            if 10 * count > edges {
                wrong.push(format!("{what}, {projection:?}: {count} of {edges} pixels differ in a high box"));
            }
        }
        let from = Transform::from_xyz(0.3, 1.8, 2.5).looking_at(Vec3::ZERO, Vec3::Y);
        stage.set((Projection::Perspective(wide.clone()), from));
        place(&mut stage, 1.0, 1.0);
        let usual = stage.draw(EdgeSmoothing::Coverage);
        for scale in [1e-4, 1e6] {
            let near = if scale < 1.0 { 0.1 * scale } else { 0.1 };
            let projection = PerspectiveProjection { near, ..wide.clone() };
            let at = from.with_translation(scale * from.translation);
            stage.set((Projection::Perspective(projection), at));
            place(&mut stage, 1.0, scale);
            let count = differing(&stage.draw(EdgeSmoothing::Coverage), &usual, 8);
            if count > 3 {
                wrong.push(format!("{what}: {count} pixels differ at a scale of {scale}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
