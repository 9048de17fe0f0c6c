//! Tests that quality presets and settings are as accurate as promised, against the float64 reference.

use bevy::{camera::ScalingMode, prelude::*, render::render_asset::RenderAssets};
use bevy_plenoctree::{
    EdgeSmoothing, FieldPalette, GpuField, Palette, PlenOctree, Posterize, PropQuality, SolidOpacity,
};
use glam::DVec3;
use image::RgbaImage;
use plenoctree::{BakeSettings, Basis, bake, camera::PinholeCamera, reference};

use super::stage::{
    Stage,
    fields::{SOLID, colored, cube, included},
    pixels::{at, difference, differing, is_near, is_off},
    unlit,
};

const SIZE: u32 = 160;

/// One of the included props, which has everything that is hard: thin rails, gloss, and regions of one color.
fn drum() -> PlenOctree {
    included("drum")
}

/// Bakes what no preset was tuned to: a glossy ball with stripes and a checkered plate among rods that are hardly
/// thicker than a cell, in a ball of thin haze.
fn thicket() -> PlenOctree {
    // There are a million leaves.
    let settings = BakeSettings { depth: 7, basis: Basis::Sh9, directions: 16, ..default() };
    let rod = |at: DVec3| {
        let off = |x: f64| (x / 0.4 - (x / 0.4).round()).abs() * 0.4;
        let (x, y, z) = (off(at.x + 0.2 * at.z), off(at.y), off(at.z + 0.1 * at.x));
        x.hypot(y).min(y.hypot(z)).min(z.hypot(x)) < 0.014
    };
    let density = move |at: DVec3| {
        let is_plate = at.z.abs() < 0.03 && at.x.hypot(at.y) < 0.9;
        match at.length() {
            // Almost half of the box is outside.
            1.0.. => 0.0,
            radius if radius < 0.95 && (radius < 0.5 || is_plate || rod(at)) => 200.0,
            _ => 0.02,
        }
    };
    let tint = move |at: DVec3| {
        let base = if at.length() < 0.52 {
            if (9.0 * at.z).sin() > 0.0 { DVec3::new(0.8, 0.2, 0.15) } else { DVec3::new(0.95, 0.9, 0.8) }
        } else if at.z.abs() < 0.04 {
            if ((7.0 * at.x).floor() + (7.0 * at.y).floor()) % 2.0 == 0.0 {
                DVec3::splat(0.15)
            } else {
                DVec3::splat(0.7)
            }
        } else {
            DVec3::new(0.15, 0.35, 0.7)
        };
        let normal = at.normalize_or_zero();
        move |direction: DVec3| base + 0.12 * direction.dot(normal).min(0.0).powi(2)
    };
    bake(&settings, density, tint).unwrap()
}

/// Creates a stage with a prop before white, whose frames are `size` pixels wide and high.
fn stage(size: u32, field: &PlenOctree) -> Stage {
    let mut stage = Stage::of(size, field);
    stage.set_background(Color::WHITE);
    stage
}

fn capture(stage: &mut Stage, camera: &PinholeCamera, quality: PropQuality) -> RgbaImage {
    let field = stage.field();
    let up = stage.resource::<Assets<PlenOctree>>().get(&field).unwrap().up();
    stage.set(quality);
    stage.capture_from(camera, up)
}

fn psnr(frame: &RgbaImage, truth: &[DVec3]) -> f64 {
    20.0 * (255.0 / difference(frame, truth)).log10()
}

#[test]
fn presets_are_as_accurate_as_promised() {
    let colors =
        [[0.89; 3], [0.03, 0.5, 0.52], [0.5, 0.51, 0.55], [0.74, 0.13, 0.13], [0.09, 0.08, 0.1], [0.87, 0.63, 0.14]];
    check_promises("drum", &drum(), &Palette::new(colors.to_vec()).unwrap());
    let colors = [[0.8, 0.2, 0.15], [0.95, 0.9, 0.8], [0.15; 3], [0.7; 3], [0.15, 0.35, 0.7]];
    check_promises("thicket", &thicket(), &Palette::new(colors.to_vec()).unwrap());
}

