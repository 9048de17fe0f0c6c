//! Tests where palettes come from: files next to fields, handles, and extraction when fields arrive and change.

use bevy::{asset::LoadState, prelude::*};
use bevy_plenoctree::{
    ExtractionSettings, FieldPalette, Palette, PaletteExtraction, PaletteReady, PaletteSampler, Palettes, PlenOctree,
    PlenOctreePlugin, Posterize, Prop, RampAdjustment, SampleOrigin,
};
use glam::DVec3;
use tempfile::TempDir;

use super::{
    palettes::{COLORS, RED, round_trip, solid},
    ramps::ramps,
    stage::{Heard, Stage, hear, pixels::bytes, wait_for},
};

/// An app that loads fields and palettes from a folder without drawing them.
struct Files {
    app: App,
    folder: TempDir,
}

impl Files {
    /// Creates a folder with `x.npz` in it, and starts an app there.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        solid(10.0).write(folder.path().join("x.npz")).unwrap();
        let mut files = Self { app: App::new(), folder };
        files.restart();
        files
    }

    /// Starts another app in the same folder.
    fn restart(&mut self) {
        self.app = App::new();
        let assets = AssetPlugin { file_path: self.folder.path().to_string_lossy().into(), ..default() };
        self.app.add_plugins((MinimalPlugins, assets, PlenOctreePlugin));
        hear::<PaletteReady>(&mut self.app);
        self.app.finish();
        self.app.cleanup();
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.path().join(name), text).unwrap();
    }

    fn load<T: Asset>(&self, name: &'static str) -> Handle<T> {
        self.app.world().resource::<AssetServer>().load(name)
    }

    fn spawn(&mut self) -> Handle<PlenOctree> {
        let field = self.load("x.npz");
        self.app.world_mut().spawn((Prop(field.clone()), Posterize::default()));
        field
    }

    /// Updates the app until `done` returns true.
    fn run_until(&mut self, what: &str, done: impl Fn(&World) -> bool) {
        wait_for(what, || {
            self.app.update();
            done(self.app.world())
        });
    }

    /// Replaces the field on disk, and updates the app until it has the new one.
    fn reload(&mut self, field: &Handle<PlenOctree>, new: &PlenOctree) {
        new.write(self.folder.path().join("x.npz")).unwrap();
        self.app.world().resource::<AssetServer>().reload("x.npz");
        let (id, density) = (field.id(), new.densities()[0]);
        self.run_until("the new field", move |world| {
            world.resource::<Assets<PlenOctree>>().get(id).is_some_and(|field| field.densities()[0] == density)
        });
        // The change is announced at the end of the frame, and noticed in the next.
        self.app.update();
    }

    /// Updates the app until the field has a palette, and returns it.
    fn palette(&mut self, field: &Handle<PlenOctree>) -> FieldPalette {
        self.run_until("a palette", |world| {
            let error = world.resource::<PaletteExtraction>().error(field);
            assert!(error.is_none(), "{}", error.map(ToString::to_string).unwrap_or_default());
            world.resource::<Palettes>().get(field).is_some()
        });
        self.app.world().resource::<Palettes>().get(field).unwrap().clone()
    }

    fn heard(&self) -> &[PaletteReady] {
        &self.app.world().resource::<Heard<PaletteReady>>().0
    }
}

