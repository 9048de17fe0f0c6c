//! Tests props that overlap in the view: solid parts hide what is behind them, and only that.

use std::f32::consts::FRAC_PI_2;

use bevy::{
    diagnostic::{DiagnosticPath, DiagnosticsStore},
    prelude::*,
    render::diagnostic::RenderDiagnosticsPlugin,
};
use bevy_plenoctree::{Prop, PropQuality, SolidOpacity, VOLUME_SPANS};
use glam::{DVec2, DVec3};

use super::depth::{in_every_mode, through_pane};
use crate::stage::{
    fields::colored,
    sides::{BACKGROUND, BLUE, GREEN, RED, SOLID, Side, Sides, cube, density, flat, in_cube, seen, shape, within},
};

#[test]
fn props_alone() {
    Sides::new().run(&[
        haze_hides_no_solid_part,
        cores_are_seen_through_haze,
        a_solid_prop_is_seen_in_fog,
        props_show_through_one_that_is_solid_but_not_opaque,
        props_that_are_never_solid_are_cut_by_others,
        props_that_touch_and_props_in_the_same_place_are_whole,
        a_camera_inside_of_overlapping_props_sees_what_is_before_it,
        fewer_rays_know_solid_parts_too,
    ]);
}

#[test]
fn props_and_meshes() {
    Sides::with_meshes().run(&[panes_are_hidden_by_a_solid_prop_behind_fog, empty_parts_are_never_solid]);
}

/// The prop whose center is farther away has haze in front of the other one.
fn haze_hides_no_solid_part(stage: &mut Sides) {
    for opacity in [0.01, 0.03, 0.05, 0.06, 0.2, 0.4] {
        stage.clear();
        let haze = shape(8.0 * density(opacity), BLUE, |at| at.z > 0.875 || at.max_element() < -0.875);
        stage.spawn_prop(&haze, Transform::from_xyz(0.0, 0.0, -0.4));
        stage.spawn_prop(&cube(SOLID, RED), Transform::from_xyz(0.0, 0.0, -0.1));
        stage.wait();
        in_every_mode(stage, |stage, mode| {
            stage.check(format!("haze of {opacity}, {mode}"), |side, place| {
                let mut layers = Vec::new();
                layers.extend(within(place, (-1.0, -1.0), (1.0, 1.0)).then_some((0.5, BLUE, opacity)));
                layers.extend(within(place, (-1.0, -1.0), (-0.875, -0.875)).then_some((-1.3, BLUE, opacity)));
                layers.extend(in_cube(place).then_some((-0.1, RED, 1.0)));
                seen(side, &layers)
            });
        });
    }
}

/// Two props with a solid core, and haze all around it that reaches in front of the other one's core.
fn cores_are_seen_through_haze(stage: &mut Sides) {
    for opacity in [0.03, 0.06, 0.3] {
        let trained = |color| {
            let core = |at: DVec3| at.abs().max_element() < 0.5;
            let haze = density(opacity) / 0.5;
            colored(4, |at| if core(at) { SOLID } else { haze }, |_| color)
        };
        // The cores are side by side, and the cubes of haze overlap for half of their width.
        for (color, x, z) in [(RED, -0.5, 0.25), (BLUE, 0.5, -0.25)] {
            stage.spawn_prop(&trained(color), Transform::from_xyz(x, 0.0, z));
        }
        stage.wait();
        stage.check(format!("haze of {opacity}"), |side, place| {
            // A half unit of its own haze is before each core, or a whole unit of it beside the core.
            let sign = side.sign();
            let core = |x: f64| in_cube(place - DVec2::new(x, 0.0));
            let haze = |x: f64| within(place, (x - 1.0, -1.0), (x + 1.0, 1.0));
            let solid = if core(-0.5) { Some((RED, BLUE, 0.25, -0.25)) } else { None };
            let solid = if core(0.5) { Some((BLUE, RED, -0.25, 0.25)) } else { solid };
            let (own, other, z, other_z) = solid?;
            let mut color = own;
            if haze(if z > 0.0 { 0.5 } else { -0.5 }) {
                // From where the other one's haze begins to where the core begins.
                let path = (sign * other_z + 1.0) - (sign * z + 0.5);
                color = color.lerp(other, 1.0 - (-density(opacity) / 0.5 * path).exp());
            }
            Some(color)
        });
        stage.clear();
    }
}

