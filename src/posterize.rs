//! Settings of posterization: section 4 of the method.

use bevy::{ecs::VariantDefaults, prelude::*};
use plenoctree::{
    LABEL_OPACITY,
    palette::{LabelSpace, Palette, PaletteLabel, PaletteMethod},
};

use crate::ink::Ink;

/// The maximum of [`Posterize::blend_steps`].
pub const MAX_BLEND_STEPS: u32 = 8;
/// The maximum of [`BilateralFilter::iterations`].
pub const MAX_FILTER_ITERATIONS: u32 = 16;
/// The maximum of [`BilateralFilter::radius`], in pixels.
pub const MAX_FILTER_RADIUS: u32 = 6;

/// Posterizes a [`Prop`](crate::Prop): filters its pixels and replaces their colors with labels, as described in
/// section 4 of [the method](https://github.com/bevy-plenoctree/bevy_plenoctree/blob/main/docs/method.md).
///
/// With [tones](crate::PaletteMethod::Tones), the default, labels do not depend on what is behind the prop, and the
/// prop stays as transparent as the field. With other palettes, posterized pixels are opaque, and the background
/// affects their label, as in the paper.
///
/// Uses the palette of the prop's field in [`Palettes`](crate::Palettes). If the field has none, one is loaded or
/// extracted; [`before_palette`](Self::before_palette) sets what is drawn until it is ready. Add a
/// [`PaletteOverride`](crate::PaletteOverride) to change the shown colors of this entity only.
///
/// On a camera, these are the settings of its [`PosterizeView`](crate::PosterizeView).
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct Posterize {
    /// The number of steps from one palette color to another, `d` in the method. With 1, the labels are the palette
    /// colors alone, without blends.
    ///
    /// Defaults to 3. Clamped to 1..=[`MAX_BLEND_STEPS`]. Palettes of [tones](crate::PaletteMethod::Tones) have no
    /// blends and ignore this. Other palettes of more than 17 colors may get fewer steps: no more than
    /// [`PaletteLabel::most_blend_steps`], so that every pixel is compared to at most [`PaletteLabel::MAX_LABELS`]
    /// labels. In that case, an error is logged.
    pub blend_steps: u32,
    /// The distance over which neighboring labels blend, `D` in the method: in encoded sRGB, or in [tone
    /// space](plenoctree::palette::tone_space) for palettes of [tones](crate::PaletteMethod::Tones). 0 is a hard
    /// border.
    ///
    /// Defaults to 0 (the paper uses 0.2). Values up to 0.4 are useful. Negative values count as 0.
    pub softness: f32,
    /// The opacity below which pixels are drawn as trained, from 0 to 1; `lambda` in the method.
    ///
    /// Defaults to 80/255. Negative values count as 0. With values above 1, nothing is posterized.
    pub min_opacity: f32,
    /// The filter that flattens colors before labels are assigned.
    ///
    /// Defaults to one iteration with a radius of 6, four taps, a spatial sigma of 5 and a range sigma of 5: tones
    /// flatten colors, too, and a second iteration would lose details. [`BilateralFilter::default`] is the paper's
    /// filter instead. To change a single setting, write `..Posterize::default().filter`.
    pub filter: BilateralFilter,
    /// What is drawn until the palette is loaded or extracted.
    ///
    /// Defaults to [`BeforePalette::Hide`]. Posterized views ignore it: until then, they are drawn unchanged.
    pub before_palette: BeforePalette,
    /// How the prop's silhouette is drawn.
    ///
    /// Defaults to [`EdgeSmoothing::Coverage`]. Posterized views ignore it.
    pub edges: EdgeSmoothing,
    /// How borders between labels are drawn.
    ///
    /// Defaults to [`BorderSmoothing::Interpolated`].
    pub borders: BorderSmoothing,
    /// Suppresses flicker: how much nearer another label must be before a pixel changes its label while the prop or the
    /// camera moves. In encoded sRGB, or in [tone space](plenoctree::palette::tone_space) for palettes of
    /// [tones](crate::PaletteMethod::Tones). 0 assigns the labels of every frame anew.
    ///
    /// Where neither has moved for ten frames, every pixel has the nearest label. Only hard labels are kept
    /// ([`softness`](Self::softness) 0), where the prop is [solid](crate::SolidOpacity), and only in views whose
    /// [`PropQuality::steady_labels`](crate::PropQuality::steady_labels) is true.
    ///
    /// Defaults to 0.032. Negative values count as 0.
    pub steadiness: f32,
    /// The method with which a palette is extracted, if the field has none. With `None`, that of
    /// [`PaletteExtraction::settings`](crate::PaletteExtraction::settings), which is [`PaletteMethod::Tones`] by
    /// default. If several props share a field, one of them decides.
    ///
    /// Defaults to `None`.
    pub method: Option<PaletteMethod>,
}

