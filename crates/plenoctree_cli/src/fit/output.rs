//! Writes the results of a fit. Files are complete before they replace others.

use std::{
    fs,
    panic::resume_unwind,
    path::{Path, PathBuf},
    thread,
};

use image::RgbImage;
use plenoctree::{PackError, PackSettings, Packed, PlenOctree, palette::Palette};
use plenoctree_fit::Comparison;
use serde_json::{Value, json};

use crate::{
    console,
    extraction::{self, ExtractionArguments},
    files, pack,
    result::Result,
};

/// Checks that the output and the histograms can be written, and how the palette is to be extracted, before the work
/// starts.
pub fn check(out: &Path, inputs: &[&Path], extraction: &ExtractionArguments) -> Result {
    extraction.settings()?;
    files::check_inputs(inputs)?;
    if !["npz", "plenoctree"].iter().any(|known| out.extension().is_some_and(|extension| extension == *known)) {
        return Err(format!("{}: the name of the field must end in .npz or .plenoctree", out.display()).into());
    }
    let views = views(out);
    if views.exists() && !views.is_dir() {
        return Err(format!("{}: is a file, but the previews need a folder of this name", views.display()).into());
    }
    check_outside_previews(out, inputs.iter().copied())?;
    let targets = targets(out);
    // They are moved into place once all are complete, which would replace devices and pipes.
    if let Some(device) =
        targets.iter().find(|target| fs::metadata(target).is_ok_and(|at| !at.is_file() && !at.is_dir()))
    {
        return Err(format!("{}: is not a regular file; choose another --out", device.display()).into());
    }
    let partials = targets.each_ref().map(|target| partial(target));
    let outputs: Vec<&Path> =
        targets.iter().chain(&partials).chain(&extraction.histograms).map(PathBuf::as_path).collect();
    files::check_outputs(&outputs, inputs)
}

/// Checks that nothing is read from the folder of previews.
pub fn check_outside_previews<'a>(out: &Path, inputs: impl IntoIterator<Item = &'a Path>) -> Result {
    files::check_outside(&views(out), inputs)
}

/// Extracts the palette of a field. Warns if it has none, because nothing of it is visible: that is no reason to lose
/// the field.
fn palette(out: &Path, field: &PlenOctree, arguments: &ExtractionArguments) -> Option<Palette> {
    let extracted = extraction::extract(field, out, arguments, None, false);
    extracted
        .inspect_err(|error| console::complain!("warning: the field is written without a palette: {error}"))
        .ok()
        .map(|extracted| extracted.extraction.palette)
}

/// Extracts the palette of the field, and writes both, previews of the held-out views, and the report. Another palette
/// that is there is kept under another name. If that fails, nothing incomplete is left. A field that cannot be packed is
/// written as it is, next to the output. Returns the file and the number of leaves in it: packing leaves out hidden ones.
pub fn write(
    out: &Path,
    field: &PlenOctree,
    extraction: &ExtractionArguments,
    previews: &[Comparison],
    report: &Value,
) -> Result<(PathBuf, usize)> {
    write_all(out, field, extraction, previews, report).inspect_err(|_| remove_unfinished(out))
}

/// Returns a closure that removes what is not finished of the results.
pub fn cleaning_up(out: &Path) -> impl Fn() + Send + 'static {
    let files = [out.to_path_buf(), unpacked(out)];
    move || {
        files.iter().for_each(|out| remove_unfinished(out));
        files::clean_up();
    }
}

/// Returns where a field is written that cannot be packed.
fn unpacked(out: &Path) -> PathBuf {
    out.with_extension("npz")
}

fn remove_unfinished(out: &Path) {
    targets(out).iter().for_each(|target| _ = fs::remove_file(partial(target)));
}

