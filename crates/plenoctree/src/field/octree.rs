//! The octree in memory.

use std::{borrow::Cow, sync::Arc};

use glam::{DVec3, UVec3};
use half::f16;

use super::{
    activation::Activation,
    basis::Basis,
    cell::{Cell, LeafCell},
    coefficients::{Codebook, Coefficients},
    densities::Densities,
    frame::{Frame, UpAxis},
};
use crate::histograms::{Histograms, Recorded, SamplingSettings};

/// The maximum depth of a field, in levels of cells. The finest cells are at least `2^-MAX_DEPTH` of the cube wide.
///
/// svox builds trees of at most 10 or 11 levels.
pub const MAX_DEPTH: u32 = 20;

/// The nodes that contain a cell, by their level: the binary logarithm of their width in finest cells.
pub(crate) type NodePath = [u32; MAX_DEPTH as usize + 1];

/// The opacity from which pixels get labels, unless settings say otherwise.
pub const LABEL_OPACITY: f64 = 80.0 / 255.0;

/// An error that occurs when the parts given to [`PlenOctree::new`] do not form a valid field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidField {
    /// The tree has no root, or a cell refers to a node or leaf that does not exist.
    #[error("a cell of node {node} points outside the tree")]
    Dangling {
        /// The node that contains the cell.
        node: u32,
    },
    /// Two cells refer to the same node, or a cell refers to a node above it.
    #[error("node {node} is reached twice: the tree has a cycle or a shared node")]
    Shared {
        /// The node that was reached twice.
        node: u32,
    },
    /// Two cells refer to the same leaf.
    #[error("leaf {leaf} is reached twice")]
    SharedLeaf {
        /// The leaf that was reached twice.
        leaf: u32,
    },
    /// The tree is deeper than [`MAX_DEPTH`].
    #[error("the tree is deeper than {MAX_DEPTH} levels")]
    TooDeep,
    /// Two arrays have lengths that do not match.
    #[error("{leaves} leaves have {found} {what}, expected {expected}")]
    Lengths {
        /// Number of leaves.
        leaves: usize,
        /// The values that were counted.
        what: &'static str,
        /// Number of values found.
        found: usize,
        /// Number of values expected.
        expected: usize,
    },
    /// A number is not finite, or not positive although it must be.
    #[error("{what} must be finite{}", if *.positive { " and positive" } else { "" })]
    Number {
        /// What the number is.
        what: &'static str,
        /// Whether the number must also be positive.
        positive: bool,
    },
}

/// A radiance field: a sparse octree over a box, with a density and spherical-harmonic coefficients in every leaf.
///
/// Leaves are numbered in depth-first order. Neighbors in space are therefore mostly neighbors in memory, and the
/// leaves inside a cell are always contiguous. Cloning is cheap, because clones share the arrays.
#[derive(Clone, Debug)]
#[cfg_attr(
    feature = "bevy",
    derive(bevy_asset::Asset, bevy_reflect::Reflect),
    reflect(opaque),
    reflect(Clone, Debug),
    type_path = "plenoctree"
)]
pub struct PlenOctree {
    frame: Frame,
    basis: Basis,
    activation: Activation,
    up: UpAxis,
    depth: u32,
    bounds: Option<(UVec3, UVec3)>,
    nodes: Arc<Vec<[Cell; 8]>>,
    densities: Densities,
    coefficients: Coefficients,
    recorded: Option<Arc<Recorded>>,
}

/// Returns an error unless the numbers of a frame are finite, and its scale positive.
fn check_frame(frame: Frame) -> Result<(), InvalidField> {
    let number = |what, positive| Err(InvalidField::Number { what, positive });
    if !frame.offset.is_finite() {
        return number("the offset", false);
    }
    if !frame.scale.is_finite() || frame.scale.min_element() <= 0.0 {
        return number("the scale", true);
    }
    Ok(())
}

