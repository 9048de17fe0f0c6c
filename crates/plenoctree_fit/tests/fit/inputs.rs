//! Reads inputs, good and bad.

use std::fs;

use glam::{DVec2, DVec3};
use plenoctree_fit::{Distortion, FitInput, FitProgress, FitSettings, InputFolders, Picture, View, fit};

use crate::{
    photographed,
    scene::{SIZE, cameras, folder, write_colmap_binary, write_colmap_text, write_pictures, write_transforms},
};

fn read(path: &std::path::Path) -> Result<FitInput, String> {
    FitInput::read(path, &InputFolders::default()).map_err(|error| error.to_string())
}

/// A COLMAP model, as text or binary, gives the same cameras as a transforms.json file.
#[test]
fn colmap_models_have_the_same_cameras() {
    let expected = cameras(5);
    let focal = expected[0].focal_x;
    let rational = [focal, focal, 20.0, 20.0, 0.1, 0.2, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06];
    let models: [(u32, &str, Vec<f64>, Distortion); 9] = [
        (0, "SIMPLE_PINHOLE", vec![focal, 20.0, 20.0], Distortion::None),
        (1, "PINHOLE", vec![focal, focal, 20.0, 20.0], Distortion::None),
        (2, "SIMPLE_RADIAL", vec![focal, 20.0, 20.0, 0.1], radial([0.1, 0.0], [0.0; 2])),
        (3, "RADIAL", vec![focal, 20.0, 20.0, 0.1, 0.2], radial([0.1, 0.2], [0.0; 2])),
        (4, "OPENCV", vec![focal, focal, 20.0, 20.0, 0.1, 0.2, 0.01, 0.02], radial([0.1, 0.2], [0.01, 0.02])),
        (
            5,
            "OPENCV_FISHEYE",
            vec![focal, focal, 20.0, 20.0, 0.1, 0.2, 0.01, 0.02],
            Distortion::Fisheye([0.1, 0.2, 0.01, 0.02]),
        ),
        (
            6,
            "FULL_OPENCV",
            rational.into(),
            Distortion::Radial { radial: [0.1, 0.2, 0.03, 0.0], divisor: [0.04, 0.05, 0.06], tangential: [0.01, 0.02] },
        ),
        (14, "SIMPLE_FISHEYE", vec![focal, 20.0, 20.0], Distortion::Fisheye([0.0; 4])),
        (15, "FISHEYE", vec![focal, focal, 20.0, 20.0], Distortion::Fisheye([0.0; 4])),
    ];
    for (number, name, parameters, distortion) in models {
        let folder = folder(&format!("colmap_{name}"));
        write_pictures(&folder.join("images"), &expected, None, |_| 1.0);
        write_colmap_binary(&folder, &expected, number, &parameters);
        let binary = read(&folder).unwrap();
        fs::remove_dir_all(folder.join("sparse")).unwrap();
        let words: Vec<String> = parameters.iter().map(f64::to_string).collect();
        write_colmap_text(&folder, &expected, &format!("1 {name} {SIZE} {SIZE} {}", words.join(" ")));
        let text = read(&folder).unwrap();
        for input in [binary, text] {
            assert_eq!(input.points, [DVec3::new(0.1, 0.2, 0.3)]);
            assert_eq!(input.views.len(), 5);
            for (view, expected) in input.views.iter().zip(&expected) {
                assert_eq!(view.camera.lens.distortion, distortion);
                assert!(view.camera.position.distance(expected.position) < 1e-9);
                if distortion == Distortion::None {
                    let (_, direction) = expected.ray(3.5, 30.5);
                    assert!(view.camera.direction(DVec2::new(3.5, 30.5)).distance(direction) < 1e-9, "{name}");
                }
            }
        }
    }
}

fn radial([k1, k2]: [f64; 2], tangential: [f64; 2]) -> Distortion {
    Distortion::Radial { radial: [k1, k2, 0.0, 0.0], divisor: [0.0; 3], tangential }
}

