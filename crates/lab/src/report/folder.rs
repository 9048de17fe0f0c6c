//! The folder of a report.

use std::path::{Path, PathBuf};

use image::RgbImage;
use plenoctree::palette::Palette;
use plenoctree_cli::{files, result::Result};

use super::{
    content::{Cell, Table},
    swatches,
};

/// The folder of a report. Paths that its methods return are relative to it.
pub struct Folder(PathBuf);

impl Folder {
    /// Creates the folder, unless it exists.
    pub fn create(path: &Path) -> Result<Self> {
        files::create_folder(path)?;
        Ok(Self(path.to_path_buf()))
    }

    /// Returns the path of a file, in a folder that exists.
    fn path(&self, name: &str) -> Result<PathBuf> {
        let path = self.0.join(name);
        path.parent().map_or(Ok(()), files::create_folder)?;
        Ok(path)
    }

    /// Writes a text file.
    pub fn text(&self, name: &str, text: &str) -> Result {
        files::write_text(&self.path(name)?, text)
    }

    /// Writes a picture and returns its path.
    pub fn picture(&self, name: &str, image: &RgbImage) -> Result<String> {
        let file = format!("pictures/{name}.png");
        files::write_image(&self.path(&file)?, image)?;
        Ok(file)
    }

    /// Writes a plot and returns its path.
    pub fn plot(&self, name: &str, svg: &str) -> Result<String> {
        let file = format!("plots/{name}.svg");
        self.text(&file, svg)?;
        Ok(file)
    }

    /// Writes a palette and a drawing of it, and returns the path of the drawing.
    pub fn palette(&self, name: &str, palette: &Palette) -> Result<String> {
        palette.write(self.path(&format!("palettes/{name}.palette.json"))?)?;
        let file = format!("palettes/{name}.svg");
        self.text(&file, &swatches::svg(palette))?;
        Ok(file)
    }

    /// Writes the cells of a table that are not images, and returns the file's path.
    pub fn csv(&self, name: &str, table: &Table) -> Result<String> {
        let is_image = |column: usize| table.rows.iter().any(|row| matches!(row[column], Cell::Image(_)));
        let columns: Vec<usize> = (0..table.head.len()).filter(|&column| !is_image(column)).collect();
        let line = |cells: Vec<String>| cells.join(",") + "\n";
        let mut text = line(columns.iter().map(|&column| table.head[column].1.to_string()).collect());
        for row in &table.rows {
            text += &line(columns.iter().map(|&column| value(&row[column])).collect());
        }
        let file = format!("csv/{name}.csv");
        self.text(&file, &text)?;
        Ok(file)
    }
}

fn value(cell: &Cell) -> String {
    match cell {
        Cell::Text(text) if text.contains([',', '"', '\n']) => format!("\"{}\"", text.replace('"', "\"\"")),
        Cell::Text(text) | Cell::Name(_, text) => text.clone(),
        Cell::Number(value, _) => value.to_string(),
        Cell::Image(_) | Cell::Empty => String::new(),
    }
}
