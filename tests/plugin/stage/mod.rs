//! What the tests share: an app without a window, with a camera that draws to its target.

pub mod fields;
pub mod pixels;
pub mod sides;

use std::{
    io::Write,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use bevy::{
    camera::RenderTarget,
    core_pipeline::tonemapping::Tonemapping,
    prelude::*,
    render::{
        RenderApp,
        render_resource::{PipelineCache, PipelineDescriptor},
        renderer::{RenderAdapterInfo, RenderDevice},
        view::screenshot::{Screenshot, ScreenshotCaptured},
    },
    shader::Shader,
    tasks::{ComputeTaskPool, TaskPoolBuilder, available_parallelism},
};
use bevy_plenoctree::{
    FieldPalette, LabelStages, Palettes, PlenOctree, PlenOctreePlugin, Prop,
    headless::{Headless, LitMeshPlugins, exact_camera, pinhole_view},
};
use image::RgbaImage;
use plenoctree::{UpAxis, camera::PinholeCamera};

/// How long tests wait for something that must happen.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// All of Bevy's ways to map tones.
pub const TONEMAPPINGS: [Tonemapping; 9] = [
    Tonemapping::None,
    Tonemapping::Reinhard,
    Tonemapping::ReinhardLuminance,
    Tonemapping::AcesFitted,
    Tonemapping::AgX,
    Tonemapping::SomewhatBoringDisplayTransform,
    Tonemapping::TonyMcMapface,
    Tonemapping::BlenderFilmic,
    Tonemapping::KhronosPbrNeutral,
];

/// An app without a window, its camera, and its props.
pub struct Stage {
    pub headless: Headless,
    /// A camera with exact colors over black, at the origin.
    pub camera: Entity,
    /// What [`spawn_prop`](Self::spawn_prop) has spawned.
    pub props: Vec<Entity>,
}

impl Stage {
    /// Creates an app for props alone, whose frames are this wide and high.
    pub fn new(size: u32) -> Self {
        Self::with(UVec2::splat(size), |_| ())
    }

    /// Creates an app for props, meshes, lights and gizmos.
    pub fn with_meshes(size: u32) -> Self {
        Self::with(UVec2::splat(size), |app| _ = app.add_plugins(LitMeshPlugins))
    }

    /// Creates an app that `configure` adds to, also the plugin itself if its place matters.
    pub fn with(size: UVec2, configure: impl FnOnce(&mut App)) -> Self {
        use_all_cores();
        Self::around(Headless::new(size, |app| plugins(app, configure)).unwrap())
    }

    /// Creates such an app on a device with limits.
    pub fn limited(size: u32, limits: wgpu::Limits, configure: impl FnOnce(&mut App)) -> Self {
        use_all_cores();
        let size = UVec2::splat(size);
        Self::around(Headless::with_limits(size, limits, |app| plugins(app, configure)).unwrap())
    }

    /// Creates an app for props alone with one prop, which is ready.
    pub fn of(size: u32, field: &PlenOctree) -> Self {
        let mut stage = Self::new(size);
        stage.spawn_prop(field, ());
        stage.wait();
        stage
    }

    fn around(mut headless: Headless) -> Self {
        let camera = (exact_camera(Color::BLACK), headless.target());
        let camera = headless.app.world_mut().spawn(camera).id();
        Self { headless, camera, props: vec![] }
    }

    pub fn world(&mut self) -> &mut World {
        self.headless.app.world_mut()
    }

    pub fn get<T: Component>(&self, entity: Entity) -> &T {
        self.headless.app.world().get(entity).unwrap()
    }

    pub fn resource<T: Resource>(&self) -> &T {
        self.headless.app.world().resource()
    }

    /// Returns the messages of a type that the app has sent since [`hear`].
    pub fn heard<M: Message>(&self) -> &[M] {
        &self.resource::<Heard<M>>().0
    }

    pub fn render_world(&self) -> &World {
        self.headless.app.sub_app(RenderApp).world()
    }

    pub fn device(&self) -> &RenderDevice {
        self.render_world().resource()
    }

    /// Whether the memory of the GPU is that of this process.
    pub fn is_on_cpu(&self) -> bool {
        self.render_world().resource::<RenderAdapterInfo>().device_type == wgpu::DeviceType::Cpu
    }

    pub fn add<A: Asset>(&mut self, asset: impl Into<A>) -> Handle<A> {
        self.world().resource_mut::<Assets<A>>().add(asset)
    }

    pub fn spawn(&mut self, components: impl Bundle) -> Entity {
        self.world().spawn(components).id()
    }

    pub fn spawn_prop(&mut self, field: &PlenOctree, components: impl Bundle) -> Entity {
        let field = self.add(field.clone());
        let prop = self.world().spawn(Prop(field)).insert(components).id();
        self.props.push(prop);
        prop
    }

    pub fn spawn_mesh(&mut self, mesh: impl Into<Mesh>, material: StandardMaterial, place: Transform) -> Entity {
        let (mesh, material) = (self.add(mesh), self.add(material));
        self.spawn((Mesh3d(mesh), MeshMaterial3d::<StandardMaterial>(material), place))
    }

    /// Despawns all props.
    pub fn clear(&mut self) {
        for prop in std::mem::take(&mut self.props) {
            self.world().despawn(prop);
        }
    }

    /// Inserts components into an entity.
    pub fn insert(&mut self, entity: Entity, components: impl Bundle) {
        self.world().entity_mut(entity).insert(components);
    }

    /// Inserts components into the camera.
    pub fn set(&mut self, components: impl Bundle) {
        self.insert(self.camera, components);
    }

    pub fn unset<T: Bundle>(&mut self) {
        let camera = self.camera;
        self.world().entity_mut(camera).remove::<T>();
    }

    /// Inserts components into the camera if `given`, and removes them otherwise.
    pub fn set_if<T: Bundle>(&mut self, given: bool, components: T) {
        if given { self.set(components) } else { self.unset::<T>() }
    }

    pub fn set_background(&mut self, color: Color) {
        self.camera_mut().clear_color = color.into();
    }

    /// Draws nothing from now on.
    pub fn close(&mut self) {
        let camera = self.camera;
        self.world().despawn(camera);
    }

    pub fn camera_mut(&mut self) -> Mut<'_, Camera> {
        let camera = self.camera;
        self.world().get_mut(camera).unwrap()
    }

    /// Returns the first prop.
    pub fn prop(&self) -> Entity {
        self.props[0]
    }

    /// Returns the field of the first prop.
    pub fn field(&self) -> Handle<PlenOctree> {
        self.get::<Prop>(self.prop()).0.clone()
    }

    /// Inserts components into the first prop.
    pub fn dress(&mut self, components: impl Bundle) {
        self.insert(self.prop(), components);
    }

    pub fn undress<T: Bundle>(&mut self) {
        let prop = self.prop();
        self.world().entity_mut(prop).remove::<T>();
    }

    /// Gives the first prop another field, and waits for it.
    pub fn show(&mut self, field: &PlenOctree) {
        let field = self.add(field.clone());
        self.dress(Prop(field));
        self.wait();
    }

    /// Gives the field of the first prop a palette.
    pub fn paint(&mut self, palette: FieldPalette) {
        let field = self.field();
        self.world().resource_mut::<Palettes>().insert(&field, palette);
    }

    /// Returns the palette of the first prop's field.
    pub fn palette(&mut self) -> Mut<'_, FieldPalette> {
        let field = self.field();
        let palettes = self.world().resource_mut::<Palettes>();
        palettes.map_unchanged(move |palettes| palettes.get_mut(&field).unwrap())
    }

    pub fn update(&mut self, frames: usize) {
        (0..frames).for_each(|_| self.headless.update());
    }

    pub fn wait(&mut self) {
        self.headless.wait_until_ready(PATIENCE).unwrap();
    }

    pub fn capture(&mut self) -> RgbaImage {
        self.headless.capture().unwrap()
    }

    /// Returns all frames up to the first one for which `is_last`, also those that a capture would draw again because
    /// they are not complete.
    pub fn frames_until(&mut self, what: &str, is_last: impl Fn(&RgbaImage) -> bool) -> Vec<RgbaImage> {
        let RenderTarget::Image(target) = self.headless.target() else { panic!("the target is no image") };
        let frames = Arc::new(Mutex::new(Vec::<RgbaImage>::new()));
        wait_for(what, || {
            let saved = frames.clone();
            let save = move |event: On<ScreenshotCaptured>| {
                saved.lock().unwrap().push(event.image.clone().try_into_dynamic().unwrap().into_rgba8());
            };
            self.world().spawn(Screenshot::image(target.handle.clone())).observe(save);
            self.update(1);
            frames.lock().unwrap().last().is_some_and(&is_last)
        });
        std::mem::take(&mut *frames.lock().unwrap())
    }

    /// Captures what a pinhole camera sees, in the frame of a field whose up axis is `up`.
    pub fn capture_from(&mut self, camera: &PinholeCamera, up: UpAxis) -> RgbaImage {
        self.set(pinhole_view(camera, up));
        self.capture()
    }

    /// Whether there is a render pipeline with this label, or, instead of that, with this definition of its shader.
    pub fn has_pipeline(&self, name: &str) -> bool {
        self.render_world().resource::<PipelineCache>().pipelines().any(|pipeline| match &pipeline.descriptor {
            PipelineDescriptor::RenderPipelineDescriptor(descriptor) => {
                let defines = |defs: &[_]| defs.contains(&name.into());
                descriptor.label.as_deref() == Some(name)
                    || descriptor.fragment.as_ref().is_some_and(|fragment| defines(&fragment.shader_defs))
            }
            PipelineDescriptor::ComputePipelineDescriptor(_) => false,
        })
    }

    /// Returns a custom stage that changes nothing.
    pub fn idle_stage(&mut self) -> LabelStages {
        const KEEP: &str = "
            @group(1) @binding(0) var colors: texture_2d<f32>;

            @fragment
            fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
                return textureLoad(colors, vec2<u32>(position.xy), 0);
            }
        ";
        LabelStages(vec![self.add(Shader::from_wgsl(KEEP, "stage.wgsl"))])
    }
}

