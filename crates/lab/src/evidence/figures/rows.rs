//! Rows of pictures and tables that several figures share.

use image::{DynamicImage, RgbImage, RgbaImage};
use plenoctree::palette::ColorErrors;
use plenoctree_cli::result::Result;

use super::super::{data::Evidence, measures, methods::Method};
use crate::report::{Cell, Picture, Section, Table};

/// Returns the figures of a posterized picture in words.
pub fn note(errors: Option<ColorErrors>) -> String {
    let Some(errors) = errors else { return "nothing is opaque enough to be posterized".into() };
    let psnr = measures::psnr_db(errors);
    let psnr = if psnr.is_finite() { format!("{psnr:.1} dB") } else { "no difference".into() };
    format!("{psnr}, RMSE {:.1}, hue errors {:.1}%", 255.0 * errors.rmse, 100.0 * errors.hue)
}

/// Returns a picture as trained, without alpha.
pub fn opaque(original: &RgbaImage) -> RgbImage {
    DynamicImage::from(original.clone()).into_rgb8()
}

impl Evidence {
    /// Writes the first view as trained, and posterized with the palette of each method.
    pub fn first_view(&self, methods: &[Method]) -> Result<Vec<Picture>> {
        let posterized = methods.iter().map(|method| self.posterized(0, *method));
        std::iter::once(self.original(0)).chain(posterized).collect()
    }

    /// Writes a view as trained.
    pub fn original(&self, view: usize) -> Result<Picture> {
        let file = self.folder.picture(&format!("view_{view}"), &opaque(&self.shots[view].original))?;
        Ok(Picture { file, title: "as trained".into(), note: format!("view {view}"), palette: None })
    }

    /// Writes a view posterized with the palette of a method.
    pub fn posterized(&self, view: usize, method: Method) -> Result<Picture> {
        let posterized = self.shots[view].posterized(method);
        let file = self.folder.picture(&format!("view_{view}_{}", method.name()), &posterized.image)?;
        let palette = Some(self.drawings[method as usize].clone());
        Ok(Picture { file, title: method.label().into(), note: note(posterized.errors), palette })
    }

    /// Returns the mean errors of a method over all views that show results.
    pub fn mean(&self, method: Method) -> Option<ColorErrors> {
        measures::mean(self.shots.iter().map(|shot| shot.posterized(method).errors))
    }

    /// Adds the claim that pictures with one palette have a higher PSNR than with another.
    pub fn claim(&self, section: &mut Section, claim: &'static str, [better, worse]: [Method; 2]) {
        if let (Some(better), Some(worse)) = (self.mean(better), self.mean(worse)) {
            let found = format!(
                "PSNR {:.2} against {:.2} dB; hue errors {:.1} against {:.1}%",
                measures::psnr_db(better),
                measures::psnr_db(worse),
                100.0 * better.hue,
                100.0 * worse.hue
            );
            section.claim(claim, found, better.rmse < worse.rmse);
        }
    }

    /// Returns the mean figures of methods over all views that show results.
    pub fn means(&self, methods: &[Method]) -> Table {
        let rows = methods.iter().map(|&method| {
            let errors = self.mean(method);
            let mut row = vec![Cell::name(method.label(), method.name())];
            row.extend(cells(errors));
            row
        });
        let mut head = vec![("palette", "palette")];
        head.extend(COLUMNS);
        Table { head, rows: rows.collect() }
    }
}

/// The columns of the figures of posterized pictures.
pub const COLUMNS: [(&str, &str); 3] =
    [("PSNR, dB", "psnr_db"), ("weighted RMSE, of 255", "rmse"), ("hue errors, %", "hue_errors_percent")];

/// The columns of the figures of enlarged parts of these pictures.
pub const PART_COLUMNS: [(&str, &str); 3] = [
    ("part: PSNR, dB", "part_psnr_db"),
    ("part: RMSE, of 255", "part_rmse"),
    ("part: hue errors, %", "part_hue_errors_percent"),
];

/// Returns the cells of [`COLUMNS`] or of [`PART_COLUMNS`].
pub fn cells(errors: Option<ColorErrors>) -> [Cell; 3] {
    [
        Cell::number(errors.map(measures::psnr_db), 2),
        Cell::number(errors.map(|errors| 255.0 * errors.rmse), 2),
        Cell::number(errors.map(|errors| 100.0 * errors.hue), 2),
    ]
}
