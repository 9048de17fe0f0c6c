//! Ray casts against props: a system parameter, and a backend for `bevy_picking`.

#[cfg(feature = "picking")]
mod backend;
mod ray_cast;

#[cfg(feature = "picking")]
pub use backend::PropPickingPlugin;
pub use ray_cast::{PropHit, PropRayCast};
