//! Formats a report as Markdown.

use super::content::{Block, Cell, Picture, Report, Table};

/// Returns the report as Markdown.
pub fn format(report: &Report) -> String {
    let mut text = format!("# {}\n", escape(&report.title));
    for section in &report.sections {
        text += &format!("\n## {}\n", escape(&section.title));
        for block in &section.blocks {
            text += "\n";
            text += &match block {
                Block::Text(paragraph) => format!("{}\n", escape(paragraph)),
                Block::Pictures(pictures) => row(pictures),
                Block::Plot { file, about } => format!("![{}]({file})\n", escape(about)),
                Block::Table { table, csv } => format!("{}\n[CSV]({csv})\n", lines(table)),
            };
        }
    }
    text
}

/// Pictures side by side are a table, with titles as its head.
fn row(pictures: &[Picture]) -> String {
    let mut text = line(pictures.iter().map(|picture| escape(&picture.title)));
    text += &line(pictures.iter().map(|_| "---".into()));
    text += &line(pictures.iter().map(|picture| image(&picture.title, &picture.file)));
    text += &line(pictures.iter().map(|picture| escape(&picture.note)));
    if pictures.iter().any(|picture| picture.palette.is_some()) {
        text += &line(pictures.iter().map(|picture| picture.palette.as_deref().map_or(String::new(), palette)));
    }
    text
}

fn lines(table: &Table) -> String {
    let mut text = line(table.head.iter().map(|(name, _)| escape(name)));
    text += &line(table.head.iter().map(|_| "---".into()));
    for row in &table.rows {
        text += &line(row.iter().map(|cell| match cell {
            Cell::Image(file) => palette(file),
            cell => escape(&cell.shown()),
        }));
    }
    text
}

fn line(cells: impl Iterator<Item = String>) -> String {
    format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
}

fn palette(file: &str) -> String {
    image("palette", file)
}

fn image(about: &str, file: &str) -> String {
    format!("![{}]({file})", escape(about))
}

fn escape(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "\\<").replace('*', "\\*").replace('_', "\\_")
}
