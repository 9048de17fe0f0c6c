//! Fits fields to pictures of a known field.

mod inputs;
mod leaves;
mod refine;
mod scene;

use std::{path::PathBuf, time::Duration};

use glam::{DMat3, DVec3};
use plenoctree::{Basis, Densities, PlenOctree, camera::PinholeCamera};
use plenoctree_fit::{FitInput, FitProgress, FitSettings, Fitted, InputFolders, fit};
use scene::{cameras, folder, write_pictures, write_transforms};

/// A few seconds of work.
fn quick() -> FitSettings {
    FitSettings { depth: Some(6), effort: 0.08, basis: Basis::Sh4, ..FitSettings::default() }
}

/// Returns a folder with pictures with opacity, and their cameras.
fn photographed(test: &str, count: usize) -> PathBuf {
    let (folder, cameras) = (folder(test), cameras(count));
    write_pictures(&folder, &cameras, None, |_| 1.0);
    write_transforms(&folder, &cameras);
    folder
}

fn fit_folder(path: &std::path::Path, settings: &FitSettings) -> Fitted {
    let input = FitInput::read(path, &InputFolders::default()).unwrap();
    fit(&input, None, settings, &FitProgress::default()).unwrap()
}

fn parts(field: &PlenOctree) -> (&Densities, Vec<u16>) {
    (field.densities(), field.coefficients().iter().map(|k| k.to_bits()).collect())
}

/// Pictures with opacity give a field that matches held-out views, in the cameras' frame, and is the same on any number
/// of threads.
#[test]
fn pictures_with_opacity_are_fitted() {
    let folder = photographed("opacity", 32);
    let Fitted { field, report, .. } = fit_folder(&folder, &quick());
    let held_out = report.held_out.as_ref().unwrap();
    assert_eq!((held_out.views.len(), report.views), (4, 28));
    assert!(held_out.psnr_db > 23.5, "{held_out:?}");
    assert!(report.suspicious.is_empty(), "{:?}", report.suspicious);
    let (low, high) = field.dense_bounds().unwrap();
    assert!((low - DVec3::new(-0.6, -0.6, -0.8)).abs().max_element() < 0.15, "{low}");
    assert!((high - DVec3::new(0.8, 0.6, 0.8)).abs().max_element() < 0.15, "{high}");
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit_folder(&folder, &FitSettings { effort: 0.02, ..quick() }).field)
    });
    assert_eq!(parts(&one), parts(&three));
}

/// The unit of lengths does not matter: pictures give the same result in meters and in millimeters.
#[test]
fn units_do_not_matter() {
    let folder = folder("units");
    let views = cameras(24);
    write_pictures(&folder, &views, None, |_| 1.0);
    let [meters, millimeters] = [1.0, 1000.0].map(|unit| {
        let in_unit = |camera: &PinholeCamera| PinholeCamera { position: unit * camera.position, ..*camera };
        write_transforms(&folder, &views.iter().map(in_unit).collect::<Vec<_>>());
        let fitted = fit_folder(&folder, &FitSettings { effort: 0.04, ..quick() });
        (fitted.report.held_out.unwrap().psnr_db, fitted.field.leaves() as f64)
    });
    assert!((meters.0 - millimeters.0).abs() < 0.3, "{meters:?} {millimeters:?}");
    assert!((meters.1 / millimeters.1 - 1.0).abs() < 0.05, "{meters:?} {millimeters:?}");
}

/// Opaque pictures with different exposures: the background and the exposures are learned, and the field is the object.
/// A transparent pixel in one of them does not matter.
#[test]
fn opaque_pictures_are_fitted() {
    let folder = folder("opaque");
    let cameras = cameras(32);
    let gain = |index: usize| if index % 2 == 1 { 0.8 } else { 1.0 };
    write_pictures(&folder, &cameras, Some(|_, _| DVec3::new(0.7, 0.75, 0.8)), gain);
    let mut odd = image::open(folder.join("v_5.png")).unwrap().into_rgba8();
    odd.get_pixel_mut(3, 3)[3] = 200;
    odd.save(folder.join("v_5.png")).unwrap();
    write_transforms(&folder, &cameras);
    let settings = FitSettings { depth: Some(7), effort: 0.08, ..quick() };
    let fitted = fit_folder(&folder, &settings);
    let held_out = fitted.report.held_out.unwrap();
    assert!(held_out.aligned_psnr_db > 22.0, "{held_out:?}");
    let gains = fitted.report.gains.unwrap();
    // Views 0, 8, 16 and 24 are held out: of seven in a row, those at odd places are brighter.
    let (dark, bright) = (gains[0][1], gains[1][1]);
    assert!((dark / bright - 0.8).abs() < 0.05, "{dark} {bright}");
}

