//! Fields of captures.

use glam::{DAffine3, DVec3, Quat, Vec3};
use plenoctree::{
    Basis, LoadSettings, PackSettings, Packed, PlenOctree, camera::PinholeCamera, reference::render, sampling::Progress,
};
use plenoctree_fit::splat::{Axis, Gaussian, Splats, SubjectSettings, VoxelSettings, Voxels, render_splats, voxelize};

/// A ball of colored Gaussians on its surface, some of which are thin, and a bar next to it.
fn ball(degree: u32) -> Splats {
    let mut splats = Splats::new(degree);
    for index in 0..6000 {
        let height = 1.0 - 2.0 * (index as f32 + 0.5) / 6000.0;
        let turn = 2.399_963 * index as f32;
        let level = (1.0 - height * height).sqrt();
        let outward = Vec3::new(level * turn.cos(), level * turn.sin(), height);
        let color = Vec3::new(0.5 + 0.4 * outward.x.signum(), 0.5 + 0.3 * outward.y.signum(), 0.3);
        let mut coefficients = vec![Vec3::ZERO; (degree as usize + 1).pow(2)];
        coefficients[0] = (color - 0.5) / 0.282_094_8;
        if degree > 0 {
            // Brighter from above.
            coefficients[2] = Vec3::splat(-0.15);
        }
        let gaussian = Gaussian {
            position: outward,
            scale: Vec3::new(0.03, 0.03, 0.004),
            rotation: Quat::from_rotation_arc(Vec3::Z, outward),
            opacity: 0.9,
        };
        splats.push(gaussian, &coefficients);
    }
    splats
}

fn cameras(size: u32) -> Vec<PinholeCamera> {
    let from = [DVec3::new(3.0, -1.0, 1.5), DVec3::new(-2.0, 3.0, -0.5), DVec3::new(0.3, 0.2, 4.0)];
    from.map(|from| {
        PinholeCamera::new(size, size, 0.8, glam::DMat4::IDENTITY).looking_at(from, DVec3::new(0.1, 0.0, 0.0), DVec3::Y)
    })
    .into()
}

/// Mean PSNR of the field's views, over a background.
fn psnr(field: &PlenOctree, splats: &Splats, background: DVec3) -> f64 {
    let [found] = psnrs(field, splats, [background]);
    found
}

/// Mean PSNR of the field's views, over each background.
fn psnrs<const N: usize>(field: &PlenOctree, splats: &Splats, backgrounds: [DVec3; N]) -> [f64; N] {
    // About a pixel for each cell.
    let cameras = cameras(160);
    let views: Vec<_> = cameras.iter().map(|camera| (render_splats(splats, camera), render(field, camera))).collect();
    backgrounds.map(|background| {
        let of_views = views.iter().map(|(splat, field)| {
            let (splat, field) = (splat.over(background), field.over(background));
            let squared: f64 = splat.iter().zip(&field).map(|(a, b)| a.distance_squared(*b)).sum();
            -10.0 * (squared / (3.0 * splat.len() as f64)).log10()
        });
        of_views.sum::<f64>() / views.len() as f64
    })
}

/// Views of the field are like those of the capture, over any background, also where color depends on direction.
#[test]
fn fields_look_like_their_captures() {
    for (degree, leaves) in [(0, 1_000_000), (1, 1_000_000), (3, 100_000)] {
        let splats = ball(degree);
        let field = voxelize(&splats, &VoxelSettings { depth: 7, leaves, ..Default::default() }).unwrap();
        let expected = [Basis::Sh1, Basis::Sh4, Basis::Sh9, Basis::Sh9][degree as usize];
        // Degree 3 is cut to 2.
        assert_eq!(field.basis(), expected);
        let found = psnrs(&field, &splats, [DVec3::ONE, DVec3::ZERO]);
        assert!(found.iter().all(|psnr| *psnr > 24.0), "degree {degree} over white and black: {found:?}");
    }
}

