//! Tests that a tint multiplies the light of everything that is drawn of a prop.

use bevy::prelude::*;
use bevy_plenoctree::{
    BilateralFilter, FieldPalette, PaletteOverride, PlenOctree, Posterize, Prop, PropPlacement, PropQuality, PropTint,
    SolidOpacity,
};
use glam::DVec3;

use super::stage::{
    Stage,
    fields::{SOLID, colored, cube, density},
    pixels::{differing, encoded, is_off},
};

const FIELD: Color = Color::srgb(0.8, 0.6, 0.2);
const SHOWN: Color = Color::srgb(0.3, 0.5, 0.9);
const OWN: Color = Color::srgb(0.2, 0.8, 0.4);
const BACKGROUND: Color = Color::srgb(0.5, 0.7, 0.9);

fn dimmed(color: Color, tint: Color) -> DVec3 {
    let [r, g, b] = (color.to_linear().to_vec3() * tint.to_linear().to_vec3()).to_array();
    encoded(LinearRgba::rgb(r, g, b))
}

/// At the edges of a posterized prop, too, whose rays do not see what the layer shows.
#[test]
fn nothing_of_a_black_prop_is_bright() {
    let mut stage = Stage::new(48);
    // A solid half, and next to it haze in cells of half a pixel, every second of them empty.
    let inside = |at: DVec3| at.abs().max_element() < 0.7;
    let cell = |at: f64| (64.0 * (at + 1.0)).floor() as u32;
    let haze = |at: DVec3| if cell(at.x) % 2 == 0 { density(0.28) / 0.7 } else { 0.0 };
    let plate = |at: DVec3| {
        if !inside(at) {
            0.0
        } else if at.x < 0.0 {
            1e4
        } else {
            haze(at)
        }
    };
    let bright = DVec3::new(0.95, 0.9, 0.85);
    let mut capture = |color: DVec3, tint: Color| {
        stage.clear();
        stage.spawn_prop(&colored(7, plate, |_| color), PropTint(tint));
        let [r, g, b] = color.to_array().map(|channel| channel as f32);
        stage.paint(FieldPalette::from_colors([Color::srgb(r, g, b)]).unwrap());
        stage.dress(Posterize::paper());
        stage.set((PropQuality::EXACT, Transform::from_xyz(0.0, 0.0, 3.0)));
        stage.set_background(BACKGROUND);
        stage.wait();
        stage.capture()
    };
    let (tinted, black) = (capture(bright, Color::BLACK), capture(DVec3::ZERO, Color::WHITE));
    assert_eq!(differing(&tinted, &black, 2), 0);
}

#[test]
fn a_tint_reaches_everything_that_is_drawn_of_a_prop() {
    let mut stage = Stage::new(16);
    let [solid, fog] = [SOLID, density(0.5)].map(|density| {
        stage.clear();
        stage.spawn_prop(&cube(density, encoded(FIELD)), ());
        // Dimmed, the first color would be nearer to the second.
        let mut palette = FieldPalette::from_colors([FIELD, Color::srgb(0.1, 0.1, 0.1)]).unwrap();
        palette.set(0, SHOWN);
        stage.paint(palette);
        stage.field()
    });
    // The view is so narrow that all rays are almost parallel.
    let projection = Projection::Perspective(PerspectiveProjection { fov: 0.01, ..default() });
    stage.set((projection, Transform::from_xyz(0.0, 0.0, 20.0)));
    stage.set_background(BACKGROUND);
    stage.wait();

    let posterize = Posterize { filter: BilateralFilter { iterations: 0, ..default() }, ..default() };
    let night = Color::linear_rgb(0.02, 0.05, 0.2);
    let bright = Color::linear_rgb(1.5, 2.0, 1.0);
    let harmless = Color::linear_rgb(f32::NAN, -1.0, 0.5);
    for (tint, factors) in
        [(Color::WHITE, Color::WHITE), (night, night), (bright, bright), (harmless, Color::linear_rgb(0.0, 0.0, 0.5))]
    {
        for place in [PropPlacement::Scene, PropPlacement::Display] {
            let mut check = |what: &str,
                             field: &Handle<PlenOctree>,
                             posterize: Option<Posterize>,
                             own: Option<Color>,
                             expected: DVec3| {
                stage.set(place);
                stage.undress::<(Posterize, PaletteOverride)>();
                stage.dress((Prop(field.clone()), PropTint(tint)));
                if let Some(posterize) = posterize {
                    stage.dress(posterize);
                }
                if let Some(own) = own {
                    stage.dress(PaletteOverride::default().with(0, own));
                }
                let pixel = *stage.capture().get_pixel(8, 8);
                let is_right = !is_off(&pixel, expected, 1.0);
                assert!(is_right, "{what} at {place:?}, {tint:?}: {pixel:?}, expected {expected}");
            };
            check("as trained", &solid, None, None, dimmed(FIELD, factors));
            check("posterized", &solid, Some(posterize), None, dimmed(SHOWN, factors));
            check("overridden", &solid, Some(posterize), Some(OWN), dimmed(OWN, factors));
            // Half of the light is the background's, which is not tinted.
            let behind = encoded(BACKGROUND);
            check("fog", &fog, None, None, 0.5 * dimmed(FIELD, factors) + 0.5 * behind);
            let thin = Posterize { min_opacity: 0.9, ..posterize };
            // A palette that has changed would change them, too.
            check("thin pixels", &fog, Some(thin), Some(FIELD), 0.5 * dimmed(FIELD, factors) + 0.5 * behind);
        }
    }
}

/// Without a tint, and without a setting of where it is solid, a prop is drawn as with the defaults.
#[test]
fn props_are_drawn_without_components_that_were_removed() {
    let mut stage = Stage::new(16);
    stage.spawn_prop(&cube(SOLID, encoded(FIELD)), ());
    stage.wait();
    let drawn = stage.capture();
    stage.dress(PropTint(Color::BLACK));
    assert_ne!(stage.capture(), drawn);
    stage.undress::<PropTint>();
    stage.undress::<SolidOpacity>();
    assert_eq!(stage.capture(), drawn);
}
