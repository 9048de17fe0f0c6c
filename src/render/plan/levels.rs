//! Chooses the level at which each prop of a view is drawn.

use bevy::{
    camera::MainPassResolutionOverride,
    prelude::*,
    render::{camera::ExtractedCamera, render_asset::RenderAssets, view::ExtractedView},
};

use super::view::{OrderedProp, PropView, drawn_viewport};
use crate::{
    gpu::{GpuField, Level, MAX_PROPS_IN_VIEW},
    render::extract::{ExtractedProps, VisibleProps},
};

/// Sorts the props of every view back to front, and requests their levels.
pub(in crate::render) fn choose_levels(
    extracted: Res<ExtractedProps>,
    mut fields: ResMut<RenderAssets<GpuField>>,
    mut views: Query<(
        &ExtractedView,
        &ExtractedCamera,
        Option<&MainPassResolutionOverride>,
        &VisibleProps,
        &mut PropView,
    )>,
) {
    for (view, camera, resolution, visible, mut prop_view) in &mut views {
        let PropView { order, changes_levels, .. } = &mut *prop_view;
        let quality = &visible.quality;
        *changes_levels = quality.cell_size > 0.0 || Level::new(0, quality) != Level::default();
        order.clear();
        let Some(viewport) = drawn_viewport(camera, resolution) else {
            continue;
        };
        let (eye, forward) = (view.world_from_view.translation(), view.world_from_view.forward());
        order.extend(visible.props.iter().filter_map(|&index| {
            let index = extracted.drawn(index, &fields)?;
            let prop = extracted.props.get(index)?;
            let field = fields.get_mut(prop.field)?;
            let mut coarser = 0;
            if quality.cell_size > 0.0 {
                let size = viewport.physical_size;
                let rays = prop.pose.rays(&view.world_from_view, view.clip_from_view, size)?;
                let most = prop.pose.cells.log2() as u32;
                coarser = levels_coarser(rays.cell_size, quality.cell_size).min(most);
            }
            let level = Level::new(coarser, quality);
            field.request(level);
            let distance = (prop.pose.center() - eye.as_dvec3()).dot(forward.as_dvec3());
            Some(OrderedProp { distance, index, level })
        }));
        // Break ties by index, so that the order is deterministic. A stable sort would allocate.
        order.sort_unstable_by(|a, b| b.distance.total_cmp(&a.distance).then(a.index.cmp(&b.index)));
        if order.len() > MAX_PROPS_IN_VIEW {
            error_once!("a camera sees {} props but draws only the nearest {MAX_PROPS_IN_VIEW}", order.len());
            order.drain(..order.len() - MAX_PROPS_IN_VIEW);
        }
    }
}

/// Returns how many times the width of cells, `size` pixels, can be doubled without exceeding `wanted` pixels.
pub(in crate::render) fn levels_coarser(size: f64, wanted: f32) -> u32 {
    // The cast saturates, and converts NaN to 0.
    (f64::from(wanted) / size).log2().floor().min(32.0) as u32
}
