//! Figure 4: a gallery.

use plenoctree_cli::{
    renderer::{Look, PosterizeSettings},
    result::Result,
};

use super::{
    super::{data::Evidence, methods::Method},
    rows::note,
};
use crate::recolor::opposite_main_hue;
use crate::report::{Picture, Section};

/// Shows every view as trained, posterized and recolored.
pub fn section(evidence: &mut Evidence) -> Result<Section> {
    let mut section = Section::new("Figure 4: gallery");
    section.text(
        "As trained, posterized with the field's palette, and recolored: the palette's main hue, with all of its \
         shades, is turned by 180 degrees. Above, the palette is the paper's hull; below, the fitted one.",
    );
    for method in [Method::Hull, Method::Fitted] {
        let palette = evidence.methods.palette(method).clone();
        let shown = opposite_main_hue(&palette);
        let recolored = plenoctree::palette::Palette { colors: shown, ..palette.clone() };
        let name = format!("{}_recolored", method.name());
        let drawing = evidence.folder.palette(&name, &recolored)?;
        for view in 0..evidence.shots.len() {
            let look = Look { palette: &palette, shown: &recolored.colors, settings: PosterizeSettings::default() };
            let image = evidence.renderer.posterized(&evidence.shots[view].camera, &look)?.0;
            let file = evidence.folder.picture(&format!("view_{view}_{name}"), &image)?;
            let mut posterized = evidence.posterized(view, method)?;
            posterized.note = note(evidence.shots[view].posterized(method).errors);
            let recolored =
                Picture { file, title: "recolored".into(), note: String::new(), palette: Some(drawing.clone()) };
            section.pictures(vec![evidence.original(view)?, posterized, recolored]);
        }
    }
    Ok(section)
}
