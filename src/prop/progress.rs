//! The progress of props on their way to the screen.

use bevy::prelude::*;

/// The progress of a [`Prop`](crate::Prop) on its way to the screen, for loading screens.
///
/// Every prop has this component; do not change it. It is updated together with [`PropState`](crate::PropState), and
/// marked as changed only when it changes. When a prop is ready or has failed, all fractions are 1. Saved worlds do not
/// contain it.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_plenoctree::{PlenOctreePlugin, PropProgress, props_ready};
/// # #[derive(Component)]
/// # struct LoadingBar;
/// fn show_progress(props: Query<&PropProgress>, mut bars: Query<&mut Transform, With<LoadingBar>>) {
///     let shares = props.iter().map(PropProgress::fraction);
///     let mean = shares.sum::<f32>() / props.iter().len().max(1) as f32;
///     for mut bar in &mut bars {
///         bar.scale.x = mean;
///     }
/// }
///
/// fn plugin(app: &mut App) {
///     app.add_systems(Update, show_progress.run_if(not(props_ready)));
/// }
/// # App::new().add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin, plugin)).update();
/// ```
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct PropProgress {
    /// The fraction of the field's file that has been read and parsed, from 0 to 1. Asset sources that cannot seek
    /// return whole files, so it jumps from 0 to 1.
    pub read: f32,
    /// The fraction of the field that is on the GPU, from 0 to 1. It is 0 while the field is prepared in the
    /// background.
    pub uploaded: f32,
    /// The progress of the palette's extraction, from 0 to 1, or `None` if the prop is not posterized.
    pub palette: Option<f32>,
}

impl PropProgress {
    /// Returns the mean of the fractions, from 0 to 1.
    pub fn fraction(&self) -> f32 {
        match self.palette {
            Some(palette) => (self.read + self.uploaded + palette) / 3.0,
            None => (self.read + self.uploaded) / 2.0,
        }
    }
}