impl PlenOctree {
    /// Creates a field from its parts.
    ///
    /// `nodes[0]` is the root. The cells of a node are ordered by x, y and z, with z fastest: cell (x, y, z) has index
    /// `4x + 2y + z`. `density` holds one positive value per leaf, per world unit of the field. `coefficients` holds
    /// [`Basis::coefficients`] values per leaf. Leaves that are not in depth-first order are renumbered.
    ///
    /// # Errors
    ///
    /// Returns an error if a number is not finite or not positive although it must be, if the lengths of the arrays do
    /// not match, or if `nodes` is not a tree of at most [`MAX_DEPTH`] levels.
    pub fn new(
        frame: Frame,
        basis: Basis,
        activation: Activation,
        up: UpAxis,
        nodes: Vec<[Cell; 8]>,
        density: Vec<f32>,
        coefficients: Vec<f16>,
    ) -> Result<Self, InvalidField> {
        if coefficients.iter().any(|k| !k.is_finite()) {
            return Err(InvalidField::Number { what: "a coefficient", positive: false });
        }
        let expected = density.len() * basis.coefficients();
        if coefficients.len() != expected {
            let (leaves, found) = (density.len(), coefficients.len());
            return Err(InvalidField::Lengths { leaves, what: "coefficients", found, expected });
        }
        check_frame(frame)?;
        if density.iter().any(|d| !d.is_finite() || *d <= 0.0) {
            return Err(InvalidField::Number { what: "the density of a leaf", positive: true });
        }
        let coefficients = Coefficients::Each(Arc::new(coefficients));
        let mut field = Self::of_valid(frame, basis, activation, up, 0, nodes, density.into(), coefficients);
        field.depth = field.validate()?;
        field.sort_leaves();
        field.bounds = field.leaf_bounds();
        Ok(field)
    }

    /// Creates a field from parts that are known to be valid: a tree of this depth, with its leaves in depth-first
    /// order.
    pub(crate) fn of_valid(
        frame: Frame,
        basis: Basis,
        activation: Activation,
        up: UpAxis,
        depth: u32,
        nodes: Vec<[Cell; 8]>,
        densities: Densities,
        coefficients: Coefficients,
    ) -> Self {
        let mut field = Self {
            frame,
            basis,
            activation,
            up,
            depth,
            bounds: None,
            nodes: Arc::new(nodes),
            densities,
            coefficients,
            recorded: None,
        };
        if depth > 0 {
            field.bounds = field.leaf_bounds();
        }
        field
    }

    /// Returns the field with another tree, which is known to be valid: derived from this one, with its leaves in
    /// depth-first order.
    pub(crate) fn with_tree(&self, nodes: Vec<[Cell; 8]>, densities: Densities, coefficients: Coefficients) -> Self {
        let mut depth = 1;
        let mut stack = vec![(0u32, 1)];
        while let Some((node, level)) = stack.pop() {
            depth = depth.max(level);
            stack.extend(nodes[node as usize].iter().filter_map(|cell| Some((cell.as_node()?, level + 1))));
        }
        let field = Self { depth, nodes: Arc::new(nodes), densities, coefficients, recorded: None, ..self.clone() };
        Self { bounds: field.leaf_bounds(), ..field }
    }

    fn leaf_bounds(&self) -> Option<(UVec3, UVec3)> {
        let mut bounds: Option<(UVec3, UVec3)> = None;
        let mut stack = vec![(0u32, UVec3::ZERO, 1u32 << (self.depth.max(1) - 1))];
        while let Some((node, corner, size)) = stack.pop() {
            // A node inside of the box does not change it.
            if bounds.is_some_and(|(low, high)| corner.cmpge(low).all() && (corner + 2 * size).cmple(high).all()) {
                continue;
            }
            for (cell, index) in self.nodes[node as usize].iter().zip(0u32..) {
                let corner = corner + size * UVec3::new(index >> 2, index >> 1 & 1, index & 1);
                if let Some(child) = cell.as_node() {
                    stack.push((child, corner, size / 2));
                } else if cell.as_leaf().is_some() {
                    let (low, high) = bounds.unwrap_or((corner, corner));
                    bounds = Some((low.min(corner), high.max(corner + size)));
                }
            }
        }
        bounds
    }

