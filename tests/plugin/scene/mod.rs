//! Tests props together with meshes, cameras and other props. Every pixel is compared with a color worked out by hand.
//!
//! Props are composited in encoded sRGB, the space in which fields are trained: `a` times the encoded color of the prop
//! plus `1 - a` times the encoded color behind it, where `a` is the opacity. Panes of glass blend in linear light, like
//! all transparent meshes of Bevy.

mod cached;
mod cameras;
mod depth;
mod effects;
mod life;
mod memory;
mod motion;
mod overlap;
mod random;
mod reports;
mod resize;
mod stale;
mod transforms;
mod transmission;
