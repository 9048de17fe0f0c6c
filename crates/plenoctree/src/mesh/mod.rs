//! Surfaces of fields as meshes, for physics and navigation.

mod simplify;

use fast_surface_nets::{
    SurfaceNetsBuffer,
    ndshape::{RuntimeShape, Shape},
    surface_nets,
};
use glam::{DVec3, IVec3, UVec3};

use self::simplify::simplify;
use crate::field::PlenOctree;

/// Width of the empty space around the field, in cells, so that its surface is closed.
const PADDING: i32 = 2;
/// How far simplifying moves the surface at most, in cells.
const TOLERANCE: f64 = 0.1;
/// Largest number of cells of the grid: 896 MiB of numbers.
const MAX_CELLS: f64 = (1u32 << 26) as f64;

/// A closed surface. Seen from outside, the corners of its triangles go around counterclockwise.
///
/// Every edge of a triangle is shared with another triangle, which traverses it in the opposite direction. Where parts
/// of a surface touch along an edge, there are two of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceMesh {
    /// Positions of the vertices, in the field's frame.
    pub vertices: Vec<[f32; 3]>,
    /// Three vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// An error that occurs when a surface cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The opacity, rounded to float32, is not more than 0 and less than 1.
    #[error("found opacity {0}, expected more than 0 and less than 1 in float32")]
    Opacity(f64),
    /// The cell size is not positive and finite.
    #[error("found cell size {0}, expected a positive number")]
    CellSize(f64),
    /// The cells are so small that the field has too many of them.
    #[error("found {0:e} cells, expected at most 67108864: choose a larger cell size")]
    TooManyCells(f64),
}

impl PlenOctree {
    /// Returns the surface of the field's solid parts, as closed triangle meshes, for example for colliders.
    ///
    /// The surface is found in a grid of cubes of width `cell_size`, in world units of the field: larger cubes make
    /// simpler surfaces. The solidity of a cube is the opacity of paths of that length through its content; the surface
    /// is where it reaches `opacity`, more than 0 and less than 1 in float32. Closed hollows count as solid, because
    /// trained and packed fields are often empty inside. Walls that are thinner than a cube become as thick as one. If
    /// cubes are about as small as the field's cells, few of them may be opaque enough, and walls have holes. An empty
    /// field has an empty surface.
    ///
    /// The surface is simplified: parts that are flat to within a tenth of a cube consist of few, large triangles.
    ///
    /// # Errors
    ///
    /// Returns an error if an argument is out of range, or if there would be more than 67 million cells.
    pub fn surface_mesh(&self, opacity: f64, cell_size: f64) -> Result<SurfaceMesh, MeshError> {
        let solid = opacity as f32;
        if !(solid > 0.0 && solid < 1.0) {
            return Err(MeshError::Opacity(opacity));
        }
        if !(cell_size > 0.0 && cell_size.is_finite()) {
            return Err(MeshError::CellSize(cell_size));
        }
        let Some((low, high)) = self.bounds() else { return Ok(SurfaceMesh::default()) };
        let size = ((high - low) / cell_size).ceil() + f64::from(2 * PADDING);
        let count = size.element_product();
        if count.is_nan() || count > MAX_CELLS {
            return Err(MeshError::TooManyCells(count));
        }
        let mut grid = Grid::new(low, cell_size, size.as_uvec3());
        grid.add(self);
        grid.fill(solid);
        Ok(grid.surface(solid))
    }
}

/// The solidity of cubes.
struct Grid {
    /// Center of the first cube.
    origin: DVec3,
    cell_size: f64,
    shape: RuntimeShape<u32, 3>,
    size: IVec3,
    solid: Vec<f32>,
    /// The opacity of each cube along each axis, as if its leaves were side by side. That of a thin wall is greater than
    /// its solidity.
    across: Vec<[f32; 3]>,
    /// The mean optical depth of each cube.
    depth: Vec<f32>,
}

/// The steps between the neighbors of a cube that share a side with it.
const NEIGHBORS: [IVec3; 6] = [IVec3::X, IVec3::Y, IVec3::Z, IVec3::NEG_X, IVec3::NEG_Y, IVec3::NEG_Z];

impl Grid {
    fn new(low: DVec3, cell_size: f64, size: UVec3) -> Self {
        let shape = RuntimeShape::<u32, 3>::new(size.to_array());
        let count = shape.size() as usize;
        let origin = low + (0.5 - f64::from(PADDING)) * cell_size;
        let (solid, across, depth) = (vec![0.0; count], vec![[0.0; 3]; count], vec![0.0; count]);
        Self { origin, cell_size, shape, size: size.as_ivec3(), solid, across, depth }
    }

