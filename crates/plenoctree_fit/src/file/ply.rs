//! PLY files: elements with numbers and lists, as text or binary.

use super::{
    bytes::{Bytes, Number},
    fault::Fault,
};

/// Longest header.
const MAX_HEADER: usize = 1 << 16;

/// A file whose header is read.
pub struct Ply<'a> {
    /// The elements, in the order of their data.
    pub elements: Vec<Element>,
    /// The comments in the header.
    pub comments: Vec<String>,
    encoding: Encoding,
    data: &'a [u8],
}

/// An element of a file: a table.
pub struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

/// A column.
pub struct Property {
    pub name: String,
    number: Number,
    /// The type of the number of items, if the property is a list.
    count: Option<Number>,
}

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

impl<'a> Ply<'a> {
    /// Reads the header.
    pub fn new(bytes: &'a [u8]) -> Result<Self, Fault> {
        let line_fault = |line: &str, expected: &str| Fault::found("header", format!("`{line}`"), expected);
        let (mut encoding, mut elements, mut comments) = (None, Vec::<Element>::new(), Vec::new());
        let mut rest = bytes;
        loop {
            let searched = &rest[..rest.len().min(MAX_HEADER.saturating_sub(bytes.len() - rest.len()))];
            let Some(end) = searched.iter().position(|byte| *byte == b'\n') else {
                return Err(Fault::found("header", "no end", "`end_header` within 64 KiB"));
            };
            let line = String::from_utf8_lossy(&rest[..end]);
            rest = &rest[end + 1..];
            let words: Vec<&str> = line.split_whitespace().collect();
            match words[..] {
                ["ply"] | [] => {}
                ["comment" | "obj_info", ref words @ ..] => comments.push(words.join(" ")),
                ["format", name, _] => {
                    encoding = Some(match name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::Little,
                        "binary_big_endian" => Encoding::Big,
                        _ => return Err(line_fault(&line, "ascii, binary_little_endian or binary_big_endian")),
                    });
                }
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| line_fault(&line, "a number of elements"))?;
                    elements.push(Element { name: name.into(), count, properties: Vec::new() });
                }
                ["property", "list", count, number, name] => {
                    let types = number_of(count).zip(number_of(number));
                    let (Some((count, number)), Some(element)) = (types, elements.last_mut()) else {
                        return Err(line_fault(&line, "a list of a known type, in an element"));
                    };
                    element.properties.push(Property { name: name.into(), number, count: Some(count) });
                }
                ["property", number, name] => {
                    let (Some(number), Some(element)) = (number_of(number), elements.last_mut()) else {
                        return Err(line_fault(&line, "a property of a known type, in an element"));
                    };
                    element.properties.push(Property { name: name.into(), number, count: None });
                }
                ["end_header"] => break,
                _ => return Err(line_fault(&line, "a line of a PLY header")),
            }
        }
        let encoding = encoding.ok_or_else(|| Fault::found("header", "no `format`", "a PLY header"))?;
        Ok(Self { elements, comments, encoding, data: rest })
    }

    /// Returns the rows of an element, behind the data of those before it, or `None` if there is no such element.
    pub fn rows(&self, name: &str) -> Result<Option<Rows<'_>>, Fault> {
        let Some(place) = self.elements.iter().position(|element| element.name == name) else { return Ok(None) };
        let mut source = match self.encoding {
            Encoding::Ascii => Source::Text(self.data),
            encoding => Source::Binary(Bytes::new(self.data), encoding == Encoding::Big),
        };
        for element in &self.elements[..place] {
            source.skip(element)?;
        }
        let element = &self.elements[place];
        let mut rows = Rows { element, left: element.rows(), certain: 0, source };
        if let (Source::Binary(bytes, _), Some(size)) = (&mut rows.source, element.row_size()) {
            *bytes = Bytes::new(bytes.take(rows.left.saturating_mul(size), name)?);
            rows.certain = rows.left as usize;
        }
        Ok(Some(rows))
    }
}