fn check_promises(name: &str, field: &PlenOctree, palette: &Palette) {
    let colors: Vec<DVec3> = palette.colors.iter().map(|color| DVec3::from(*color)).collect();
    let hard = Posterize { softness: 0.0, edges: EdgeSmoothing::Off, ..Posterize::paper() };
    let settings = reference::Posterization { softness: 0.0, ..Default::default() };
    let mut broken = vec![];
    let mut stage = stage(SIZE, field);
    stage.paint(FieldPalette::new(palette.clone()));
    for size in [160, 400] {
        stage.headless.resize(UVec2::splat(size));
        let camera = PinholeCamera::around(field, size, size, 0.5, 0.4).unwrap();
        let truth = reference::render(field, &camera);
        let over = truth.over(DVec3::ONE);
        // With hard edges, the color of a pixel tells its label.
        let expected = reference::posterize(&truth, DVec3::ONE, palette, &colors, &settings);
        let is_owned = |opacity: f64| opacity >= 80.0 / 255.0;
        let owned = truth.opacity.iter().filter(|opacity| is_owned(**opacity)).count();
        for (preset, quality) in PropQuality::PRESETS {
            stage.undress::<Posterize>();
            let psnr = psnr(&capture(&mut stage, &camera, quality), &over);
            stage.dress(hard);
            let labels = capture(&mut stage, &camera, quality);
            let changed = labels.pixels().zip(&expected).zip(&truth.opacity);
            let changed =
                changed.filter(|((pixel, color), opacity)| is_owned(**opacity) && is_off(pixel, **color, 2.0));
            let changed = changed.count() as f64 / owned as f64;
            let (least, most) = promise(preset, size);
            let found = format!("{name}, {preset}, {size} pixels: {psnr:.1} dB, {:.1}% of labels", 100.0 * changed);
            println!("{found}");
            if psnr < least || changed > most {
                broken.push(found);
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
}

/// Returns the lowest PSNR in dB, and the largest share of labels that change, as documented for `PropQuality`.
fn promise(preset: &str, size: u32) -> (f64, f64) {
    match (preset, size) {
        ("exact", _) => (55.0, 0.01),
        ("high", _) => (45.0, 0.02),
        ("balanced", 400) => (38.0, 0.08),
        ("balanced", _) => (34.0, 0.1),
        ("fast", 400) => (33.0, 0.2),
        ("fast", _) => (29.0, 0.23),
        _ => panic!("nothing is promised of {preset}"),
    }
}

/// From far away, averaged cells look like a supersampled rendering of the field, more so than rays through the field
/// itself, which hit or miss details.
#[test]
fn averaged_cells_look_like_the_field_from_far_away() {
    let field = drum();
    let mut stage = stage(SIZE, &field);
    let far = |size: u32| {
        let near = PinholeCamera::around(&field, size, size, 0.5, 0.4).unwrap();
        PinholeCamera { focal_x: near.focal_x / 6.0, focal_y: near.focal_y / 6.0, ..near }
    };
    const FINE: u32 = 4;
    let fine = reference::render(&field, &far(FINE * SIZE)).over(DVec3::ONE);
    let truth: Vec<DVec3> = (0..SIZE * SIZE)
        .map(|pixel| {
            let (x, y) = (pixel % SIZE * FINE, pixel / SIZE * FINE);
            let taps = (0..FINE * FINE).map(|tap| fine[((y + tap / FINE) * FINE * SIZE + x + tap % FINE) as usize]);
            taps.sum::<DVec3>() / f64::from(FINE * FINE)
        })
        .collect();
    let leaves = psnr(&capture(&mut stage, &far(SIZE), PropQuality::EXACT), &truth);
    let coarse = PropQuality { cell_size: 1.0, ..PropQuality::EXACT };
    let averaged = psnr(&capture(&mut stage, &far(SIZE), coarse), &truth);
    assert!(averaged > leaves, "{averaged:.1} dB for averaged cells, {leaves:.1} dB for leaves");
}

/// Frames lose no more than the opacity that rays may lose, and fog of faint leaves is kept.
#[test]
fn dropping_faint_leaves_has_a_bounded_error() {
    let settings = BakeSettings { depth: 6, basis: Basis::Sh4, min_density: 0.0, directions: 8, ..default() };
    let haze = |at: DVec3| 0.1 * (1.5 - at.length()).max(0.01) + if at.length() < 0.6 { 90.0 } else { 0.0 };
    let fog = |at: DVec3| if at.length() < 0.9 { 0.4 } else { 0.0 };
    let tint = |at: DVec3| {
        let color = 0.5 + 0.5 * (5.0 * at).map(f64::sin);
        move |_: DVec3| color
    };
    let [haze, fog] = [bake(&settings, haze, tint).unwrap(), bake(&settings, fog, tint).unwrap()];
    let mut stage = stage(SIZE, &haze);
    for (field, loss, least) in [(&haze, 0.03, 30.5), (&fog, 0.03, 40.0)] {
        let camera = PinholeCamera::around(field, SIZE, SIZE, 0.5, 0.4).unwrap();
        let truth = reference::render(field, &camera).over(DVec3::ONE);
        stage.show(field);
        let all = capture(&mut stage, &camera, PropQuality::EXACT);
        let fewer = capture(&mut stage, &camera, PropQuality { opacity_loss: loss, ..PropQuality::EXACT });
        let psnr = psnr(&fewer, &truth);
        assert!(fewer != all && psnr >= least, "{psnr:.1} dB");
    }
}

/// Levels take additional memory, which is freed when no camera requests them anymore.
#[test]
fn levels_that_no_camera_requests_are_dropped() {
    let field = drum();
    let camera = PinholeCamera::around(&field, SIZE, SIZE, 0.5, 0.4).unwrap();
    let mut stage = stage(SIZE, &field);
    let bytes =
        |stage: &Stage| stage.render_world().resource::<RenderAssets<GpuField>>().get(&stage.field()).unwrap().bytes();
    capture(&mut stage, &camera, PropQuality::EXACT);
    let alone = bytes(&stage);
    capture(&mut stage, &camera, PropQuality { density_threshold: 1.0, cell_size: 5.0, ..PropQuality::EXACT });
    capture(&mut stage, &camera, PropQuality { opacity_loss: 0.01, ..PropQuality::EXACT });
    assert!(bytes(&stage) > alone + alone / 2);
    stage.camera_mut().is_active = false;
    stage.update(610);
    assert_eq!(bytes(&stage), alone);
}

/// Rays that never stop draw the same as rays that do, even if a prop becomes solid only where no light is left.
#[test]
fn rays_that_never_stop_end_in_a_solid_prop() {
    let solid = colored(3, |_| 1e6, |_| DVec3::new(0.2, 0.4, 0.6));
    let camera = PinholeCamera::around(&solid, SIZE, SIZE, 0.5, 0.4).unwrap();
    let mut stage = stage(SIZE, &solid);
    stage.dress(SolidOpacity::At(1.0));
    let stopped = capture(&mut stage, &camera, PropQuality::EXACT);
    let never = capture(&mut stage, &camera, PropQuality { stop_transmittance: 0.0, ..PropQuality::EXACT });
    assert_eq!(differing(&stopped, &never, 1), 0);
}

/// Beyond its range, every setting does what it does at the end of the range. NaN does what the default does.
#[test]
fn settings_beyond_their_range_count_as_its_ends() {
    let field = drum();
    let camera = PinholeCamera::around(&field, SIZE, SIZE, 0.5, 0.4).unwrap();
    let mut stage = stage(SIZE, &field);
    stage.paint(FieldPalette::new(Palette::new(vec![[0.9, 0.1, 0.1], [0.1, 0.1, 0.9]]).unwrap()));
    stage.dress(Posterize::default());
    let exact = capture(&mut stage, &camera, PropQuality::EXACT);
    let drawn = |frame: &RgbaImage| frame.pixels().filter(|pixel| pixel.0 != [255; 4]).count();
    assert!(drawn(&exact) > 4000, "{} pixels", drawn(&exact));
    type Set = fn(f32) -> PropQuality;
    // The ends of every range, and what is seen there: as much as by default, something else, or nothing.
    let settings: [(&str, Set, [f32; 2], [bool; 2]); 5] = [
        ("stop_transmittance", |x| PropQuality { stop_transmittance: x, ..default() }, [0.0, 1.0], [true, true]),
        ("density_threshold", |x| PropQuality { density_threshold: x, ..default() }, [0.0, f32::MAX], [true, false]),
        ("opacity_loss", |x| PropQuality { opacity_loss: x, ..default() }, [0.0, 1.0], [true, false]),
        ("cell_size", |x| PropQuality { cell_size: x, ..default() }, [0.0, f32::MAX], [true, true]),
        ("ray_tolerance", |x| PropQuality { ray_tolerance: x, ..default() }, [0.0, f32::MAX], [true, true]),
    ];
    for (name, set, ends, seen) in settings {
        assert!(capture(&mut stage, &camera, set(f32::NAN)) == exact, "{name}: NaN is not the default");
        for ((end, seen), beyond) in ends.into_iter().zip(seen).zip([[-1.0, f32::NEG_INFINITY], [1e38, f32::INFINITY]])
        {
            let at_end = capture(&mut stage, &camera, set(end));
            let share = drawn(&at_end) as f64 / drawn(&exact) as f64;
            assert!(if seen { (0.8..4.0).contains(&share) } else { share < 0.05 }, "{name} = {end}: {share}");
            for value in beyond {
                let frame = capture(&mut stage, &camera, set(value));
                assert!(frame == at_end, "{name}: {value} is not {end}");
            }
        }
    }
    let most = PropQuality { filter_iterations: u32::MAX, ..default() };
    assert!(capture(&mut stage, &camera, most) == exact, "the largest count is not the default");
}

/// A bar that is one pixel wide hides the prop behind it, also between the rays of the grid and if rays are parallel.
#[test]
fn narrow_meshes_hide_props_with_fewer_rays() {
    let size = 64;
    // The camera's distance from the bar, and the height of the view there.
    let (distance, parallel) = (4.0, 3.0);
    let perspective = PerspectiveProjection::default();
    let height = 2.0 * distance * (0.5 * perspective.fov).tan();
    let scaling_mode = ScalingMode::FixedVertical { viewport_height: parallel };
    let orthographic = OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() };
    for (name, projection, height) in [
        ("perspective", Projection::Perspective(perspective), height),
        ("parallel rays", Projection::Orthographic(orthographic), parallel),
    ] {
        let mut stage = Stage::with_meshes(size);
        stage.spawn_prop(&cube(SOLID, DVec3::new(0.8, 0.2, 0.1)), ());
        let wall = Transform::from_xyz(0.0, 0.0, -3.0);
        stage.spawn_mesh(Rectangle::new(40.0, 40.0), unlit(Color::srgb(0.2, 0.4, 0.9)), wall);
        let (green, pixel) = (Color::srgb(0.1, 0.7, 0.2), height / size as f32);
        // Rays of the grid go through even columns.
        let column = size / 2 + 3;
        let place = Transform::from_xyz(3.5 * pixel, 0.0, 1.0);
        stage.spawn_mesh(Rectangle::new(0.9 * pixel, 40.0), unlit(green), place);
        stage.set((projection, Transform::from_xyz(0.0, 0.0, 1.0 + distance)));
        stage.set(PropQuality::EXACT);
        let exact = stage.capture();
        assert!(is_near(at(&exact, column, size / 2), green, 1), "{name}");
        stage.set(PropQuality { ray_tolerance: 0.18, ..PropQuality::EXACT });
        assert_eq!(differing(&exact, &stage.capture(), 1), 0, "{name}");
    }
}

/// There is no ray of the grid beyond the last row and column of a view, so they are not interpolated.
#[test]
fn the_last_pixels_of_a_view_are_exact() {
    let color = |at: DVec3| DVec3::new(0.5, 0.5 + 0.3 * (40.0 * at.x).sin(), 0.5 + 0.3 * (40.0 * at.y).sin());
    let mut stage = Stage::of(64, &colored(7, |_| SOLID, color));
    stage.set((PropQuality::EXACT, Transform::from_xyz(0.0, 0.0, 2.2)));
    let exact = stage.capture();
    stage.set(PropQuality { ray_tolerance: 0.4, ..PropQuality::EXACT });
    let frame = stage.capture();
    assert!(differing(&exact, &frame, 8) > 200, "others are interpolated");
    for (x, y) in (0..64).flat_map(|index| [(63, index), (index, 63)]) {
        assert_eq!(at(&frame, x, y), at(&exact, x, y), "{x} {y}");
    }
}