    fn index(&self, cell: IVec3) -> usize {
        self.shape.linearize(cell.as_uvec3().to_array()) as usize
    }

    /// Adds the absorption of leaves to their cubes.
    fn add(&mut self, field: &PlenOctree) {
        let cells = f64::from(1u32 << field.depth());
        for leaf in field.leaf_cells() {
            let density = f64::from(field.densities()[leaf.leaf as usize]) * self.cell_size;
            let absorbed = -(-density).exp_m1();
            let corner = leaf.corner.as_dvec3();
            let ends = [corner, corner + f64::from(leaf.size)].map(|end| field.frame().to_world(end / cells));
            // In cubes.
            let [low, high] = ends.map(|end| (end - self.origin) / self.cell_size + 0.5);
            let first = low.floor().as_ivec3().max(IVec3::ZERO);
            let last = high.ceil().as_ivec3().min(self.size) - 1;
            let share = |axis: usize, cell: i32| {
                let cell = f64::from(cell);
                (high[axis].min(cell + 1.0) - low[axis].max(cell)).max(0.0)
            };
            for x in first.x..=last.x {
                for y in first.y..=last.y {
                    for z in first.z..=last.z {
                        let index = self.index(IVec3::new(x, y, z));
                        let part = DVec3::new(share(0, x), share(1, y), share(2, z));
                        let volume = part.element_product();
                        self.solid[index] += (absorbed * volume) as f32;
                        self.depth[index] += (density * volume) as f32;
                        for (axis, across) in self.across[index].iter_mut().enumerate() {
                            let area = volume / part[axis].max(1e-9);
                            let opacity = -area * (-density * part[axis]).exp_m1();
                            *across += opacity as f32;
                        }
                    }
                }
            }
        }
    }

    /// Fills hollows, which are what cannot be reached from outside, and thickens walls that are thinner than a cube.
    fn fill(&mut self, opacity: f32) {
        // Leaves behind one another are less opaque than side by side, and no cube is more opaque than an even one.
        let is_thick = |depth: &f32| -(-depth).exp_m1() >= opacity;
        let is_wall =
            |(across, depth): (&[f32; 3], &f32)| is_thick(depth) && across.iter().any(|across| *across >= opacity);
        let is_wall: Vec<bool> = self.across.iter().zip(&self.depth).map(is_wall).collect();
        let mut outside = vec![false; self.solid.len()];
        outside[0] = true;
        let mut open = vec![IVec3::ZERO];
        while let Some(cell) = open.pop() {
            for index in self.neighbors(cell) {
                let blocks = is_wall[index] || self.solid[index] >= opacity;
                if !blocks && !std::mem::replace(&mut outside[index], true) {
                    open.push(self.cell(index));
                }
            }
        }
        let mut thin = vec![];
        for index in 0..self.solid.len() {
            if outside[index] || self.solid[index] >= opacity {
                continue;
            }
            let cell = self.cell(index);
            if is_wall[index] && self.neighbors(cell).any(|near| outside[near]) {
                thin.push((index, cell));
            } else {
                self.solid[index] = 1.0;
            }
        }
        // At the surface of something thick, the solidity tells where in the cube the surface is.
        thin.retain(|(_, cell)| self.neighbors(*cell).all(|near| self.solid[near] < opacity));
        thin.iter().for_each(|(index, _)| self.solid[*index] = 1.0);
    }

    fn cell(&self, index: usize) -> IVec3 {
        UVec3::from_array(self.shape.delinearize(index as u32)).as_ivec3()
    }

    /// Returns the cubes that share a side with one.
    fn neighbors(&self, cell: IVec3) -> impl Iterator<Item = usize> {
        let is_inside = |cell: &IVec3| cell.cmpge(IVec3::ZERO).all() && cell.cmplt(self.size).all();
        NEIGHBORS.into_iter().map(move |step| cell + step).filter(is_inside).map(|cell| self.index(cell))
    }