fn write_all(
    out: &Path,
    field: &PlenOctree,
    extraction: &ExtractionArguments,
    previews: &[Comparison],
    report: &Value,
) -> Result<(PathBuf, usize)> {
    let (views, targets) = (views(out), targets(out));
    let packed = match is_packed(out).then(|| packed(out, field)) {
        Some(Err(error)) => {
            let unpacked = unpacked(out);
            if unpacked.exists() {
                return Err(format!("{}: {error}", out.display()).into());
            }
            console::complain!(
                "warning: {}: not packed: {error}; written to {} instead",
                out.display(),
                unpacked.display()
            );
            return write(&unpacked, field, extraction, previews, report);
        }
        Some(Ok(packed)) => Some(packed),
        None => None,
    };
    pack::warn_of_density(out, field);
    let field_file = partial(&targets[0]);
    let (leaves, psnr) = match &packed {
        Some(packed) => (packed.field().leaves(), pack::psnr(field, packed.field())),
        None => (field.leaves(), None),
    };
    let write = || match &packed {
        Some(packed) => packed.write(&field_file),
        None => field.write(&field_file),
    };
    // A field is compressed on one core. The others extract the palette meanwhile.
    let (written, palette) = thread::scope(|scope| {
        let writing = scope.spawn(write);
        let palette = palette(out, field, extraction);
        (writing.join(), palette)
    });
    written.unwrap_or_else(|panic| resume_unwind(panic)).map_err(|error| format!("{}: {error}", out.display()))?;
    if let Some(psnr) = psnr {
        console::say!("packed: {psnr:.1} dB from the field that was measured");
    }
    let mut report = report.clone();
    report["field"] = identity(out, &field_file);
    // The rest of the report, and the previews, are about the field before it is packed.
    report["written"] = json!({ "leaves": leaves, "packed": packed.is_some(), "packed_psnr_db": psnr });
    let names = preview_names(previews.iter().map(|preview| &*preview.name));
    report[PREVIEWS] = json!(names);
    if let Some(palette) = &palette {
        palette.write(partial(&targets[1]))?;
    }
    files::write_text(&partial(&targets[2]), &(serde_json::to_string_pretty(&report)? + "\n"))?;
    // The result is worth more than an edited palette of the one before, or the report about another field.
    let kept = [
        files::keep_former_palette(&targets[1], palette.as_ref()),
        files::keep_former_report(&targets[2], |former| former["field"]["file"] == report["field"]["file"]),
    ];
    for error in kept.into_iter().filter_map(Result::err) {
        console::complain!("warning: {error}; it is replaced");
    }
    // Those of the field that is replaced. Other files in the folder stay.
    let mut outdated = previews_before(out);
    outdated.retain(|name| !names.contains(name));
    if palette.is_none() {
        // An older one belongs to another field.
        let _ = fs::remove_file(&targets[1]);
    }
    let written = targets.iter().enumerate().filter(|(index, _)| *index != 1 || palette.is_some());
    written.map(|(_, target)| target).try_for_each(|target| {
        plenoctree::move_file(partial(target), target).map_err(|error| format!("{}: {error}", target.display()))
    })?;
    if !previews.is_empty() {
        // The field is worth more than pictures of it.
        if let Err(error) = write_previews(&views, previews, &names) {
            console::complain!("warning: {error}; the field is written without all of its previews");
        }
    }
    outdated.iter().for_each(|name| _ = fs::remove_file(views.join(name)));
    Ok((out.to_path_buf(), leaves))
}

/// Packs the field. One that is so faint that nothing would be left is packed with all of its leaves.
fn packed(out: &Path, field: &PlenOctree) -> Result<Packed, PackError> {
    let settings = PackSettings::default();
    match pack::pack_unchanged(field, &settings) {
        Err(error @ PackError::Faint { .. }) => {
            console::complain!("warning: {}: {error}; all leaves are kept", out.display());
            pack::pack_unchanged(field, &PackSettings { hidden: 0.0, ..settings })
        }
        packed => packed,
    }
}

fn write_previews(folder: &Path, previews: &[Comparison], names: &[String]) -> Result {
    files::create_folder(folder)?;
    let mut named = previews.iter().zip(names);
    named.try_for_each(|(preview, name)| files::write_image(&folder.join(name), &side_by_side(preview)))
}

/// The pictures in a report of a fit: their sizes, and what is behind and around the object.
pub const COMPARED: &str = "pictures";
/// Returns whether the pictures of an earlier report are those that are `compared` now. Older reports say less of them.
fn is_same(earlier: &Value, compared: &Value) -> bool {
    earlier.as_object().is_none_or(|earlier| earlier.iter().all(|(key, value)| compared[key] == *value))
}

/// The previews in a report.
const PREVIEWS: &str = "previews";

/// Returns the report that is there, or null. It may be about another field.
fn report_beside(out: &Path) -> Value {
    let text = fs::read(&targets(out)[2]).ok();
    text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
}