/// Rays through the center of a Gaussian see its opacity, from every side: that of a large one as it is, and on average
/// most of that of one that is smaller than a cell.
#[test]
fn opacities_are_kept() {
    let bounds = Some((DVec3::NEG_ONE, DVec3::ONE));
    for (scale, opacity, tolerance) in [(0.15, 0.3, 0.05), (0.15, 0.95, 0.05), (0.01, 0.8, 0.4), (0.002, 0.5, 0.55)] {
        let (mut sum, mut count) = (0.0, 0.0);
        for index in 0..6 {
            let at = |step: f32| 0.1 * (step * index as f32).sin();
            let position = Vec3::new(at(1.1), at(2.3), at(3.7));
            let mut splats = Splats::new(0);
            let gaussian = Gaussian { position, scale: Vec3::splat(scale), rotation: Quat::IDENTITY, opacity };
            splats.push(gaussian, &[Vec3::ZERO]);
            let field = voxelize(&splats, &VoxelSettings { depth: 6, bounds, ..Default::default() }).unwrap();
            for camera in cameras(1) {
                let direction = (position.as_dvec3() - camera.position).normalize();
                sum += field.render_ray(camera.position, direction).1;
                count += 1.0;
            }
        }
        let (found, expected) = (sum / count, f64::from(opacity));
        assert!((found / expected - 1.0).abs() < tolerance, "{scale} {opacity}: {found}");
    }
}

/// Gaussians of an antialiased capture that are smaller than a cell cover about as much in all as they do in the
/// capture: the total of the optical depths over a plane. Others cover as much more as they grow.
#[test]
fn antialiased_gaussians_keep_what_they_cover() {
    let bounds = Some((DVec3::NEG_ONE, DVec3::ONE));
    let (scale, opacity) = (0.012f64, 0.6f64);
    let mut splats = Splats::new(0);
    let gaussian =
        Gaussian { position: Vec3::ZERO, scale: Vec3::splat(scale as f32), rotation: Quat::IDENTITY, opacity: 0.6 };
    splats.push(gaussian, &[Vec3::ZERO]);
    // The integral of -ln(1 - a exp(-r^2 / 2 s^2)) over the plane.
    let series: f64 = (1..200).map(|k| opacity.powi(k) / f64::from(k).powi(2)).sum();
    let expected = std::f64::consts::TAU * scale * scale * series;
    let total = |splats: &Splats| {
        let field = voxelize(splats, &VoxelSettings { depth: 6, bounds, ..Default::default() }).unwrap();
        let lines = (-60..60).flat_map(|y| (-60..60).map(move |x| (f64::from(x), f64::from(y))));
        let step = 0.005;
        let depth = |(x, y): (f64, f64)| {
            let from = DVec3::new(step * (x + 0.5), step * (y + 0.5), 3.0);
            -(1.0 - field.render_ray(from, DVec3::NEG_Z).1).ln()
        };
        step * step * lines.map(depth).sum::<f64>()
    };
    let classic = total(&splats);
    splats.set_antialiased(true);
    let found = total(&splats);
    assert!((found / expected - 1.0).abs() < 0.25, "{found} {expected}");
    assert!(classic > 1.7 * expected, "{classic} {expected}");
}

/// Gaussians as large as the capture, all at one place, become a field of at most as many leaves as asked for: one
/// cell after another, each of them would take hours.
#[test]
fn piles_of_wide_gaussians_become_fields() {
    let mut splats = Splats::new(0);
    for index in 0..4000 {
        let color = Vec3::splat((0.1 * index as f32).sin());
        let gaussian =
            Gaussian { position: Vec3::ZERO, scale: Vec3::splat(0.1), rotation: Quat::IDENTITY, opacity: 0.5 };
        splats.push(gaussian, &[color]);
    }
    let field = voxelize(&splats, &VoxelSettings { leaves: 100_000, ..Default::default() }).unwrap();
    assert!((1000..=100_000).contains(&field.leaves()), "{}", field.leaves());
    let (_, opacity) = field.render_ray(DVec3::new(3.0, 0.0, 0.0), DVec3::NEG_X);
    assert!(opacity > 0.99, "{opacity}");
}