#[test]
fn a_palette_next_to_a_field_replaces_extraction() {
    let mut files = Files::new();
    files.write("x.palette.json", r#"{"colors": [[0.25, 0.5, 0.75], [0.5, 0, 0]]}"#);
    let field = files.spawn();
    let palette = files.palette(&field);
    assert_eq!(palette.palette().colors, [[0.25, 0.5, 0.75], [0.5, 0.0, 0.0]]);
    assert_eq!(palette.shown(), [Color::srgb(0.25, 0.5, 0.75), Color::srgb(0.5, 0.0, 0.0)]);
    assert!(palette.extraction().is_none());
    // It is not extracted later either.
    let loaded = field.clone();
    files.run_until("the field", move |world| world.resource::<Assets<PlenOctree>>().contains(&loaded));
    for _ in 0..20 {
        files.app.update();
        assert!(files.app.world().resource::<PaletteExtraction>().progress(&field).is_none());
    }
    assert_eq!(files.heard(), [PaletteReady { field: field.id(), sampled: None }]);
}

/// The included toadstool has neither a palette file nor recorded histograms: in an app that loads it, it is sampled,
/// in compute shaders if so wished, and both processors find the same palette.
#[test]
fn the_toadstool_is_sampled_when_it_arrives() {
    let extracted = |sampler| {
        let mut stage = Stage::with(UVec2::ONE, hear::<PaletteReady>);
        stage.close();
        let mut extraction = stage.world().resource_mut::<PaletteExtraction>();
        extraction.sampler = sampler;
        let sampling = &mut extraction.settings.sampling;
        (sampling.sample_fraction, sampling.directions) = (Some(0.01), 1);
        let field = stage.resource::<AssetServer>().load("toadstool.plenoctree");
        stage.spawn((Prop(field.clone()), Posterize::default()));
        stage.wait();
        let ready = stage.heard::<PaletteReady>();
        let [PaletteReady { sampled: Some(origin), .. }] = ready[..] else { panic!("{ready:?}") };
        (origin, stage.resource::<Palettes>().get(&field).unwrap().palette().clone())
    };
    let (on_cpu, expected) = extracted(PaletteSampler::Cpu);
    let (on_gpu, found) = extracted(PaletteSampler::Gpu);
    assert_eq!((on_cpu, on_gpu), (SampleOrigin::Cpu, SampleOrigin::Gpu));
    for (found, expected) in found.colors.iter().zip(&expected.colors) {
        assert!(DVec3::from(*found).distance(DVec3::from(*expected)) < 1e-3, "{found:?}, expected {expected:?}");
    }
}

#[test]
fn an_extracted_palette_can_be_saved_and_shipped() {
    let mut files = Files::new();
    let field = files.spawn();
    let extracted = files.palette(&field);
    assert!(extracted.extraction().is_some());
    assert_eq!(files.heard(), [PaletteReady { field: field.id(), sampled: Some(SampleOrigin::Cpu) }]);
    extracted.save(files.folder.path().join("x.palette.json")).unwrap();

    // Once it comes from a file, a reloaded field does not replace it.
    let saved = files.load::<Palette>("x.palette.json");
    files.app.world_mut().resource_mut::<Palettes>().insert_handle(&field, saved);
    let id = field.id();
    files.run_until("the file", move |world| world.resource::<Palettes>().get(id).unwrap().extraction().is_none());

    files.restart();
    let field = files.spawn();
    let shipped = files.palette(&field);
    assert!(shipped.extraction().is_none());
    assert_eq!(shipped.palette(), extracted.palette());
}

/// An extraction that failed is tried again when its settings change, and not before.
#[test]
fn failed_extractions_are_tried_again_with_other_settings() {
    let mut files = Files::new();
    let valid = files.app.world().resource::<PaletteExtraction>().settings.clone();
    let set = |files: &mut Files, settings: ExtractionSettings| {
        files.app.world_mut().resource_mut::<PaletteExtraction>().settings = settings;
    };
    // It differs from itself.
    set(&mut files, ExtractionSettings { coarse_threshold: f64::NAN, ..valid.clone() });
    let field = files.spawn();
    let id = field.id();
    files.run_until("a failure", move |world| world.resource::<PaletteExtraction>().error(id).is_some());
    for _ in 0..5 {
        files.app.update();
        assert!(files.app.world().resource::<PaletteExtraction>().error(id).is_some());
    }
    set(&mut files, valid);
    files.app.update();
    assert!(files.palette(&field).extraction().is_some());
}

/// An app that nobody sees extracts nothing on its own.
#[test]
fn palettes_are_only_extracted_on_request_if_so_wished() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), PlenOctreePlugin));
    app.world_mut().resource_mut::<PaletteExtraction>().automatic = false;
    let field = app.world_mut().resource_mut::<Assets<PlenOctree>>().add(solid(10.0));
    app.world_mut().spawn((Prop(field.clone()), Posterize::default()));
    for _ in 0..5 {
        app.update();
        assert!(app.world().resource::<PaletteExtraction>().progress(&field).is_none());
        assert!(app.world().resource::<Palettes>().get(&field).is_none());
    }
    app.world_mut().resource_mut::<PaletteExtraction>().request(&field);
    wait_for("a palette", || {
        app.update();
        app.world().resource::<Palettes>().get(&field).is_some()
    });
}

