//! Whether all props are ready.

use bevy::prelude::*;

use crate::prop::{Prop, PropState};

/// A run condition: returns whether no prop is waiting for its field, its palette or its pipelines.
///
/// Props that have [failed](PropState::Failed) do not count, because they would never let a loading screen end. Returns
/// true if there are no props. A prop that was spawned in this frame is waiting, even if its field is on the GPU.
pub fn props_ready(props: Query<&PropState, With<Prop>>) -> bool {
    !props.iter().any(PropState::is_waiting)
}