/// Captures that are no props become fields, or errors that say why.
#[test]
fn strange_captures_become_fields_or_errors() {
    let capture = |count: usize, gaussian: &dyn Fn(f32) -> Gaussian| {
        let mut splats = Splats::new(0);
        (0..count).for_each(|index| splats.push(gaussian(index as f32), &[Vec3::splat(0.3)]));
        splats
    };
    let turn = |at: f32| Vec3::new(at.sin(), (1.7 * at).sin(), (2.9 * at).cos());
    let round = |position: Vec3, scale: f32, opacity: f32| Gaussian {
        position,
        scale: Vec3::splat(scale),
        rotation: Quat::IDENTITY,
        opacity,
    };
    let huge = capture(300, &|at| round(turn(at), 1e3, 0.9));
    let point = capture(300, &|_| round(Vec3::ONE, 0.0, 0.9));
    let room = capture(6000, &|at| {
        let wall = turn(at);
        round(3.0 * wall / wall.abs().max_element(), 0.08, 0.8)
    });
    for splats in [huge, point, room] {
        let settings = VoxelSettings { depth: 7, leaves: 300_000, ..Default::default() };
        let field = voxelize(&splats, &settings).unwrap();
        assert!(field.leaves() > 0 && field.depth() <= 7, "{} at {}", field.leaves(), field.depth());
        let (low, high) = field.bounds().unwrap();
        let from = high + 2.0 * (high - low);
        let (_, opacity) = field.render_ray(from, (0.5 * (low + high) - from).normalize());
        assert!(opacity > 0.3, "{opacity}");
    }
    let faint = capture(300, &|at| round(turn(at), 0.1, 1e-3));
    let error = voxelize(&faint, &VoxelSettings::default()).unwrap_err().to_string();
    assert!(error.contains("nothing is left of the capture"), "{error}");
}

/// A ball, one half of which has one color, while the other is striped.
fn striped_ball() -> Splats {
    let ball = ball(0);
    let mut striped = Splats::new(0);
    for gaussian in ball.gaussians() {
        let Vec3 { x, z, .. } = gaussian.position;
        let light = x < 0.0 || (40.0 * z).sin() > 0.0;
        striped.push(*gaussian, &[Vec3::splat(if light { 1.2 } else { -1.2 })]);
    }
    striped
}

/// Leaves are smaller where there are stripes, none are inside, and a limit of their number costs quality.
#[test]
fn leaves_are_where_the_detail_is() {
    let splats = striped_ball();
    let settings = VoxelSettings { depth: 8, leaves: 200_000, ..Default::default() };
    let voxels = Voxels::new(&splats, &settings).unwrap();
    let fields = [40_000, 200_000].map(|leaves| {
        let field = voxels.field(leaves).unwrap();
        assert!(field.leaves() <= leaves, "{} of {leaves}", field.leaves());
        field
    });
    let [few, many] = [&fields[0], &fields[1]].map(|field| psnr(field, &splats, DVec3::ONE));
    assert!(few > 20.0 && many > few + 0.5, "{few} {many}");
    let (mut fine, mut all) = ([0.0; 2], [0.0; 2]);
    let field = &fields[0];
    let cells = f64::from(1u32 << field.depth());
    for cell in field.leaf_cells() {
        let center = field.frame().to_world((cell.corner.as_dvec3() + 0.5 * f64::from(cell.size)) / cells);
        assert!(center.length() > 0.85, "{center}");
        let side = usize::from(center.x > 0.0);
        all[side] += f64::from(cell.size.pow(2));
        fine[side] += if cell.size == 1 { 1.0 } else { 0.0 };
    }
    let [flat, striped] = [fine[0] / all[0], fine[1] / all[1]];
    assert!(striped > 1.2 * flat, "{striped} {flat}");
}

/// What is hidden by a closed surface, a few cells thick, is left out.
#[test]
fn hidden_cells_are_left_out() {
    let inside = Gaussian { position: Vec3::ZERO, scale: Vec3::splat(0.1), rotation: Quat::IDENTITY, opacity: 0.9 };
    let bounds = Some((DVec3::splat(-1.2), DVec3::splat(1.2)));
    let inner = |shell: bool| {
        let mut splats = Splats::new(0);
        splats.push(inside, &[Vec3::ONE]);
        for gaussian in ball(0).gaussians().iter().filter(|_| shell) {
            splats.push(Gaussian { scale: Vec3::splat(0.06), opacity: 0.99, ..*gaussian }, &[Vec3::ZERO]);
        }
        let field =
            voxelize(&splats, &VoxelSettings { depth: 7, leaves: 1_000_000, bounds, ..Default::default() }).unwrap();
        let cells = f64::from(1u32 << field.depth());
        let center = |corner: glam::UVec3| field.frame().to_world((corner.as_dvec3() + 0.5) / cells);
        field.leaf_cells().filter(|cell| center(cell.corner).length() < 0.4).count()
    };
    assert!(inner(false) > 10);
    assert_eq!(inner(true), 0);
}

