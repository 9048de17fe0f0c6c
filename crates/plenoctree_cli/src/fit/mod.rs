//! `fit`: fits a field to photographs.

mod arguments;
#[cfg(feature = "gltf")]
mod mipmaps;
#[cfg(feature = "gltf")]
mod model;
pub mod output;

pub use arguments::Arguments;

use std::{
    collections::{BTreeSet, HashMap},
    fs,
    path::{Path, PathBuf},
};

use plenoctree_fit::{FitInput, FitReport, Fitted, InputFolders, View, fit};
use serde_json::{Value, json};

use self::output::Quality;
use crate::{
    capture, console, files, hex,
    number::counted,
    result::Result,
    training::{Interruption, use_threads},
};

/// The least share of the leaves that the largest part has without a warning.
const LEAST_PART: f64 = 0.05;

/// Reads the views to measure the result on. Their pictures may have the same names as those of `fitted`, but other masks.
fn read_test(path: &Path, fitted: &FitInput, masks: Option<PathBuf>) -> Result<FitInput> {
    let ignored = fitted.views.iter().filter_map(|view| view.ignored.clone()).collect::<BTreeSet<_>>();
    let folders = InputFolders { ignored: ignored.into_iter().collect(), ..InputFolders::default() };
    let unmasked = FitInput::read(path, &folders)?;
    if masks.is_none() {
        return Ok(unmasked);
    }
    let pictures: HashMap<_, _> = fitted.views.iter().map(|view| (&view.mask, &view.picture)).collect();
    let reason = match FitInput::read(path, &InputFolders { masks, ..folders }) {
        Ok(masked) => {
            let is_of_another = |view: &&View| pictures.get(&view.mask).is_some_and(|other| **other != view.picture);
            let Some(view) = masked.views.iter().find(is_of_another) else { return Ok(masked) };
            let mask = view.mask.as_deref().unwrap_or(path);
            format!("{}: is the mask of {} already", mask.display(), pictures[&view.mask].display())
        }
        Err(error) => error.to_string(),
    };
    console::complain!("warning: {reason}; the views of {} are compared without --masks", path.display());
    Ok(unmasked)
}

/// Fits the field, extracts its palette, and writes both with previews and a report.
pub fn run(arguments: &Arguments) -> Result {
    capture::refuse(&arguments.input)?;
    let folders = arguments.folders();
    output::check(&arguments.out, &arguments.inputs(), &arguments.extraction)?;
    use_threads(arguments.threads)?;
    let interruption = Interruption::new(output::cleaning_up(&arguments.out))?;
    let mut settings = arguments.settings();
    let checkpoint = settings.checkpoint.clone();
    if let Some(checkpoint) = checkpoint.as_ref().filter(|path| settings.resume && !path.exists()) {
        console::complain!("warning: {}: not found, so the fit starts anew", checkpoint.display());
    }
    let pictures = match model_pictures(arguments)? {
        Some((pictures, supersampling)) => {
            settings.downscale *= supersampling;
            pictures
        }
        None => arguments.input.clone(),
    };
    let input = FitInput::read(&pictures, &folders)?;
    warn_of_input(&arguments.input, &input);
    let test = arguments.test.as_deref().map(|path| read_test(path, &input, folders.masks)).transpose()?;
    let views = input.views.iter().chain(test.iter().flat_map(|test| &test.views));
    output::check_outside_previews(&arguments.out, views.clone().flat_map(files_of))?;
    let compared = compared(views, arguments, settings.downscale);
    if let (Some(path), Some(test)) = (&arguments.test, &test) {
        warn_of_input(path, test);
    }
    let held_out: Vec<&str> = match &test {
        Some(test) => test.views.iter().map(|view| view.name.as_str()).collect(),
        None => {
            let views = input.views.iter().enumerate().filter(|(index, _)| settings.holds_out(*index));
            views.map(|(_, view)| view.name.as_str()).collect()
        }
    };
    let fitted = input.views.len() - if test.is_none() { held_out.len() } else { 0 };
    let earlier = if settings.resume { Quality::earlier(&arguments.out, &held_out, fitted, &compared)? } else { None };
    let Fitted { field, previews, report } =
        interruption.watched(&arguments.input, move |progress| fit(&input, test.as_ref(), &settings, progress))?;
    if let Some(error) = &report.unsaved {
        console::complain!(
            "warning: the state of this fit could not be saved, so --resume cannot go on from it: {error}"
        );
    }
    let mut described = serde_json::to_value(&report)?;
    described[output::COMPARED] = compared;
    let now = Quality::of(&described);
    if let Some(before) = earlier
        && before.is_above(now.as_ref())
    {
        console::complain!(
            "warning: {}: kept as it is: the earlier result has {:.2} dB on {}, and this one {}; fit without --resume \
             to replace it",
            arguments.out.display(),
            now.as_ref().map_or(before.psnr, |now| before.in_common(now)[0]),
            before.views(),
            now.map_or("is in none of them".into(), |now| format!("{:.2} dB", before.in_common(&now)[1]))
        );
    } else {
        let (file, leaves) = output::write(&arguments.out, &field, &arguments.extraction, &previews, &described)?;
        print(&file, &report, leaves);
    }
    if let Some(path) = checkpoint.filter(|_| !report.stopped) {
        // One that cannot be removed costs nothing but its space.
        let _ = fs::remove_file(path);
    }
    Ok(())
}