/// Pictures that are scaled copies of those whose cameras were found have the same rays, and a note says so.
#[test]
fn scaled_pictures_have_the_same_rays() {
    let folder = folder("scaled");
    let cameras = cameras(3);
    write_pictures(&folder.join("images"), &cameras, None, |_| 1.0);
    let same_rays = |path: &std::path::Path| {
        let input = read(path).unwrap();
        assert_eq!(
            input.notes.iter().filter(|note| note.contains("to 40x40 from 120x120")).count(),
            1,
            "{:?}",
            input.notes
        );
        for (view, camera) in input.views.iter().zip(&cameras) {
            let lens = view.camera.lens;
            assert_eq!(lens.distortion, radial([0.1, 0.0], [0.0; 2]));
            assert!((lens.focal - DVec2::splat(50.0)).length() < 1e-9, "{lens:?}");
            assert!((lens.center - DVec2::new(19.0, 21.0)).length() < 1e-9, "{lens:?}");
            assert!(view.camera.position.distance(camera.position) < 1e-9);
        }
    };
    write_colmap_text(&folder, &cameras, "1 OPENCV 120 120 150 150 57 63 0.1 0 0 0");
    same_rays(&folder);
    fs::create_dir_all(folder.join("transforms")).unwrap();
    write_transforms(&folder.join("transforms"), &cameras);
    let file = folder.join("transforms/transforms.json");
    let text = fs::read_to_string(&file).unwrap().replace("./v_", "../images/v_");
    let lens = r#"{"w": 120, "h": 120, "fl_x": 150, "cx": 57, "cy": 63, "k1": 0.1,"#;
    fs::write(&file, text.replace("camera_angle_x", "angle").replacen('{', lens, 1)).unwrap();
    same_rays(&file);
}

/// Frames may have their own intrinsics, as nerfstudio writes them.
#[test]
fn frames_have_their_own_lenses() {
    let folder = folder("own_lenses");
    write_pictures(&folder, &cameras(2), None, |_| 1.0);
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]";
    let json = format!(
        r#"{{"fl_x": 50, "w": 40, "h": 40, "k1": 0.1, "frames": [
            {{"file_path": "v_0.png", "transform_matrix": {pose}}},
            {{"file_path": "v_1.png", "camera_angle_x": 1.2, "cx": 19, "k1": 0, "transform_matrix": {pose}}}]}}"#
    );
    fs::write(folder.join("transforms.json"), json).unwrap();
    let views = read(&folder).unwrap().views;
    assert_eq!(views[0].camera.lens.focal, DVec2::splat(50.0));
    assert_eq!(views[0].camera.lens.distortion, radial([0.1, 0.0], [0.0; 2]));
    assert!((views[1].camera.lens.focal.x - 20.0 / 0.6f64.tan()).abs() < 1e-9);
    assert_eq!(views[1].camera.lens.center, DVec2::new(19.0, 20.0));
    assert_eq!(views[1].camera.lens.distortion, Distortion::None);
}

/// Masks make what they leave out transparent, and pictures are averaged with premultiplied colors.
#[test]
fn masks_and_downscaling_keep_colors() {
    let folder = folder("masks");
    let picture = image::RgbImage::from_fn(4, 2, |x, _| image::Rgb(if x % 2 == 0 { [200, 100, 50] } else { [0; 3] }));
    picture.save(folder.join("a.png")).unwrap();
    let mask = image::GrayImage::from_fn(4, 2, |x, _| image::Luma([if x % 2 == 0 { 255 } else { 0 }]));
    mask.save(folder.join("mask.png")).unwrap();
    let half = Picture::read(&folder.join("a.png"), Some(&folder.join("mask.png")), 2).unwrap();
    assert_eq!((half.width, half.height, half.knows_opacity), (2, 1, true));
    assert_eq!(half.pixels, [[100, 50, 25, 128]; 2]);
}

/// Masks that differ from frame to frame show the object, unlike in nerfstudio, and a note says so. Those of a folder
/// replace them, even if they are gone.
#[test]
fn masks_of_single_frames_are_noted() {
    let folder = folder("own_masks");
    write_pictures(&folder, &cameras(3), None, |_| 1.0);
    write_transforms(&folder, &cameras(3));
    let mask = image::GrayImage::from_pixel(SIZE, SIZE, image::Luma([255]));
    (0..2).for_each(|index| mask.save(folder.join(format!("mask_{index}.png"))).unwrap());
    let file = folder.join("transforms.json");
    let mut json: serde_json::Value = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    (0..2).for_each(|index| json["frames"][index]["mask_path"] = format!("mask_{index}.png").into());
    fs::write(&file, json.to_string()).unwrap();
    let input = read(&folder).unwrap();
    assert!(input.views[0].mask.is_some() && input.views.iter().all(|view| view.ignored.is_none()));
    assert_eq!(input.notes.len(), 1);
    assert!(input.notes[0].starts_with("2 of 3 frames have masks of their own"), "{:?}", input.notes);

    fs::remove_file(folder.join("mask_0.png")).unwrap();
    let masks = folder.join("masks");
    fs::create_dir_all(&masks).unwrap();
    (0..3).for_each(|index| mask.save(masks.join(format!("v_{index}.png"))).unwrap());
    let input = FitInput::read(&folder, &InputFolders { masks: Some(masks.clone()), ..Default::default() }).unwrap();
    assert!(input.views.iter().all(|view| view.mask.as_ref().unwrap().starts_with(&masks)) && input.notes.is_empty());
}