/// A box that is only one or two finest cells thin is not empty.
#[test]
fn boxes_may_be_thin() {
    let mut splats = Splats::new(0);
    let gaussian = Gaussian { position: Vec3::ZERO, scale: Vec3::splat(0.1), rotation: Quat::IDENTITY, opacity: 0.9 };
    splats.push(gaussian, &[Vec3::ONE]);
    for thickness in [0.01, 0.014, 0.03] {
        let half = DVec3::new(0.5, 0.5, 0.5 * thickness);
        let field =
            voxelize(&splats, &VoxelSettings { depth: 6, bounds: Some((-half, half)), ..Default::default() }).unwrap();
        let (_, opacity) = field.render_ray(DVec3::new(0.0, 2.0, 0.0), DVec3::NEG_Y);
        assert!(opacity > 0.5, "{thickness}: {opacity}");
    }
}

/// Simple captures have few leaves, however many there may be.
#[test]
fn simple_captures_have_few_leaves() {
    let mut splats = Splats::new(0);
    let gaussian = Gaussian { position: Vec3::ZERO, scale: Vec3::splat(0.3), rotation: Quat::IDENTITY, opacity: 0.9 };
    splats.push(gaussian, &[Vec3::ONE]);
    let settings = VoxelSettings { depth: 7, leaves: 3_000_000, ..Default::default() };
    let field = voxelize(&splats, &settings).unwrap();
    assert!(field.leaves() < 100_000, "{}", field.leaves());
    let found = psnr(&field, &splats, DVec3::ONE);
    assert!(found > 35.0, "{found}");
}

/// Files, levels of detail, packing and ray casts take leaves of many sizes.
#[test]
fn leaves_of_many_sizes_pass_through_everything() {
    let splats = striped_ball();
    let field = voxelize(&splats, &VoxelSettings { depth: 8, leaves: 40_000, ..Default::default() }).unwrap();
    let sizes = |field: &PlenOctree| field.leaf_cells().map(|cell| cell.size).collect::<Vec<_>>();
    assert!((0..3).all(|level| sizes(&field).contains(&(1 << level))));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    field.write(&path).unwrap();
    let settings = LoadSettings { density_threshold: 0.0, ..Default::default() };
    let read = PlenOctree::read(&path, &settings).unwrap();
    assert!(read.leaf_cells().eq(field.leaf_cells()) && read.coefficients() == field.coefficients());
    // Files store half floats.
    assert!(read.densities().iter().zip(field.densities().iter()).all(|(a, b)| (a / b - 1.0).abs() < 1e-3));

    let near = |other: &PlenOctree, least: f64| {
        for camera in cameras(60) {
            let [a, b] = [&field, other].map(|field| render(field, &camera).over(DVec3::ONE));
            let squared: f64 = a.iter().zip(&b).map(|(a, b)| a.distance_squared(*b)).sum();
            let psnr = -10.0 * (squared / (3.0 * a.len() as f64)).log10();
            assert!(psnr > least, "{psnr}");
        }
    };
    let coarser = field.coarser(1).unwrap();
    assert!(coarser.leaves() <= field.leaves(), "{} of {}", coarser.leaves(), field.leaves());
    assert_eq!(coarser.depth() + 1, field.depth());
    near(&coarser, 20.0);
    let packed = Packed::new(&field, &PackSettings::default(), &Progress::default()).unwrap();
    assert!(packed.field().leaves() > field.leaves() / 2);
    near(packed.field(), 25.0);

    for camera in cameras(1) {
        let direction = -camera.position.normalize();
        let hit = field.cast_ray(camera.position, direction).unwrap();
        assert!((hit.distance - (camera.position.length() - 1.0)).abs() < 0.05, "{}", hit.distance);
    }
}

