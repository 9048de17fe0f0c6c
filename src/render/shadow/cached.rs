//! The shadows of casters at rest, which shadow maps cache.

use bevy::{
    ecs::entity::EntityHashMap,
    prelude::*,
    render::{
        render_resource::{BindGroup, BindGroupEntries, BindGroupId, BindGroupLayout, TextureUsages, TextureView},
        renderer::RenderDevice,
    },
};

use crate::render::{
    frame::{TILE_FORMAT, create_texture},
    uniforms::PropUniform,
};

/// Everything that the shadow of a caster depends on, besides where the map is among the light's texels.
#[derive(PartialEq)]
pub(super) struct CasterKey {
    /// The rays through the texels: where the light and the prop are, and the size of texels. The box around the
    /// leaves, and where the prop is solid.
    pub caster: PropUniform,
    /// The field at a level.
    pub field: BindGroupId,
    /// The texels to cache.
    pub texels: IRect,
}

/// The distances from the start of a caster's rays to the caster, in its own texels.
pub(super) struct Tile {
    pub texture: TextureView,
    /// The bind group for copying the tile into the map.
    pub group: BindGroup,
    /// Whether the rays have been marched.
    pub is_filled: bool,
}

impl Tile {
    pub fn new(device: &RenderDevice, layout: &BindGroupLayout, size: UVec2) -> Self {
        let label = "plenoctree_shadow_tile";
        let texture = create_texture(device, label, size, 1, TILE_FORMAT, TextureUsages::empty());
        let group = device.create_bind_group(label, layout, &BindGroupEntries::single(&texture));
        Self { texture, group, is_filled: false }
    }
}

/// The casters of a map.
#[derive(Default)]
pub(super) struct CachedCasters {
    casters: EntityHashMap<CachedCaster>,
    /// The number of texels that all tiles have together.
    texels: u32,
}

struct CachedCaster {
    key: CasterKey,
    tile: Option<Tile>,
    is_in_map: bool,
}

impl CachedCaster {
    fn cached_texels(&self) -> u32 {
        let UVec2 { x, y } = self.key.texels.size().as_uvec2();
        if self.tile.is_some() { x * y } else { 0 }
    }
}

impl CachedCasters {
    /// Begins a frame: drops the tiles of casters that the last one did not update.
    pub fn begin(&mut self) {
        self.casters.retain(|_, caster| std::mem::take(&mut caster.is_in_map));
        self.texels = self.casters.values().map(CachedCaster::cached_texels).sum();
    }

    /// Updates a caster. Returns its tile, unless its shadow has changed since the previous frame: in that case, it is
    /// cheaper to march rays directly into the map. `most` is the number of texels that all tiles may have together,
    /// and `create` creates one.
    pub fn update(
        &mut self,
        prop: Entity,
        key: CasterKey,
        most: u32,
        create: impl FnOnce(UVec2) -> Option<Tile>,
    ) -> Option<&Tile> {
        let texels = key.texels.size().as_uvec2();
        let rests = self.casters.get(&prop).is_some_and(|caster| caster.key == key);
        if !rests {
            let moved = self.casters.insert(prop, CachedCaster { key, tile: None, is_in_map: true });
            self.texels -= moved.map_or(0, |caster| caster.cached_texels());
        }
        let caster = self.casters.get_mut(&prop)?;
        caster.is_in_map = true;
        // A level may have a smaller box, which misses the map.
        let fits = texels.min_element() > 0 && self.texels + texels.element_product() <= most;
        if rests && caster.tile.is_none() && fits {
            caster.tile = create(texels);
            self.texels += caster.cached_texels();
        }
        caster.tile.as_ref()
    }

    pub fn tile(&mut self, prop: Entity) -> Option<&mut Tile> {
        self.casters.get_mut(&prop)?.tile.as_mut()
    }
}