fn plugins(app: &mut App, configure: impl FnOnce(&mut App)) {
    configure(app);
    if !app.is_plugin_added::<PlenOctreePlugin>() {
        app.add_plugins(PlenOctreePlugin);
    }
}

/// Lets systems of several tests run at once: all apps share the threads, of which Bevy creates a single one for systems
/// on two cores.
fn use_all_cores() {
    // One more than there are cores, because some wait for the GPU.
    let threads = available_parallelism() + 1;
    ComputeTaskPool::get_or_init(|| TaskPoolBuilder::new().num_threads(threads).build());
}

/// The messages of a type that an app has sent.
#[derive(Resource)]
pub struct Heard<M: Message>(pub Vec<M>);

/// Keeps all messages of a type.
pub fn hear<M: Message + Clone>(app: &mut App) {
    let keep = |mut heard: ResMut<Heard<M>>, mut sent: MessageReader<M>| heard.0.extend(sent.read().cloned());
    app.insert_resource(Heard::<M>(vec![])).add_systems(Last, keep);
}

/// Waits until something is done, which `is_done` may work on.
#[track_caller]
pub fn wait_for(what: &str, mut is_done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_done() {
        assert!(start.elapsed() < PATIENCE, "still waiting for {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// How a line about a test that is skipped begins.
pub const SKIPPED: &str = "skipped: ";

/// Says that a test, or the rest of it, does not run on this adapter.
pub fn skip(why: &str) {
    let test = std::thread::current();
    tell(&format!("{SKIPPED}{} needs {why}", test.name().unwrap_or_default()));
}

/// Prints a line even if the test passes: what `eprintln` prints is only shown if it fails.
pub fn tell(line: &str) {
    _ = writeln!(std::io::stderr(), "{line}");
}

/// An unlit material that is seen from both sides. It is opaque if its color is.
pub fn unlit(color: Color) -> StandardMaterial {
    let alpha_mode = if color.is_fully_opaque() { AlphaMode::Opaque } else { AlphaMode::Blend };
    StandardMaterial { base_color: color, unlit: true, cull_mode: None, alpha_mode, ..default() }
}