/// Writes the pictures with noise in their left quarter, transparent if they have opacity, and frames that all name one
/// mask, which is black there.
fn photographed_with_mask(test: &str, background: Option<scene::Background>) -> PathBuf {
    let (folder, cameras) = (folder(test), cameras(32));
    write_pictures(&folder, &cameras, background, |_| 1.0);
    write_transforms(&folder, &cameras);
    for index in 0..cameras.len() as u32 {
        let path = folder.join(format!("v_{index}.png"));
        let mut picture = image::open(&path).unwrap().into_rgba8();
        for (x, y, pixel) in picture.enumerate_pixels_mut().filter(|(x, ..)| *x < 10) {
            let noise = ((7 * x + 13 * y + 29 * index) % 256) as u8;
            let opacity = if background.is_some() { 255 } else { 0 };
            *pixel = image::Rgba([noise, 255 - noise, index as u8, opacity]);
        }
        picture.save(path).unwrap();
    }
    let mask = image::GrayImage::from_fn(40, 40, |x, _| image::Luma([if x < 10 { 0 } else { 255 }]));
    mask.save(folder.join("mask.png")).unwrap();
    let file = folder.join("transforms.json");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace(r#"{"file_path""#, r#"{"mask_path":"mask.png","file_path""#)).unwrap();
    folder
}

/// What is black in a mask that all frames share is not known: neither its color nor that it is empty.
#[test]
fn shared_masks_hide_what_is_not_known() {
    let folder = photographed_with_mask("shared_mask", None);
    let fitted = fit_folder(&folder, &quick());
    let held_out = fitted.report.held_out.unwrap();
    assert!(held_out.psnr_db > 23.0, "{held_out:?}");
    assert!(fitted.report.suspicious.is_empty(), "{:?}", fitted.report.suspicious);
    let (low, high) = fitted.field.dense_bounds().unwrap();
    assert!((low - DVec3::new(-0.6, -0.6, -0.8)).abs().max_element() < 0.15, "{low}");
    assert!((high - DVec3::new(0.8, 0.6, 0.8)).abs().max_element() < 0.15, "{high}");
    // What is hidden is black in the previews.
    let preview = &fitted.previews[0];
    assert_eq!([preview.photographed[5], preview.rendered[5]], [[0; 3]; 2]);

    // The mask does not make photographs know their opacity.
    let folder = photographed_with_mask("shared_mask_opaque", Some(|_, _| DVec3::new(0.7, 0.75, 0.8)));
    let report = fit_folder(&folder, &FitSettings { effort: 0.05, ..quick() }).report;
    assert!(report.gains.is_some());
    assert!(report.held_out.as_ref().unwrap().aligned_psnr_db > 20.0, "{:?}", report.held_out);
}

/// Exposures are learned, even if there are more pixels than rays.
#[test]
fn exposures_of_large_pictures_are_learned() {
    let folder = folder("large");
    let cameras: Vec<_> = cameras(32).iter().map(|camera| camera.resized(130, 130)).collect();
    let gain = |index: usize| if index % 2 == 1 { 0.8 } else { 1.0 };
    write_pictures(&folder, &cameras, Some(|_, _| DVec3::new(0.7, 0.75, 0.8)), gain);
    write_transforms(&folder, &cameras);
    let gains = fit_folder(&folder, &FitSettings { effort: 0.1, ..quick() }).report.gains.unwrap();
    let ratio = gains[0][1] / gains[1][1];
    assert!((ratio - 0.8).abs() < 0.08, "{ratio}");
}

/// Pictures of which only some fit in memory at a time give a field that is about as good: each stage looks at all of
/// them. Nor does it end because those in memory do not show the object.
#[test]
fn pictures_may_exceed_the_memory() {
    let folder = photographed("memory", 32);
    let large = 240;
    for index in 0..32 {
        let path = folder.join(format!("v_{index}.png"));
        let picture = image::open(&path).unwrap();
        picture.resize_exact(large, large, image::imageops::FilterType::Triangle).save(path).unwrap();
    }
    let mut views = cameras(32);
    views[29].rotation *= DMat3::from_rotation_y(3.0);
    write_transforms(&folder, &views);
    let input = FitInput::read(&folder, &InputFolders::default()).unwrap();
    // There are more tiles in four pictures than a stage trains on.
    let [all, four, one] = [32, 4, 1].map(|pictures| {
        let picture_memory = pictures * 4 * u64::from(large).pow(2);
        let settings = FitSettings { effort: 0.02, picture_memory, ..quick() };
        fit(&input, None, &settings, &FitProgress::default()).unwrap().report.held_out.unwrap().psnr_db
    });
    assert!(four > all - 0.5 && one > all - 1.0, "{all} {four} {one}");
}

/// What is behind the object on a tiled table that reaches beyond the cameras.
fn table(origin: DVec3, direction: DVec3) -> DVec3 {
    let at = origin + direction * ((-0.9 - origin.z) / direction.z);
    if direction.z >= 0.0 || at.length() > 12.0 {
        return DVec3::new(0.6, 0.7, 0.9);
    }
    let tile = (1.5 * at).floor();
    DVec3::new(0.5, 0.4, 0.3) + 0.3 * (tile.x + tile.y).rem_euclid(2.0)
}

/// On a table that reaches beyond the cameras, few rays of any of them end before the object.
#[test]
fn no_clouds_hang_in_front_of_lenses() {
    let folder = folder("table");
    let cameras: Vec<_> = cameras(64).into_iter().filter(|camera| camera.position.z > 0.4).collect();
    write_pictures(&folder, &cameras, Some(table), |_| 1.0);
    write_transforms(&folder, &cameras);
    let fitted = fit_folder(&folder, &quick());
    let step = f64::from(scene::SIZE) / 8.0;
    let rays = |camera: &PinholeCamera| {
        let place = |index: u32| step * (f64::from(index) + 0.5);
        std::array::from_fn::<_, 64, _>(|index| camera.ray(place(index as u32 % 8), place(index as u32 / 8)))
    };
    let mut all = 0;
    for camera in &cameras {
        let hits = rays(camera).into_iter().filter_map(|(origin, direction)| fitted.field.cast_ray(origin, direction));
        let distances: Vec<f64> = hits.map(|hit| hit.distance).collect();
        // The cameras are 4 units from the object, which reaches to 1.1 units from its middle.
        let near = distances.iter().filter(|distance| **distance < 2.7).count();
        assert!(8 * near <= distances.len(), "{near} of {} hits", distances.len());
        all += distances.len();
    }
    assert!(all > 500, "{all}");
}

/// Views with wrong poses are reported by their numbers, and only those: another pose, one that is off by a fraction of
/// the object, and one that looks away. They do not carve the object away.
#[test]
fn wrong_poses_are_reported() {
    let folder = folder("wrong_pose");
    let mut cameras = cameras(32);
    write_pictures(&folder, &cameras, None, |_| 1.0);
    let elsewhere = scene::cameras(60)[57];
    (cameras[11].rotation, cameras[11].position) = (elsewhere.rotation, elsewhere.position);
    cameras[18].position += DVec3::new(0.4, -0.4, 0.4);
    cameras[29].rotation *= DMat3::from_rotation_y(3.0);
    write_transforms(&folder, &cameras);
    let fitted = fit_folder(&folder, &FitSettings { effort: 0.12, ..quick() });
    let numbers: Vec<usize> = fitted.report.suspicious.iter().map(|view| view.number).collect();
    assert_eq!(numbers, [11, 18, 29], "{:?}", fitted.report.suspicious);
    assert_eq!(fitted.report.suspicious[0].name, "./v_11");
    assert_eq!(fitted.report.suspicious[2].psnr_db, None);
    let held_out = fitted.report.held_out.unwrap();
    assert!(held_out.psnr_db > 22.0, "{held_out:?}");
}

/// Photographs show so much else that even wrong poses are matched to some degree. They are reported anyway, by their
/// numbers, and only those.
#[test]
fn wrong_poses_of_photographs_are_reported() {
    let folder = folder("wrong_photographs");
    let mut cameras: Vec<_> = cameras(64).into_iter().filter(|camera| camera.position.z > 0.4).collect();
    cameras.iter_mut().for_each(|camera| *camera = camera.resized(80, 80));
    write_pictures(&folder, &cameras, Some(table), |_| 1.0);
    cameras.swap(10, 21);
    write_transforms(&folder, &cameras);
    let fitted = fit_folder(&folder, &FitSettings { depth: Some(7), effort: 0.05, ..quick() });
    let numbers: Vec<usize> = fitted.report.suspicious.iter().map(|view| view.number).collect();
    assert_eq!(numbers, [10, 21], "{:?}", fitted.report.suspicious);
}

/// Returns the result of a fit that is stopped soon after training began.
fn stopped(input: &FitInput, settings: &FitSettings) -> Fitted {
    let progress = FitProgress::default();
    std::thread::scope(|scope| {
        let worker = scope.spawn(|| fit(input, None, settings, &progress));
        while progress.status().fraction < 0.001 && !worker.is_finished() {
            std::thread::sleep(Duration::from_millis(5));
        }
        progress.stop();
        worker.join().unwrap().unwrap()
    })
}

/// A fit that is stopped returns its current result.
#[test]
fn a_stopped_fit_returns_a_field() {
    let folder = photographed("stopped", 16);
    let input = FitInput::read(&folder, &InputFolders::default()).unwrap();
    let checkpoint = folder.join("checkpoint");
    let settings = FitSettings { effort: 20.0, checkpoint: Some(checkpoint.clone()), ..quick() };
    let fitted = stopped(&input, &settings);
    assert!(fitted.report.stopped && fitted.report.stages.len() == 1 && fitted.field.leaves() > 100);

    // It resumes where it stopped, and finishes.
    let trained = fitted.report.stages[0].million_rays;
    let settings = FitSettings { effort: trained / 4.0 + 0.02, resume: true, ..settings };
    let others = FitSettings { basis: Basis::Sh9, ..settings.clone() };
    let error = fit(&input, None, &others, &FitProgress::default()).unwrap_err().to_string();
    assert!(error.contains("checkpoint") && error.contains("other settings"), "{error}");
    let resumed = fit(&input, None, &settings, &FitProgress::default()).unwrap();
    assert!(!resumed.report.stopped && resumed.report.stages[0].million_rays > trained + 0.07);

    // It can be resumed again, at its end, in case that the field could not be saved.
    let again = fit(&input, None, &settings, &FitProgress::default()).unwrap();
    assert!(again.report.stages.is_empty() && parts(&again.field) == parts(&resumed.field));
    let bytes = std::fs::read(&checkpoint).unwrap();
    std::fs::write(&checkpoint, &bytes[..bytes.len() / 2]).unwrap();
    let error = fit(&input, None, &settings, &FitProgress::default()).unwrap_err().to_string();
    assert!(error.contains("checkpoint: checkpoint: found a file that is cut off"), "{error}");
}

/// A state that cannot be saved does not cost the result.
#[test]
fn a_stopped_fit_without_a_checkpoint_returns_a_field() {
    let folder = photographed("unsaved", 16);
    let input = FitInput::read(&folder, &InputFolders::default()).unwrap();
    let settings = FitSettings { effort: 20.0, checkpoint: Some(folder.join("none/checkpoint")), ..quick() };
    let fitted = stopped(&input, &settings);
    assert!(fitted.field.leaves() > 100);
    assert!(fitted.report.unsaved.unwrap().contains("none/checkpoint"));
}

/// However little time there is, something is trained: the coarsest stage, and no other.
#[test]
fn short_fits_train_the_coarsest_stage() {
    let folder = photographed("short", 32);
    for depth in [6, 8] {
        let settings = FitSettings { depth: Some(depth), time: Some(Duration::from_millis(1)), ..quick() };
        let stages = fit_folder(&folder, &settings).report.stages;
        let trained: Vec<_> = stages.iter().map(|stage| (stage.resolution, stage.million_rays > 0.0)).collect();
        assert_eq!(trained, [(64, true)], "depth {depth}");
    }
}

/// A held-out picture that cannot be read is found before training. If it is damaged while training, nothing of that is
/// lost: the fit resumes behind it.
#[test]
fn damaged_pictures_do_not_cost_what_was_trained() {
    let folder = photographed("held_out", 32);
    let input = FitInput::read(&folder, &InputFolders::default()).unwrap();
    let checkpoint = folder.join("checkpoint");
    let short = FitSettings { effort: 0.05, ..quick() };
    let settings = FitSettings { hold_out: Some(2), checkpoint: Some(checkpoint.clone()), resume: true, ..short };
    let picture = folder.join("v_2.png");
    let intact = std::fs::read(&picture).unwrap();

    std::fs::write(&picture, &intact[..intact.len() / 2]).unwrap();
    let progress = FitProgress::default();
    let error = fit(&input, None, &settings, &progress).unwrap_err().to_string();
    assert!(error.contains("v_2.png") && progress.status().stage == "reading", "{error}");

    std::fs::write(&picture, &intact).unwrap();
    let progress = FitProgress::default();
    let failed = std::thread::scope(|scope| {
        let worker = scope.spawn(|| fit(&input, None, &settings, &progress));
        while progress.status().fraction == 0.0 && !worker.is_finished() {
            std::thread::sleep(Duration::from_millis(1));
        }
        std::fs::write(&picture, &intact[..intact.len() / 2]).unwrap();
        worker.join().unwrap()
    });
    let error = failed.unwrap_err().to_string();
    assert!(error.contains("v_2.png") && checkpoint.exists(), "{error}");

    std::fs::write(&picture, &intact).unwrap();
    let fitted = fit(&input, None, &settings, &FitProgress::default()).unwrap();
    assert!(fitted.report.stages.is_empty() && fitted.report.held_out.unwrap().psnr_db > 20.0);
}

/// A field of tilted cameras stands upright on the origin, and the report has the transform.
#[test]
fn fields_stand_on_the_origin() {
    let folder = folder("stand");
    let upright = cameras(32);
    write_pictures(&folder, &upright, None, |_| 1.0);
    let tilt = DMat3::from_rotation_x(0.8);
    let mut tilted = upright;
    for camera in &mut tilted {
        camera.rotation = tilt * camera.rotation;
        camera.position = tilt * camera.position + DVec3::new(5.0, 6.0, 7.0);
    }
    write_transforms(&folder, &tilted);
    let fitted = fit_folder(&folder, &FitSettings { stand: true, keep_largest: true, effort: 0.06, ..quick() });
    let (low, high) = fitted.field.dense_bounds().unwrap();
    assert!(low.z.abs() < 1e-6 && (low + high).truncate().length() < 1e-6, "{low} {high}");
    assert!((high.z - 1.6).abs() < 0.3, "the post is 1.6 high: {high}");
    let [x, y, z, _] = fitted.report.from_input.unwrap();
    let middle = [5.0, 6.0, 7.0, 1.0];
    let height: f64 = z.iter().zip(middle).map(|(a, b)| a * b).sum();
    assert!((height - 0.8).abs() < 0.15, "{height}");
    assert!(x.iter().chain(&y).all(|value| value.is_finite()));
}

/// Boxes are in the frame of the cameras, also if the field is turned upright.
#[test]
fn boxes_turn_with_the_field() {
    let folder = folder("turned_boxes");
    let turn = DMat3::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let mut cameras = cameras(24);
    write_pictures(&folder, &cameras, None, |_| 1.0);
    for camera in &mut cameras {
        camera.rotation = turn * camera.rotation;
        camera.position = turn * camera.position + DVec3::new(5.0, 6.0, 7.0);
    }
    write_transforms(&folder, &cameras);
    // The upper half of the post: up is -y here.
    let post = Some((DVec3::new(5.5, 5.0, 6.8), DVec3::new(6.0, 6.0, 7.2)));
    let short = FitSettings { effort: 0.03, ..quick() };
    for settings in [FitSettings { crop: post, ..short.clone() }, FitSettings { bounds: post, ..short }] {
        let standing = fit_folder(&folder, &FitSettings { stand: true, ..settings.clone() });
        let (low, high) = standing.field.dense_bounds().unwrap();
        // The edge of the ball is in the box, too.
        let expected = DVec3::new(0.35, 0.4, 0.85);
        assert!((high - low - expected).abs().max_element() < 0.15, "{low} {high}");
        let (low, high) = fit_folder(&folder, &settings).field.bounds().unwrap();
        assert!(low.x > 5.4 && low.y > 4.9 && high.x < 6.1 && high.y < 6.1, "{low} {high}");
    }
}

/// Cropping keeps what is inside the box; the largest part is the ball with the post or a piece of it. Held-out views
/// are compared before that. Few pictures are in memory at a time.
#[test]
fn fields_are_cut() {
    let folder = photographed("cut", 24);
    let crop = (DVec3::new(-1.0, -1.0, 0.0), DVec3::ONE);
    let settings = FitSettings { crop: Some(crop), keep_largest: true, picture_memory: 5 * 4 * 40 * 40, ..quick() };
    let fitted = fit_folder(&folder, &settings);
    let (low, _) = fitted.field.bounds().unwrap();
    assert!(low.z > -0.1, "{low}");
    // The pictures show what was cut away.
    let held_out = fitted.report.held_out.unwrap();
    assert!(held_out.psnr_db > 22.0, "{held_out:?}");
    // A box without any of it is found before training.
    let input = FitInput::read(&folder, &InputFolders::default()).unwrap();
    let settings = FitSettings { crop: Some((DVec3::splat(50.0), DVec3::splat(51.0))), ..quick() };
    let error = fit(&input, None, &settings, &FitProgress::default()).unwrap_err().to_string();
    assert!(error.starts_with("crop: found [50, 50, 50] to [51, 51, 51], expected "), "{error}");
}