/// Masks may consist of zeros and ones, be an opacity, and be in the same folders as their pictures.
#[test]
fn masks_of_other_programs_are_read() {
    let folder = folder("other_masks");
    let picture = image::RgbImage::from_pixel(2, 1, image::Rgb([200, 100, 50]));
    fs::create_dir_all(folder.join("images")).unwrap();
    picture.save(folder.join("images/a.png")).unwrap();
    let masked = |name: &str, mask: image::DynamicImage| {
        mask.save(folder.join(name)).unwrap();
        Picture::read(&folder.join("images/a.png"), Some(&folder.join(name)), 1).unwrap().pixels
    };
    let expected = [[200, 100, 50, 255], [0; 4]];
    assert_eq!(masked("ones.png", image::GrayImage::from_raw(2, 1, vec![1, 0]).unwrap().into()), expected);
    let cutout = image::RgbaImage::from_raw(2, 1, vec![9, 9, 9, 255, 200, 200, 200, 0]).unwrap();
    assert_eq!(masked("cutout.png", cutout.into()), expected);

    // Two cameras with pictures of the same name.
    let cameras = cameras(2);
    let mask = image::GrayImage::from_pixel(SIZE, SIZE, image::Luma([255]));
    for side in ["left", "right"] {
        write_pictures(&folder.join("images").join(side), &cameras[..1], None, |_| 1.0);
        fs::create_dir_all(folder.join("masks").join(side)).unwrap();
        mask.save(folder.join("masks").join(side).join("v_0.png.png")).unwrap();
    }
    write_colmap_text(&folder, &cameras, "1 SIMPLE_PINHOLE 40 40 50 20 20");
    let images = folder.join("sparse/0/images.txt");
    let text = fs::read_to_string(&images).unwrap();
    fs::write(&images, text.replace("v_0.png", "left/v_0.png").replace("v_1.png", "right/v_0.png")).unwrap();
    let folders = InputFolders { masks: Some(folder.join("masks")), ..InputFolders::default() };
    let views = FitInput::read(&folder, &folders).unwrap().views;
    for (view, side) in views.iter().zip(["left", "right"]) {
        assert_eq!(view.mask, Some(folder.join("masks").join(side).join("v_0.png.png")));
    }
}

/// COLMAP itself accepts quaternions of any length and blank lines. Other programs write models without points, or
/// without the lines of the points of images.
#[test]
fn unusual_colmap_models_are_read() {
    let expected = cameras(3);
    let folder = folder("unusual_colmap");
    write_pictures(&folder.join("images"), &expected, None, |_| 1.0);
    write_colmap_text(&folder, &expected, "1 SIMPLE_PINHOLE 40 40 50 20 20");
    let model = folder.join("sparse/0");
    let text = fs::read_to_string(model.join("images.txt")).unwrap();
    let doubled = text.lines().map(|line| {
        let words: Vec<&str> = line.split(' ').collect();
        if words.len() < 10 {
            return line.to_string();
        }
        let quaternion: Vec<String> =
            words[1..5].iter().map(|word| (2.0 * word.parse::<f64>().unwrap()).to_string()).collect();
        format!("{} {} {}", words[0], quaternion.join(" "), words[5..].join(" "))
    });
    fs::write(model.join("images.txt"), format!("\n{}\n", doubled.collect::<Vec<_>>().join("\n"))).unwrap();
    fs::remove_file(model.join("points3D.txt")).unwrap();
    let input = read(&folder).unwrap();
    assert!(input.points.is_empty() && input.views.len() == 3);
    for (view, expected) in input.views.iter().zip(&expected) {
        assert!(view.camera.position.distance(expected.position) < 1e-9);
    }
    let images = text.lines().filter(|line| line.split(' ').count() >= 10).collect::<Vec<_>>().join("\n");
    fs::write(model.join("images.txt"), &images).unwrap();
    assert_eq!(read(&folder).unwrap().views.len(), 3);
    (0..3).for_each(|view| {
        let [from, to] = [format!("v_{view}.png"), view.to_string()].map(|name| folder.join("images").join(name));
        fs::copy(from, to).unwrap();
    });
    fs::write(model.join("images.txt"), images.replace("v_", "").replace(".png", "")).unwrap();
    assert_eq!(read(&folder).unwrap().views.len(), 3);
    fs::write(model.join("images.txt"), "1 0 0 0 0 0 0 4 1 v_0.png\n\n").unwrap();
    assert!(read(&folder).unwrap_err().contains("quaternion"));
}