/// The field is the same on any number of threads, and the capture's coordinates are those of the field.
#[test]
fn fields_do_not_depend_on_threads() {
    let splats = ball(0).transformed(DAffine3::from_translation(DVec3::new(5.0, 6.0, 7.0)));
    let middle = DVec3::new(5.0, 6.0, 7.0);
    let views = [DVec3::X, DVec3::NEG_Y, DVec3::new(0.2, 1.0, -1.5)].map(|from| {
        PinholeCamera::new(50, 40, 0.8, glam::DMat4::IDENTITY).looking_at(middle + 2.5 * from, middle, DVec3::Z)
    });
    let settings = VoxelSettings { depth: 7, leaves: 1_000_000, ..Default::default() };
    let fields = [vec![], views.to_vec()].map(|views| {
        let settings = VoxelSettings { views, ..settings.clone() };
        let fields = [1, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| voxelize(&splats, &settings).unwrap())
        });
        assert_eq!(fields[0].densities(), fields[1].densities());
        assert!(fields[0].coefficients() == fields[1].coefficients() && fields[0].nodes() == fields[1].nodes());
        let [field, _] = fields;
        field
    });
    assert_ne!(fields[0].densities(), fields[1].densities());
    let (low, high) = fields[0].dense_bounds().unwrap();
    assert!((0.5 * (low + high) - DVec3::new(5.0, 6.0, 7.0)).length() < 0.05, "{low} {high}");
    assert!((high - low - 2.0).abs().max_element() < 0.2, "{low} {high}");
}

/// Thin disks have their opacity for the cameras that see them, whatever it is for others. Views without pixels, and
/// those that see nothing, change nothing.
#[test]
fn disks_have_their_opacity_for_those_who_see_them() {
    let mut splats = Splats::new(0);
    let scale = Vec3::new(0.3, 0.3, 1e-3);
    let disk = Gaussian { position: Vec3::ZERO, scale, rotation: Quat::IDENTITY, opacity: 0.6 };
    splats.push(disk, &[Vec3::splat(0.5)]);
    let bounds = Some((DVec3::splat(-1.0), DVec3::splat(1.0)));
    let view = |size: u32, from: DVec3| {
        PinholeCamera::new(size, size, 0.8, glam::DMat4::IDENTITY).looking_at(from, DVec3::ZERO, DVec3::Y)
    };
    let field = |views: Vec<PinholeCamera>| {
        voxelize(&splats, &VoxelSettings { depth: 7, bounds, views, ..Default::default() }).unwrap()
    };
    let opacity = |field: &PlenOctree, from: DVec3| field.render_ray(from, -from.normalize()).1;
    let (front, edge) = (DVec3::new(0.01, 0.01, 3.0), DVec3::new(3.0, 0.01, 0.01));
    let usual = field(Vec::new());
    assert!(opacity(&usual, front) < 0.5, "{}", opacity(&usual, front));
    for from in [front, -front] {
        let seen = field(vec![view(60, from)]);
        // Merged cells let as much light through as their parts on average over the axes.
        assert!((0.55..0.62).contains(&opacity(&seen, front)), "{}", opacity(&seen, front));
        assert!((0.55..0.62).contains(&opacity(&seen, -front)));
    }
    let seen = field(vec![view(300, edge)]);
    assert!(opacity(&seen, edge) < 0.8 && opacity(&usual, edge) > 0.9, "{}", opacity(&seen, edge));
    let away = PinholeCamera { rotation: view(60, -front).rotation, ..view(60, front) };
    let blind = field(vec![view(0, front), away]);
    assert_eq!(blind.densities(), usual.densities());
}

/// Cropping keeps what is inside the box; the largest part is the ball without floaters, and the box excludes a distant
/// shell of background.
#[test]
fn floaters_and_backgrounds_are_left_out() {
    let ball = ball(0);
    let mut splats = ball.clone();
    for index in 0..300 {
        let at = index as f32;
        let direction = Vec3::new(at.sin(), (1.7 * at).sin(), (2.9 * at).cos()).normalize_or_zero();
        let distance = if index % 3 == 0 { 2.0 } else { 60.0 };
        let gaussian = Gaussian {
            position: distance * direction,
            scale: Vec3::splat(0.05),
            rotation: Quat::IDENTITY,
            opacity: 0.9,
        };
        splats.push(gaussian, &[Vec3::ONE]);
    }
    let (low, high) = splats.dense_bounds().unwrap();
    assert!(low.min_element() > -2.2 && high.max_element() < 2.2, "{low} {high}");
    let inside = splats.cropped(low, high);
    assert!((6050..6150).contains(&inside.len()), "{}", inside.len());
    let largest = inside.largest_part(low, high);
    assert!(largest == ball, "{} of {}", largest.len(), ball.len());
    let (low, high) = (DVec3::splat(-2.0), DVec3::new(2.0, 2.0, 0.0));
    let field = voxelize(&ball, &VoxelSettings { depth: 6, bounds: Some((low, high)), ..Default::default() }).unwrap();
    assert!(field.bounds().unwrap().1.z < 1e-6);
}

