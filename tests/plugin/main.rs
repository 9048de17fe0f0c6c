//! Tests of the plugin on whatever adapter there is. They are one program, so that Bevy is linked once.

mod arrival;
mod brightness;
mod edges;
mod extract;
mod extremes;
mod fog;
mod frames;
mod idle_stage;
mod large;
mod lighting;
mod loading;
mod looks;
mod memory;
mod palettes;
mod panel;
mod picking;
mod quality;
mod recolor;
mod sampling;
mod scene;
mod shadows;
mod stages;
mod states;
mod steady;
mod tint;
mod worlds;