/// Names of pictures from other systems and other places, and files that start with a byte order mark.
#[test]
fn moved_pictures_are_found() {
    let cameras = cameras(3);
    let folder = folder("moved");
    write_pictures(&folder.join("train"), &cameras, None, |_| 1.0);
    write_transforms(&folder, &cameras);
    let good = fs::read_to_string(folder.join("transforms.json")).unwrap();
    let pictures = InputFolders { pictures: Some(folder.join("train")), ..InputFolders::default() };
    for (prefix, folders) in [
        ("./train/", InputFolders::default()),
        (r".\\train\\", InputFolders::default()),
        ("/home/someone/scene/train/", InputFolders::default()),
        (r"C:\\scene\\train\\", InputFolders::default()),
        ("./train/", pictures.clone()),
        ("./", pictures),
    ] {
        let json = format!("\u{feff}{}", good.replace("./v_", &format!("{prefix}v_")));
        fs::write(folder.join("transforms.json"), json).unwrap();
        let views = FitInput::read(&folder, &folders).unwrap().views;
        assert_eq!(
            fs::canonicalize(&views[2].picture).unwrap(),
            fs::canonicalize(folder.join("train/v_2.png")).unwrap()
        );
    }
    fs::write(folder.join("transforms.json"), good.replace("./v_", "./test/v_")).unwrap();
    assert!(read(&folder).unwrap_err().contains("frames[0].file_path"));
    // A focal length in pixels is for one size.
    let json = good.replace("./v_", "./train/v_").replace(r#""camera_angle_x":0.6"#, r#""fl_x":60"#);
    assert!(json.contains("fl_x"));
    fs::write(folder.join("transforms.json"), json).unwrap();
    assert_eq!(read(&folder).unwrap().views.len(), 3);
    image::RgbImage::new(20, 20).save(folder.join("train/v_1.png")).unwrap();
    let message = read(&folder).unwrap_err();
    assert!(message.contains("v_1.png") && message.contains("20x20") && message.contains("40x40"), "{message}");
}

/// Names in COLMAP models may be from other systems and other places, too.
#[test]
fn moved_pictures_of_colmap_are_found() {
    let cameras = cameras(3);
    let folder = folder("moved_colmap");
    write_pictures(&folder.join("images/train"), &cameras, None, |_| 1.0);
    write_colmap_text(&folder, &cameras, "1 SIMPLE_PINHOLE 40 40 50 20 20");
    let images = folder.join("sparse/0/images.txt");
    let text = fs::read_to_string(&images).unwrap();
    for prefix in [r"train\", "/home/someone/scene/images/train/"] {
        fs::write(&images, text.replace("v_", &format!("{prefix}v_"))).unwrap();
        let views = read(&folder).unwrap().views;
        let expected = fs::canonicalize(folder.join("images/train/v_2.png")).unwrap();
        assert_eq!(fs::canonicalize(&views[2].picture).unwrap(), expected, "{prefix}");
    }
}

/// A picture that is listed twice with the same pose counts once. With another pose, there is no telling which one is
/// right.
#[test]
fn views_that_are_listed_twice_count_once() {
    let cameras = cameras(4);
    let folder = folder("twice");
    write_pictures(&folder, &cameras, None, |_| 1.0);
    write_transforms(&folder, &[&cameras[..], &cameras[..3]].concat());
    let file = folder.join("transforms.json");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, text.replace("v_4", "v_0.png").replace("v_5", "v_1").replace("v_6", "v_3")).unwrap();
    let input = read(&folder).unwrap();
    let names: Vec<_> = input.views.iter().map(|view| &view.name[..]).collect();
    assert_eq!(names, ["./v_0", "./v_1", "./v_2", "./v_3", "./v_3"]);
    assert!(input.notes[0].starts_with("2 of 7 pictures are left out: they are listed twice"), "{:?}", input.notes);
}