/// How the edges of a posterized prop are drawn: in front of the background, a mesh or another prop, or where a mesh
/// hides the rest of it.
///
/// Pixels away from edges are the same either way, and so is the prop's depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, VariantDefaults)]
#[reflect(Default, Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum EdgeSmoothing {
    /// The labels of the prop are blended with the background by the share of an edge pixel that the prop covers, in
    /// linear light, like the edges of multisampled meshes: section 4 of the method, step 6. The opacity around the
    /// pixel says how much that is ([`PropQuality::estimates_edges`](crate::PropQuality::estimates_edges)), or else
    /// several rays through it do ([`PropQuality::edge_rays`](crate::PropQuality::edge_rays)). This is the default.
    #[default]
    Coverage,
    /// The ray through the center of a pixel decides for the whole pixel, as in the paper.
    Off,
}

/// How the borders between the labels of a posterized prop are drawn.
///
/// Pixels away from borders are the same either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, VariantDefaults)]
#[reflect(Default, Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum BorderSmoothing {
    /// Borders run where interpolated colors are equally near to two labels: along a straight line within each pixel.
    /// The labels on both sides are blended in linear light, by the share of the pixel that they cover. Islands of up
    /// to three pixels are absorbed by the label around them, and so are lines of one pixel between two ramps that have
    /// the color of a third. Labels that blend into one another ([`Posterize::softness`]) have no borders, and are
    /// drawn as with [`BorderSmoothing::Off`]. See section 4 of the method, step 11. This is the default.
    #[default]
    Interpolated,
    /// The center of a pixel decides for the whole pixel, as in the paper.
    Off,
}

/// What is drawn of a posterized or recolored prop while the palette of its field is being loaded or extracted.
///
/// If no palette can be extracted, the prop is drawn as trained.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, VariantDefaults)]
#[reflect(Default, Clone, Debug, PartialEq, Hash)]
#[type_path = "bevy_plenoctree"]
pub enum BeforePalette {
    /// Nothing, or the prop's earlier field if it had another one. This is the default.
    #[default]
    Hide,
    /// The prop as trained. In a dark scene, it may look too bright until then if only its palette was darkened.
    AsTrained,
}

impl Default for Posterize {
    /// Returns the look of a cartoon, with the palette that the field has: see [`Posterize::toon`].
    fn default() -> Self {
        Self {
            blend_steps: 3,
            softness: 0.0,
            min_opacity: LABEL_OPACITY as f32,
            filter: BilateralFilter { iterations: 1, radius: 6, taps: 4, spatial_sigma: 5.0, range_sigma: 5.0 },
            before_palette: BeforePalette::default(),
            edges: EdgeSmoothing::default(),
            borders: BorderSmoothing::default(),
            steadiness: 0.032,
            method: None,
        }
    }
}

impl Posterize {
    /// Returns the look of a cartoon: [tones](PaletteMethod::Tones), and hard labels with smooth borders. It is the
    /// default, except that the default leaves the method to
    /// [`PaletteExtraction::settings`](crate::PaletteExtraction::settings).
    ///
    /// Add [`Ink`](crate::Ink) for the look of a comic: [`Posterize::comic`] returns both.
    pub fn toon() -> Self {
        Self { method: Some(PaletteMethod::Tones), ..Self::default() }
    }

    /// Returns the look of a comic, as a bundle: tones, and lines.
    ///
    /// ```
    /// # use bevy::prelude::*;
    /// # use bevy_plenoctree::{PlenOctreePlugin, Posterize, Prop};
    /// fn spawn(mut commands: Commands, assets: Res<AssetServer>) {
    ///     commands.spawn((Prop(assets.load("robot.plenoctree")), Posterize::comic()));
    /// }
    /// # let mut app = App::new();
    /// # app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin)).add_systems(Update, spawn);
    /// # app.update();
    /// ```
    pub fn comic() -> (Self, Ink) {
        (Self::toon(), Ink::default())
    }

    /// Returns a soft look: tones that blend into one another.
    pub fn soft() -> Self {
        Self { softness: 0.12, ..Self::toon() }
    }

    /// Returns the look of the paper, with which the accuracy of this crate is measured. Labels are the colors of a
    /// [hull](PaletteMethod::Hull) and blends of them, with soft transitions, as section 4 of the method specifies. The
    /// silhouette is smooth, unlike the paper's: see [`EdgeSmoothing`]. The field gets such a palette only if it has
    /// none yet.
    pub fn paper() -> Self {
        Self {
            softness: 0.2,
            filter: BilateralFilter::default(),
            borders: BorderSmoothing::Off,
            steadiness: 0.0,
            method: Some(PaletteMethod::Hull),
            ..Self::default()
        }
    }

