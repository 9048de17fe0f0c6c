//! Names of ramps, after their colors.

use glam::DVec3;

/// Chroma in Oklab below which a color is called black, gray or white.
const NEUTRAL: f64 = 0.035;

/// Hues in Oklab, in degrees, up to which a name applies.
const HUES: [(f64, &str); 9] = [
    (15.0, "pink"),
    (40.0, "red"),
    (75.0, "orange"),
    (115.0, "yellow"),
    (165.0, "green"),
    (225.0, "cyan"),
    (285.0, "blue"),
    (330.0, "purple"),
    (360.0, "pink"),
];

/// Returns the name of a color of Oklab.
pub(super) fn name(oklab: DVec3) -> &'static str {
    let chroma = oklab.y.hypot(oklab.z);
    if chroma < NEUTRAL {
        return match oklab.x {
            light if light > 0.8 => "white",
            light if light > 0.35 => "gray",
            _ => "black",
        };
    }
    let hue = oklab.z.atan2(oklab.y).to_degrees().rem_euclid(360.0);
    match HUES.iter().find(|(end, _)| hue < *end).map_or("pink", |(_, name)| name) {
        "orange" if chroma < 0.06 && oklab.x > 0.5 => "tan",
        "yellow" if chroma < 0.08 && oklab.x > 0.5 => "tan",
        "orange" if oklab.x < 0.55 => "brown",
        "yellow" if oklab.x < 0.5 => "olive",
        name => name,
    }
}

/// Returns names that differ: later ones of the same name get a number.
pub(super) fn distinct(names: impl IntoIterator<Item = &'static str>) -> Vec<String> {
    let mut found: Vec<(&str, usize)> = Vec::new();
    let count = |name: &'static str| {
        let before = found.iter().filter(|(other, _)| *other == name).count();
        found.push((name, before));
        if before == 0 { name.to_owned() } else { format!("{name} {}", before + 1) }
    };
    names.into_iter().map(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::oklab::oklab;

    #[test]
    fn colors_are_called_by_their_names() {
        for (color, expected) in [
            ([0.85, 0.1, 0.1], "red"),
            ([0.9, 0.5, 0.1], "orange"),
            ([0.4, 0.22, 0.12], "brown"),
            ([0.8, 0.68, 0.5], "tan"),
            ([0.95, 0.85, 0.2], "yellow"),
            ([0.2, 0.6, 0.15], "green"),
            ([0.1, 0.5, 0.55], "cyan"),
            ([0.1, 0.2, 0.8], "blue"),
            ([0.5, 0.25, 0.7], "purple"),
            ([0.95, 0.5, 0.7], "pink"),
            ([0.05; 3], "black"),
            ([0.5; 3], "gray"),
            ([0.95; 3], "white"),
        ] {
            assert_eq!(name(oklab(color.into())), expected, "{color:?}");
        }
    }

    #[test]
    fn names_are_numbered_if_they_repeat() {
        assert_eq!(distinct(["red", "blue", "red", "red"]), ["red", "blue", "red 2", "red 3"]);
    }
}