/// Nothing is connected in haze, so that all of it is the largest part.
#[test]
fn haze_is_kept_with_keep_largest() {
    let mut haze = Splats::new(0);
    for gaussian in ball(0).gaussians().iter().step_by(10) {
        haze.push(Gaussian { opacity: 0.02, ..*gaussian }, &[Vec3::ONE]);
    }
    let settings = SubjectSettings { keep_largest: true, ..Default::default() };
    let kept = haze.clone().subject(&settings).unwrap().splats;
    assert_eq!(kept, haze.subject(&SubjectSettings::default()).unwrap().splats);
    assert!(voxelize(&kept, &VoxelSettings { depth: 6, ..Default::default() }).unwrap().leaves() > 0);
}

/// All that is visible in a box that was chosen is converted, also what is far from most Gaussians.
#[test]
fn what_is_in_the_chosen_box_is_kept() {
    let mut splats = ball(0);
    for x in [9.0, 12.0] {
        let far = Gaussian { position: Vec3::new(x, 0.0, 0.0), ..splats.gaussians()[0] };
        splats.push(far, &[Vec3::ZERO]);
    }
    let crop = Some((DVec3::splat(-10.0), DVec3::splat(10.0)));
    for up in [None, Some(Axis::NegativeY)] {
        let settings = SubjectSettings { crop, up, ..Default::default() };
        let subject = splats.clone().subject(&settings).unwrap();
        assert_eq!(subject.splats.len(), splats.len() - 1);
        assert!((9.0..=10.0).contains(&subject.high.x) && (1.0..1.3).contains(&subject.high.y), "{}", subject.high);
        let (low, high) =
            splats.clone().subject(&SubjectSettings { up, ..Default::default() }).map(|s| (s.low, s.high)).unwrap();
        assert!((low.x + high.x).abs() < 0.1 && high.x < 1.3, "{low} {high}");
    }
}

/// Settings out of range and boxes without anything are errors.
#[test]
fn impossible_settings_are_errors() {
    let splats = ball(0);
    let error = |settings: VoxelSettings| voxelize(&splats, &settings).unwrap_err().to_string();
    assert!(error(VoxelSettings { depth: 11, ..Default::default() }).contains("6 to 10"));
    let bounds = Some((DVec3::splat(5.0), DVec3::splat(6.0)));
    assert!(error(VoxelSettings { depth: 6, bounds, ..Default::default() }).contains("nothing is left of the capture"));
    assert!(error(VoxelSettings { blur: 0.05, ..Default::default() }).contains("0.1 to 0.5 cells"));
    assert!(error(VoxelSettings { blur: f64::NAN, ..Default::default() }).contains("0.1 to 0.5 cells"));
    assert!(error(VoxelSettings { leaves: 1, ..Default::default() }).contains("32768 to 20000000"));
    let bounds = Some((DVec3::ONE, DVec3::ZERO));
    assert!(error(VoxelSettings { depth: 6, bounds, ..Default::default() }).contains("a lowest and a highest corner"));
}

/// Captures of one Gaussian or two become fields that show all of them: the box contains more than their centers.
#[test]
fn few_gaussians_are_shown() {
    for count in [1, 2] {
        let mut splats = Splats::new(0);
        for index in 0..count {
            let position = Vec3::new(0.1, 0.4 * index as f32, 0.0);
            let scale = Vec3::new(0.3, 0.2, 0.1);
            let gaussian = Gaussian { position, scale, rotation: Quat::IDENTITY, opacity: 0.9 };
            splats.push(gaussian, &[Vec3::new(1.0, -0.5, 0.2)]);
        }
        let (low, high) = splats.dense_bounds().unwrap();
        assert!(low.x < -0.4 && high.x > 0.6 && high.y > 0.3 + 0.4 * f64::from(count - 1), "{low} {high}");
        let field = voxelize(&splats, &VoxelSettings { depth: 6, ..Default::default() }).unwrap();
        let found = psnr(&field, &splats, DVec3::ONE);
        assert!(found > 30.0, "{count}: {found}");
    }
}