/// A prop whose look is switched before its palette is ready gets a palette of the new look, unless another prop of the
/// field still wants the old one.
#[test]
fn looks_that_are_switched_early_have_their_palettes() {
    for is_wanted in [false, true] {
        let mut files = Files::new();
        let field: Handle<PlenOctree> = files.load("x.npz");
        let world = files.app.world_mut();
        let prop = world.spawn((Prop(field.clone()), Posterize::default())).id();
        if is_wanted {
            world.spawn((Prop(field.clone()), Posterize::toon()));
        }
        let id = field.id();
        files.run_until("an extraction", move |world| world.resource::<PaletteExtraction>().progress(id).is_some());
        *files.app.world_mut().get_mut::<Posterize>(prop).unwrap() = Posterize::paper();
        let palette = files.palette(&field);
        // Only hulls have clusters.
        assert_eq!(palette.extraction().unwrap().clusters.is_none(), is_wanted);
    }
}

/// What a player recolored is in the file, next to the source colors, and comes back with them. Files without shown
/// colors are as they always were.
#[test]
fn shown_colors_and_ramps_are_saved() {
    let mut files = Files::new();
    let path = files.folder.path().join("x.palette.json");
    let mut palette = ramps();
    palette.save(&path).unwrap();
    assert!(!std::fs::read_to_string(&path).unwrap().contains("shown"), "nothing was recolored");
    palette.edit_ramps(|palette| palette.rename_ramp(0, "cap")).unwrap();
    palette.adjust_ramp(0, &RampAdjustment { brightness: 0.05, ..default() });
    // Also colors that no file may have as source colors.
    palette.set(3, Color::linear_rgb(3.0, 0.25, 0.125));
    palette.save(&path).unwrap();

    let field = files.spawn();
    let loaded = files.palette(&field);
    assert_eq!(loaded.palette(), palette.palette());
    assert_eq!(loaded.ramp("cap"), Some(0));
    let shown = |palette: &FieldPalette| palette.shown().iter().map(|color| color.to_srgba()).collect::<Vec<_>>();
    assert_eq!(shown(&loaded), shown(&palette));
    let bytes = std::fs::read(&path).unwrap();
    loaded.save(&path).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes, "saving again changes nothing");

    // A file whose shown colors alone change is shown.
    let mut other = loaded.clone();
    other.show([Color::BLACK]);
    other.save(&path).unwrap();
    files.app.world().resource::<AssetServer>().reload("x.palette.json");
    let id = field.id();
    files.run_until("the new colors", move |world| {
        world.resource::<Palettes>().get(id).is_some_and(|palette| palette.shown()[0].to_srgba() == Srgba::BLACK)
    });
    assert_eq!(files.heard(), [PaletteReady { field: id, sampled: None }; 2]);

    // A file without shown colors, in which only the ramps changed, keeps what is shown.
    let mut source = loaded.palette().clone();
    source.ramps[0].name = "hat".into();
    source.write(&path).unwrap();
    files.app.world().resource::<AssetServer>().reload("x.palette.json");
    files.run_until("the new name", move |world| {
        world.resource::<Palettes>().get(id).is_some_and(|palette| palette.ramp("hat") == Some(0))
    });
    assert_eq!(files.palette(&field).shown()[0].to_srgba(), Srgba::BLACK);

    let registry = files.app.world().resource::<AppTypeRegistry>().read();
    let reflected: FieldPalette = round_trip(&loaded, &registry);
    assert_eq!((reflected.palette(), reflected.shown()), (loaded.palette(), loaded.shown()));
}