/// A solid cube inside of fog. The center of the fog is nearer from one side, and farther away from the other.
fn a_solid_prop_is_seen_in_fog(stage: &mut Sides) {
    for opacity in [0.06, 0.2, 0.4, 0.6, 0.95] {
        let sigma = density(opacity) / 2.0;
        stage.spawn_prop(&shape(sigma, GREEN, |_| true), ());
        stage.spawn_prop(&cube(SOLID, RED), Transform::from_xyz(0.0, 0.0, 0.25).with_scale(Vec3::splat(0.5)));
        stage.wait();
        in_every_mode(stage, |stage, mode| {
            stage.check(format!("fog of {opacity}, {mode}"), |side, place| {
                let is_solid = within(place, (-0.25, -0.25), (0.25, 0.25));
                // The cube begins at 0.5 from the front, and at 0 from behind.
                let path = match side {
                    _ if !is_solid => 2.0,
                    Side::Front => 0.5,
                    Side::Behind => 1.0,
                };
                let behind = if is_solid { RED } else { BACKGROUND };
                let opacity = if within(place, (-1.0, -1.0), (1.0, 1.0)) { 1.0 - (-sigma * path).exp() } else { 0.0 };
                behind.lerp(GREEN, opacity)
            });
        });
        stage.clear();
    }
}

/// From the front: fog, a pane, a solid prop, another pane.
fn panes_are_hidden_by_a_solid_prop_behind_fog(stage: &mut Sides) {
    stage.spawn_prop(&cube(SOLID, GREEN), ());
    stage.spawn_rectangle((-1.0, -1.0), (0.0, 1.0), 0.75, RED, 0.5);
    stage.spawn_rectangle((-1.0, 0.0), (1.0, 1.0), -0.75, BLUE, 0.5);
    for opacity in [0.1, 0.2, 0.4, 0.45] {
        let wide = Transform::from_xyz(0.0, 0.0, 1.5).with_scale(Vec3::new(2.0, 2.0, 1.0));
        let fog = stage.spawn_prop(&cube(density(opacity), BLUE), wide);
        stage.wait();
        in_every_mode(stage, |stage, mode| {
            stage.check(format!("fog of {opacity}, {mode}"), |side, place| {
                let mut layers = Vec::new();
                layers.extend(within(place, (-1.0, -1.0), (1.0, 1.0)).then_some((1.5, BLUE, opacity)));
                layers.extend(in_cube(place).then_some((0.0, GREEN, 1.0)));
                let mut color = seen(side, &layers);
                let panes = [
                    (0.75, within(place, (-1.0, -1.0), (0.0, 1.0)), RED),
                    (-0.75, within(place, (-1.0, 0.0), (1.0, 1.0)), BLUE),
                ];
                let far = if side == Side::Front { [panes[1], panes[0]] } else { panes };
                for (z, covers, pane) in far {
                    if covers && !(in_cube(place) && side.sign() * z < 0.0) {
                        color = through_pane(pane, color);
                    }
                }
                color
            });
        });
        stage.world().despawn(fog);
    }
}

/// A prop with an opacity of 6/10 is solid, but another one shows through it. The other one is a wall at the back of
/// its bounding box, whose center is nearer.
fn props_show_through_one_that_is_solid_but_not_opaque(stage: &mut Sides) {
    stage.spawn_prop(&cube(density(0.6), RED), ());
    let wall = shape(SOLID, BLUE, |at| at.z < -0.75 || at.min_element() > 0.875);
    stage.spawn_prop(&wall, Transform::from_xyz(0.0, 0.0, 0.2));
    // Fog behind the wall from one side, and in front of it from the other.
    stage.spawn_prop(&cube(density(0.3), GREEN), Transform::from_xyz(0.0, 0.0, -1.5));
    stage.wait();
    in_every_mode(stage, |stage, mode| {
        stage.check(mode, |side, place| {
            let mut layers = vec![];
            layers.extend(in_cube(place).then_some((0.0, RED, 0.6)));
            layers.extend(within(place, (-1.0, -1.0), (1.0, 1.0)).then_some((-0.7, BLUE, 1.0)));
            layers.extend(in_cube(place).then_some((-1.5, GREEN, 0.3)));
            seen(side, &layers)
        });
    });
}

