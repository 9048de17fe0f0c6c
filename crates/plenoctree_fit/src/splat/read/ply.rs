//! The `.ply` files that trainers of 3D Gaussian splatting write.

use glam::{Quat, Vec3};

use super::{
    bytes::{Bytes, Number},
    shared::sigmoid,
};
use crate::splat::{
    error::Fault,
    harmonics::functions,
    splats::{Gaussian, Splats},
};

/// Longest header.
const MAX_HEADER: usize = 1 << 16;

#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

struct Property {
    name: String,
    number: Number,
    /// The type of the number of items, if the property is a list.
    count: Option<Number>,
}

/// The properties of a vertex that matter, by their index.
struct Columns {
    position: [usize; 3],
    /// The last one may be missing: flat Gaussians.
    scale: [Option<usize>; 3],
    rotation: [usize; 4],
    opacity: usize,
    /// All coefficients of red, then of green, then of blue.
    coefficients: [Vec<usize>; 3],
    degree: u32,
}

pub fn read(bytes: &[u8]) -> Result<Splats, Fault> {
    let (encoding, elements, data) = header(bytes)?;
    let Some(place) = elements.iter().position(|element| element.name == "vertex") else {
        return Err(Fault::found("header", "no element `vertex`", "the vertices of 3D Gaussian splatting"));
    };
    let vertex = &elements[place];
    if vertex.properties.iter().any(|property| property.name.starts_with("packed_")) {
        let expected = "properties that are not packed: convert the file with splat-transform";
        return Err(Fault::found("vertex", "a compressed .ply file", expected));
    }
    let columns = Columns::find(vertex)?;
    match encoding {
        Encoding::Ascii => read_ascii(data, &elements[..place], vertex, &columns),
        _ => read_binary(data, &elements[..place], vertex, &columns, encoding == Encoding::Big),
    }
}