#[test]
fn a_palette_is_extracted_if_its_file_is_invalid() {
    let mut files = Files::new();
    files.write("x.palette.json", r#"{"colors": [[255, 128, 0]]}"#);
    let field = files.spawn();
    assert!(files.palette(&field).extraction().is_some());

    let handle = files.load::<Palette>("x.palette.json");
    let error = |world: &World| match world.resource::<AssetServer>().load_state(&handle) {
        LoadState::Failed(error) => Some(error.to_string()),
        _ => None,
    };
    files.run_until("an error", |world| error(world).is_some());
    let error = error(files.app.world()).unwrap();
    assert!(error.contains("did you mean 0 to 255?"), "{error}");

    // Mended while the app runs, it replaces the extracted palette.
    drop(handle);
    files.write("x.palette.json", r#"{"colors": [[1, 0.5, 0]]}"#);
    files.app.world().resource::<AssetServer>().reload("x.palette.json");
    let id = field.id();
    files.run_until("the palette of the file", move |world| {
        world.resource::<Palettes>().get(id).is_some_and(|palette| palette.palette().colors == [[1.0, 0.5, 0.0]])
    });
}

/// Nothing loads a default handle.
#[test]
fn a_palette_is_extracted_if_its_handle_is_a_default_one() {
    let mut files = Files::new();
    let field = files.spawn();
    files.app.world_mut().resource_mut::<Palettes>().insert_handle(&field, Handle::default());
    assert!(files.palette(&field).extraction().is_some());
}

/// A palette that is given by its handle replaces one with the same source colors and other shown ones.
#[test]
fn palettes_of_the_same_source_colors_replace_each_other() {
    let mut files = Files::new();
    files.write("x.palette.json", r#"{"colors": [[0.5, 0.5, 0]]}"#);
    files.write("winter.palette.json", r#"{"colors": [[0.5, 0.5, 0]], "shown": [[1, 1, 1]]}"#);
    let field = files.spawn();
    let summer = files.palette(&field).shown().to_vec();
    for (name, shown) in [("winter.palette.json", vec![Color::srgb(1.0, 1.0, 1.0)]), ("x.palette.json", summer)] {
        let handle = files.load::<Palette>(name);
        files.app.world_mut().resource_mut::<Palettes>().insert_handle(&field, handle);
        let id = field.id();
        files.run_until(name, move |world| world.resource::<Palettes>().get(id).unwrap().shown() == shown);
    }
}

/// A field that nobody needs any more before it is loaded leaves no palette behind.
#[test]
fn fields_that_never_arrive_leave_no_palette() {
    let mut files = Files::new();
    files.write("y.palette.json", r#"{"colors": [[0.5, 0.5, 0]]}"#);
    let field = files.load::<PlenOctree>("y.npz");
    let id = field.id();
    let prop = files.app.world_mut().spawn((Prop(field.clone()), Posterize::default())).id();
    assert_eq!(files.palette(&field).palette().colors, [[0.5, 0.5, 0.0]]);
    drop(field);
    files.app.world_mut().despawn(prop);
    files.run_until("its end", move |world| world.resource::<Palettes>().get(id).is_none());
}

#[test]
fn a_palette_can_be_given_by_handle() {
    let mut files = Files::new();
    files.write("winter.palette.json", r#"{"colors": [[0.9, 0.95, 1]]}"#);
    files.write("x.palette.json", r#"{"colors": [[0, 0, 0]]}"#);
    let field = files.spawn();
    let winter = files.load::<Palette>("winter.palette.json");
    files.app.world_mut().resource_mut::<Palettes>().insert_handle(&field, winter.clone());
    assert_eq!(files.palette(&field).palette().colors, [[0.9, 0.95, 1.0]]);

    // When the file changes, so does the palette. When it is reloaded unchanged, the shown colors stay.
    let colors = |files: &Files| {
        let palette = files.app.world().resource::<Palettes>().get(&field).unwrap();
        (palette.palette().colors.clone(), palette.shown().to_vec())
    };
    for (change, shown) in [(0.0, RED), (0.1, Color::srgb(0.8, 0.95, 1.0))] {
        files.app.world_mut().resource_mut::<Palettes>().get_mut(&field).unwrap().set(0, RED);
        files.app.world_mut().resource_mut::<Assets<Palette>>().get_mut(&winter).unwrap().colors[0][0] -= change;
        // The change is detected at the end of one frame and applied in the next.
        files.app.update();
        files.app.update();
        assert_eq!(bytes(colors(&files).1[0]), bytes(shown));
    }

    // A palette that is inserted in code stays, even if the file changes.
    let given = FieldPalette::from_colors(COLORS).unwrap();
    files.app.world_mut().resource_mut::<Palettes>().insert(&field, given);
    files.app.world_mut().resource_mut::<Assets<Palette>>().get_mut(&winter).unwrap().colors[0][0] = 0.0;
    (0..5).for_each(|_| files.app.update());
    assert_eq!(colors(&files).1, COLORS);

    // A palette that is removed is loaded again.
    files.app.world_mut().resource_mut::<Palettes>().remove(&field);
    assert_eq!(files.palette(&field).palette().colors, [[0.0; 3]]);
}

/// The total weight of the samples that a palette was extracted from, which tells fields apart.
fn total_weight(palette: Option<&FieldPalette>) -> Option<f64> {
    palette?.extraction().map(|extraction| extraction.total_weight)
}

/// A field that changes on disk is reloaded and gets a new palette. Until that is extracted, it keeps the old one. A
/// palette that was inserted in code stays.
#[test]
fn a_field_is_reloaded() {
    let mut files = Files::new();
    let field = files.spawn();
    let extracted = files.palette(&field);
    files.reload(&field, &solid(0.5));
    let (id, before) = (field.id(), total_weight(Some(&extracted)));
    files.run_until("another palette", move |world| {
        let palette = world.resource::<Palettes>().get(id);
        assert!(palette.is_some(), "the prop has no palette meanwhile");
        total_weight(palette) != before
    });
    assert!(total_weight(Some(&files.palette(&field))) < before);

    let colors = [Color::srgb(0.0, 0.0, 0.0), Color::srgb(1.0, 0.0, 0.0)];
    let palette = FieldPalette::from_colors(colors).unwrap();
    files.app.world_mut().resource_mut::<Palettes>().insert(&field, palette);
    files.reload(&field, &solid(10.0));
    for _ in 0..100 {
        assert_eq!(files.palette(&field).shown(), colors);
        files.app.update();
    }
    // So does a copy of one that was extracted.
    files.app.world_mut().resource_mut::<Palettes>().insert(&field, extracted.clone());
    files.reload(&field, &solid(0.5));
    for _ in 0..100 {
        let palette = files.palette(&field);
        assert!(palette.extraction().is_none() && palette.palette() == extracted.palette());
        files.app.update();
    }
}

/// An extraction that was requested is not lost when the field is reloaded in the meantime, even if the field has a
/// palette that was inserted. The palette is that of the new field.
#[test]
fn a_reload_does_not_cancel_a_requested_extraction() {
    for waiting in [false, true] {
        let mut files = Files::new();
        let field = files.spawn();
        let thick = total_weight(Some(&files.palette(&field)));
        let given = FieldPalette::from_colors(COLORS).unwrap();
        files.app.world_mut().resource_mut::<Palettes>().insert(&field, given);
        files.app.world_mut().resource_mut::<PaletteExtraction>().request(&field);
        if !waiting {
            files.app.update();
        }
        // The file was read before: nothing takes longer than a frame.
        files.app.world_mut().resource_mut::<Assets<PlenOctree>>().insert(field.id(), solid(0.5)).unwrap();
        let id = field.id();
        files.run_until("the palette of the new field", move |world| {
            let found = total_weight(world.resource::<Palettes>().get(id));
            found.is_some() && found < thick
        });
    }
}

/// A palette that is inserted after an extraction was requested stays, whether or not the extraction has begun.
#[test]
fn what_is_inserted_later_stays() {
    for begins in [false, true] {
        let mut files = Files::new();
        let field = files.spawn();
        files.palette(&field);
        let request = |files: &mut Files, id: AssetId<PlenOctree>| {
            files.app.world_mut().resource_mut::<PaletteExtraction>().request(id);
            files.app.update();
        };
        // One begins once there is such a field.
        let reserved = files.app.world().resource::<Assets<PlenOctree>>().reserve_handle();
        let id = if begins { field.id() } else { reserved.id() };
        request(&mut files, id);
        let given = FieldPalette::from_colors(COLORS).unwrap();
        files.app.world_mut().resource_mut::<Palettes>().insert(id, given.clone());
        files.app.update();
        _ = files.app.world_mut().resource_mut::<Assets<PlenOctree>>().insert(id, solid(10.0));
        for _ in 0..100 {
            files.app.update();
            let world = files.app.world();
            assert_eq!(world.resource::<Palettes>().get(id).unwrap(), &given, "begins: {begins}");
            assert!(world.resource::<PaletteExtraction>().progress(id).is_none(), "begins: {begins}");
        }
        // What is requested later replaces it.
        request(&mut files, id);
        files.run_until("an extraction", move |world| {
            world.resource::<Palettes>().get(id).is_some_and(|palette| palette.extraction().is_some())
        });
    }
}

/// A palette that is loading is not lost because the field changes, and with it one that was extracted before.
#[test]
fn a_palette_that_is_loading_survives_a_reload() {
    let mut files = Files::new();
    let field = files.spawn();
    files.palette(&field);
    let id = field.id();
    files.app.world_mut().resource_mut::<Assets<PlenOctree>>().insert(id, solid(0.5)).unwrap();
    files.app.update();
    let winter = files.app.world().resource::<Assets<Palette>>().reserve_handle();
    files.app.world_mut().resource_mut::<Palettes>().insert_handle(&field, winter.clone());
    (0..100).for_each(|_| files.app.update());
    let palette = Palette::new(vec![[0.9, 0.95, 1.0]]).unwrap();
    _ = files.app.world_mut().resource_mut::<Assets<Palette>>().insert(winter.id(), palette.clone());
    (0..3).for_each(|_| files.app.update());
    let found = |files: &Files| files.app.world().resource::<Palettes>().get(id).unwrap().palette().clone();
    assert_eq!(found(&files), palette);
    // One that is removed and added again is applied again.
    files.app.world_mut().resource_mut::<Assets<Palette>>().remove(&winter);
    (0..3).for_each(|_| files.app.update());
    assert_eq!(found(&files), palette);
    let other = Palette::new(vec![[0.1, 0.2, 0.3]]).unwrap();
    _ = files.app.world_mut().resource_mut::<Assets<Palette>>().insert(winter.id(), other.clone());
    (0..3).for_each(|_| files.app.update());
    assert_eq!(found(&files), other);
}

/// A field that is taken out and put back keeps the palette that it was given.
#[test]
fn fields_that_are_put_back_keep_palettes() {
    let mut files = Files::new();
    let field = files.spawn();
    files.palette(&field);
    let given = FieldPalette::from_colors(COLORS).unwrap();
    let world = files.app.world_mut();
    let mut fields = world.resource_mut::<Assets<PlenOctree>>();
    let taken = fields.remove(&field).unwrap();
    _ = fields.insert(field.id(), taken);
    world.resource_mut::<Palettes>().insert(&field, given.clone());
    for _ in 0..20 {
        files.app.update();
        assert_eq!(files.app.world().resource::<Palettes>().get(&field), Some(&given));
    }
}

/// The palette next to a field outside the assets folder is loaded if the field is.
#[test]
fn a_palette_next_to_an_unapproved_field_is_loaded() {
    use bevy::asset::UnapprovedPathMode;
    let files = Files::new();
    files.write("x.palette.json", r#"{"colors": [[0.25, 0.5, 0.75]]}"#);
    std::fs::create_dir_all(files.folder.path().join("assets")).unwrap();
    let mut app = App::new();
    let assets = AssetPlugin {
        file_path: files.folder.path().join("assets").to_string_lossy().into(),
        unapproved_path_mode: UnapprovedPathMode::Deny,
        ..default()
    };
    app.add_plugins((MinimalPlugins, assets, PlenOctreePlugin));
    let server = app.world().resource::<AssetServer>();
    let path = files.folder.path().join("x.npz");
    let field: Handle<PlenOctree> = server.load_builder().override_unapproved().load(path);
    app.world_mut().spawn((Prop(field.clone()), Posterize::default()));
    wait_for("a palette", || {
        app.update();
        app.world().resource::<Palettes>().get(&field).is_some()
    });
    let palette = app.world().resource::<Palettes>().get(&field).unwrap();
    assert_eq!(palette.palette().colors, [[0.25, 0.5, 0.75]]);
}