/// Returns the files of a view.
fn files_of(view: &View) -> impl Iterator<Item = &Path> {
    [&view.picture].into_iter().chain(&view.mask).chain(&view.ignored).map(PathBuf::as_path)
}

/// Describes the pictures that the field is compared with. A field matches small pictures more easily than large ones,
/// so that the quality of two fits compares only where these are the same.
fn compared<'a>(views: impl Iterator<Item = &'a View> + Clone, arguments: &Arguments, downscale: u32) -> Value {
    let size = |view: &View| [view.camera.width, view.camera.height].map(|side| (side / downscale).max(1));
    let whole = |path: &Path| fs::canonicalize(path).unwrap_or_else(|_| path.into());
    // All of the input may move together.
    let input = whole(&arguments.input);
    let folder = if input.is_dir() { &input } else { files::folder_of(&input) };
    let place = |path: &Path| {
        let path = whole(path);
        path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().into_owned()
    };
    let own_masks = views.clone().filter_map(|view| view.mask.as_deref().filter(|_| arguments.masks.is_none()));
    json!({
        "sizes": views.clone().map(size).collect::<BTreeSet<_>>(),
        "masks": arguments.masks.as_deref().map(place),
        "own_masks": own_masks.map(place).collect::<BTreeSet<_>>(),
        "ignored": views.filter_map(|view| view.ignored.as_deref()).map(place).collect::<BTreeSet<_>>(),
        "background": arguments.background.map(hex::format),
    })
}

/// Warns of pictures that are not there, once, and of what else users should know.
fn warn_of_input(path: &Path, input: &FitInput) {
    for note in &input.notes {
        console::complain!("warning: {}: {note}", path.display());
    }
    if let Some(first) = input.missing.first() {
        let (missing, all) = (input.missing.len(), input.missing.len() + input.views.len());
        console::complain!(
            "warning: {}: {missing} of {all} pictures do not exist and are left out, such as {}",
            path.display(),
            first.display()
        );
    }
}

/// Returns whether the input is a glTF model, judging by its name.
fn is_model(input: &Path) -> bool {
    input.extension().is_some_and(|extension| ["gltf", "glb"].iter().any(|name| extension.eq_ignore_ascii_case(name)))
}

/// Renders the input if it is a glTF model. Returns the path of its pictures, next to the output, and how many of their
/// pixels the fit must average along each axis.
#[cfg(feature = "gltf")]
fn model_pictures(arguments: &Arguments) -> Result<Option<(PathBuf, u32)>> {
    let input = arguments.input.display();
    if !is_model(&arguments.input) {
        if arguments.views.is_some() || arguments.size.is_some() {
            return Err(format!("{input}: --views and --size are for glTF models, .gltf or .glb").into());
        }
        return Ok(None);
    }
    if arguments.input.extension().is_none_or(|extension| extension != "gltf" && extension != "glb") {
        return Err(format!("{input}: the engine knows models by the endings .gltf and .glb; rename it").into());
    }
    if arguments.pictures.is_some() {
        return Err(format!("{input}: --pictures is for photographs, but a model is rendered").into());
    }
    let folder = arguments.out.with_extension("pictures");
    files::check_outside(&folder, arguments.inputs())?;
    if let Some(test) = &arguments.test {
        let test = FitInput::read(test, &InputFolders::default())?;
        files::check_outside(&folder, test.views.iter().flat_map(files_of))?;
    }
    let (views, size) = (arguments.views.unwrap_or(120), arguments.size.unwrap_or(400));
    let transforms = model::photograph(&arguments.input, &folder, views, size)?;
    Ok(Some((transforms, model::SUPERSAMPLING)))
}

/// Rejects glTF models: rendering them requires the engine.
#[cfg(not(feature = "gltf"))]
fn model_pictures(arguments: &Arguments) -> Result<Option<(PathBuf, u32)>> {
    if is_model(&arguments.input) {
        let input = arguments.input.display();
        return Err(format!(
            "{input}: rendering a glTF model requires the engine: build with the feature gltf, which is on by default"
        )
        .into());
    }
    Ok(None)
}

fn print(file: &Path, report: &FitReport, leaves: usize) {
    for view in &report.suspicious {
        let what = match view.psnr_db {
            Some(psnr) => {
                let usual = report.fitted_psnr_db.unwrap_or_default();
                format!("contradicts the others, {psnr:.1} dB where {usual:.1} dB are usual")
            }
            None => "does not have the object in view".into(),
        };
        console::complain!("warning: view {} ({}) {what}: its pose may be wrong", view.number, view.name);
    }
    if report.up_agreement.is_some_and(|agreement| agreement < FitReport::LEAST_UP_AGREEMENT) {
        console::complain!(
            "warning: {}: --stand may have turned the wrong side up: the cameras hardly agree on a direction",
            file.display()
        );
    }
    if let Some(share) = report.largest_part.filter(|share| *share < LEAST_PART) {
        console::complain!(
            "warning: {}: --keep-largest keeps only {:.1}% of the leaves: the largest connected part may not be all of the \
             object",
            file.display(),
            100.0 * share
        );
    }
    if let Some(held_out) = &report.held_out {
        console::say!(
            "{:.2} dB, SSIM {:.3} on {}",
            held_out.psnr_db,
            held_out.ssim,
            counted(held_out.views.len(), "held-out view", "held-out views")
        );
    }
    let seconds = report.seconds.preparing + report.seconds.training + report.seconds.measuring;
    console::say!("{}: {}, {seconds:.0} s", file.display(), counted(leaves, "leaf", "leaves"));
}
