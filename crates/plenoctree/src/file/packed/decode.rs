//! Reads a packed field.

use std::{
    io::{Read, Seek},
    sync::Arc,
};

use glam::DVec3;
use half::f16;

use super::super::{error::ReadFault, frame::check_frame};
use super::{
    container::{Container, fault},
    histogram,
    quantized::{MAX_LEVELS, MAX_ROWS, Quantized, content},
    recent::Recent,
    sections::{BINS, CONSTANTS, DENSITIES, HEAD, HEAD_BYTES, LEVELS, ROWS, TABLE, TREE},
    streams::{self, Rows},
};
use crate::field::{Activation, Basis, Cell, Frame, MAX_DEPTH, PlenOctree, Tables, UpAxis};

/// Reads a packed field, as the file has it.
pub(in crate::file) fn read_packed(reader: impl Read + Seek) -> Result<PlenOctree, ReadFault> {
    let mut file = Container::open(reader)?;
    let head = Head::parse(&file.read(HEAD, HEAD_BYTES as u64)?)?;
    let (leaves, nodes) = (head.leaves as u64, head.nodes as u64);
    file.check_room(HEAD, content(leaves, nodes))?;
    let (nodes, depth) = head.tree(&mut file)?;
    let densities = head.densities(&mut file)?;
    let damaged = |section| fault(section, "damaged content", "that of the head");
    let shares = head.rows[0].count > 0;
    let recorded = match file.has(BINS) {
        true => Some(histogram::read(&file.read_up_to(BINS, histogram::MOST_BYTES)?)?),
        false => None,
    };
    let others = head.basis.functions() - 1;
    let numbers = others as u64 * (head.rows[0].count as u64 + 2 * head.rows[1].count as u64);
    let levels = file.read_up_to(LEVELS, streams::most_bytes(leaves))?;
    let colors = file.read_up_to(CONSTANTS, streams::most_bytes(3 * leaves))?;
    let tables = file.read_up_to(TABLE, streams::most_bytes(numbers))?;
    let rows = file.read_up_to(ROWS, streams::most_bytes(2 * leaves))?;
    let levels = streams::read_levels(&levels, head.leaves, head.densities).ok_or_else(|| damaged(LEVELS))?;
    let read_colors = || streams::read_colors(&colors, &levels, head.densities);
    let read_rows = || streams::read_rows(&rows, if shares { &levels } else { &[] }, head.densities, head.rows);
    let (colors, rows) = rayon::join(read_colors, read_rows);
    let tables = streams::read_tables(&tables, others, head.rows.map(|rows| rows.count));
    let [luma, chroma] = tables.ok_or_else(|| damaged(TABLE))?;
    let quantized = Quantized {
        frame: head.frame,
        basis: head.basis,
        activation: head.activation,
        up: head.up,
        depth,
        nodes,
        densities,
        levels,
        colors: colors.ok_or_else(|| damaged(CONSTANTS))?,
        rows: rows.ok_or_else(|| damaged(ROWS))?,
        tables: Tables { color_step: head.color_step, table_step: head.table_step, luma, chroma },
        recorded: recorded.map(Arc::new),
    };
    Ok(quantized.field())
}

/// The section `HEAD`.
struct Head {
    basis: Basis,
    activation: Activation,
    up: UpAxis,
    depth: u32,
    nodes: usize,
    leaves: usize,
    densities: usize,
    /// Of luma, and of the differences.
    rows: [Rows; 2],
    color_step: f32,
    table_step: f32,
    frame: Frame,
}

impl Head {
    fn parse(bytes: &[u8]) -> Result<Self, ReadFault> {
        let choice = |what: &str, found: u8, expected: &str| fault(HEAD, format!("{what} {found}"), expected);
        let [basis, activation, up, depth] = [0, 1, 2, 3].map(|at| bytes[at]);
        let count = |at: usize| u32::from_le_bytes(part(bytes, 4 + 4 * at)) as usize;
        let step = |at: usize| f32::from_le_bytes(part(bytes, 32 + 4 * at));
        let number = |at: usize| f64::from_le_bytes(part(bytes, 40 + 8 * at));
        let head = Self {
            basis: *Basis::ALL.get(usize::from(basis)).ok_or_else(|| choice("basis", basis, "0 to 5"))?,
            activation: match activation {
                0 => Activation::Sigmoid,
                1 => Activation::ShiftedRelu,
                2 => Activation::Identity,
                other => return Err(choice("activation", other, "0 to 2")),
            },
            up: match up {
                0 => UpAxis::Y,
                1 => UpAxis::Z,
                other => return Err(choice("up axis", other, "0 or 1")),
            },
            depth: u32::from(depth),
            nodes: count(0),
            leaves: count(1),
            densities: count(2),
            rows: [3, 5].map(|at| Rows { count: count(at), first_new: count(at + 1), recent: Recent::default() }),
            color_step: step(0),
            table_step: step(1),
            frame: Frame {
                offset: DVec3::new(number(0), number(1), number(2)),
                scale: DVec3::new(number(3), number(4), number(5)),
            },
        };
        if !(1..=MAX_DEPTH).contains(&head.depth) {
            return Err(choice("depth", depth, "1 to 20"));
        }
        let range = |what: &str, found: usize, least: usize, most: usize| {
            let holds = (least..=most).contains(&found);
            if holds { Ok(()) } else { Err(fault(HEAD, format!("{found} {what}"), format!("{least} to {most}"))) }
        };
        range("nodes", head.nodes, 1, (1 << 28) - 1)?;
        range("leaves", head.leaves, 0, 8 * head.nodes)?;
        range("densities", head.densities, usize::from(head.leaves > 0), MAX_LEVELS)?;
        let shares = head.leaves > 0 && head.basis.functions() > 1;
        for rows in head.rows {
            range("rows", rows.count, usize::from(shares), if shares { MAX_ROWS } else { 0 })?;
            range("rows before the first new one", rows.first_new, 0, rows.count)?;
        }
        for step in [head.color_step, head.table_step] {
            if !step.is_finite() || step <= 0.0 {
                return Err(fault(HEAD, format!("a step of {step}"), "a positive number"));
            }
        }
        check_frame([HEAD; 2], head.frame)?;
        Ok(head)
    }

