//! Simplifies closed surfaces, by collapsing edges with the least quadric error (Garland and Heckbert 1997).

use std::{cmp::Reverse, collections::BinaryHeap};

use glam::{DMat3, DVec3};

/// The cosine of the largest angle by which a triangle may turn in one step.
const LEAST_COSINE: f64 = 0.5;
/// The least height of a triangle that a step makes, relative to its longest side, so that none becomes a needle.
const LEAST_HEIGHT: f64 = 0.02;

/// Merges triangles while the surface stays within `tolerance` of the planes of all triangles that it replaces. Returns
/// the vertices and the triangles that are left.
///
/// Closed surfaces stay closed: where parts of them touch, nothing changes.
pub(super) fn simplify(vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>, tolerance: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut surface = Surface::new(vertices, triangles);
    surface.collapse_all(tolerance);
    surface.into_parts()
}

/// The sum of squared distances to planes, as a quadratic function of a point.
#[derive(Clone, Copy)]
struct Quadric {
    squares: DMat3,
    linear: DVec3,
    constant: f64,
}

impl Quadric {
    const ZERO: Self = Self { squares: DMat3::ZERO, linear: DVec3::ZERO, constant: 0.0 };

    /// The squared distance to the plane through `point`. Its normal has the length 1.
    fn plane(point: DVec3, normal: DVec3) -> Self {
        let offset = -normal.dot(point);
        let squares = DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        Self { squares, linear: offset * normal, constant: offset * offset }
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            squares: self.squares + other.squares,
            linear: self.linear + other.linear,
            constant: self.constant + other.constant,
        }
    }

    fn at(&self, point: DVec3) -> f64 {
        (point.dot(self.squares * point) + 2.0 * self.linear.dot(point) + self.constant).max(0.0)
    }

    /// Returns the point where it is least, if there is only one.
    fn least(&self) -> Option<DVec3> {
        // The sum of squared normals is at least 1, so this is relative.
        let determinant = self.squares.determinant();
        (determinant > 1e-3).then(|| -(self.squares.inverse() * self.linear))
    }
}

/// An edge to collapse: its cost, as an integer with the same order, and its vertices, which are as old as when the
/// cost was computed.
type Candidate = Reverse<(u64, [u32; 2], [u32; 2])>;

struct Surface {
    /// Relative to the first one, so that quadrics far from the origin are exact.
    vertices: Vec<DVec3>,
    origin: DVec3,
    triangles: Vec<[u32; 3]>,
    /// The triangles around every vertex. None if it is gone.
    around: Vec<Vec<u32>>,
    quadrics: Vec<Quadric>,
    /// How many times every vertex has changed.
    ages: Vec<u32>,
    /// Whether the triangles around a vertex form one disk.
    is_free: Vec<bool>,
}

impl Surface {
    fn new(mut vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        let origin = vertices.first().copied().unwrap_or_default();
        vertices.iter_mut().for_each(|vertex| *vertex -= origin);
        let mut around = vec![vec![]; vertices.len()];
        for (index, triangle) in (0..).zip(&triangles) {
            triangle.iter().for_each(|vertex| around[*vertex as usize].push(index));
        }
        let count = vertices.len();
        let mut surface =
            Self { vertices, origin, triangles, around, quadrics: vec![], ages: vec![0; count], is_free: vec![] };
        surface.quadrics = (0..count as u32).map(|vertex| surface.quadric(vertex)).collect();
        surface.is_free = (0..count as u32).map(|vertex| surface.is_disk(vertex)).collect();
        surface
    }

