//! Tests the other effects of Bevy: a prop is to look to them like a mesh of the same shape.

use bevy::{
    camera::Hdr,
    core_pipeline::prepass::NormalPrepass,
    pbr::{ContactShadows, ScreenSpaceAmbientOcclusion},
    post_process::{
        auto_exposure::AutoExposure,
        bloom::Bloom,
        dof::{DepthOfField, DepthOfFieldMode},
        effect_stack::{ChromaticAberration, LensDistortion, Vignette},
    },
    prelude::*,
};
use bevy_anti_alias::{contrast_adaptive_sharpening::ContrastAdaptiveSharpening, fxaa::Fxaa};

use super::motion::View;
use crate::stage::{Stage, pixels::differing};

/// Inserts an effect into the camera of a stage, or removes it.
type Set = fn(&mut Stage, bool);

/// Effects, and whether they change how an unlit cube alone looks.
const EFFECTS: [(&str, bool, Set); 11] = [
    ("no effect", false, |_, _| ()),
    ("depth of field, Gaussian", true, |stage, on| stage.set_if(on, blurred(DepthOfFieldMode::Gaussian))),
    ("depth of field, bokeh", true, |stage, on| stage.set_if(on, blurred(DepthOfFieldMode::Bokeh))),
    ("FXAA", true, |stage, on| stage.set_if(on, Fxaa::default())),
    ("sharpening", false, |stage, on| stage.set_if(on, ContrastAdaptiveSharpening::default())),
    ("ambient occlusion", false, |stage, on| stage.set_if(on, ScreenSpaceAmbientOcclusion::default())),
    ("contact shadows", false, |stage, on| stage.set_if(on, ContactShadows::default())),
    ("bloom", true, |stage, on| stage.set_if(on, Bloom { intensity: 0.4, ..default() })),
    ("automatic exposure", false, |stage, on| stage.set_if(on, AutoExposure::default())),
    ("chromatic aberration", true, |stage, on| stage.set_if(on, ChromaticAberration { intensity: 0.1, ..default() })),
    ("lens distortion, vignette", true, |stage, on| stage.set_if(on, (LensDistortion::default(), Vignette::default()))),
];

fn blurred(mode: DepthOfFieldMode) -> DepthOfField {
    DepthOfField { mode, focal_distance: 1.0, aperture_f_stops: 0.05, ..default() }
}

#[test]
fn effects_treat_props_like_meshes() {
    let mut views = [true, false].map(|is_prop| View::new(is_prop, false));
    let place = Transform::from_xyz(0.0, 0.1, 0.0).with_rotation(Quat::from_rotation_y(0.5));
    let eye = Transform::from_xyz(0.4, 1.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y);
    for view in &mut views {
        // What effects need is there from the beginning: Bevy does not expect prepasses to change.
        view.stage.set((Hdr, Msaa::Off, NormalPrepass));
    }
    let mut bare = None;
    for (effect, is_seen, set) in EFFECTS {
        let [prop, mesh] = views.each_mut().map(|view| {
            set(&mut view.stage, true);
            // Some effects take several frames.
            view.stage.update(4);
            let frame = view.capture(place, eye);
            set(&mut view.stage, false);
            frame
        });
        let bare = bare.get_or_insert_with(|| mesh.clone());
        let changed = differing(&mesh, bare, 3);
        assert!(!is_seen || changed > 100, "{effect} changes only {changed} pixels");
        let wrong = differing(&prop, &mesh, 3);
        assert!(wrong <= 2, "{effect}: {wrong} pixels differ");
    }
}