/// Returns the names of the previews of the field that is there.
fn previews_before(out: &Path) -> Vec<String> {
    let report = report_beside(out);
    if report["field"] != identity(out, out) {
        return Vec::new();
    }
    let names = report[PREVIEWS].as_array().into_iter().flatten().filter_map(Value::as_str);
    // Nothing outside of the folder.
    names.filter(|name| Path::new(name).components().count() == 1).map(String::from).collect()
}

/// Draws the photograph at the left and the field at the right.
fn side_by_side(preview: &Comparison) -> RgbImage {
    RgbImage::from_fn(2 * preview.width, preview.height, |x, y| {
        let (pixels, x) = match x.checked_sub(preview.width) {
            None => (&preview.photographed, x),
            Some(x) => (&preview.rendered, x),
        };
        image::Rgb(pixels[(y * preview.width + x) as usize])
    })
}

/// Returns whether the field is to be packed.
fn is_packed(out: &Path) -> bool {
    out.extension().is_some_and(|extension| extension == "plenoctree")
}

/// Returns what tells whose report it is: fields in the same folder share its name.
fn identity(out: &Path, file: &Path) -> Value {
    let bytes = fs::metadata(file).ok().map(|metadata| metadata.len());
    json!({ "file": out.file_name().map(|name| name.to_string_lossy()), "bytes": bytes })
}

/// How well a field matches the views that were held out or, if none were, those that it was fitted to.
pub struct Quality {
    /// The held-out views that were measured, and the PSNR of each in decibels.
    held_out: Vec<(String, f64)>,
    fitted: u64,
    /// The PSNR in decibels.
    pub psnr: f64,
}

impl Quality {
    /// Returns what a report says.
    pub fn of(report: &Value) -> Option<Self> {
        let measured = report.get("held_out").filter(|held_out| !held_out.is_null());
        let psnr = measured.map_or(report.get("fitted_psnr_db"), |held_out| held_out.get("psnr_db"))?.as_f64()?;
        let views = measured.map_or(Some(&[][..]), |held_out| Some(held_out.get("views")?.as_array()?))?;
        let view = |view: &Value| {
            // JSON has no infinity.
            Some((view.get("name")?.as_str()?.to_string(), view["psnr_db"].as_f64().unwrap_or(f64::INFINITY)))
        };
        Some(Self { held_out: views.iter().map(view).collect::<Option<_>>()?, fitted: report["views"].as_u64()?, psnr })
    }

    /// Returns that of an earlier result, if there is one.
    ///
    /// # Errors
    ///
    /// Returns an error if it is unknown, or was measured on other views than those with these names, or fitted to
    /// another number of views, or on other pictures than [`COMPARED`]: then there is no telling which result is
    /// better.
    pub fn earlier(out: &Path, held_out: &[&str], fitted: usize, compared: &Value) -> Result<Option<Self>> {
        if !out.exists() {
            return Ok(None);
        }
        let report = report_beside(out);
        let found = Self::of(&report).filter(|_| report["field"] == identity(out, out));
        let reason = match found {
            None => "is not the field that report.json is about",
            Some(found) if found.fitted != fitted as u64 => "was fitted to other views",
            Some(found) if !found.is_of(held_out, report["stopped"] == true) => "was measured on other views",
            Some(_) if !is_same(&report[COMPARED], compared) => {
                "was not compared with pictures of the same size, masks and background"
            }
            Some(found) => return Ok(Some(found)),
        };
        let out = out.display();
        Err(format!(
            "{out}: {reason}, so --resume cannot tell whether to replace it; move it away to resume, or leave --resume \
             out to start anew"
        )
        .into())
    }

    /// Returns whether these are the views that it was measured on, or if that was stopped, the first of them.
    fn is_of(&self, held_out: &[&str], is_stopped: bool) -> bool {
        let measured = self.held_out.iter().map(|(name, _)| name.as_str());
        let count = if is_stopped && !self.held_out.is_empty() { self.held_out.len() } else { held_out.len() };
        held_out.get(..count).is_some_and(|expected| measured.eq(expected.iter().copied()))
    }

    /// Returns whether it is higher than that of another fit to the same pictures, which is `None` if its field is not
    /// in view. If a fit was stopped while it was measured, the views count that both were measured on.
    pub fn is_above(&self, other: Option<&Self>) -> bool {
        other.is_none_or(|other| {
            let [own, others] = self.in_common(other);
            others < own
        })
    }