/// Of several COLMAP models, the one with the most pictures counts, and the others are named.
#[test]
fn the_largest_colmap_model_counts() {
    let cameras = cameras(6);
    let folder = folder("several_models");
    write_pictures(&folder.join("images"), &cameras, None, |_| 1.0);
    let model = |name: &str, count: usize| {
        let made = crate::scene::folder(&format!("several_models_{count}"));
        let into = folder.join("sparse").join(name);
        fs::create_dir_all(&into).unwrap();
        let from = if name == "2" {
            write_colmap_binary(&made, &cameras[..count], 0, &[50.0, 20.0, 20.0]);
            made.join("sparse")
        } else {
            write_colmap_text(&made, &cameras[..count], "1 SIMPLE_PINHOLE 40 40 50 20 20");
            made.join("sparse/0")
        };
        for file in fs::read_dir(from).unwrap() {
            let file = file.unwrap();
            fs::copy(file.path(), into.join(file.file_name())).unwrap();
        }
    };
    model("1", 3);
    let input = read(&folder).unwrap();
    assert_eq!((input.views.len(), input.notes.len()), (3, 0));
    model("0", 2);
    model("10", 4);
    let input = read(&folder).unwrap();
    assert_eq!((input.views.len(), input.notes.len()), (4, 1));
    assert!(
        input.notes[0].contains("0 (2 pictures)") && input.notes[0].contains("1 (3 pictures)"),
        "{:?}",
        input.notes
    );
    model("2", 5);
    assert_eq!(read(&folder).unwrap().views.len(), 5);
}

/// COLMAP's pictures may be missing, too, also the first ones, as long as there are others.
#[test]
fn missing_pictures_of_colmap_are_left_out() {
    let cameras = cameras(4);
    let folder = folder("missing_colmap");
    write_pictures(&folder.join("images"), &cameras, None, |_| 1.0);
    write_colmap_text(&folder, &cameras, "1 SIMPLE_PINHOLE 40 40 50 20 20");
    let whole = read(&folder).unwrap();
    assert!(whole.missing.is_empty());
    fs::remove_file(folder.join("images/v_0.png")).unwrap();
    fs::remove_file(folder.join("images/v_2.png")).unwrap();
    let part = read(&folder).unwrap();
    let names: Vec<_> = part.missing.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["v_0.png", "v_2.png"]);
    assert_eq!(part.views.iter().map(|view| &view.name).collect::<Vec<_>>(), ["v_1.png", "v_3.png"]);
    assert_eq!(part.views[0].camera.position, whole.views[1].camera.position);
    let folders = InputFolders { pictures: Some(folder.join("sparse")), ..InputFolders::default() };
    let message = FitInput::read(&folder, &folders).unwrap_err().to_string();
    assert!(message.contains("no file") && message.contains("v_0.png"), "{message}");
}

/// nerfstudio names a cloud of points, which may be text or binary, and of any type.
#[test]
fn points_of_nerfstudio_are_read() {
    let cameras = cameras(3);
    let folder = folder("cloud");
    write_pictures(&folder, &cameras, None, |_| 1.0);
    write_transforms(&folder, &cameras);
    let good = fs::read_to_string(folder.join("transforms.json")).unwrap();
    let named = good.replacen('{', r#"{"ply_file_path": "clouds\\points.ply","#, 1);
    fs::write(folder.join("transforms.json"), named).unwrap();
    let input = read(&folder).unwrap();
    assert!(input.points.is_empty() && input.notes[0].contains("points.ply"), "{:?}", input.notes);

    fs::create_dir_all(folder.join("clouds")).unwrap();
    let cloud = folder.join("clouds/points.ply");
    let points = [DVec3::new(0.25, -1.5, 3.0), DVec3::new(-2.0, 0.125, 0.5)];
    let header = |format: &str, kind: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty uint8 red\nproperty {kind} x\nproperty {kind} y\n\
             property {kind} z\nend_header\n"
        )
    };
    fs::write(&cloud, header("ascii", "float") + "9 0.25 -1.5 3\n8 nan 0 0\n7 -2 0.125 .5\n").unwrap();
    let input = read(&folder).unwrap();
    assert_eq!((&input.points[..], input.notes.len()), (&points[..], 0));
    let mut bytes = header("binary_big_endian", "double").into_bytes();
    for point in [points[0], DVec3::INFINITY, points[1]] {
        bytes.push(200);
        point.to_array().map(f64::to_be_bytes).iter().for_each(|number| bytes.extend(number));
    }
    fs::write(&cloud, &bytes).unwrap();
    assert_eq!(read(&folder).unwrap().points, points);
    fs::write(&cloud, &bytes[..bytes.len() - 1]).unwrap();
    let message = read(&folder).unwrap_err();
    assert!(message.contains("points.ply: vertex: found 74 bytes, expected 75 bytes"), "{message}");
}

