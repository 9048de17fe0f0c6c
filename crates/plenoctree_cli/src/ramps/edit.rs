//! Edits of ramps on the command line.

use plenoctree::palette::Palette;

use crate::{number::counted, result::Result};

/// A ramp, and the tones that it gets.
#[derive(Clone, Debug, PartialEq)]
pub struct Edit {
    name: String,
    sources: Vec<Source>,
}

/// The tones that a ramp gets.
#[derive(Clone, Debug, PartialEq)]
enum Source {
    /// A palette color, by its index.
    Tone(usize),
    /// All tones of a ramp, by its name, which is never a number and has no comma.
    Ramp(String),
}

/// Parses `NAME=SOURCE,SOURCE..`, where a source is the name of a ramp or the index of a palette color.
pub fn parse(text: &str) -> Result<Edit, String> {
    let (name, sources) = text.split_once('=').ok_or("expected NAME=RAMP or NAME=INDEX,INDEX")?;
    let source = |source: &str| match source {
        "" => Err("expected the name of a ramp or a palette index after the = and after every comma".to_string()),
        digits if digits.bytes().all(|byte| byte.is_ascii_digit()) => {
            let index = digits.parse().map_err(|_| format!("found {digits} as an index, expected a smaller number"));
            index.map(Source::Tone)
        }
        name => Ok(Source::Ramp(name.into())),
    };
    let sources = sources.split(',').map(str::trim).map(source).collect::<Result<_, _>>()?;
    Ok(Edit { name: name.trim().into(), sources })
}

impl Edit {
    /// Changes the ramps of a palette. A ramp that is only renamed keeps its place.
    pub fn apply(&self, palette: &mut Palette) -> Result<(), String> {
        let fail = |what: String| format!("{}: {what}", self.name);
        if let [Source::Ramp(from)] = &self.sources[..]
            && palette.ramp(&self.name).is_none()
        {
            let ramp = palette.ramp(from).ok_or_else(|| fail(missing(from, palette)))?;
            return palette.rename_ramp(ramp, &self.name).map_err(|error| fail(error.to_string()));
        }
        let mut tones = vec![];
        for source in &self.sources {
            match source {
                Source::Tone(tone) => tones.push(*tone),
                Source::Ramp(from) => {
                    let ramp = palette.ramp(from).ok_or_else(|| fail(missing(from, palette)))?;
                    tones.extend_from_slice(&palette.ramps[ramp].tones);
                }
            }
        }
        palette.gather_tones(&tones, &self.name).map_err(|error| fail(error.to_string()))
    }
}

fn missing(ramp: &str, palette: &Palette) -> String {
    let names: Vec<&str> = palette.ramps.iter().map(|ramp| ramp.name.as_str()).collect();
    match &names[..] {
        [] => {
            let colors = counted(palette.colors.len(), "color", "colors");
            format!("found no ramp {ramp}: the palette has {colors} and no ramps; gather colors by their indices")
        }
        names => format!("found no ramp {ramp}, expected one of {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use plenoctree::palette::Ramp;

    use super::*;

    fn edited(edits: &[&str]) -> Result<Vec<Ramp>, String> {
        let mut palette = Palette::new((1..6).map(|tone| [0.1 * f64::from(tone); 3]).collect::<Vec<_>>()).unwrap();
        palette.gather_tones(&[0, 1, 2], "gray").unwrap();
        palette.gather_tones(&[3, 4], "white").unwrap();
        edits.iter().try_for_each(|edit| parse(edit)?.apply(&mut palette))?;
        palette.validate().unwrap();
        Ok(palette.ramps)
    }

    fn ramp(name: &str, tones: &[usize]) -> Ramp {
        Ramp { name: name.into(), tones: tones.into() }
    }

    #[test]
    fn ramps_are_renamed_merged_and_split() {
        assert_eq!(edited(&["iron=gray"]).unwrap(), [ramp("iron", &[0, 1, 2]), ramp("white", &[3, 4])]);
        assert_eq!(edited(&["iron=white,gray"]).unwrap(), [ramp("iron", &[0, 1, 2, 3, 4])]);
        assert_eq!(edited(&["gray=white"]).unwrap(), [ramp("gray", &[0, 1, 2, 3, 4])]);
        let split = [ramp("gray", &[1]), ramp("white", &[3, 4]), ramp("iron", &[0, 2])];
        assert_eq!(edited(&["iron=2,0,2"]).unwrap(), split);
        assert_eq!(edited(&["iron=2,0", "gray=iron"]).unwrap(), [ramp("gray", &[0, 1, 2]), ramp("white", &[3, 4])]);
        assert_eq!(edited(&["gray=gray"]).unwrap(), edited(&[]).unwrap());
    }

    #[test]
    fn errors_say_what_there_is() {
        for (edit, message) in [
            ("iron", "expected NAME=RAMP"),
            ("iron=", "expected the name of a ramp or a palette index"),
            ("iron=gray,", "expected the name of a ramp or a palette index"),
            ("iron=red", "iron: found no ramp red, expected one of gray, white"),
            ("iron=9", "iron: found tone 9, expected one of 5"),
            ("3=gray", "expected one that is not a number"),
            (
                "gray,white=gray",
                "found the name \"gray,white\", expected one that is not a number, without `=`, `:`, `,`",
            ),
            ("=gray", "expected one that is not a number"),
        ] {
            let error = edited(&[edit]).unwrap_err();
            assert!(error.contains(message), "{edit}: {error}");
        }
    }
}