/// Neither order of drawing cuts the fog in front of an opaque prop that is never solid.
fn props_that_are_never_solid_are_cut_by_others(stage: &mut Sides) {
    let never = stage.spawn_prop(&cube(density(0.9), BLUE), Transform::from_xyz(0.25, 0.0, 0.0));
    stage.world().entity_mut(never).insert(SolidOpacity::Never);
    stage.spawn_prop(&cube(SOLID, RED), Transform::from_xyz(0.0, 0.0, 0.25));
    stage.wait();
    stage.check("never solid", |side, place| {
        let (blue, red) = (in_cube(place - DVec2::new(0.25, 0.0)), in_cube(place));
        // The red cube reaches from -0.25 to 0.75, the blue one from -0.5 to 0.5.
        let path = match (red, side) {
            (false, _) => 1.0,
            (true, Side::Front) => 0.0,
            (true, Side::Behind) => 0.25,
        };
        let behind = if red { RED } else { BACKGROUND };
        behind.lerp(BLUE, if blue { 1.0 - (-density(0.9) * path).exp() } else { 0.0 })
    });
}

/// Even a prop that is solid from no opacity on is not solid where its box is empty: a pane is seen behind it, through
/// fog.
fn empty_parts_are_never_solid(stage: &mut Sides) {
    let corner = shape(SOLID, RED, |at| at.abs().max_element() < 0.5 || at.min_element() > 0.875);
    let prop = stage.spawn_prop(&corner, ());
    stage.world().entity_mut(prop).insert(SolidOpacity::At(0.0));
    stage.spawn_prop(&cube(density(0.3), GREEN), Transform::from_xyz(0.25, 0.25, 1.2));
    stage.spawn_rectangle((-1.5, -0.625), (1.5, 0.625), -2.0, BLUE, 0.5);
    stage.wait();
    stage.check("solid from no opacity on", |side, place| {
        let is_red = in_cube(place) || within(place, (0.875, 0.875), (1.0, 1.0));
        let mut layers = vec![];
        layers.extend(is_red.then_some((0.0, RED, 1.0)));
        layers.extend(in_cube(place - 0.25).then_some((1.2, GREEN, 0.3)));
        let color = seen(side, &layers);
        let is_hidden = is_red && side == Side::Front;
        let in_pane = within(place, (-1.5, -0.625), (1.5, 0.625));
        if in_pane && !is_hidden { through_pane(BLUE, color) } else { color }
    });
}

fn props_that_touch_and_props_in_the_same_place_are_whole(stage: &mut Sides) {
    let first = stage.spawn_prop(&cube(SOLID, GREEN), Transform::from_xyz(-0.5, 0.0, 0.0));
    let field = stage.field();
    let second = stage.spawn((Prop(field), Transform::from_xyz(0.5, 0.0, 0.0)));
    let fog = stage.spawn_prop(&cube(density(0.4), BLUE), Transform::from_xyz(0.0, 1.0, 0.0));
    stage.wait();
    stage.check("side by side", |_, place| {
        let mut color = BACKGROUND;
        if within(place, (-1.0, -0.5), (1.0, 0.5)) {
            color = GREEN;
        }
        if in_cube(place - DVec2::new(0.0, 1.0)) { color.lerp(BLUE, 0.4) } else { color }
    });
    stage.world().despawn(fog);
    for entity in [first, second] {
        stage.world().get_mut::<Transform>(entity).unwrap().translation.x = 0.0;
    }
    stage.check("in the same place", |_, place| if in_cube(place) { GREEN } else { BACKGROUND });
}

