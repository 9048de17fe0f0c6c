//! Figure 7: neighboring frames.

use plenoctree_cli::{number::counted, progress, renderer::PosterizeSettings, result::Result};

use super::super::shot::posterize;
use super::{
    super::{arguments::Arguments, data::Evidence, methods::Method},
    rows::{COLUMNS, cells, note, opaque},
};
use crate::coherence::{FieldPalette, Series, compare, palette_of_frame, quarter};
use crate::report::{Cell, Picture, Section, Table};

/// Compares one palette for the field with one palette per frame, over a turn of 90 degrees.
pub fn section(evidence: &mut Evidence, arguments: &Arguments) -> Result<Section> {
    let mut section = Section::new("Figure 7: neighboring frames");
    section.text(
        "The camera turns by 90 degrees around the field. Lines show how much each frame differs from the one before: \
         the mean absolute difference of encoded sRGB over all pixels. A frame's own palette is the simplified hull of \
         its pixels (Tan et al. 2016). Recolored frames show every palette color with the opposite hue. A spike is a \
         difference of more than one and a half times that of the frames as trained.",
    );
    let camera = evidence.shots[0].camera;
    let cameras = quarter(&evidence.field, (camera.width, camera.height), arguments.frames as usize)
        .ok_or("nothing is visible in the field")?;
    let methods = &evidence.methods;
    let palettes = [
        FieldPalette { name: "hull", label: "field's hull", palette: methods.palette(Method::Hull) },
        FieldPalette { name: "fitted", label: "field's fitted palette", palette: methods.palette(Method::Fitted) },
    ];
    let bar = progress::bar("frames", cameras.len() as u64, arguments.quiet);
    let colors = arguments.colors as usize;
    let series = compare(&mut *evidence.renderer, &cameras, &palettes, colors, &bar)?;
    bar.finish_and_clear();

    evidence.folder.text("csv/figure_07_frames.csv", &series.csv())?;
    section.plot(evidence.folder.plot("figure_07", &series.svg(&evidence.name))?, "differences of neighboring frames");
    let rows = series.columns.iter().map(|column| {
        let (frame, worst) = column.worst();
        vec![
            Cell::name(&column.label, &column.name),
            Cell::Number(column.mean(), 5),
            Cell::Number(worst, 5),
            Cell::Number(frame as f64, 0),
            Cell::Number(series.spikes(column) as f64, 0),
        ]
    });
    let head = vec![
        ("frames", "frames"),
        ("mean", "mean"),
        ("worst", "worst"),
        ("at frame", "worst_at_frame"),
        ("spikes", "spikes"),
    ];
    let table = Table { head, rows: rows.collect() };
    section.table(&evidence.folder, "figure_07", table)?;

    claims(&mut section, &series);
    let worst = series.columns.iter().find(|column| column.name == "per_frame").map_or(1, |column| column.worst().0);
    section.text(format!(
        "The two neighboring frames that differ most with palettes of their own, {} and {worst}, and the same frames \
         with the field's hull.",
        worst.saturating_sub(1)
    ));
    let mut rows = Vec::new();
    for frame in [worst.saturating_sub(1), worst] {
        let pictures = transition(evidence, &cameras[frame.min(cameras.len() - 1)], frame, colors, &mut rows)?;
        section.pictures(pictures);
    }
    let mut head = vec![("frame", "frame"), ("palette", "palette")];
    head.extend(COLUMNS);
    section.table(&evidence.folder, "figure_07_pictures", Table { head, rows })?;
    Ok(section)
}

/// Checks what the paper says about one palette against one per frame.
fn claims(section: &mut Section, series: &Series) {
    let column = |name: &str| series.columns.iter().find(|column| column.name == name);
    for (claim, field, frame) in [
        ("One palette keeps neighboring posterized frames more alike than one per frame.", "hull", "per_frame"),
        (
            "One palette keeps neighboring recolored frames more alike than one per frame.",
            "hull_recolored",
            "per_frame_recolored",
        ),
    ] {
        if let (Some(field), Some(frame)) = (column(field), column(frame)) {
            let (a, b) = (field.worst().1, frame.worst().1);
            section.claim(
                claim,
                format!("mean {:.4} against {:.4}, worst {a:.4} against {b:.4}", field.mean(), frame.mean()),
                field.mean() < frame.mean(),
            );
        }
    }
    if let (Some(field), Some(frame)) = (column("hull"), column("per_frame")) {
        let (field, frame) = (series.spikes(field), series.spikes(frame));
        section.claim(
            "One palette per frame has frequent spikes.",
            format!("{}, {field} with the field's palette", counted(frame, "spike", "spikes")),
            frame > field,
        );
    }
}

/// Shows a frame as trained, with its own palette, and with the field's. Adds a row of figures for each palette.
fn transition(
    evidence: &mut Evidence,
    camera: &plenoctree::camera::PinholeCamera,
    frame: usize,
    colors: usize,
    rows: &mut Vec<Vec<Cell>>,
) -> Result<Vec<Picture>> {
    let original = evidence.renderer.original(camera)?;
    let own = palette_of_frame(&original, colors)?;
    let field = evidence.methods.palette(Method::Hull).clone();
    let file = evidence.folder.picture(&format!("frame_{frame}"), &opaque(&original))?;
    let mut pictures =
        vec![Picture { file, title: "as trained".into(), note: format!("frame {frame}"), palette: None }];
    for (name, title, palette) in [("own", "frame's palette", own), ("hull", "field's hull", field)] {
        let posterized = posterize(&mut *evidence.renderer, camera, &original, &palette, PosterizeSettings::default())?;
        let mut row = vec![Cell::Number(frame as f64, 0), Cell::name(title, name)];
        row.extend(cells(posterized.errors));
        rows.push(row);
        let name = format!("frame_{frame}_{name}");
        let file = evidence.folder.picture(&name, &posterized.image)?;
        let palette = Some(evidence.folder.palette(&name, &palette)?);
        pictures.push(Picture { file, title: title.into(), note: note(posterized.errors), palette });
    }
    Ok(pictures)
}