    /// Returns whether there are borders between labels, and they are smooth.
    pub(crate) fn smooths_borders(&self) -> bool {
        self.borders == BorderSmoothing::Interpolated && self.softness == 0.0
    }

    /// Returns whether pixels may keep their labels while something moves.
    pub(crate) fn is_steady(&self) -> bool {
        self.steadiness > 0.0 && self.softness == 0.0
    }

    /// Clamps every setting to its valid range, so that no shader divides by zero or loops for too long. NaN becomes
    /// the lowest value.
    pub(crate) fn clamped(self) -> Self {
        let BilateralFilter { iterations, radius, taps, spatial_sigma, range_sigma } = self.filter;
        Self {
            blend_steps: self.blend_steps.clamp(1, MAX_BLEND_STEPS),
            // `f32::max` ignores NaN.
            softness: self.softness.max(0.0),
            // Where there is nothing, nothing is posterized.
            min_opacity: self.min_opacity.max(f32::EPSILON),
            filter: BilateralFilter {
                iterations: iterations.min(MAX_FILTER_ITERATIONS),
                radius: radius.min(MAX_FILTER_RADIUS),
                taps: taps.clamp(1, MAX_FILTER_RADIUS),
                spatial_sigma: spatial_sigma.max(1e-3),
                range_sigma: range_sigma.max(1e-3),
            },
            // Shaders multiply it with 0.
            steadiness: self.steadiness.clamp(0.0, 1e3).max(0.0),
            ..self
        }
    }
}

impl Posterize {
    /// Returns the number of blend steps that are drawn with a palette: 1 if its colors are tones, which have no
    /// blends.
    pub(crate) fn blend_steps_of(&self, palette: &Palette) -> u32 {
        let colors = palette.colors.len().min(Palette::MAX_COLORS);
        if palette.label_space() == LabelSpace::Tones {
            return 1;
        }
        let (wanted, most) = (self.blend_steps.clamp(1, MAX_BLEND_STEPS), PaletteLabel::most_blend_steps(colors));
        if wanted > most {
            // Palettes by hand may be meant as tones.
            let by_hand = palette.method.is_none();
            let hint = if by_hand { "; if its colors are not to blend, its method must be \"tones\"" } else { "" };
            error_once!(
                "a palette of {colors} colors with {wanted} blend steps has {} labels, expected at most {}: it is drawn \
                 with {most}{hint}",
                PaletteLabel::count(colors, wanted),
                PaletteLabel::MAX_LABELS
            );
        }
        wanted.min(most)
    }
}

/// Settings of the separable bilateral filter: section 4, step 2 of the method. The defaults are the paper's.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default, Clone, Debug, PartialEq)]
#[type_path = "bevy_plenoctree"]
pub struct BilateralFilter {
    /// The number of iterations; each one filters horizontally, then vertically. 0 disables the filter.
    ///
    /// Defaults to 4. Clamped to 0..=[`MAX_FILTER_ITERATIONS`].
    pub iterations: u32,
    /// The radius, in pixels.
    ///
    /// Defaults to 2. Clamped to 0..=[`MAX_FILTER_RADIUS`].
    pub radius: u32,
    /// The number of pixels to read on each side. If the radius contains more, they are spread over it and may skip the
    /// nearest ones: with a radius of 6, four taps read the pixels at distances 2, 3, 5 and 6. The cost of an iteration
    /// depends on the taps, not on the radius.
    ///
    /// Defaults to [`MAX_FILTER_RADIUS`], which skips none. Clamped to 1..=[`MAX_FILTER_RADIUS`].
    pub taps: u32,
    /// The standard deviation of the spatial weight, in pixels.
    ///
    /// Defaults to 3. Clamped to at least 0.001.
    pub spatial_sigma: f32,
    /// The standard deviation of the range weight, in units of CIELAB.
    ///
    /// Defaults to 4.25. Clamped to at least 0.001.
    pub range_sigma: f32,
}

impl Default for BilateralFilter {
    fn default() -> Self {
        Self { iterations: 4, radius: 2, taps: MAX_FILTER_RADIUS, spatial_sigma: 3.0, range_sigma: 4.25 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::log::logged;

    #[test]
    fn palettes_with_too_many_labels_are_reported_once() {
        let palette = |colors| Palette::new(vec![[0.5; 3]; colors]).unwrap();
        let of = |colors| Posterize { blend_steps: 8, ..default() }.blend_steps_of(&palette(colors));
        let (steps, log) = logged(|| [6, 17, 64, 64].map(of));
        assert_eq!(steps, [8, 8, 1, 1]);
        let expected = "a palette of 64 colors with 8 blend steps has 14176 labels, expected at most 1024: it is drawn \
                        with 1; if its colors are not to blend, its method must be \"tones\"\n";
        assert_eq!(log, expected);
    }
}
