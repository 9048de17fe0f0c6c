//! Tests ramps: adjusting, recoloring and editing them.

use bevy::prelude::*;
use bevy_plenoctree::{FieldPalette, InvalidRamps, Palette, PaletteOverride, Ramp, RampAdjustment, Wish};

/// A palette of three reds and a gray, with ramps.
pub fn ramps() -> FieldPalette {
    let mut palette = Palette::new(vec![[0.3, 0.06, 0.06], [0.5, 0.1, 0.1], [0.8, 0.2, 0.2], [0.6; 3]]).unwrap();
    palette.ramps = palette.guess_ramps();
    FieldPalette::new(palette)
}

/// Ramps that are adjusted in every frame allocate nothing, and each frame starts from the source colors.
#[test]
fn adjusted_ramps_do_not_allocate() {
    let (mut palette, mut own) = (ramps(), PaletteOverride::default().with(3, Color::WHITE));
    own.set_ramp("red", Color::BLACK);
    let mut adjust = |step: u32| {
        let color = Some([0.1, 0.2, 0.02 * f64::from(step)]);
        let adjustment = RampAdjustment { color, brightness: 0.01 * f64::from(step), ..default() };
        own.adjust_ramp("red", &adjustment);
        palette.adjust_ramp(0, &adjustment)
    };
    let count = allocation_counter::measure(|| assert!((0..40).all(&mut adjust))).count_total;
    assert_eq!(count, 0);
    assert!(palette.adjust_ramp(0, &RampAdjustment::default()));
    assert!(palette.source().eq(palette.shown().iter().copied()));
    assert!(!palette.set_ramp(2, Color::WHITE));
}

/// Wishes come true on the field and on single entities, and other colors stay.
#[test]
fn wishes_come_true_on_fields_and_entities() {
    let (mut palette, mut own) = (ramps(), PaletteOverride::default());
    let wishes = [Wish::tone(1, [0.1, 0.2, 0.6])];
    own.recolor(&palette, &wishes, &[]).unwrap();
    palette.recolor(&wishes, &[]).unwrap();
    assert_eq!(
        (palette.shown()[1], palette.shown()[3]),
        (Color::srgb(0.1, 0.2, 0.6), palette.source().nth(3).unwrap())
    );
    assert_eq!((0..4).map(|index| own.get(index)).collect::<Vec<_>>(), {
        let shown = palette.shown().iter().copied();
        shown.enumerate().map(|(index, color)| (index < 3).then_some(color)).collect::<Vec<_>>()
    });
    let red = palette.ramp("red").unwrap();
    // A locked ramp keeps what it shows, and so does one that only other wishes move.
    let before = palette.shown().to_vec();
    assert!(palette.recolor(&[Wish::tone(0, [0.9, 0.9, 0.1])], &[red]).is_err());
    assert_eq!(palette.shown(), before);
    palette.recolor(&[Wish::tone(3, [0.1, 0.5, 0.2])], &[]).unwrap();
    assert_eq!(palette.shown()[..3], before[..3]);
    assert_eq!(palette.shown()[3], Color::srgb(0.1, 0.5, 0.2));
}

/// Ramps can be edited, and edits that do not fit change nothing.
#[test]
fn ramps_are_edited() {
    let mut palette = ramps();
    palette.edit_ramps(|palette| palette.gather_tones(&[1, 2], "light")).unwrap();
    assert_eq!(palette.ramps()[2], Ramp { name: "light".into(), tones: vec![1, 2] });
    let before = palette.ramps().to_vec();
    let twice = palette.edit_ramps(|palette| {
        palette.ramps[0].tones.push(0);
        Ok(())
    });
    assert_eq!(twice, Err(InvalidRamps::Twice { tone: 0 }));
    assert_eq!(palette.ramps(), before);
}
