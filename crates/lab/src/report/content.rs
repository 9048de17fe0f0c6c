//! The parts of a report.

/// A document. Its text is plain, so that it reads the same in every format.
pub struct Report {
    /// The title.
    pub title: String,
    /// The parts, in order.
    pub sections: Vec<Section>,
}

/// A part of a report with a heading.
pub struct Section {
    pub(super) title: String,
    pub(super) blocks: Vec<Block>,
    claims: Vec<Claim>,
}

/// What the paper claims, and what was found here.
pub struct Claim {
    /// The heading of the section that shows it.
    pub section: String,
    /// The claim.
    pub claim: &'static str,
    /// The figures that support it.
    pub found: String,
    /// Whether it holds.
    pub holds: bool,
}

/// A part of a section.
pub(super) enum Block {
    Text(String),
    Pictures(Vec<Picture>),
    Plot { file: String, about: String },
    Table { table: Table, csv: String },
}

/// A picture of a row.
pub struct Picture {
    /// Its file, relative to the report.
    pub file: String,
    /// What it shows.
    pub title: String,
    /// Its figures, or more about it.
    pub note: String,
    /// The drawing of its palette, relative to the report.
    pub palette: Option<String>,
}

/// A table. Its file of comma-separated values has the same cells, with all digits and without images.
pub struct Table {
    /// The names of the columns, for readers and for the file.
    pub head: Vec<(&'static str, &'static str)>,
    /// The rows, with a cell for every column.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone)]
pub enum Cell {
    /// Words.
    Text(String),
    /// The name of the row, for readers and in files.
    Name(String, String),
    /// A number, and the decimals that readers see.
    Number(f64, usize),
    /// The path of an image, relative to the report.
    Image(String),
    /// Not measured.
    Empty,
}

impl Section {
    /// Creates a section without content.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), blocks: Vec::new(), claims: Vec::new() }
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: impl Into<String>) {
        self.blocks.push(Block::Text(text.into()));
    }

    /// Adds a row of pictures.
    pub fn pictures(&mut self, pictures: Vec<Picture>) {
        self.blocks.push(Block::Pictures(pictures));
    }

    /// Adds a plot: an SVG file, relative to the report, and what it is about.
    pub fn plot(&mut self, file: String, about: impl Into<String>) {
        self.blocks.push(Block::Plot { file, about: about.into() });
    }

    /// Adds a claim, which is listed at the top of the report.
    pub fn claim(&mut self, claim: &'static str, found: String, holds: bool) {
        self.claims.push(Claim { section: self.title.clone(), claim, found, holds });
    }

    /// Returns the claims.
    pub fn claims(&self) -> &[Claim] {
        &self.claims
    }
}

impl Cell {
    /// Returns a text.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// Returns the name of a row.
    pub fn name(shown: impl Into<String>, name: impl Into<String>) -> Self {
        Self::Name(shown.into(), name.into())
    }

    /// Returns a number, or an empty cell.
    pub fn number(value: Option<f64>, digits: usize) -> Self {
        value.map_or(Self::Empty, |value| Self::Number(value, digits))
    }

    /// Formats the cell for readers. Images are not text.
    pub(super) fn shown(&self) -> String {
        match self {
            Self::Text(text) | Self::Name(text, _) => text.clone(),
            Self::Number(value, _) if value.is_infinite() => "\u{221e}".into(),
            Self::Number(value, digits) => format!("{value:.digits$}"),
            Self::Image(_) => String::new(),
            Self::Empty => "\u{2013}".into(),
        }
    }
}
