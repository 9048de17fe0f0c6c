//! Groups tones into ramps.

use glam::{DVec2, DVec3, swizzles::Vec3Swizzles};

use super::{borders::Borders, names};
use crate::palette::{
    colors::Palette,
    oklab::oklab,
    ramp::{Ramp, sort},
};

/// The cost above which groups are different materials.
const DIFFERENT: f64 = 0.063;
/// Lightness in Oklab below which the ratio of chroma to lightness is mostly noise.
const DARK: f64 = 0.12;
/// Ratio of chroma to lightness beyond which it counts logarithmically.
const VIVID: f64 = 0.1;
/// Compressed ratio from which a color has a hue that tells materials apart.
const HUED: f64 = 0.04;
/// How much more a difference of hue counts than one of chroma.
const HUE: f64 = 2.5;
/// How much a difference of chroma counts beside a gray, and how much less between colors with a hue.
const CHROMA: (f64, f64) = (1.3, 0.8);
/// The cost where a border is as long as by chance, and how much less it is if a group borders nothing else, or more.
const BORDER: (f64, f64) = (1.15, 0.82);
/// The length of a border in neighboring rays that may be chance.
const CHANCE: f64 = 15.0;
/// The distance in Oklab between the nearest tones of two groups that doubles the cost.
const GAP: f64 = 0.3;
/// The weight of a group whose gaps count half: small parts have few tones, far apart.
const SMALL: f64 = 0.02;
/// How much chroma counts in that distance, compared to lightness.
const GAP_CHROMA: f64 = 1.7;

/// Returns ramps of all colors of a palette, the heaviest first.
pub(super) fn group(palette: &Palette, borders: &Borders) -> Vec<Ramp> {
    let tones: Vec<DVec3> = palette.colors.iter().map(|color| oklab((*color).into())).collect();
    // Handmade palettes may have fewer weights than colors.
    let weight = |tone: usize| palette.weights.get(tone).copied().unwrap_or(0.0);
    let mut groups: Vec<Group> = (0..tones.len())
        .map(|tone| Group { tones: vec![tone], weight: weight(tone), chroma: chroma(tones[tone]) })
        .collect();
    while let Some((first, second)) = cheapest(&groups, &tones, borders) {
        let other = groups.remove(second);
        groups[first].add(other);
    }
    groups.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let mean = |group: &Group| {
        let sum: DVec3 = group.tones.iter().map(|&tone| weight(tone) * tones[tone]).sum();
        if group.weight > 0.0 { sum / group.weight } else { tones[group.tones[0]] }
    };
    let names = names::distinct(groups.iter().map(|group| names::name(mean(group))));
    let ramp = |(Group { mut tones, .. }, name)| {
        sort(&mut tones, &palette.colors);
        Ramp { name, tones }
    };
    groups.into_iter().zip(names).map(ramp).collect()
}

/// Tones that belong together.
struct Group {
    tones: Vec<usize>,
    weight: f64,
    /// The mean [`chroma`].
    chroma: DVec2,
}

impl Group {
    fn add(&mut self, other: Self) {
        let weight = self.weight + other.weight;
        // Handmade palettes may have colors without weight.
        let share = if weight > 0.0 { other.weight / weight } else { 0.5 };
        self.chroma = self.chroma.lerp(other.chroma, share);
        self.weight = weight;
        self.tones.extend(other.tones);
    }
}

/// Returns a and b relative to the lightness, which do not change when there is less light, compressed.
fn chroma(oklab: DVec3) -> DVec2 {
    let ratio = oklab.yz() / oklab.x.max(DARK);
    let length = ratio.length();
    if length > 0.0 { ratio * (VIVID * (length / VIVID).ln_1p() / length) } else { ratio }
}

/// Returns the two groups that are most likely one material, or `None` if all are different.
fn cheapest(groups: &[Group], tones: &[DVec3], borders: &Borders) -> Option<(usize, usize)> {
    let mut best = (DIFFERENT, None);
    let own: Vec<f64> = groups.iter().map(|group| outside(group, tones.len(), borders)).collect();
    let all: f64 = groups.iter().map(|group| group.weight).sum();
    for (second, b) in groups.iter().enumerate() {
        for (first, a) in groups[..second].iter().enumerate() {
            let shared = pairs(a, b).map(|(a, b)| f64::from(borders.between(a, b))).sum::<f64>();
            let (short, long) = if own[first] < own[second] { (first, second) } else { (second, first) };
            let chance = chance(groups[short].weight, groups[long].weight, all);
            let gaps = pairs(a, b).map(|(a, b)| gap(tones[a], tones[b]));
            let weight = a.weight.min(b.weight);
            let gap = gaps.fold(f64::INFINITY, f64::min) * weight / (weight + SMALL);
            let border = BORDER.0 - BORDER.1 * excess(shared, own[short], chance);
            let cost = apart(a.chroma, b.chroma) * border * (1.0 + gap / GAP);
            if cost < best.0 {
                best = (cost, Some((first, second)));
            }
        }
    }
    best.1
}

/// Returns the share of a group's border that would be with another one if tones were anywhere, given their weights and
/// that of all groups.
fn chance(own: f64, other: f64, all: f64) -> f64 {
    let others = all - own;
    if others > 0.0 { (other / others).min(1.0) } else { 1.0 }
}

/// Returns how much more of a border is shared than by chance: 0 by chance, 1 if all of it, and at least -1.
fn excess(shared: f64, border: f64, chance: f64) -> f64 {
    let rest = 1.0 - chance;
    // Of two groups that are all there is, it says nothing that they border each other.
    if rest < 1e-9 { 0.0 } else { ((shared - chance * border) / ((border + CHANCE) * rest)).max(-1.0) }
}

fn pairs<'a>(a: &'a Group, b: &'a Group) -> impl Iterator<Item = (usize, usize)> + 'a {
    a.tones.iter().flat_map(|&first| b.tones.iter().map(move |&second| (first, second)))
}

/// Returns the length of a group's border with all other tones.
fn outside(group: &Group, tones: usize, borders: &Borders) -> f64 {
    let others = |tone: usize| (0..tones).filter(|other| !group.tones.contains(other)).map(move |other| (tone, other));
    group.tones.iter().flat_map(|&tone| others(tone)).map(|(a, b)| f64::from(borders.between(a, b))).sum()
}

/// Returns how different two compressed chromas are. If both have a hue, it counts most: shadows and highlights have
/// more or less chroma. Beside a gray, chroma counts most.
fn apart(a: DVec2, b: DVec2) -> f64 {
    let (long, short) = (a.length().max(b.length()), a.length().min(b.length()));
    // The chord of the angle between them, at their mean length.
    let turned = (a.distance_squared(b) - (long - short).powi(2)).max(0.0).sqrt();
    let hued = short * short / (short * short + HUED * HUED);
    ((HUE * turned).powi(2) + ((CHROMA.0 - CHROMA.1 * hued) * (long - short)).powi(2)).sqrt()
}

fn gap(a: DVec3, b: DVec3) -> f64 {
    ((a - b) * DVec3::new(1.0, GAP_CHROMA, GAP_CHROMA)).length()
}
