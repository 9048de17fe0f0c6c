//! Pointers of apps without a window.

use bevy::{
    picking::pointer::{Location, PointerAction, PointerButton, PointerId, PointerInput},
    prelude::*,
    window::PrimaryWindow,
};

use super::{Headless, HeadlessError};

impl Headless {
    /// Moves the mouse pointer to `position`, in pixels of the target from its upper left corner, and runs one frame,
    /// in which no camera draws. By the time it returns, the observers of the entity under the pointer have run, such
    /// as those of [`Pointer<Over>`](Over) and [`Pointer<Move>`](Move).
    ///
    /// Pointers hit what the last frame showed, so run a frame after spawning or moving something. Props are hit if the
    /// app has the [`PropPickingPlugin`](crate::PropPickingPlugin). Requires the feature `picking`.
    ///
    /// Bevy's picking looks for a primary window even if cameras draw to images. If there is none, one is spawned,
    /// which is not shown.
    ///
    /// Returns [`HeadlessError::NoPointers`] if the app does not have Bevy's `DefaultPickingPlugins`.
    pub fn pointer_to(&mut self, position: Vec2) -> Result<(), HeadlessError> {
        let delta = position - self.pointer.unwrap_or(position);
        self.pointer = Some(position);
        self.point(position, PointerAction::Move { delta })
    }

    /// Clicks at `position`, in pixels of the target from its upper left corner: moves the mouse pointer there, presses
    /// its primary button, and releases it, each in a frame in which no camera draws. By the time it returns, the
    /// observers of [`Pointer<Press>`](Press), [`Pointer<Release>`](Release) and [`Pointer<Click>`](Click) have run,
    /// and so have those that [`pointer_to`](Self::pointer_to) triggers.
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use bevy::{picking::DefaultPickingPlugins, prelude::*};
    /// # use bevy_plenoctree::{PlenOctreePlugin, Prop, PropPickingPlugin, headless::Headless};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let mut headless = Headless::new(UVec2::new(640, 480), |app| {
    ///     app.add_plugins((PlenOctreePlugin, DefaultPickingPlugins, PropPickingPlugin));
    /// })?;
    /// let target = headless.target();
    /// let world = headless.app.world_mut();
    /// let field = world.resource::<AssetServer>().load("drum.plenoctree");
    /// let despawn = |click: On<Pointer<Click>>, mut commands: Commands| commands.entity(click.entity).despawn();
    /// let drum = world.spawn(Prop(field)).observe(despawn).id();
    /// world.spawn((Camera3d::default(), target, Transform::from_xyz(0.0, 1.0, 4.0).looking_at(Vec3::ZERO, Vec3::Y)));
    /// headless.wait_until_ready(Duration::from_secs(60))?;
    /// headless.click(Vec2::new(320.0, 240.0))?;
    /// assert!(headless.app.world().get_entity(drum).is_err());
    /// # Ok(()) }
    /// ```
    ///
    /// Returns [`HeadlessError::NoPointers`] if the app does not have Bevy's `DefaultPickingPlugins`.
    pub fn click(&mut self, position: Vec2) -> Result<(), HeadlessError> {
        self.pointer_to(position)?;
        self.point(position, PointerAction::Press(PointerButton::Primary))?;
        self.point(position, PointerAction::Release(PointerButton::Primary))
    }

    /// Runs a frame in which the mouse does something.
    fn point(&mut self, position: Vec2, action: PointerAction) -> Result<(), HeadlessError> {
        let target = self.target();
        let world = self.app.world_mut();
        if !world.contains_resource::<Messages<PointerInput>>() {
            return Err(HeadlessError::NoPointers);
        }
        let window = world.query_filtered::<Entity, With<PrimaryWindow>>().iter(world).next();
        let window = window.unwrap_or_else(|| world.spawn((Window::default(), PrimaryWindow)).id());
        if let Some(target) = target.normalize(Some(window)) {
            world.write_message(PointerInput::new(PointerId::Mouse, Location { target, position }, action));
        }
        self.update_without_drawing();
        Ok(())
    }
}
