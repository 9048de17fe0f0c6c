//! The report: sections of text, pictures, plots and tables, and the folder that they are written to.

mod content;
mod folder;
mod html;
mod markdown;
mod swatches;

pub use content::{Cell, Picture, Report, Section, Table};
pub use folder::Folder;

use content::Block;
use plenoctree_cli::result::Result;

impl Section {
    /// Adds a table, which is also written to `csv/NAME.csv`.
    pub fn table(&mut self, folder: &Folder, name: &str, table: Table) -> Result {
        let csv = folder.csv(name, &table)?;
        self.blocks.push(Block::Table { table, csv });
        Ok(())
    }
}

impl Report {
    /// Returns the report as Markdown.
    pub fn markdown(&self) -> String {
        markdown::format(self)
    }

    /// Writes `report.md` and `report.html`.
    pub fn write(&self, folder: &Folder) -> Result {
        folder.text("report.md", &self.markdown())?;
        folder.text("report.html", &html::format(self))
    }
}
