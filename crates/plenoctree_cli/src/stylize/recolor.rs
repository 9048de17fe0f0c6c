//! The recolorings of the command line.

use plenoctree::palette::{Palette, RampAdjustment};

use crate::{hex, number::counted, result::Result};

/// A color in place of another, or of a ramp.
#[derive(Clone, Debug, PartialEq)]
pub struct Recoloring {
    of: Recolored,
    color: [u8; 3],
}

/// What is recolored.
#[derive(Clone, Debug, PartialEq)]
enum Recolored {
    /// A palette color, by its index.
    Color(usize),
    /// A ramp, by its index.
    Ramp(usize),
    /// A ramp, by its name, which is never a number and has no colon.
    Name(String),
}

/// Parses `3=#rrggbb` (a palette color), `ramp:3=#rrggbb` or `red=#rrggbb` (a ramp).
pub fn parse(text: &str) -> Result<Recoloring, String> {
    let (of, color) = text.split_once('=').ok_or("expected INDEX=#RRGGBB, RAMP=#RRGGBB or ramp:INDEX=#RRGGBB")?;
    let index = |digits: &str| digits.parse().map_err(|_| format!("found {digits} as an index, expected a number"));
    let of = match of.strip_prefix("ramp:") {
        Some(digits) => Recolored::Ramp(index(digits)?),
        None if of.is_empty() => return Err("expected a palette index or the name of a ramp before the =".into()),
        None if of.bytes().all(|byte| byte.is_ascii_digit()) => Recolored::Color(index(of)?),
        None => Recolored::Name(of.into()),
    };
    Ok(Recoloring { of, color: hex::parse(color)? })
}

/// Returns the palette's shown colors with all recolorings, one after another: those of ramps, then those of single
/// colors, which may be in these ramps.
pub fn apply(recolorings: &[Recoloring], palette: &Palette) -> Result<Vec<[f64; 3]>, String> {
    let mut colors = palette.shown_colors().to_vec();
    let mut found = vec![];
    let (of_colors, of_ramps): (Vec<_>, Vec<_>) =
        recolorings.iter().partition(|recoloring| matches!(recoloring.of, Recolored::Color(_)));
    for Recoloring { of, color } in of_ramps.into_iter().chain(of_colors) {
        let color = hex::unit(*color);
        let ramp = match of {
            Recolored::Color(index) => {
                once(&mut found, of, &index.to_string())?;
                *colors.get_mut(*index).ok_or_else(|| missing_color(*index, palette))? = color;
                continue;
            }
            Recolored::Ramp(index) => *index,
            Recolored::Name(name) => palette.ramp(name).ok_or_else(|| missing_ramp(name, palette))?,
        };
        let name = palette.ramps.get(ramp).map_or_else(|| format!("ramp:{ramp}"), |ramp| ramp.name.clone());
        once(&mut found, &Recolored::Ramp(ramp), &name)?;
        let adjustment = RampAdjustment::to_color(color);
        let shown = palette.show_ramp(ramp, &adjustment, |tone, color| colors[tone] = color);
        shown.map_err(|_| missing_ramp(&format!("ramp:{ramp}"), palette))?;
    }
    Ok(colors)
}

/// Adds what is recolored, or returns an error if it already is.
fn once(found: &mut Vec<Recolored>, of: &Recolored, name: &str) -> Result<(), String> {
    if found.contains(of) {
        return Err(format!("--recolor {name}: found two colors, expected one"));
    }
    found.push(of.clone());
    Ok(())
}

fn missing_color(index: usize, palette: &Palette) -> String {
    let count = palette.colors.len();
    format!("--recolor {index}: the palette has {}, 0 to {}", counted(count, "color", "colors"), count - 1)
}

fn missing_ramp(ramp: &str, palette: &Palette) -> String {
    let names: Vec<&str> = palette.ramps.iter().map(|ramp| ramp.name.as_str()).collect();
    match &names[..] {
        [] => format!("--recolor {ramp}: the palette has no ramps; those of --method tones have"),
        names => format!("--recolor {ramp}: the palette has the ramps {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use plenoctree::palette::Ramp;

    use super::*;

    fn palette() -> Palette {
        let mut palette = Palette::new(vec![[0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.9; 3]]).unwrap();
        palette.ramps = vec![Ramp { name: "cap".into(), tones: vec![0, 1] }];
        palette
    }

    /// Applies recolorings that spaces separate.
    fn recolored(text: &str) -> Result<Vec<[f64; 3]>, String> {
        apply(&text.split(' ').map(parse).collect::<Result<Vec<_>, _>>()?, &palette())
    }

    /// Numbers are palette colors. Ramps have names, or an index after a word.
    #[test]
    fn colors_and_ramps_are_told_apart() {
        let before = palette().colors;
        let color = recolored("1=#0000ff").unwrap();
        assert_eq!(color, [before[0], [0.0, 0.0, 1.0], before[2]]);
        let ramp = recolored("cap=#3060d0").unwrap();
        assert_eq!(recolored("ramp:0=#3060d0").unwrap(), ramp);
        let both = [color[1], ramp[0]];
        for order in ["1=#0000ff cap=#3060d0", "cap=#3060d0 1=#0000ff"] {
            let found = recolored(order).unwrap();
            assert_eq!([found[1], found[0]], both, "{order}");
        }
        assert!(ramp[..2].iter().all(|[r, _, b]| b > r) && ramp[0][2] < ramp[1][2] && ramp[2] == before[2], "{ramp:?}");
    }

    /// The colors that a file shows are recolored further.
    #[test]
    fn shown_colors_come_first() {
        let shown = vec![[0.1; 3], [0.2; 3], [0.3; 3]];
        let palette = Palette { shown: shown.clone(), ..palette() };
        assert_eq!(apply(&[], &palette).unwrap(), shown);
        assert_eq!(apply(&[parse("1=#0000ff").unwrap()], &palette).unwrap(), [shown[0], [0.0, 0.0, 1.0], shown[2]]);
    }

    #[test]
    fn errors_say_what_there_is() {
        for (text, message) in [
            ("9=#000000", "--recolor 9: the palette has 3 colors, 0 to 2"),
            ("stem=#000000", "--recolor stem: the palette has the ramps cap"),
            ("ramp:1=#000000", "--recolor ramp:1: the palette has the ramps cap"),
            ("ramp:x=#000000", "found x as an index, expected a number"),
            ("=#000000", "expected a palette index or the name of a ramp before the ="),
            ("cap", "expected INDEX=#RRGGBB"),
            ("cap=red", "expected #RRGGBB"),
            ("cap=#ff0000 ramp:0=#00ff00", "--recolor cap: found two colors, expected one"),
            ("1=#ff0000 1=#00ff00", "--recolor 1: found two colors, expected one"),
        ] {
            let error = recolored(text).unwrap_err();
            assert!(error.contains(message), "{text}: {error}");
        }
        let plain = Palette { ramps: vec![], ..palette() };
        let error = apply(&[parse("cap=#000000").unwrap()], &plain).unwrap_err();
        assert!(error.contains("has no ramps"), "{error}");
    }
}