/// The camera is in fog, then also inside of a solid cube in the fog, which its near plane cuts.
fn a_camera_inside_of_overlapping_props_sees_what_is_before_it(stage: &mut Sides) {
    stage.spawn_prop(&shape(0.5, GREEN, |_| true), ());
    stage.spawn_prop(&cube(SOLID, RED), Transform::from_xyz(0.0, 0.0, -0.5).with_scale(Vec3::splat(0.5)));
    stage.wait();
    let wide = PerspectiveProjection { fov: FRAC_PI_2, aspect_ratio: 1.0, near: 0.001, ..default() };
    stage.set((Projection::Perspective(wide), Transform::default()));
    stage.check("in fog", |side, place| {
        let ray = (0.5 * place).extend(1.0);
        // The cube's face at a distance of 1/4 is as wide as the view.
        let color = RED.lerp(GREEN, 1.0 - (-0.5 * 0.25 * ray.length()).exp());
        (side == Side::Front).then_some(color)
    });
    stage.set((flat(), Transform::from_xyz(0.0, 0.0, -0.5)));
    stage.check("inside of a solid", |side, place| {
        let is_red = within(place, (-0.25, -0.25), (0.25, 0.25));
        let fog = within(place, (-1.0, -1.0), (1.0, 1.0));
        let behind = BACKGROUND.lerp(GREEN, if fog { 1.0 - (-0.25f64).exp() } else { 0.0 });
        (side == Side::Front).then_some(if is_red { RED } else { behind })
    });
}

/// Fewer rays show the same.
fn fewer_rays_know_solid_parts_too(stage: &mut Sides) {
    stage.spawn_prop(&shape(density(0.3) / 2.0, GREEN, |_| true), ());
    stage.spawn_prop(&cube(SOLID, RED), Transform::from_xyz(0.0, 0.0, 0.4));
    stage.set_both(PropQuality { ray_tolerance: 0.1, ..PropQuality::EXACT });
    stage.wait();
    stage.check("fewer rays", |side, place| {
        // The cube begins at 0.9 from the front, and at -0.1 from behind.
        let path = if side == Side::Front { 0.1 } else { 0.9 };
        within(place, (-0.25, -0.25), (0.25, 0.25)).then(|| RED.lerp(GREEN, 1.0 - (-density(0.3) / 2.0 * path).exp()))
    });
}

/// The pass that finds solid parts runs only in views in which props overlap, and one of those is ever solid.
#[test]
fn only_views_with_overlaps_pay_for_them() {
    let mut stage = Sides::with(|app| {
        app.add_plugins(RenderDiagnosticsPlugin);
    });
    let left = stage.spawn_prop(&cube(SOLID, RED), Transform::from_xyz(-0.75, 0.0, 0.0));
    let right = stage.spawn_prop(&cube(SOLID, BLUE), Transform::from_xyz(0.75, 0.0, 1.0));
    stage.wait();
    assert!(VOLUME_SPANS.contains(&"plenoctree_solid"));
    // Returns when the pass was last measured. Measurements arrive a few frames later.
    let last_run = |stage: &mut Sides| {
        stage.update(8);
        let diagnostics = stage.world().resource::<DiagnosticsStore>();
        let path = DiagnosticPath::new("render/plenoctree_solid/elapsed_cpu");
        diagnostics.get(&path).and_then(|diagnostic| Some(diagnostic.measurement()?.time))
    };
    assert!(last_run(&mut stage).is_none(), "side by side");
    stage.world().get_mut::<Transform>(right).unwrap().translation.x = 0.0;
    let first = last_run(&mut stage);
    assert!(first.is_some() && last_run(&mut stage) > first, "one behind the other");
    for prop in [left, right] {
        stage.world().entity_mut(prop).insert(SolidOpacity::Never);
    }
    let last = last_run(&mut stage);
    assert_eq!(last_run(&mut stage), last, "never solid");
}
