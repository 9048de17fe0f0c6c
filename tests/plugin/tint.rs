//! Tests that a tint multiplies the light of everything that is drawn of a prop.

use std::time::Duration;

use bevy::prelude::*;
use bevy_plenoctree::{
    BilateralFilter, FieldPalette, PaletteOverride, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop, PropStage,
    PropTint,
    headless::{Headless, exact_camera},
};
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

const FIELD: Color = Color::srgb(0.8, 0.6, 0.2);
const SHOWN: Color = Color::srgb(0.3, 0.5, 0.9);
const OWN: Color = Color::srgb(0.2, 0.8, 0.4);
const BACKGROUND: Color = Color::srgb(0.5, 0.7, 0.9);

/// Bakes the cube from -0.5 to 0.5.
fn cube(density: f64) -> PlenOctree {
    let settings = BakeSettings { depth: 3, basis: Basis::Rgba, ..default() };
    let [r, g, b] = Srgba::from(FIELD).to_f32_array_no_alpha().map(f64::from);
    bake(&settings, |at| if at.abs().max_element() < 0.5 { density } else { 0.0 }, |_| move |_| DVec3::new(r, g, b))
        .unwrap()
}

fn dimmed(color: Color, tint: Color) -> Vec3 {
    let (color, tint) = (color.to_linear().to_vec3(), tint.to_linear().to_vec3());
    let [r, g, b] = (color * tint).to_array();
    Srgba::from(LinearRgba::rgb(r, g, b)).to_vec3()
}

#[test]
fn a_tint_reaches_everything_that_is_drawn_of_a_prop() {
    let mut headless = Headless::new(UVec2::splat(16), |app| {
        app.add_plugins(PlenOctreePlugin);
    })
    .unwrap();
    let target = headless.target();
    let world = headless.app.world_mut();
    let [solid, fog] = [1e4, std::f64::consts::LN_2].map(|density| {
        let field = world.resource_mut::<Assets<PlenOctree>>().add(cube(density));
        // Dimmed, the first color would be nearer to the second.
        let mut palette = FieldPalette::from_colors([FIELD, Color::srgb(0.1, 0.1, 0.1)]).unwrap();
        palette.set(0, SHOWN);
        world.resource_mut::<Palettes>().insert(&field, palette);
        field
    });
    let prop = world.spawn(Prop(solid.clone())).id();
    // The view is so narrow that all rays are almost parallel.
    let projection = Projection::Perspective(PerspectiveProjection { fov: 0.01, ..default() });
    let view = (projection, Transform::from_xyz(0.0, 0.0, 20.0));
    let camera = world.spawn((exact_camera(BACKGROUND), target, view)).id();
    headless.wait_until_ready(Duration::from_secs(60)).unwrap();

    let posterize = Posterize { filter: BilateralFilter { iterations: 0, ..default() }, ..default() };
    let night = Color::linear_rgb(0.02, 0.05, 0.2);
    let bright = Color::linear_rgb(1.5, 2.0, 1.0);
    let harmless = Color::linear_rgb(f32::NAN, -1.0, 0.5);
    for (tint, factors) in
        [(Color::WHITE, Color::WHITE), (night, night), (bright, bright), (harmless, Color::linear_rgb(0.0, 0.0, 0.5))]
    {
        for stage in [PropStage::Scene, PropStage::Display] {
            let mut check = |what: &str,
                             field: &Handle<PlenOctree>,
                             posterize: Option<Posterize>,
                             own: Option<Color>,
                             expected: Vec3| {
                let world = headless.app.world_mut();
                world.entity_mut(camera).insert(stage);
                let mut prop = world.entity_mut(prop);
                prop.remove::<(Posterize, PaletteOverride)>().insert((Prop(field.clone()), PropTint(tint)));
                if let Some(posterize) = posterize {
                    prop.insert(posterize);
                }
                if let Some(own) = own {
                    prop.insert(PaletteOverride::default().with(0, own));
                }
                let pixel = headless.capture().unwrap().get_pixel(8, 8).0;
                let expected = (255.0 * expected).clamp(Vec3::ZERO, Vec3::splat(255.0));
                let off = (0..3).map(|c| (f32::from(pixel[c]) - expected[c]).abs()).fold(0.0, f32::max);
                assert!(off <= 1.0, "{what} at {stage:?}, {tint:?}: {pixel:?}, expected {expected}");
            };
            check("as trained", &solid, None, None, dimmed(FIELD, factors));
            check("posterized", &solid, Some(posterize), None, dimmed(SHOWN, factors));
            check("overridden", &solid, Some(posterize), Some(OWN), dimmed(OWN, factors));
            // Half of the light is the background's, which is not tinted.
            let behind = Srgba::from(BACKGROUND).to_vec3();
            check("fog", &fog, None, None, 0.5 * dimmed(FIELD, factors) + 0.5 * behind);
            let thin = Posterize { min_opacity: 0.9, ..posterize };
            // A palette that has changed would change them, too.
            check("thin pixels", &fog, Some(thin), Some(FIELD), 0.5 * dimmed(FIELD, factors) + 0.5 * behind);
        }
    }
}
