//! Measures the CPU time of animated palettes: `cargo bench --bench palettes`.
//!
//! There are a hundred props of a hundred fields, and all six colors of each palette change in every frame. `change` is
//! what a game does in the main world. `track` is `PreUpdate`, where the plugin looks for new palettes. `extract` is
//! extraction to the render world. The last two include Bevy's own work, so compare a hundred props with none.

use std::time::Duration;

use bevy::{app::AppLabel, core_pipeline::tonemapping::Tonemapping, prelude::*, render::RenderApp};
use bevy_plenoctree::{
    BlendSpace, FieldPalette, PaletteOverride, Palettes, PlenOctree, PlenOctreePlugin, Posterize, Prop,
    headless::Headless,
};
use divan::Bencher;
use glam::DVec3;
use plenoctree::{BakeSettings, Basis, bake};

const PROPS: usize = 100;

fn main() {
    divan::main();
}

fn colors(hue: f32) -> [Color; 6] {
    std::array::from_fn(|index| Srgba::from(Hsva::hsv((hue + 60.0 * index as f32) % 360.0, 0.8, 0.9)).into())
}

/// The change to make in every frame.
#[derive(Clone, Copy, Debug)]
enum Change {
    SetPalettes,
    BlendEncoded,
    BlendOklab,
    BlendOverrides,
}

const CHANGES: [Change; 4] = [Change::SetPalettes, Change::BlendEncoded, Change::BlendOklab, Change::BlendOverrides];

struct Scene {
    headless: Headless,
    props: Vec<(Entity, Handle<PlenOctree>)>,
    frame: u32,
}

impl Scene {
    fn new(props: usize) -> Self {
        let mut headless = Headless::new(UVec2::splat(16), |app| {
            app.add_plugins(PlenOctreePlugin);
        })
        .unwrap();
        let settings = BakeSettings { depth: 2, basis: Basis::Rgba, ..default() };
        let field = bake(&settings, |_| 10.0, |_| |_| DVec3::splat(0.5)).unwrap();
        let target = headless.target();
        let world = headless.app.world_mut();
        let props = (0..props)
            .map(|_| {
                let field = world.resource_mut::<Assets<PlenOctree>>().add(field.clone());
                let palette = FieldPalette::from_colors(colors(0.0)).unwrap();
                world.resource_mut::<Palettes>().insert(&field, palette);
                let look = (Prop(field.clone()), Posterize::default(), PaletteOverride::default());
                (world.spawn(look).id(), field)
            })
            .collect();
        let place = Transform::from_xyz(0.0, 0.0, 8.0);
        world.spawn((Camera3d::default(), target, place, Msaa::Off, Tonemapping::None));
        headless.wait_until_ready(Duration::from_secs(60)).unwrap();
        Self { headless, props, frame: 0 }
    }

    fn change(&mut self, change: Change) {
        self.frame += 1;
        let t = (self.frame % 97) as f32 / 97.0;
        let (from, to) = (colors(0.0), colors(180.0));
        let world = self.headless.app.world_mut();
        if let Change::BlendOverrides = change {
            for (entity, _) in &self.props {
                let mut own = world.get_mut::<PaletteOverride>(*entity).unwrap();
                own.blend(&from, &to, t, BlendSpace::Oklab);
            }
            return;
        }
        let mut palettes = world.resource_mut::<Palettes>();
        for (_, field) in &self.props {
            match change {
                Change::SetPalettes => {
                    let palette = palettes.get_mut(field).unwrap();
                    to.iter().enumerate().for_each(|(index, color)| _ = palette.set(index, *color));
                }
                Change::BlendEncoded => palettes.get_mut(field).unwrap().blend(&from, &to, t, BlendSpace::Encoded),
                Change::BlendOklab => palettes.get_mut(field).unwrap().blend(&from, &to, t, BlendSpace::Oklab),
                Change::BlendOverrides => {}
            }
        }
    }

    fn track(&mut self) {
        self.headless.app.world_mut().run_schedule(PreUpdate);
    }

    /// Runs all of Bevy's extraction, including that of props.
    fn extract(&mut self) {
        let subs = self.headless.app.sub_apps_mut();
        subs.sub_apps.get_mut(&RenderApp.intern()).unwrap().extract(subs.main.world_mut());
    }
}

#[divan::bench(args = CHANGES, sample_count = 1000)]
fn change(bencher: Bencher, what: Change) {
    let mut scene = Scene::new(PROPS);
    bencher.bench_local(|| scene.change(what));
}

#[divan::bench(args = [0, PROPS], sample_count = 1000)]
fn track(bencher: Bencher, props: usize) {
    let mut scene = Scene::new(props);
    bencher.bench_local(|| scene.track());
}

#[divan::bench(args = [0, PROPS], sample_count = 1000)]
fn extract(bencher: Bencher, props: usize) {
    let mut scene = Scene::new(props);
    bencher.bench_local(|| scene.extract());
}