impl Element {
    /// Returns the index of a property that is a number.
    pub fn number(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|property| property.name == name && property.count.is_none())
    }

    /// Returns the index of a property that is a number. `expected` describes all that there should be, in errors.
    pub fn required(&self, name: &str, expected: &str) -> Result<usize, Fault> {
        self.number(name).ok_or_else(|| Fault::found(&self.name, format!("no property `{name}`"), expected))
    }

    /// Returns the number of rows that have anything in them.
    fn rows(&self) -> u64 {
        if self.properties.is_empty() { 0 } else { self.count }
    }

    /// Returns the size of a row in a binary file, if all rows have the same.
    fn row_size(&self) -> Option<u64> {
        let size = |property: &Property| property.count.is_none().then_some(property.number.size() as u64);
        self.properties.iter().map(size).sum()
    }
}

/// The rows of an element.
pub struct Rows<'a> {
    /// The element.
    pub element: &'a Element,
    /// The number of rows that are there for certain, before they are read.
    pub certain: usize,
    left: u64,
    source: Source<'a>,
}

impl Rows<'_> {
    /// Reads the next row, and returns whether there is one. Lists count as 0.
    pub fn read(&mut self, row: &mut Vec<f64>) -> Result<bool, Fault> {
        row.clear();
        if self.left == 0 {
            return Ok(false);
        }
        self.left -= 1;
        for property in &self.element.properties {
            row.push(self.source.property(property, &self.element.name)?);
        }
        Ok(true)
    }
}

/// Where numbers come from. A binary file may be big-endian.
enum Source<'a> {
    Text(&'a [u8]),
    Binary(Bytes<'a>, bool),
}

impl Source<'_> {
    fn number(&mut self, number: Number, what: &str) -> Result<f64, Fault> {
        match self {
            Self::Binary(bytes, big_endian) => Ok(number.read(bytes.take(number.size() as u64, what)?, *big_endian)),
            Self::Text(text) => {
                let rest = text.trim_ascii_start();
                let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
                let (word, rest) = rest.split_at(end);
                *text = rest;
                if word.is_empty() {
                    return Err(Fault::found(what, "the end of the file", "more numbers"));
                }
                let word = String::from_utf8_lossy(word);
                word.parse().map_err(|_| Fault::found(what, format!("`{word}`"), "a number"))
            }
        }
    }

    /// Reads a number, or skips a list, which counts as 0.
    fn property(&mut self, property: &Property, what: &str) -> Result<f64, Fault> {
        let Some(count) = property.count else { return self.number(property.number, what) };
        let items = self.number(count, what)?;
        if !(items >= 0.0 && items.fract() == 0.0) {
            return Err(Fault::found(what, format!("a list of {items} items"), "a whole number of items"));
        }
        match self {
            Self::Binary(bytes, _) => {
                bytes.take((items as u64).saturating_mul(property.number.size() as u64), what)?;
            }
            Self::Text(_) => {
                for _ in 0..items as u64 {
                    self.number(property.number, what)?;
                }
            }
        }
        Ok(0.0)
    }

    fn skip(&mut self, element: &Element) -> Result<(), Fault> {
        if let (Self::Binary(bytes, _), Some(size)) = (&mut *self, element.row_size()) {
            bytes.take(element.rows().saturating_mul(size), &element.name)?;
            return Ok(());
        }
        for _ in 0..element.rows() {
            for property in &element.properties {
                self.property(property, &element.name)?;
            }
        }
        Ok(())
    }
}

fn number_of(name: &str) -> Option<Number> {
    Some(match name {
        "char" | "int8" => Number::I8,
        "uchar" | "uint8" => Number::U8,
        "short" | "int16" => Number::I16,
        "ushort" | "uint16" => Number::U16,
        "int" | "int32" => Number::I32,
        "uint" | "uint32" => Number::U32,
        "float" | "float32" => Number::F32,
        "double" | "float64" => Number::F64,
        _ => return None,
    })
}