    /// Reads the nodes, and numbers them and the leaves in depth-first order. Returns also the level of the deepest
    /// nodes.
    fn tree(&self, file: &mut Container<impl Read + Seek>) -> Result<(Vec<[Cell; 8]>, u32), ReadFault> {
        // Nodes of the last level have one byte, others two. The number of each is known only at the end.
        let raw = file.size(TREE)?;
        if raw < self.nodes as u64 || raw > 2 * self.nodes as u64 {
            return Err(fault(
                TREE,
                format!("{raw} bytes of content"),
                format!("1 or 2 for each of {} nodes", self.nodes),
            ));
        }
        let bytes = file.read(TREE, raw)?;
        let mismatch = || fault(TREE, "more or fewer cells", format!("{} nodes, {} leaves", self.nodes, self.leaves));
        // Which cells of each level's nodes are not empty, and which are leaves.
        let mut levels: Vec<(&[u8], &[u8])> = Vec::new();
        let (mut rest, mut count, mut nodes, mut leaves) = (&bytes[..], 1, 0, 0);
        for level in 1..=self.depth {
            let last = level == self.depth;
            let (filled, after) = rest.split_at_checked(count).ok_or_else(mismatch)?;
            let (whole, after) = after.split_at_checked(if last { 0 } else { count }).ok_or_else(mismatch)?;
            rest = after;
            nodes += count;
            let ones = |bytes: &[u8]| bytes.iter().map(|bits| bits.count_ones() as usize).sum::<usize>();
            let whole_count = if last { ones(filled) } else { ones(whole) };
            if whole.iter().zip(filled).any(|(whole, filled)| whole & !filled != 0) {
                return Err(fault(TREE, "an empty leaf", "leaves among the cells that are not empty"));
            }
            leaves += whole_count;
            count = ones(filled) - whole_count;
            levels.push((filled, if last { filled } else { whole }));
        }
        if !rest.is_empty() || (nodes, leaves) != (self.nodes, self.leaves) {
            return Err(mismatch());
        }
        let depth = levels.iter().take_while(|(filled, _)| !filled.is_empty()).count() as u32;
        Ok((depth_first(&levels, self.nodes), depth))
    }

    fn densities(&self, file: &mut Container<impl Read + Seek>) -> Result<Vec<f16>, ReadFault> {
        let bytes = file.read(DENSITIES, 2 * self.densities as u64)?;
        let (low, high) = bytes.split_at(self.densities);
        let densities: Vec<f16> = low.iter().zip(high).map(|(low, high)| f16::from_le_bytes([*low, *high])).collect();
        match densities.iter().find(|density| !density.is_finite() || **density <= f16::ZERO) {
            Some(density) => Err(fault(DENSITIES, density.to_string(), "a positive number")),
            None => Ok(densities),
        }
    }
}

/// Returns the `N` bytes at a position.
fn part<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    std::array::from_fn(|index| bytes[at + index])
}

/// Returns the nodes in depth-first order. Every level lists which cells of its nodes are not empty, and which are
/// leaves.
fn depth_first(levels: &[(&[u8], &[u8])], count: usize) -> Vec<[Cell; 8]> {
    struct Visit {
        node: usize,
        /// Its position in its level.
        place: usize,
        next: usize,
    }
    let mut nodes = Vec::with_capacity(count);
    nodes.push([Cell::EMPTY; 8]);
    let mut leaves = 0;
    // The number of nodes of each level that were reached.
    let mut reached = vec![0; levels.len()];
    let mut open = vec![Visit { node: 0, place: 0, next: 0 }];
    while let Some(Visit { node, place, next }) = open.last_mut() {
        if *next == 8 {
            open.pop();
            continue;
        }
        let (node, place, cell) = (*node, *place, std::mem::replace(next, *next + 1));
        let (filled, whole) = levels[open.len() - 1];
        if whole[place] >> cell & 1 == 1 {
            nodes[node][cell] = Cell::leaf(leaves);
            leaves += 1;
        } else if filled[place] >> cell & 1 == 1 {
            nodes[node][cell] = Cell::node(nodes.len() as u32);
            let reached = &mut reached[open.len()];
            open.push(Visit { node: nodes.len(), place: *reached, next: 0 });
            *reached += 1;
            nodes.push([Cell::EMPTY; 8]);
        }
    }
    nodes
}