    /// Checks the tree and returns its depth.
    fn validate(&self) -> Result<u32, InvalidField> {
        if self.nodes.is_empty() {
            return Err(InvalidField::Dangling { node: 0 });
        }
        let mut reached = vec![false; self.nodes.len()];
        let mut leaves_reached = vec![false; self.densities.len()];
        let mut leaves = 0;
        let mut deepest = 0;
        let mut stack = vec![(0u32, 1u32)];
        while let Some((node, level)) = stack.pop() {
            if level > MAX_DEPTH {
                return Err(InvalidField::TooDeep);
            }
            if std::mem::replace(&mut reached[node as usize], true) {
                return Err(InvalidField::Shared { node });
            }
            deepest = deepest.max(level);
            for cell in self.nodes[node as usize] {
                if let Some(child) = cell.as_node() {
                    if child as usize >= self.nodes.len() {
                        return Err(InvalidField::Dangling { node });
                    }
                    stack.push((child, level + 1));
                } else if let Some(leaf) = cell.as_leaf() {
                    match leaves_reached.get_mut(leaf as usize) {
                        None => return Err(InvalidField::Dangling { node }),
                        Some(true) => return Err(InvalidField::SharedLeaf { leaf }),
                        Some(reached) => *reached = true,
                    }
                    leaves += 1;
                }
            }
        }
        if leaves != self.densities.len() {
            let (leaves, found) = (leaves, self.densities.len());
            return Err(InvalidField::Lengths { leaves, what: "densities", found, expected: leaves });
        }
        Ok(deepest)
    }

    /// Renumbers the leaves in depth-first order.
    fn sort_leaves(&mut self) {
        if self.leaf_cells().map(|cell| cell.leaf).eq(0..self.leaves() as u32) {
            return;
        }
        let order: Vec<usize> = self.leaf_cells().map(|cell| cell.leaf as usize).collect();
        let mut renumbered = vec![0; order.len()];
        for (new, old) in order.iter().enumerate() {
            renumbered[*old] = new as u32;
        }
        let nodes = Arc::make_mut(&mut self.nodes).as_flattened_mut();
        for cell in nodes {
            if let Some(renumbered) = cell.as_leaf().and_then(|leaf| renumbered.get(leaf as usize)) {
                *cell = Cell::leaf(*renumbered);
            }
        }
        self.coefficients = self.coefficients.select(self.basis, order.iter().copied());
        self.densities = self.densities.select(order.into_iter());
    }

    /// Returns the position of the tree's cube in the field's frame.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// Returns the basis of the coefficients.
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// Returns the function that maps the sum of the harmonics to radiance.
    pub fn activation(&self) -> Activation {
        self.activation
    }

    /// Returns the axis that points up.
    pub fn up(&self) -> UpAxis {
        self.up
    }

    /// Returns the field with another axis that points up. It stays where it is, in its own frame.
    pub fn with_up(self, up: UpAxis) -> Self {
        self.with_settings(None, Some(up))
    }

    /// Returns the field with the properties that the settings override.
    pub(crate) fn with_settings(self, activation: Option<Activation>, up: Option<UpAxis>) -> Self {
        let (activation, up) = (activation.unwrap_or(self.activation), up.unwrap_or(self.up));
        // Seen from another side, or in other colors, the field has other histograms.
        let recorded = self.recorded.clone().filter(|_| (activation, up) == (self.activation, self.up));
        Self { activation, up, recorded, ..self }
    }

    pub(crate) fn with_recorded(self, recorded: Option<Arc<Recorded>>) -> Self {
        Self { recorded, ..self }
    }

    /// Returns the recorded histograms of the field that this packed field was made from. `None` if none are recorded,
    /// if `settings` ask for other observers or bins than those, or if the field is no longer the one in the file: if
    /// it was thinned, or read with another activation or up axis.
    ///
    /// What [`SamplingSettings::default`] asks for is recorded, if [`PackSettings::record_histograms`] says so. Bins
    /// may also be those that divide its bins. [`SamplingSettings::sample_fraction`] does not matter, because all
    /// leaves were sampled.
    ///
    /// [`PackSettings::record_histograms`]: https://docs.rs/plenoctree/latest/plenoctree/struct.PackSettings.html
    pub fn histograms(&self, settings: &SamplingSettings) -> Option<Histograms> {
        self.recorded.as_ref()?.histograms(settings)
    }

    #[cfg(feature = "write")]
    pub(crate) fn recorded(&self) -> Option<&Arc<Recorded>> {
        self.recorded.as_ref()
    }

    /// Returns the number of levels of cells: a field of 2^8 cells per side has depth 8.
    pub fn depth(&self) -> u32 {
        self.depth
    }

    /// Returns the number of leaves.
    pub fn leaves(&self) -> usize {
        self.densities.len()
    }

    /// Returns all nodes, the root first.
    pub fn nodes(&self) -> &[[Cell; 8]] {
        &self.nodes
    }

    /// Returns the density of every leaf, per world unit.
    pub fn densities(&self) -> &Densities {
        &self.densities
    }

