//! Turns inputs upright.

use glam::{DMat3, DQuat, DVec3};

use super::{
    input::{FitInput, View, ViewCamera},
    scene::focus,
};

/// Returns the rotation that turns the mean up direction of the cameras to z, and the length of that mean: 1 if all agree.
///
/// Pictures are turned as their EXIF data says. Without it, the up direction may be to the left or right of pictures that
/// were taken upright: it is the axis on which the cameras agree more, and those at the side look down on what they show.
pub fn upright(views: &[View]) -> (DMat3, f64) {
    let axes = views.iter().map(|view| view.camera.rotation * view.shown_axes());
    let sum = axes.fold(DMat3::ZERO, |sum, axes| sum + axes);
    let (side, mut up) = (sum.x_axis, sum.y_axis);
    if side.length() > up.length() {
        let cameras: Vec<ViewCamera> = views.iter().map(|view| view.camera.clone()).collect();
        let height = |middle: DVec3| cameras.iter().map(|camera| (camera.position - middle).dot(side)).sum::<f64>();
        up = if focus(&cameras).is_ok_and(|(middle, _)| height(middle) < 0.0) { -side } else { side };
    }
    let turn =
        up.try_normalize().map_or(DMat3::IDENTITY, |up| DMat3::from_quat(DQuat::from_rotation_arc(up, DVec3::Z)));
    (turn, up.length() / views.len().max(1) as f64)
}

/// Returns the input in another frame.
pub fn turned(input: &FitInput, turn: DMat3) -> FitInput {
    let mut input = input.clone();
    for view in &mut input.views {
        view.camera.rotation = turn * view.camera.rotation;
        view.camera.position = turn * view.camera.position;
    }
    input.points.iter_mut().for_each(|point| *point = turn * *point);
    input
}

/// Returns a rotation followed by a shift as a matrix, row by row.
pub fn matrix(turn: DMat3, shift: DVec3) -> [[f64; 4]; 4] {
    let row = |at: usize| [turn.x_axis[at], turn.y_axis[at], turn.z_axis[at], shift[at]];
    [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, TAU};

    use super::*;
    use crate::fit::report::FitReport;

    /// Views from around and above, with cameras that are turned about their optical axes by so many right angles.
    fn views(up: DVec3, turns: impl Fn(usize) -> f64) -> Vec<View> {
        let side = up.any_orthonormal_vector();
        (0..24)
            .map(|index| {
                let turn = DQuat::from_axis_angle(up, TAU * index as f64 / 24.0);
                let back = (turn * side + 0.5 * up).normalize();
                let right = up.cross(back).normalize();
                let level = DMat3::from_cols(right, back.cross(right), back);
                let rotation = level * DMat3::from_rotation_z(turns(index) * FRAC_PI_2);
                let position = DVec3::new(5.0, -3.0, 2.0) + 4.0 * back;
                let camera = ViewCamera::centered([40; 2], 50.0, rotation, position);
                View { name: String::new(), picture: "nowhere.png".into(), mask: None, ignored: None, camera }
            })
            .collect()
    }

    /// Whatever side of the picture is up, as with a phone that is held upright, and whatever the axes of the input, the
    /// object stands.
    #[test]
    fn pictures_that_are_taken_upright_stand() {
        for up in [DVec3::Z, DVec3::NEG_Y, DVec3::new(0.3, -0.8, 0.5).normalize()] {
            for turns in [0.0, 1.0, -1.0] {
                let (turn, agreement) = upright(&views(up, |_| turns));
                assert!((turn * up).distance(DVec3::Z) < 1e-6, "{turns}: {}", turn * up);
                assert!(agreement > 0.8, "{agreement}");
            }
            // Few are turned. In the other case, no more agree on any direction than on the opposite one.
            let (turn, agreement) = upright(&views(up, |index| f64::from(index % 6 == 0)));
            assert!((turn * up).distance(DVec3::Z) < 0.2 && agreement > FitReport::LEAST_UP_AGREEMENT, "{agreement}");
            let (_, agreement) = upright(&views(up, |index| [0.0, 1.0, 2.0, 3.0][index % 4]));
            assert!(agreement < FitReport::LEAST_UP_AGREEMENT, "{agreement}");
        }
    }
}
