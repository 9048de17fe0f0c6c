//! The `.ply` files that trainers of 3D Gaussian splatting write.

use glam::{Quat, Vec3};

use super::{packed_ply, shared::sigmoid};
use crate::{
    file::{
        Fault,
        ply::{Element, Ply, Rows},
    },
    splat::{
        axis::Axis,
        harmonics::functions,
        splats::{Gaussian, MOST_DEGREE, Splats},
    },
};

/// The property that raw files of Mip-Splatting have.
const FILTER: &str = "filter_3D";

/// The properties of a vertex that matter, by their index.
struct Columns {
    position: [usize; 3],
    /// The last one may be missing: flat Gaussians.
    scale: [Option<usize>; 3],
    rotation: [usize; 4],
    opacity: usize,
    /// The width of the 3D filter of Mip-Splatting, which its raw files keep apart.
    filter: Option<usize>,
    /// All coefficients of red, then of green, then of blue.
    coefficients: [Vec<usize>; 3],
    degree: u32,
}

pub fn read(bytes: &[u8]) -> Result<Splats, Fault> {
    let ply = Ply::new(bytes)?;
    let Some(mut rows) = ply.rows("vertex")? else {
        return Err(Fault::found("header", "no element `vertex`", "the vertices of 3D Gaussian splatting"));
    };
    let mut splats = if rows.element.number("packed_position").is_some() {
        packed_ply::read(&ply, &mut rows)?
    } else {
        read_vertices(&mut rows)?
    };
    let (antialiased, up) = described(&ply.comments);
    splats.set_antialiased(antialiased || rows.element.number(FILTER).is_some());
    splats.up = up;
    Ok(splats)
}

fn read_vertices(rows: &mut Rows) -> Result<Splats, Fault> {
    let columns = Columns::find(rows.element)?;
    let mut splats = Splats::new(columns.degree);
    splats.reserve(rows.certain);
    let mut row = Vec::new();
    while rows.read(&mut row)? {
        columns.push(&mut splats, |index| row[index] as f32);
    }
    Ok(splats)
}

/// Returns whether comments say that the capture was trained with antialiasing, as Brush and Postshot write it, and the
/// direction that they say is up, as Brush and nerfstudio write it. The last ones count.
fn described(comments: &[String]) -> (bool, Option<Axis>) {
    let (mut antialiased, mut up) = (false, None);
    for comment in comments {
        let comment = comment.to_ascii_lowercase();
        if let Some(mode) = comment.strip_prefix("splatrendermode:") {
            antialiased = mode.trim() == "mip";
        } else if let Some(flag) =
            ["antialiased ", "postshot.anti_aliasing="].iter().find_map(|key| comment.strip_prefix(key))
        {
            antialiased = flag.trim() == "1";
        } else if let Some(axis) = comment.strip_prefix("vertical axis:") {
            let words: Vec<&str> = axis.split_whitespace().collect();
            up = match words[..] {
                ["x", ..] => Some(Axis::X),
                // Brush means that of most captures.
                ["y", ..] => Some(Axis::NegativeY),
                ["z", ..] => Some(Axis::Z),
                [x, y, z] => {
                    let numbers: Result<Vec<f64>, _> = [x, y, z].map(str::parse).into_iter().collect();
                    let vector = numbers.ok().and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
                    vector.and_then(|vector| Axis::nearest(vector.into()))
                }
                _ => None,
            };
        }
    }
    (antialiased, up)
}

impl Columns {
    fn find(vertex: &Element) -> Result<Self, Fault> {
        let find = |name: &str| vertex.number(name);
        let required = |name: &str| {
            vertex
                .required(name, "the properties of 3D Gaussian splatting: x, y, z, scale_*, rot_*, opacity and f_dc_*")
        };
        let rest = (0..).take_while(|index| find(&format!("f_rest_{index}")).is_some()).count();
        let Some(degree) = (0..=4u32).find(|&degree| 3 * (functions(degree) - 1) == rest) else {
            let found = format!("{rest} properties `f_rest_*`");
            return Err(Fault::found("vertex", found, "0, 9, 24, 45 or 72"));
        };
        let per_channel = rest / 3;
        // Degree 4 has coefficients that nothing here evaluates.
        let degree = degree.min(MOST_DEGREE);
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
            filter: find(FILTER),
            coefficients: [channel(0)?, channel(1)?, channel(2)?],
            degree,
        })
    }

    /// Adds the Gaussian whose properties `number` returns by their index.
    fn push(&self, splats: &mut Splats, number: impl Fn(usize) -> f32) {
        let [w, x, y, z] = self.rotation.map(&number);
        let mut gaussian = Gaussian {
            position: Vec3::from_array(self.position.map(&number)),
            scale: Vec3::from_array(self.scale.map(|index| index.map_or(0.0, |index| number(index).exp()))),
            rotation: Quat::from_xyzw(x, y, z, w),
            opacity: sigmoid(number(self.opacity)),
        };
        // As its `save_fused_ply` does: a wider Gaussian lets more light through. One without a width may stay so.
        if let Some(filter) = self.filter.map(&number).filter(|filter| *filter != 0.0) {
            let wide = (gaussian.scale * gaussian.scale + filter * filter).map(f32::sqrt);
            gaussian.opacity *= (gaussian.scale / wide).element_product();
            gaussian.scale = wide;
        }
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