/// Pictures that are listed and not there are left out, and named, as long as there are others.
#[test]
fn missing_pictures_are_left_out() {
    let folder = photographed("missing", 4);
    let whole = read(&folder).unwrap();
    assert!(whole.missing.is_empty());
    fs::remove_file(folder.join("v_1.png")).unwrap();
    fs::remove_file(folder.join("v_3.png")).unwrap();
    let part = read(&folder).unwrap();
    let names: Vec<_> = part.missing.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["v_1", "v_3"]);
    assert_eq!(part.views.iter().map(|view| &view.name).collect::<Vec<_>>(), ["./v_0", "./v_2"]);
    assert_eq!(part.views[1].camera.position, whole.views[2].camera.position);
}

/// A mask is that of a lens if the frames share it that have pictures and masks, however they spell its name. Different
/// ones are those of objects.
#[test]
fn masks_that_frames_share_are_ignored() {
    let folder = photographed("lens_masks", 4);
    let text = fs::read_to_string(folder.join("transforms.json")).unwrap();
    for name in ["same.png", "other.png"] {
        image::GrayImage::from_pixel(40, 40, image::Luma([255])).save(folder.join(name)).unwrap();
    }
    let read = |masks: [&str; 4], folders: &InputFolders| {
        let masked = masks.iter().enumerate().fold(text.clone(), |text, (index, mask)| {
            let (name, key) = (format!(r#""file_path":"./v_{index}""#), format!(r#""mask_path":"{mask}","#));
            if mask.is_empty() { text } else { text.replace(&name, &format!("{key}{name}")) }
        });
        fs::write(folder.join("transforms.json"), masked).unwrap();
        let views = FitInput::read(&folder, folders).unwrap().views;
        let count = |has: fn(&View) -> bool| views.iter().filter(|view| has(view)).count();
        [count(|view| view.ignored.is_some()), count(|view| view.mask.is_some())]
    };
    let folders = InputFolders::default();
    assert_eq!(read(["same.png"; 4], &folders), [4, 0]);
    assert_eq!(read(["same.png", "same.png", "../lens_masks/./same.png", ""], &folders), [3, 0]);
    assert_eq!(read(["same.png", "same.png", "same.png", "other.png"], &folders), [0, 4]);
    assert_eq!(read(["same.png", "", "", ""], &folders), [0, 1]);
    let known = InputFolders { ignored: vec![folder.join("./same.png")], ..folders.clone() };
    assert_eq!(read(["same.png", "", "", ""], &known), [1, 0]);
    fs::remove_file(folder.join("v_3.png")).unwrap();
    assert_eq!(read(["same.png", "same.png", "same.png", "other.png"], &folders), [3, 0]);
}

/// Every kind of bad input gives an error that names the file and what is wrong with it.
#[test]
fn errors_name_file_and_reason() {
    let cameras = cameras(4);
    let folder = folder("bad");
    write_pictures(&folder, &cameras, None, |_| 1.0);
    write_transforms(&folder, &cameras);
    let good = fs::read_to_string(folder.join("transforms.json")).unwrap();
    let fails = |json: &str, expected: &[&str]| {
        fs::write(folder.join("transforms.json"), json).unwrap();
        let message = read(&folder).unwrap_err();
        assert!(expected.iter().all(|part| message.contains(part)), "{message}");
    };
    fails(&good.replace("./v_", "./w_"), &["transforms.json", "frames[0].file_path: found no file", "w_0"]);
    fails(&good.replacen('{', r#"{"w": 44, "h": 40,"#, 1), &["v_0.png", "size", "40x40", "44x40"]);
    fails(&good.replacen('{', r#"{"h": 41,"#, 1), &["v_0.png", "size", "40x40", "a height of 41"]);
    fails(&good.replace("camera_angle_x", "angle"), &["camera_angle_x"]);
    fails(r#"{"camera_angle_x": 0.6, "frames": []}"#, &["frames: found []"]);
    fails("[", &["transforms.json"]);
    fails(&good.replacen('{', r#"{"k3": 1e300,"#, 1), &["json: k3: found 1e300"]);
    let flat = r#"{"camera_angle_x": 0.6, "frames": [{"file_path": "v_0",
        "transform_matrix": [[1,0,0,0],[0,0,0,0],[0,0,1,4],[0,0,0,1]]}]}"#;
    fails(flat, &["frames[0].transform_matrix", "not a rotation"]);
    let unknown = good.replacen('{', r#"{"camera_model": "EQUIRECTANGULAR","#, 1);
    fails(&unknown, &["camera_model", "EQUIRECTANGULAR"]);
    fs::write(folder.join("v_1.png"), "not a picture").unwrap();
    fails(&good, &["v_1.png"]);
    fs::write(folder.join("v_1.png"), b"\0\0\0\x18ftypheic\0\0\0\0mif1heic").unwrap();
    fails(&good, &["v_1.png", "a HEIC picture"]);
    let nowhere = read(&folder.join("nowhere")).unwrap_err();
    assert!(nowhere.contains("nowhere"), "{nowhere}");
    fs::remove_file(folder.join("transforms.json")).unwrap();
    assert!(read(&folder).unwrap_err().contains("transforms.json"));

    write_pictures(&folder.join("images"), &cameras, None, |_| 1.0);
    write_colmap_text(&folder, &cameras, "1 FOV 40 40 50 50 20 20 0.1");
    let unknown = read(&folder).unwrap_err();
    assert!(unknown.contains("FOV") && unknown.contains("cameras.txt"), "{unknown}");
    // Cameras without pictures do not matter. The folder of all models will do.
    write_colmap_text(&folder, &cameras, "1 SIMPLE_PINHOLE 40 40 50 20 20\n2 FOV 40 40 50 50 20 20 0.1");
    assert_eq!(read(&folder.join("sparse")).unwrap().views.len(), cameras.len());
    write_colmap_text(&folder, &cameras, "1 EQUIRECTANGULAR 40 40 40 40");
    assert!(read(&folder).unwrap_err().contains("model EQUIRECTANGULAR"));
    write_colmap_text(&folder, &cameras, "1 PINHOLE 44 40 50 50 20 20");
    let message = read(&folder).unwrap_err();
    assert!(message.contains("v_0.png") && message.contains("44x40"), "{message}");
    write_colmap_text(&folder, &cameras, "2 PINHOLE 40 40 50 50 20 20");
    assert!(read(&folder).unwrap_err().contains("images.txt: image v_0.png: found camera 1"));
    write_colmap_text(&folder, &cameras, "1 PINHOLE 40 40 50 50 20 20\n1 PINHOLE 40 40 60 60 20 20");
    assert!(read(&folder).unwrap_err().contains("cameras.txt: camera 1: found two of this number"));
    write_colmap_text(&folder, &cameras, "\u{7} PINHOLE 40 40 50 50 20 20");
    let message = read(&folder).unwrap_err();
    assert!(message.contains("cameras.txt: line 2: found `?`"), "{message:?}");
    write_colmap_text(&folder, &cameras, "1 PINHOLE 40 40 50 50 20 20");
    fs::write(folder.join("sparse/0/points3D.txt"), "1 0 0 inf 0 0 0 1\n").unwrap();
    let message = read(&folder).unwrap_err();
    assert!(message.contains("points3D") && message.contains("inf"), "{message}");
    fs::remove_dir_all(folder.join("sparse")).unwrap();
    write_colmap_binary(&folder, &cameras, 0, &[50.0, 20.0, 20.0]);
    let images = folder.join("sparse/images.bin");
    let bytes = fs::read(&images).unwrap();
    fs::write(&images, &bytes[..bytes.len() - 5]).unwrap();
    assert!(read(&folder).unwrap_err().contains("images.bin"));
}

/// A JPEG file of one channel that ends where its pixels would begin.
fn jpeg_header(width: u16, height: u16) -> Vec<u8> {
    let [(w, x), (h, y)] = [width, height].map(|side| (side.to_be_bytes()[0], side.to_be_bytes()[1]));
    let frame = [0xff, 0xc0, 0, 11, 8, h, y, w, x, 1, 1, 0x11, 0];
    let scan = [0xff, 0xda, 0, 8, 1, 1, 0, 0, 63, 0];
    [&[0xff, 0xd8][..], &frame, &scan].concat()
}

/// Panoramas are read, and sizes that would take too much memory are errors of one line, for JPEG and PNG alike.
#[test]
fn sizes_of_pictures_are_limited() {
    let folder = folder("sizes");
    let name = |path: &str| {
        format!(
            r#"{{"camera_angle_x": 1, "frames": [{{"file_path": "{path}", "transform_matrix":
        [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}}]}}"#
        )
    };
    fs::write(folder.join("transforms.json"), name("wide.jpg")).unwrap();
    fs::write(folder.join("wide.jpg"), jpeg_header(30_000, 4000)).unwrap();
    let camera = &read(&folder).unwrap().views[0].camera;
    assert_eq!((camera.width, camera.height), (30_000, 4000));
    // A signature, and a header without the rest.
    let png = |width: u32, height: u32| {
        let mut header = b"IHDR".to_vec();
        header.extend([width, height].into_iter().flat_map(u32::to_be_bytes).chain([8, 6, 0, 0, 0]));
        let mut crc = u32::MAX;
        for byte in &header {
            crc = (0..8).fold(crc ^ u32::from(*byte), |crc, _| crc >> 1 ^ (0xedb8_8320 & (crc & 1).wrapping_neg()));
        }
        let end = [&(!crc).to_be_bytes()[..], &[0, 0, 0, 0], b"IDAT", &[0x35, 0xaf, 0x06, 0x1e]].concat();
        [b"\x89PNG\r\n\x1a\n", &13u32.to_be_bytes()[..], &header, &end].concat()
    };
    for (content, found) in [
        (jpeg_header(40_000, 2), "40000x2"),
        (jpeg_header(20_000, 20_000), "20000x20000"),
        (png(40_000, 2), "40000x2"),
        (png(1 << 30, 1 << 30), "1073741824x1073741824"),
    ] {
        fs::write(folder.join("wide.jpg"), content).unwrap();
        let message = read(&folder).unwrap_err();
        assert!(message.contains("wide.jpg") && message.contains(found), "{message}");
        assert!(message.contains("at most 32768 pixels a side and 134217728 in all"), "{message}");
    }
    fs::write(folder.join("wide.jpg"), &jpeg_header(30, 40)[..18]).unwrap();
    let message = read(&folder).unwrap_err();
    assert!(message.contains("wide.jpg: picture: found") && message.lines().count() == 1, "{message}");
}

/// Views that do not show a common object are rejected.
#[test]
fn views_must_overlap() {
    let fails = |test: &str, cameras: &[plenoctree::camera::PinholeCamera], expected: &str| {
        let folder = folder(test);
        write_pictures(&folder, cameras, None, |_| 1.0);
        write_transforms(&folder, cameras);
        let input = read(&folder).unwrap();
        let settings = FitSettings { depth: Some(6), effort: 0.01, ..FitSettings::default() };
        let message = fit(&input, None, &settings, &FitProgress::default()).unwrap_err().to_string();
        assert!(message.contains(expected), "{test}: {message}");
    };
    fails("one_view", &cameras(1), "at least two");
    // From the center, outward.
    let mut outward = cameras(12);
    for camera in &mut outward {
        let direction = camera.position.normalize();
        *camera = camera.looking_at(0.1 * direction, 5.0 * direction, DVec3::Z);
    }
    fails("outward", &outward, "common place");
    let mut parallel = cameras(6);
    for (index, camera) in parallel.iter_mut().enumerate() {
        let at = DVec3::new(20.0 * index as f64, 0.0, 0.0);
        *camera = camera.looking_at(at, at + DVec3::Y, DVec3::Z);
    }
    fails("parallel", &parallel, "common place");
}