    /// Returns the coefficients of all leaves, [`Basis::coefficients`] per leaf. If the field is packed, this creates
    /// them from the codebooks.
    pub fn coefficients(&self) -> Cow<'_, [f16]> {
        self.coefficients.all(self.basis)
    }

    /// Returns the codebooks of a packed field, whose leaves share their coefficients, or `None` for other fields.
    pub fn codebook(&self) -> Option<Codebook<'_>> {
        match &self.coefficients {
            Coefficients::Each(_) => None,
            Coefficients::Shared { colors, rows, tables } => Some(Codebook {
                color_step: tables.color_step,
                colors,
                rows,
                table_step: tables.table_step,
                luma: &tables.luma,
                chroma: &tables.chroma,
            }),
        }
    }

    /// Returns the coefficients as they are stored.
    pub(crate) fn stored(&self) -> &Coefficients {
        &self.coefficients
    }

    /// Returns the lowest and the highest corner of the box around all leaves, in finest cells, or `None` if the field
    /// is empty.
    pub fn cell_bounds(&self) -> Option<(UVec3, UVec3)> {
        self.bounds
    }

    /// Returns the lowest and the highest corner of the box around all leaves, in the field's frame, or `None` if the
    /// field is empty.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        self.tree_bounds().map(|(low, high)| (self.frame.to_world(low), self.frame.to_world(high)))
    }

    /// Returns the lowest and the highest corner of the box around all leaves, in tree units, or `None` if the field is
    /// empty.
    pub fn tree_bounds(&self) -> Option<(DVec3, DVec3)> {
        let cells = f64::from(1u32 << self.depth);
        self.bounds.map(|(low, high)| (low.as_dvec3() / cells, high.as_dvec3() / cells))
    }

    /// Returns the lowest and the highest corner of the box around most of the field, in the field's frame, or `None`
    /// if the field is empty.
    ///
    /// Along each axis, 0.5% of the field at either end is left out. This is mostly floaters, which are artifacts of
    /// training. Leaves that would get a label if they were seen alone count by their area, as large ones may be all of
    /// a surface, and fainter ones as one. Use this box to point a camera at the field.
    pub fn dense_bounds(&self) -> Option<(DVec3, DVec3)> {
        if self.leaves() == 0 {
            return None;
        }
        // The weight of the leaves that begin, and of those that end, at each coordinate.
        let places = (1 << self.depth) + 1;
        let mut counts = [[(); 2]; 3].map(|axis| axis.map(|()| vec![0u64; places]));
        let mut total = 0;
        for cell in self.leaf_cells() {
            let (LeafCell { corner, size, .. }, weight) = (cell, self.weight(cell));
            total += weight;
            for (axis, [starts, ends]) in counts.iter_mut().enumerate() {
                starts[corner[axis] as usize] += weight;
                ends[(corner[axis] + size) as usize] += weight;
            }
        }
        let left_out = total / 200;
        let [x, y, z] = counts.map(|[starts, ends]| {
            (
                first_beyond(starts.into_iter().enumerate(), left_out),
                first_beyond(ends.into_iter().enumerate().rev(), left_out),
            )
        });
        let (low, high) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
        let cells = f64::from(1u32 << self.depth);
        Some((self.frame.to_world(low / cells), self.frame.to_world(high / cells)))
    }

    /// Returns how much a leaf counts in [`Self::dense_bounds`].
    fn weight(&self, cell: LeafCell) -> u64 {
        let width = f64::from(cell.size) / f64::from(self.depth).exp2() / self.frame.scale.max_element();
        let opacity = -(-f64::from(self.densities[cell.leaf as usize]) * width).exp_m1();
        if opacity < LABEL_OPACITY { 1 } else { u64::from(cell.size).pow(2) }
    }

    /// Returns the point on which the field stands: the middle of the lowest face of [`Self::dense_bounds`]. Returns
    /// `None` if the field is empty.
    pub fn foot(&self) -> Option<DVec3> {
        let (low, high) = self.dense_bounds()?;
        let middle = 0.5 * (low + high);
        Some(match self.up {
            UpAxis::Y => middle.with_y(low.y),
            UpAxis::Z => middle.with_z(low.z),
        })
    }

    /// Returns the field moved by `shift`, in its own frame.
    ///
    /// # Errors
    ///
    /// Returns an error if the offset of the moved frame is not finite.
    pub fn shifted(self, shift: DVec3) -> Result<Self, InvalidField> {
        let frame = Frame { offset: self.frame.offset - self.frame.scale * shift, ..self.frame };
        check_frame(frame)?;
        Ok(Self { frame, ..self })
    }

    /// Returns an iterator over all leaves and their cells, in depth-first order.
    pub fn leaf_cells(&self) -> impl Iterator<Item = LeafCell> + '_ {
        let mut stack: Vec<(u32, UVec3, u32, u32)> = vec![(0, UVec3::ZERO, 1 << (self.depth.max(1) - 1), 0)];
        std::iter::from_fn(move || {
            loop {
                let (node, corner, size, next) = stack.last_mut()?;
                if *next == 8 {
                    stack.pop();
                    continue;
                }
                let (index, size) = (*next, *size);
                *next += 1;
                let cell = self.nodes[*node as usize][index as usize];
                if cell == Cell::EMPTY {
                    continue;
                }
                let corner = *corner + size * UVec3::new(index >> 2, index >> 1 & 1, index & 1);
                if let Some(child) = cell.as_node() {
                    stack.push((child, corner, size / 2, 0));
                } else if let Some(leaf) = cell.as_leaf() {
                    return Some(LeafCell { leaf, corner, size });
                }
            }
        })
    }

    /// Calls `visit` with every cell below a node that is not subdivided, its lowest corner and its width. The node is
    /// `width` finest cells wide, at `corner`.
    pub(crate) fn visit_cells(&self, node: u32, corner: UVec3, width: u32, visit: &mut impl FnMut(Cell, UVec3, u32)) {
        let half = width / 2;
        for (cell, index) in self.nodes[node as usize].iter().zip(0u32..) {
            let corner = corner + half * UVec3::new(index >> 2, index >> 1 & 1, index & 1);
            match cell.as_node() {
                Some(child) => self.visit_cells(child, corner, half, visit),
                None => visit(*cell, corner, half),
            }
        }
    }

    /// Returns the cell at `position`, its lowest corner and its width, all in finest cells.
    ///
    /// Every coordinate of `position` must be less than `2^depth`.
    pub fn locate(&self, position: UVec3) -> (Cell, UVec3, u32) {
        self.locate_below(&mut NodePath::default(), self.depth, position)
    }

    /// Locates a cell like [`Self::locate`], but starts at the node of this `level` in `path`, which must contain
    /// `position`. Then, the path leads to the cell; what it has for levels below is of earlier cells.
    pub(crate) fn locate_below(&self, path: &mut NodePath, mut level: u32, position: UVec3) -> (Cell, UVec3, u32) {
        let mut node = path[level as usize];
        loop {
            level -= 1;
            let part = (position >> level) & UVec3::ONE;
            let cell = self.nodes[node as usize][(4 * part.x + 2 * part.y + part.z) as usize];
            match cell.as_node() {
                Some(child) => {
                    node = child;
                    path[level as usize] = child;
                }
                None => return (cell, (position >> level) << level, 1 << level),
            }
        }
    }

    /// Returns the radiance of `leaf` seen along `direction`, in encoded sRGB, computed in float64: section 1 of the
    /// method.
    ///
    /// `direction` is a unit vector from the eye into the scene, in the field's frame.
    ///
    /// # Panics
    ///
    /// Panics if `leaf` is not less than [`Self::leaves`].
    pub fn radiance(&self, leaf: u32, direction: DVec3) -> DVec3 {
        self.radiance_with(leaf, &self.basis.evaluate(direction))
    }

    /// Returns the radiance of `leaf` like [`Self::radiance`], but with the basis already evaluated: `y` is the result
    /// of [`Basis::evaluate`].
    ///
    /// # Panics
    ///
    /// Panics if `leaf` is not less than [`Self::leaves`].
    pub fn radiance_with(&self, leaf: u32, y: &[f64; 25]) -> DVec3 {
        let sums = self.coefficients.sums(self.basis, leaf as usize, y);
        DVec3::from_array(sums.map(|sum| self.activation.apply(sum)))
    }
}

/// Returns the first place up to which there are more than `left_out`. `counts` are places, and how many there are at
/// each.
fn first_beyond(mut counts: impl Iterator<Item = (usize, u64)>, left_out: u64) -> f64 {
    let mut sum = 0;
    let found = counts.find(|(_, count)| {
        sum += count;
        sum > left_out
    });
    found.map_or(0.0, |(place, _)| place as f64)
}