    /// Returns the corners of a triangle.
    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        self.triangles[triangle as usize].map(|vertex| self.vertices[vertex as usize])
    }

    fn quadric(&self, vertex: u32) -> Quadric {
        let planes = self.around[vertex as usize].iter().filter_map(|triangle| {
            let corners = self.corners(*triangle);
            Some(Quadric::plane(corners[0], normal(corners).try_normalize()?))
        });
        planes.fold(Quadric::ZERO, |sum, plane| sum.plus(&plane))
    }

    /// Returns the other two vertices of the triangles around a vertex, in the order of the triangle.
    fn opposite(&self, vertex: u32) -> impl Iterator<Item = (u32, u32)> {
        self.around[vertex as usize].iter().map(move |triangle| {
            let [a, b, c] = self.triangles[*triangle as usize];
            if a == vertex {
                (b, c)
            } else if b == vertex {
                (c, a)
            } else {
                (a, b)
            }
        })
    }

    fn is_disk(&self, vertex: u32) -> bool {
        let mut next: Vec<_> = self.opposite(vertex).collect();
        let Some(&(start, mut at)) = next.first() else { return false };
        let mut steps = 1;
        next.sort_unstable();
        if next.windows(2).any(|pair| pair[0].0 == pair[1].0) {
            return false;
        }
        while at != start {
            let Ok(found) = next.binary_search_by_key(&at, |edge| edge.0) else { return false };
            at = next[found].1;
            steps += 1;
            if steps > next.len() {
                return false;
            }
        }
        steps == next.len()
    }

    fn collapse_all(&mut self, tolerance: f64) {
        let mut heap = BinaryHeap::new();
        for vertex in 0..self.vertices.len() as u32 {
            self.offer(&mut heap, vertex, tolerance, |other| other > vertex);
        }
        while let Some(Reverse((_, [u, v], ages))) = heap.pop() {
            if [u, v].map(|vertex| self.ages[vertex as usize]) != ages {
                continue;
            }
            let Some((_, point)) = self.cost(u, v) else { continue };
            if !self.may_collapse(u, v, point) {
                continue;
            }
            self.collapse(u, v, point);
            self.offer(&mut heap, u, tolerance, |_| true);
        }
    }

    /// Adds the edges of a vertex to those that may be collapsed.
    fn offer(&self, heap: &mut BinaryHeap<Candidate>, vertex: u32, tolerance: f64, wanted: impl Fn(u32) -> bool) {
        if !self.is_free[vertex as usize] {
            return;
        }
        // In a disk, every neighbor comes first once.
        for (other, _) in self.opposite(vertex) {
            if !wanted(other) || !self.is_free[other as usize] {
                continue;
            }
            let Some((error, _)) = self.cost(vertex, other) else { continue };
            if error <= tolerance * tolerance {
                // Of edges that cost the same, the shortest one comes first, so that triangles grow evenly.
                let square = self.vertices[vertex as usize].distance_squared(self.vertices[other as usize]);
                let cost = (error + 1e-3 * square).to_bits();
                let ages = [vertex, other].map(|vertex| self.ages[vertex as usize]);
                heap.push(Reverse((cost, [vertex, other], ages)));
            }
        }
    }

    /// Returns the error of an edge that is collapsed, and the best point to replace it.
    fn cost(&self, u: u32, v: u32) -> Option<(f64, DVec3)> {
        let [a, b] = [u, v].map(|vertex| self.vertices[vertex as usize]);
        let quadric = self.quadrics[u as usize].plus(&self.quadrics[v as usize]);
        // Where planes are almost parallel, the best point may be far away.
        let near = |point: &DVec3| point.distance_squared(0.5 * (a + b)) <= a.distance_squared(b);
        let points = quadric.least().filter(near).into_iter().chain([0.5 * (a + b), a, b]);
        let costs = points.map(|point| (quadric.at(point), point));
        costs.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Returns whether the surface stays closed and does not fold.
    fn may_collapse(&self, u: u32, v: u32, point: DVec3) -> bool {
        // The neighbors that both have must be the two opposite corners of the edge's triangles, and the edge between
        // those must not be opposite to both.
        let common: Vec<_> =
            self.opposite(u).map(|edge| edge.0).filter(|near| self.opposite(v).any(|edge| edge.0 == *near)).collect();
        let [a, b] = common[..] else { return false };
        let is_opposite = |vertex| self.opposite(vertex).any(|edge| edge == (a, b) || edge == (b, a));
        if is_opposite(u) && is_opposite(v) {
            return false;
        }
        let stays = |vertex: u32, other: u32| {
            self.around[vertex as usize].iter().all(|triangle| {
                let corners = self.triangles[*triangle as usize];
                if corners.contains(&other) {
                    return true;
                }
                let before = self.corners(*triangle);
                let mut after = before;
                (0..3).filter(|at| corners[*at] == vertex).for_each(|at| after[at] = point);
                let [old, new] = [before, after].map(normal);
                let longest = (0..3).map(|at| after[at].distance_squared(after[(at + 1) % 3])).fold(0.0, f64::max);
                old.dot(new) >= LEAST_COSINE * old.length() * new.length() && new.length() > LEAST_HEIGHT * longest
            })
        };
        stays(u, v) && stays(v, u)
    }

    /// Replaces an edge by `u`, at a point.
    fn collapse(&mut self, u: u32, v: u32, point: DVec3) {
        self.quadrics[u as usize] = self.quadrics[u as usize].plus(&self.quadrics[v as usize]);
        self.vertices[u as usize] = point;
        for triangle in std::mem::take(&mut self.around[v as usize]) {
            let corners = &mut self.triangles[triangle as usize];
            if corners.contains(&u) {
                for corner in *corners {
                    self.around[corner as usize].retain(|other| *other != triangle);
                }
            } else {
                corners.iter_mut().filter(|corner| **corner == v).for_each(|corner| *corner = u);
                self.around[u as usize].push(triangle);
            }
        }
        self.ages[u as usize] += 1;
        self.ages[v as usize] += 1;
    }

    fn into_parts(self) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut is_left = vec![false; self.triangles.len()];
        let mut places = vec![u32::MAX; self.vertices.len()];
        let mut vertices = vec![];
        for (vertex, around) in self.around.iter().enumerate().filter(|(_, around)| !around.is_empty()) {
            places[vertex] = vertices.len() as u32;
            vertices.push(self.vertices[vertex] + self.origin);
            around.iter().for_each(|triangle| is_left[*triangle as usize] = true);
        }
        let left = self.triangles.iter().zip(is_left).filter(|(_, is_left)| *is_left);
        (vertices, left.map(|(corners, _)| corners.map(|vertex| places[vertex as usize])).collect())
    }
}

/// Returns the normal of a triangle. Its length is twice the triangle's area.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}