    fn surface(&self, opacity: f32) -> SurfaceMesh {
        // The crate takes signed distances, which are negative inside.
        let distances: Vec<f32> = self.solid.iter().map(|solid| opacity - solid).collect();
        let mut buffer = SurfaceNetsBuffer::default();
        surface_nets(&distances, &self.shape, [0; 3], (self.size - 1).as_uvec3().to_array(), &mut buffer);
        let vertices = buffer.positions.iter().map(|at| DVec3::from(at.map(f64::from))).collect();
        let triangles = buffer.indices.chunks_exact(3).map(|corners| [corners[0], corners[1], corners[2]]).collect();
        let (vertices, triangles) = simplify(vertices, triangles, TOLERANCE);
        let place = |at: &DVec3| (self.origin + *at * self.cell_size).as_vec3().to_array();
        SurfaceMesh { vertices: vertices.iter().map(place).collect(), triangles }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;
    use crate::{
        bake::{BakeSettings, bake},
        field::Basis,
    };

    fn field(density: impl Fn(DVec3) -> f64 + Sync) -> PlenOctree {
        let settings = BakeSettings { depth: 6, basis: Basis::Rgba, directions: 1, ..Default::default() };
        bake(&settings, density, |_| |_| DVec3::splat(0.5)).unwrap()
    }

    /// The volume inside, which is negative if the triangles face inward.
    fn volume(mesh: &SurfaceMesh) -> f64 {
        let at = |vertex: u32| DVec3::from(mesh.vertices[vertex as usize].map(f64::from));
        mesh.triangles.iter().map(|[a, b, c]| at(*a).dot(at(*b).cross(at(*c))) / 6.0).sum()
    }

    /// The number of edges in each direction.
    fn edges(mesh: &SurfaceMesh) -> HashMap<(u32, u32), usize> {
        let mut edges = HashMap::new();
        for [a, b, c] in &mesh.triangles {
            for edge in [(*a, *b), (*b, *c), (*c, *a)] {
                *edges.entry(edge).or_default() += 1;
            }
        }
        edges
    }

    #[test]
    fn a_ball_has_a_closed_surface_of_its_volume() {
        let expected = 4.0 / 3.0 * std::f64::consts::PI * 0.7f64.powi(3);
        // Hollow, as packed fields are.
        let ball = field(|at| if (0.5..0.7).contains(&at.length()) { 500.0 } else { 0.0 });
        let mut triangles = usize::MAX;
        for cell_size in [0.03, 0.06, 0.12] {
            let mesh = ball.surface_mesh(0.5, cell_size).unwrap();
            let found = volume(&mesh);
            // Cells that the ball only touches are opaque too, so the field's ball is a little larger.
            assert!((found / expected - 1.04).abs() < 0.04, "{found} of {expected} in cells of {cell_size}");
            assert!(mesh.triangles.len() < triangles);
            triangles = mesh.triangles.len();
            let edges = edges(&mesh);
            assert!(edges.iter().all(|((a, b), count)| *count == 1 && edges.get(&(*b, *a)) == Some(&1)));
            let far = |vertex: &[f32; 3]| (DVec3::from(vertex.map(f64::from)).length() - 0.7).abs();
            assert!(mesh.vertices.iter().all(|vertex| far(vertex) < 0.8 * cell_size));
        }
    }

    /// A cuboid consists of few triangles, and keeps its shape.
    #[test]
    fn flat_parts_consist_of_few_triangles() {
        let size = DVec3::new(0.8, 0.5, 0.3);
        let cuboid = field(|at| if at.abs().cmplt(size).all() { 500.0 } else { 0.0 });
        let mesh = cuboid.surface_mesh(0.5, 0.03).unwrap();
        // The cuboid has about 4,000 squares of this size.
        assert!(mesh.triangles.len() < 400, "{} triangles", mesh.triangles.len());
        let far = |at: DVec3| {
            let outside = at.abs() - size;
            (outside.max(DVec3::ZERO).length() + outside.max_element().min(0.0)).abs()
        };
        let corners = mesh.triangles.iter().map(|corners| corners.map(|vertex| mesh.vertices[vertex as usize]));
        for corners in corners.map(|corners| corners.map(|at| DVec3::from(at.map(f64::from)))) {
            let middle = corners.iter().sum::<DVec3>() / 3.0;
            // The field's cells are as wide as the cubes, and the surface ends within one of each.
            assert!(corners.iter().chain([&middle]).all(|at| far(*at) < 0.035), "{corners:?}");
        }
        let edges = edges(&mesh);
        assert!(edges.iter().all(|((a, b), count)| *count == 1 && edges.get(&(*b, *a)) == Some(&1)));
    }

    /// Also where cubes touch only along edges, at the end of the field's cube, and for a single leaf.
    #[test]
    fn every_surface_is_closed() {
        let noise =
            field(|at| if (7.0 * at.x).sin() * (9.0 * at.y).sin() * (8.0 * at.z).sin() > 0.1 { 300.0 } else { 0.0 });
        let full = field(|_| 100.0);
        let corner = field(|at| if at.min_element() > 0.97 { 900.0 } else { 0.0 });
        // Two columns that share an edge.
        let touching =
            field(|at| if at.abs().max_element() < 0.5 && (at.x > 0.0) == (at.y > 0.0) { 900.0 } else { 0.0 });
        let fields =
            [(&noise, 0.05), (&noise, 0.0313), (&full, 0.3), (&corner, 0.01), (&corner, 5.0), (&touching, 0.0625)];
        for (field, cell_size) in fields {
            let mesh = field.surface_mesh(0.3, cell_size).unwrap();
            let edges = edges(&mesh);
            assert!(edges.iter().all(|((a, b), count)| edges.get(&(*b, *a)) == Some(count)));
            assert!(volume(&mesh) >= 0.0 && mesh.vertices.iter().flatten().all(|x| x.is_finite()));
        }
        assert!(volume(&full.surface_mesh(0.3, 0.1).unwrap()) > 7.5);
    }

    /// A shell that is thinner than the cubes is as solid as a ball, and an open one keeps its shape.
    #[test]
    fn thin_walls_have_surfaces() {
        let shell = |is_open: bool| {
            field(move |at| if (0.66..0.7).contains(&at.length()) && !(is_open && at.z < -0.4) { 900.0 } else { 0.0 })
        };
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.7f64.powi(3);
        for cell_size in [0.05, 0.1, 0.15] {
            let closed = volume(&shell(false).surface_mesh(0.5, cell_size).unwrap());
            assert!((0.7..1.3).contains(&(closed / ball)), "{closed} of {ball} in cells of {cell_size}");
            let open = shell(true).surface_mesh(0.5, cell_size).unwrap();
            let far = |vertex: &[f32; 3]| (DVec3::from(vertex.map(f64::from)).length() - 0.68).abs();
            assert!(open.vertices.iter().all(|vertex| far(vertex) < 1.2 * cell_size));
            // Its area is that of the sphere without a fifth, on both sides.
            let area: f64 = open
                .triangles
                .iter()
                .map(|corners| {
                    let [a, b, c] = corners.map(|vertex| DVec3::from(open.vertices[vertex as usize].map(f64::from)));
                    0.5 * (b - a).cross(c - a).length()
                })
                .sum();
            assert!((7.0..12.0).contains(&area), "{area} in cells of {cell_size}");
        }
    }

    /// A soft plate of many leaves, each of which adds next to nothing to a cube.
    #[test]
    fn soft_walls_have_surfaces_in_large_cubes() {
        let settings = BakeSettings { depth: 7, basis: Basis::Rgba, directions: 8, ..Default::default() };
        let is_plate = |at: DVec3| at.x.abs() < 0.9 && at.y.abs() < 0.9 && (0.0..0.4).contains(&at.z);
        let plate = bake(&settings, |at| if is_plate(at) { 1.8 } else { 0.0 }, |_| |_| DVec3::ONE).unwrap();
        assert!(!plate.surface_mesh(0.5, 1.0).unwrap().triangles.is_empty());
    }

    /// Matter that is not opaque enough in any direction is no wall, however many leaves a cube has, or touches.
    #[test]
    fn thin_matter_has_no_surface() {
        for (density, opacity, cell_size) in [(4.5, 0.99, 0.25), (2.5, 0.5, 0.25), (100.0, 0.999, 0.02)] {
            let ball = field(|at| if at.length() < 0.8 { density } else { 0.0 });
            let mesh = ball.surface_mesh(opacity, cell_size).unwrap();
            assert!(mesh.triangles.is_empty(), "{density}: {} triangles", mesh.triangles.len());
        }
    }

    #[test]
    fn unusual_arguments_are_errors() {
        let ball = field(|at| if at.length() < 0.5 { 10.0 } else { 0.0 });
        for opacity in [0.0, 1.0, -1.0, f64::NAN, 0.999_999_99, 1e-46] {
            assert!(matches!(ball.surface_mesh(opacity, 0.1), Err(MeshError::Opacity(_))));
        }
        for cell_size in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(ball.surface_mesh(0.5, cell_size), Err(MeshError::CellSize(_))));
        }
        assert!(matches!(ball.surface_mesh(0.5, 1e-4), Err(MeshError::TooManyCells(_))));
        assert!(matches!(ball.surface_mesh(0.5, 1e-300), Err(MeshError::TooManyCells(_))));
        assert_eq!(ball.thinned(f32::INFINITY).surface_mesh(0.5, 0.1), Ok(SurfaceMesh::default()));
        // Too faint to be solid.
        assert!(ball.surface_mesh(0.99, 0.01).unwrap().triangles.is_empty());
    }
}
