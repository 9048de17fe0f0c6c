//! Re-exports the types that most games need: `use bevy_plenoctree::prelude::*;`.

#[cfg(feature = "shadows")]
pub use crate::PropLighting;
pub use crate::{
    BeforePalette, BlendSpace, BorderSmoothing, EdgeSmoothing, FieldPalette, Ink, InkBorders, InkColor, PaletteMethod,
    PaletteOverride, PaletteReady, Palettes, PlenOctree, PlenOctreePlugin, Posterize, PosterizeView, Prop, PropHit,
    PropPath, PropPlacement, PropProgress, PropQuality, PropRayCast, PropState, PropTint, RampAdjustment, Recolor,
    SolidOpacity, Wish, props_progress, props_ready,
};