/// Rays meet as many Gaussians of a pile as there are, and hardly any of a ball. With one of a few Gaussians, they meet so
/// much less of a pile, which looks the same but for its rim.
#[test]
fn thinned_piles_look_alike() {
    let mut pile = Splats::new(0);
    let gaussian = Gaussian { position: Vec3::ONE, scale: Vec3::splat(0.2), rotation: Quat::IDENTITY, opacity: 0.9 };
    (0..1000).for_each(|_| pile.push(gaussian, &[Vec3::new(1.0, -0.5, 0.2)]));
    let (low, high) = pile.dense_bounds().unwrap();
    assert!((900.0..=1000.0).contains(&pile.overlap(low, high)), "{}", pile.overlap(low, high));
    let thinned = pile.thinned(3);
    assert_eq!(thinned.len(), 334);
    assert!((3.0 * thinned.overlap(low, high) / pile.overlap(low, high) - 1.0).abs() < 0.01);
    let camera = PinholeCamera::new(64, 64, 0.8, glam::DMat4::IDENTITY);
    let camera = camera.looking_at(DVec3::new(3.0, 0.0, 2.0), DVec3::ONE, DVec3::Y);
    let [all, few] = [&pile, &thinned].map(|splats| render_splats(splats, &camera).over(DVec3::ONE));
    let squared: f64 = all.iter().zip(&few).map(|(a, b)| a.distance_squared(*b)).sum();
    // 30 dB.
    assert!(squared / (3.0 * 64.0 * 64.0) < 1e-3, "{squared}");
    let ball = ball(0);
    let (low, high) = ball.dense_bounds().unwrap();
    assert!((3.0..60.0).contains(&ball.overlap(low, high)), "{}", ball.overlap(low, high));
}

/// Haze of small cells is not left out: a wide Gaussian looks the same at every depth.
#[test]
fn wide_gaussians_are_whole_at_every_depth() {
    let bounds = Some((DVec3::splat(-1.0), DVec3::splat(1.0)));
    // At depth 9, half as wide a Gaussian has an eighth of the cells. With half of the optical depth, they are as thin.
    for (depth, scale, opacity) in [(6, 0.3, 0.9), (8, 0.3, 0.9), (9, 0.15, 0.68)] {
        let mut splats = Splats::new(0);
        let scale = Vec3::splat(scale);
        let gaussian = Gaussian { position: Vec3::ZERO, scale, rotation: Quat::IDENTITY, opacity };
        splats.push(gaussian, &[Vec3::new(0.5, 0.0, -0.5)]);
        let field = voxelize(&splats, &VoxelSettings { depth, leaves: 200_000, bounds, ..Default::default() }).unwrap();
        let found = psnr(&field, &splats, DVec3::ONE);
        assert!(found > 45.0, "{depth}: {found:.1} dB, {} leaves", field.leaves());
    }
}

/// Files are read with all leaves that are written, in whatever unit the capture is.
#[test]
fn files_keep_every_leaf() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.npz");
    for (depth, unit) in [(6, 0.01), (7, 0.01), (6, 1.0), (6, 10.0), (7, 1000.0)] {
        let mut splats = Splats::new(0);
        for (scale, opacity) in [(0.3, 0.2), (0.05, 0.9)] {
            let scale = Vec3::splat(scale * unit as f32);
            let gaussian = Gaussian { position: Vec3::ZERO, scale, rotation: Quat::IDENTITY, opacity };
            splats.push(gaussian, &[Vec3::splat(0.5)]);
        }
        let bounds = Some((DVec3::splat(-unit), DVec3::splat(unit)));
        let field = voxelize(&splats, &VoxelSettings { depth, leaves: 200_000, bounds, ..Default::default() }).unwrap();
        field.write(&path).unwrap();
        let read = PlenOctree::read(&path, &LoadSettings::default()).unwrap();
        assert_eq!(read.leaves(), field.leaves(), "depth {depth}, {unit} units");
    }
}