/// Reads the header. Returns the data behind it.
fn header(bytes: &[u8]) -> Result<(Encoding, Vec<Element>, &[u8]), Fault> {
    let line_fault = |line: &str, expected: &str| Fault::found("header", format!("`{line}`"), expected);
    let (mut encoding, mut elements) = (None, Vec::<Element>::new());
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
            ["ply"] | [] | ["comment" | "obj_info", ..] => {}
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
    Ok((encoding, elements, rest))
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

impl Columns {
    fn find(vertex: &Element) -> Result<Self, Fault> {
        let find = |name: &str| {
            vertex.properties.iter().position(|property| property.name == name && property.count.is_none())
        };
        let required = |name: &str| {
            let expected = "the properties of 3D Gaussian splatting: x, y, z, scale_*, rot_*, opacity and f_dc_*";
            find(name).ok_or_else(|| Fault::found("vertex", format!("no property `{name}`"), expected))
        };
        let rest = (0..).take_while(|index| find(&format!("f_rest_{index}")).is_some()).count();
        let Some(degree) = (0..=4u32).find(|&degree| 3 * (functions(degree) - 1) == rest) else {
            let found = format!("{rest} properties `f_rest_*`");
            return Err(Fault::found("vertex", found, "0, 9, 24, 45 or 72"));
        };
        let per_channel = rest / 3;
        // Degree 4 has coefficients that nothing here evaluates.
        let degree = degree.min(crate::splat::splats::MOST_DEGREE);
        let channel = |channel: usize| -> Result<Vec<usize>, Fault> {
            let dc = required(&format!("f_dc_{channel}"));
            let rest = (0..functions(degree) - 1).map(|k| required(&format!("f_rest_{}", channel * per_channel + k)));
            std::iter::once(dc).chain(rest).collect()
        };
        Ok(Self {
            position: [required("x")?, required("y")?, required("z")?],
            scale: [Some(required("scale_0")?), Some(required("scale_1")?), find("scale_2")],
            rotation: [required("rot_0")?, required("rot_1")?, required("rot_2")?, required("rot_3")?],
            opacity: required("opacity")?,
            coefficients: [channel(0)?, channel(1)?, channel(2)?],
            degree,
        })
    }

    /// Adds the Gaussian whose properties `number` returns by their index.
    fn push(&self, splats: &mut Splats, number: impl Fn(usize) -> f32) {
        let [w, x, y, z] = self.rotation.map(&number);
        let gaussian = Gaussian {
            position: Vec3::from_array(self.position.map(&number)),
            scale: Vec3::from_array(self.scale.map(|index| index.map_or(0.0, |index| number(index).exp()))),
            rotation: Quat::from_xyzw(x, y, z, w),
            opacity: sigmoid(number(self.opacity)),
        };
        let mut coefficients = [Vec3::ZERO; 16];
        let count = functions(self.degree);
        for (channel, columns) in self.coefficients.iter().enumerate() {
            for (coefficient, column) in coefficients.iter_mut().zip(columns) {
                coefficient[channel] = number(*column);
            }
        }
        splats.push(gaussian, &coefficients[..count]);
    }
}

fn read_binary(
    data: &[u8],
    before: &[Element],
    vertex: &Element,
    columns: &Columns,
    big_endian: bool,
) -> Result<Splats, Fault> {
    let mut data = Bytes::new(data);
    for element in before {
        skip_binary(&mut data, element, big_endian)?;
    }
    let mut splats = Splats::new(columns.degree);
    if vertex.properties.iter().all(|property| property.count.is_none()) {
        let mut offsets = Vec::with_capacity(vertex.properties.len());
        let size = vertex.properties.iter().fold(0, |offset, property| {
            offsets.push(offset);
            offset + property.number.size()
        });
        let bytes = data.take(vertex.count.saturating_mul(size as u64), "vertex")?;
        splats.reserve(vertex.count as usize);
        for row in bytes.chunks_exact(size) {
            columns.push(&mut splats, |index| {
                vertex.properties[index].number.read(&row[offsets[index]..], big_endian) as f32
            });
        }
    } else {
        let mut row = Vec::new();
        for _ in 0..vertex.count {
            row.clear();
            for property in &vertex.properties {
                row.push(read_property(&mut data, property, big_endian, &vertex.name)?);
            }
            columns.push(&mut splats, |index| row[index] as f32);
        }
    }
    Ok(splats)
}

fn skip_binary(data: &mut Bytes, element: &Element, big_endian: bool) -> Result<(), Fault> {
    if element.properties.iter().all(|property| property.count.is_none()) {
        let size: usize = element.properties.iter().map(|property| property.number.size()).sum();
        data.take(element.count.saturating_mul(size as u64), &element.name)?;
        return Ok(());
    }
    for _ in 0..element.count {
        for property in &element.properties {
            read_property(data, property, big_endian, &element.name)?;
        }
    }
    Ok(())
}

/// Reads a number, or skips a list.
fn read_property(data: &mut Bytes, property: &Property, big_endian: bool, what: &str) -> Result<f64, Fault> {
    let Some(count) = property.count else {
        return Ok(property.number.read(data.take(property.number.size() as u64, what)?, big_endian));
    };
    let items = count.read(data.take(count.size() as u64, what)?, big_endian);
    if items < 0.0 || items.fract() != 0.0 {
        return Err(Fault::found(what, format!("a list of {items} items"), "a whole number of items"));
    }
    data.take((items as u64).saturating_mul(property.number.size() as u64), what)?;
    Ok(0.0)
}

fn read_ascii(data: &[u8], before: &[Element], vertex: &Element, columns: &Columns) -> Result<Splats, Fault> {
    let mut words = data.split(|byte| byte.is_ascii_whitespace()).filter(|word| !word.is_empty());
    let mut next = |what: &str| -> Result<f64, Fault> {
        let word = words.next().ok_or_else(|| Fault::found(what, "the end of the file", "more numbers"))?;
        let text = String::from_utf8_lossy(word);
        text.parse().map_err(|_| Fault::found(what, format!("`{text}`"), "a number"))
    };
    let mut read_property = |property: &Property, what: &str| -> Result<f64, Fault> {
        let first = next(what)?;
        if property.count.is_some() {
            if !(first >= 0.0 && first.fract() == 0.0) {
                return Err(Fault::found(what, format!("a list of {first} items"), "a whole number of items"));
            }
            for _ in 0..first as u64 {
                next(what)?;
            }
        }
        Ok(first)
    };
    for element in before.iter().filter(|element| !element.properties.is_empty()) {
        for _ in 0..element.count {
            for property in &element.properties {
                read_property(property, &element.name)?;
            }
        }
    }
    let mut splats = Splats::new(columns.degree);
    let mut row = Vec::new();
    for _ in 0..vertex.count {
        row.clear();
        for property in &vertex.properties {
            row.push(read_property(property, "vertex")?);
        }
        columns.push(&mut splats, |index| row[index] as f32);
    }
    Ok(splats)
}
