//! Props among a game's things, through the real plugin: every pixel against what it must be, worked out by hand.
//!
//! A prop is composited in encoded sRGB, the space in which fields are trained: a share `a` of its color and `1 - a` of
//! what is behind it, as they are encoded. Panes of glass blend in linear light, as Bevy's do.

mod cameras;
mod depth;
mod life;
mod stage;
mod transforms;
