//! Formats a report as HTML.

use super::content::{Block, Cell, Picture, Report, Table};
use crate::plot::escape;

const STYLE: &str = "\
body { font: 16px/1.5 system-ui, sans-serif; color: #24242c; background: #fff; max-width: 1180px; margin: 2em auto;\
 padding: 0 1em }
p { max-width: 46em }
table { border-collapse: collapse; margin: 1em 0; font-size: 14px }
th, td { border-bottom: 1px solid #e2e2e6; padding: .3em .8em; text-align: left }
.number { text-align: right; font-variant-numeric: tabular-nums }
.row { display: flex; flex-wrap: wrap; gap: 1em; margin: 1em 0 }
figure { margin: 0; font-size: 13px; max-width: 100% }
figure img { display: block; max-width: 100% }
figcaption { max-width: 24em }
.csv { font-size: 13px }
";

/// Returns the report as a page.
pub fn format(report: &Report) -> String {
    let title = escape(&report.title);
    let mut text = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width\">\n<title>{title}</title>\n<style>\n{STYLE}</style>\n<h1>{title}</h1>\n"
    );
    for section in &report.sections {
        text += &format!("<h2>{}</h2>\n", escape(&section.title));
        for block in &section.blocks {
            text += &match block {
                Block::Text(paragraph) => format!("<p>{}</p>\n", escape(paragraph)),
                Block::Pictures(pictures) => {
                    format!("<div class=\"row\">\n{}</div>\n", pictures.iter().map(figure).collect::<String>())
                }
                Block::Plot { file, about } => format!("<p>{}</p>\n", image(file, about)),
                Block::Table { table, csv } => {
                    format!("{}<p class=\"csv\"><a href=\"{}\">CSV</a></p>\n", rows(table), escape(csv))
                }
            };
        }
    }
    text + "</html>\n"
}

fn figure(picture: &Picture) -> String {
    let palette = picture.palette.as_deref().map_or(String::new(), |file| image(file, "palette"));
    format!(
        "<figure>{}<figcaption><b>{}</b><br>{}</figcaption>{palette}</figure>\n",
        image(&picture.file, &picture.title),
        escape(&picture.title),
        escape(&picture.note),
    )
}

fn rows(table: &Table) -> String {
    let class = |column: usize| match table.rows.first().map(|row| &row[column]) {
        Some(Cell::Number(..) | Cell::Empty) => " class=\"number\"",
        _ => "",
    };
    let head = table.head.iter().enumerate();
    let head: String = head.map(|(column, (name, _))| format!("<th{}>{}</th>", class(column), escape(name))).collect();
    let mut text = format!("<table>\n<tr>{head}</tr>\n");
    for row in &table.rows {
        let cells: String = row
            .iter()
            .map(|cell| match cell {
                Cell::Image(file) => format!("<td>{}</td>", image(file, "palette")),
                Cell::Text(text) | Cell::Name(text, _) => format!("<td>{}</td>", escape(text)),
                cell => format!("<td class=\"number\">{}</td>", cell.shown()),
            })
            .collect();
        text += &format!("<tr>{cells}</tr>\n");
    }
    text + "</table>\n"
}

fn image(file: &str, about: &str) -> String {
    format!("<img src=\"{}\" alt=\"{}\">", escape(file), escape(about))
}