    /// Returns the PSNR of both in the views that both were measured on, in decibels.
    pub fn in_common(&self, other: &Self) -> [f64; 2] {
        let both = self.held_out.len().min(other.held_out.len());
        [self, other].map(|of| match both {
            0 => of.psnr,
            _ => of.held_out[..both].iter().map(|(_, psnr)| psnr).sum::<f64>() / both as f64,
        })
    }

    /// Names the views that it was measured on.
    pub fn views(&self) -> &'static str {
        if self.held_out.is_empty() { "the views" } else { "the held-out views" }
    }
}

/// Returns the paths of the field, its palette and the report.
fn targets(out: &Path) -> [PathBuf; 3] {
    [out.into(), out.with_extension("palette.json"), files::folder_of(out).join("report.json")]
}

/// Returns the path of the folder of previews.
fn views(out: &Path) -> PathBuf {
    out.with_extension("views")
}

/// Returns the temporary name of an incomplete file, next to that to which links lead.
fn partial(path: &Path) -> PathBuf {
    plenoctree::follow_links(path).unwrap_or_else(|_| path.into()).with_added_extension("partial")
}

/// The longest name of a preview, without its ending. Most file systems allow 255 bytes.
const LONGEST_NAME: usize = 200;

/// Returns the names of the files that compare pictures of these names. No two are the same.
fn preview_names<'a>(pictures: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for picture in pictures {
        let name: String = picture.chars().map(|c| if c.is_alphanumeric() || c == '_' { c } else { '-' }).collect();
        let name = name.trim_matches('-');
        let name = &name[..name.floor_char_boundary(LONGEST_NAME)];
        let mut unique = format!("{name}.png");
        for number in 2.. {
            if !names.contains(&unique) {
                break;
            }
            unique = format!("{name}-{number}.png");
        }
        names.push(unique);
    }
    names
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use plenoctree::{BakeSettings, Basis, bake};

    use super::*;

    #[derive(Parser)]
    struct Arguments {
        #[command(flatten)]
        extraction: ExtractionArguments,
    }

    fn extraction() -> ExtractionArguments {
        Arguments::parse_from(["test"]).extraction
    }

    /// A field in which nothing is visible.
    fn field() -> PlenOctree {
        let settings = BakeSettings { depth: 2, basis: Basis::Rgba, directions: 8, ..Default::default() };
        bake(&settings, |_| 0.0, |_| |_| glam::DVec3::ONE).unwrap()
    }

    /// A field that is in no view is worse than any other.
    #[test]
    fn fields_that_are_not_in_view_are_worse() {
        let of = |psnr: Option<f64>| Quality::of(&json!({ "held_out": null, "fitted_psnr_db": psnr, "views": 9 }));
        let found = of(Some(12.0)).unwrap();
        assert!(found.is_above(of(None).as_ref()) && found.is_above(of(Some(11.0)).as_ref()));
        assert!(!found.is_above(of(Some(12.0)).as_ref()) && !found.is_above(of(Some(13.0)).as_ref()));
    }

    /// A fit that was stopped while it was measured compares in the views that both have.
    #[test]
    fn fits_compare_in_the_same_views() {
        let of = |views: &[f64]| {
            let psnr = views.iter().sum::<f64>() / views.len() as f64;
            let view = |(index, psnr): (usize, &f64)| json!({ "name": format!("{index}.png"), "psnr_db": psnr });
            let views: Vec<Value> = views.iter().enumerate().map(view).collect();
            Quality::of(&json!({ "held_out": { "psnr_db": psnr, "views": views }, "views": 9 })).unwrap()
        };
        let (before, worse, better) = (of(&[30.0, 20.0]), of(&[28.0]), of(&[31.0]));
        assert!(before.is_above(Some(&worse)) && !before.is_above(Some(&better)));
        assert_eq!(before.in_common(&worse), [30.0, 28.0]);
        assert!(before.is_of(&["0.png", "1.png"], false) && worse.is_of(&["0.png", "1.png"], true));
        assert!(!worse.is_of(&["0.png", "1.png"], false) && !worse.is_of(&["1.png", "0.png"], true));
    }

    #[test]
    fn previews_have_names_of_their_own() {
        let names = preview_names(["a/x.png", "a-x.png", "b.png", "a.x.png"].into_iter());
        assert_eq!(names, ["a-x-png.png", "a-x-png-2.png", "b-png.png", "a-x-png-3.png"]);
        let long = ["a", "b"].map(|end| format!("x{}{end}", "\u{e4}".repeat(300)));
        let names = preview_names(long.iter().map(String::as_str));
        assert!(names.iter().all(|name| name.len() < 210) && names[0] != names[1], "{names:?}");
    }

    /// Results compare if they were compared with the same pictures, as far as the earlier report tells.
    #[test]
    fn masks_decide_whether_results_compare() {
        let now = json!({ "sizes": [[8, 8]], "masks": null, "own_masks": ["a"], "ignored": null });
        assert!(is_same(&Value::Null, &now) && is_same(&now, &now));
        assert!(is_same(&json!({ "sizes": [[8, 8]], "masks": null }), &now));
        assert!(!is_same(&json!({ "sizes": [[8, 8]], "masks": "folder" }), &now));
        assert!(!is_same(&json!({ "sizes": [[8, 8]], "own_masks": ["b"] }), &now));
    }

    /// Links stay, the report about another field is kept, and a preview that cannot be written does not cost the field.
    #[cfg(unix)]
    #[test]
    fn what_is_beside_a_field_is_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let (out, linked) = (folder.path().join("b.npz"), folder.path().join("store/linked.npz"));
        fs::create_dir_all(folder.path().join("b.views/a-png.png")).unwrap();
        fs::create_dir_all(folder.path().join("store")).unwrap();
        fs::write(&linked, "former").unwrap();
        std::os::unix::fs::symlink("store/linked.npz", &out).unwrap();
        write(&folder.path().join("a.npz"), &field(), &extraction(), &[], &json!({ "of": "a" })).unwrap();
        let preview = Comparison {
            name: "a.png".into(),
            width: 1,
            height: 1,
            photographed: vec![[0; 3]],
            rendered: vec![[0; 3]],
        };
        write(&out, &field(), &extraction(), &[preview], &json!({ "of": "b" })).unwrap();
        let report =
            |name: &str| -> Value { serde_json::from_slice(&fs::read(folder.path().join(name)).unwrap()).unwrap() };
        assert_eq!([&report("report.json.old")["of"], &report("report.json")["of"]], ["a", "b"]);
        let new = folder.path().join("c.npz");
        std::os::unix::fs::symlink("store/new.npz", &new).unwrap();
        write(&new, &field(), &extraction(), &[], &json!({})).unwrap();
        assert!(new.is_symlink() && folder.path().join("store/new.npz").is_file());
        assert!(out.is_symlink() && fs::read(&linked).unwrap() == fs::read(folder.path().join("a.npz")).unwrap());
        assert_eq!(fs::read_dir(folder.path().join("store")).unwrap().count(), 2);
        // Devices are not replaced, and names must leave room for what is not complete.
        std::os::unix::fs::symlink("/dev/null", folder.path().join("d.npz")).unwrap();
        let error = |name: &str| check(&folder.path().join(name), &[], &extraction()).unwrap_err().to_string();
        assert!(error("d.npz").contains("is not a regular file"));
        assert!(error(&("a".repeat(240) + ".npz")).contains("cannot be written"));
    }

    /// A field of which packing would leave nothing is packed all the same.
    #[test]
    fn fields_that_cannot_be_packed_are_not_lost() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("haze.plenoctree");
        let (min, max) = (glam::DVec3::splat(-0.1), glam::DVec3::splat(0.1));
        let settings = BakeSettings { depth: 2, min, max, basis: Basis::Rgba, directions: 8, ..Default::default() };
        let haze = bake(&settings, |_| 0.02, |_| |_| glam::DVec3::ONE).unwrap();
        assert_eq!(write(&out, &haze, &extraction(), &[], &json!({})).unwrap(), (out.clone(), haze.leaves()));
        assert!(out.exists() && !folder.path().join("haze.npz").exists());
    }

    /// A field in which nothing is visible has no palette, but it is written, without the palette of another one.
    #[test]
    fn fields_without_a_palette_are_written() {
        let (folder, field) = (tempfile::tempdir().unwrap(), field());
        let out = folder.path().join("solid.npz");
        fs::write(folder.path().join("solid.palette.json"), "another").unwrap();
        check(&out, &[], &extraction()).unwrap();
        write(&out, &field, &extraction(), &[], &Value::Null).unwrap();
        let names: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert!(names.len() == 3 && names.contains(&"solid.npz".into()), "{names:?}");
        assert!(names.contains(&"solid.palette.json.old".into()), "{names:?}");
    }
}
