//! The report: sections of text, pictures, plots and tables, and the folder that they are written to.

mod content;
mod folder;
mod html;
mod markdown;

pub use content::{Cell, Picture, Report, Section, Table};
pub use folder::Folder;

use content::Block;

use crate::result::Result;

impl Section {
    /// Adds a table, which is also written to `csv/NAME.csv`.
    pub fn table(&mut self, folder: &Folder, name: &str, table: Table) -> Result {
        let csv = folder.csv(name, &table)?;
        self.blocks.push(Block::Table { table, csv });
        Ok(())
    }
}

impl Report {
    /// Writes `report.md` and `report.html`.
    pub fn write(&self, folder: &Folder) -> Result {
        folder.text("report.md", &markdown::format(self))?;
        folder.text("report.html", &html::format(self))
    }
}
