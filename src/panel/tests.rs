//! Tests of the panel with simulated pointer events, without a window.

use bevy::{ecs::system::RunSystemOnce, prelude::*};
use bevy_egui::egui;
use glam::DVec3;
use half::f16;

use super::{PaletteEditor, palette_ui};
use plenoctree::{Activation, Basis, Cell, Frame, PlenOctree, UpAxis, palette::Palette};

use crate::{
    camera::PosterizeView,
    palette::{FieldPalette, PaletteExtraction, PaletteOverride, Palettes},
    posterize::{EdgeSmoothing, Posterize},
    prop::Prop,
};

struct Panel {
    world: World,
    context: egui::Context,
    prop: Entity,
    field: Handle<PlenOctree>,
}

impl Panel {
    fn new() -> Self {
        let mut node = [Cell::EMPTY; 8];
        node[0] = Cell::leaf(0);
        let frame = Frame::spanning(DVec3::ZERO, DVec3::ONE);
        let field = PlenOctree::new(
            frame,
            Basis::Rgba,
            Activation::Sigmoid,
            UpAxis::Y,
            vec![node],
            vec![1.0],
            vec![f16::ZERO; 3],
        );
        let mut world = World::new();
        let mut fields = Assets::<PlenOctree>::default();
        let field = fields.add(field.unwrap());
        let mut palettes = Palettes::default();
        let mut palette = Palette::new(vec![[0.1, 0.2, 0.3], [0.9, 0.8, 0.7]]).unwrap();
        palette.weights = vec![0.75, 0.25];
        palettes.insert(&field, FieldPalette::new(palette));
        world.insert_resource(fields);
        world.insert_resource(palettes);
        world.init_resource::<PaletteExtraction>();
        let posterize = Posterize { blend_steps: 20, softness: 0.7, ..default() };
        let prop = world.spawn((Prop(field.clone()), posterize)).id();
        Self { world, context: egui::Context::default(), prop, field }
    }

    fn frame(&mut self, events: Vec<egui::Event>) -> egui::FullOutput {
        let (context, prop) = (self.context.clone(), self.prop);
        let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(400.0, 900.0));
        let input = egui::RawInput { screen_rect: Some(screen), events, ..default() };
        let show =
            move |mut editor: PaletteEditor| context.run_ui(input.clone(), |ui| palette_ui(ui, prop, &mut editor));
        self.world.run_system_once(show).unwrap()
    }

    /// Returns where a text is shown.
    fn text(&mut self, label: &str) -> egui::Pos2 {
        self.frame(vec![]);
        let shapes = self.frame(vec![]).shapes;
        let at = shapes.iter().find_map(|clipped| match &clipped.shape {
            egui::Shape::Text(text) if text.galley.text() == label => Some(text.visual_bounding_rect().center()),
            _ => None,
        });
        at.unwrap_or_else(|| panic!("{label} is not shown"))
    }

    fn click(&mut self, label: &str) {
        let at = self.text(label);
        self.drag(at, at);
    }

    /// Replaces the text that is edited.
    fn replace(&mut self, text: &str) {
        self.press(egui::Key::A, egui::Modifiers::COMMAND);
        self.frame(vec![egui::Event::Text(text.into())]);
    }

    fn press(&mut self, key: egui::Key, modifiers: egui::Modifiers) {
        self.frame(vec![egui::Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers }]);
    }

    /// Presses the button at one place and releases it at another.
    fn drag(&mut self, from: egui::Pos2, to: egui::Pos2) {
        let button = |pos, pressed| egui::Event::PointerButton {
            pos,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: egui::Modifiers::NONE,
        };
        self.frame(vec![egui::Event::PointerMoved(from)]);
        self.frame(vec![button(from, true)]);
        if to != from {
            self.frame(vec![egui::Event::PointerMoved(from.lerp(to, 0.5))]);
            self.frame(vec![egui::Event::PointerMoved(to)]);
        }
        self.frame(vec![button(to, false)]);
    }

    fn palette(&self) -> &FieldPalette {
        self.world.resource::<Palettes>().get(&self.field).unwrap()
    }

    /// Makes each of the two colors a ramp.
    fn split(&mut self) {
        let mut palettes = self.world.resource_mut::<Palettes>();
        let palette = palettes.get_mut(&self.field).unwrap();
        let edited = palette.edit_ramps(|palette| {
            palette.gather_tones(&[0], "cap")?;
            palette.gather_tones(&[1], "stem")
        });
        edited.unwrap();
    }

    fn posterize(&self) -> Option<Posterize> {
        self.world.get(self.prop).copied()
    }

    fn shown(&self) -> Vec<Color> {
        self.palette().shown().to_vec()
    }
}

/// Settings outside the sliders' ranges are kept as well.
#[test]
fn hovering_changes_nothing() {
    let mut panel = Panel::new();
    let settings = panel.posterize();
    panel.world.clear_trackers();
    for x in 0..40 {
        panel.frame(vec![egui::Event::PointerMoved(egui::pos2(10.0 * x as f32, 20.0 * x as f32))]);
    }
    assert!(!panel.world.is_resource_changed::<Palettes>());
    assert!(!panel.world.is_resource_changed::<PaletteExtraction>());
    assert!(!panel.world.entity(panel.prop).get_ref::<Posterize>().unwrap().is_changed());
    assert_eq!(panel.posterize(), settings);
}

#[test]
fn enabling_posterization_restores_its_settings() {
    let mut panel = Panel::new();
    let settings = panel.posterize();
    panel.click("Posterize");
    assert_eq!(panel.posterize(), None);
    panel.click("Posterize");
    assert_eq!(panel.posterize(), settings);
    panel.click("Smooth edges");
    assert_eq!(panel.posterize().map(|posterize| posterize.edges), Some(EdgeSmoothing::Off));
    panel.click("Defaults");
    assert_eq!(panel.posterize(), Some(Posterize::default()));
}

#[test]
fn colors_can_be_reset_one_by_one_or_together() {
    let mut panel = Panel::new();
    let original = panel.shown();
    let paint = |panel: &mut Panel| {
        let mut palettes = panel.world.resource_mut::<Palettes>();
        palettes.get_mut(&panel.field).unwrap().shown_mut().fill(Color::srgb(1.0, 0.0, 0.0));
    };
    paint(&mut panel);
    panel.click("Reset");
    assert_eq!(panel.shown()[0], original[0]);
    assert_ne!(panel.shown()[1], original[1]);
    paint(&mut panel);
    panel.click("Reset all");
    assert_eq!(panel.shown(), original);
}

/// Overridden colors do not affect other props, and are reset to the colors of the field.
#[test]
fn overrides_affect_one_prop() {
    let mut panel = Panel::new();
    panel.click("Override colors");
    let field = panel.shown();
    let mut own = panel.world.get_mut::<PaletteOverride>(panel.prop).unwrap();
    own.set(0, Color::srgb(1.0, 0.0, 0.0));
    own.set(1, Color::srgb(0.0, 1.0, 0.0));
    panel.click("Reset");
    let own = panel.world.get::<PaletteOverride>(panel.prop).unwrap();
    assert_eq!((own.get(0), own.get(1)), (None, Some(Color::srgb(0.0, 1.0, 0.0))));
    assert_eq!(panel.shown(), field);
    let own = own.clone();
    panel.click("Override colors");
    assert!(panel.world.get::<PaletteOverride>(panel.prop).is_none());
    panel.click("Override colors");
    assert_eq!(panel.world.get(panel.prop), Some(&own));
}

#[test]
fn ramps_are_renamed() {
    let mut panel = Panel::new();
    panel.split();
    panel.click("stem");
    // Spaces at the ends are no part of the name.
    panel.replace(" foot ");
    assert_eq!(panel.palette().ramps()[1].name, "stem");
    panel.click("Posterize");
    assert_eq!(panel.palette().ramps()[1].name, "foot");
    // Names that another ramp has are refused.
    panel.click("foot");
    panel.replace("cap");
    panel.click("Posterize");
    assert_eq!(panel.palette().ramps()[1].name, "foot");
    // Escape cancels.
    panel.click("foot");
    panel.replace("heel");
    panel.press(egui::Key::Escape, egui::Modifiers::NONE);
    panel.click("Posterize");
    assert_eq!(panel.palette().ramps()[1].name, "foot");
}

/// Overrides refer to ramps by name: those of other props and of posterized views of the field follow, also if they are
/// put away.
#[test]
fn overrides_follow_the_names_of_ramps() {
    let mut panel = Panel::new();
    panel.split();
    let red = PaletteOverride::default().with_ramp("stem", Color::srgb(0.7, 0.1, 0.1)).with_ramp("foot", Color::BLACK);
    let expected = red.clone().shown(panel.palette());
    let mut fields = panel.world.resource_mut::<Assets<PlenOctree>>();
    let field = fields.get(&panel.field).unwrap().clone();
    let other = fields.add(field);
    let siblings = [panel.field.clone(), other].map(|field| panel.world.spawn((Prop(field), red.clone())).id());
    let view = panel.world.spawn((PosterizeView(panel.field.clone()), red.clone())).id();
    panel.world.entity_mut(panel.prop).insert(red.clone());
    panel.click("Override colors");
    panel.click("stem");
    panel.replace("foot");
    panel.click("Override colors");
    assert_eq!(panel.palette().ramps()[1].name, "foot");
    for prop in [panel.prop, siblings[0], view] {
        assert_eq!(panel.world.get::<PaletteOverride>(prop).unwrap().shown(panel.palette()), expected);
    }
    assert_eq!(panel.world.get(siblings[1]), Some(&red));
}

/// Colors in no ramp are below the ramps.
#[test]
fn colors_in_no_ramp_are_shown() {
    let mut panel = Panel::new();
    let mut palettes = panel.world.resource_mut::<Palettes>();
    let palette = palettes.get_mut(&panel.field).unwrap();
    palette.edit_ramps(|palette| palette.gather_tones(&[0], "cap")).unwrap();
    let ramp = panel.text("cap");
    // The index of the other color, in the first column.
    assert!(panel.text("1").y > ramp.y);
}

/// A name that the user has not finished when another entity is shown is forgotten.
#[test]
fn unfinished_names_are_forgotten() {
    let mut panel = Panel::new();
    panel.split();
    panel.click("stem");
    panel.replace("foot");
    let other = panel.world.spawn_empty().id();
    let prop = std::mem::replace(&mut panel.prop, other);
    // For two frames, the name counts as left.
    (0..3).for_each(|_| _ = panel.frame(vec![]));
    panel.prop = prop;
    panel.text("stem");
}

/// Tones stand behind the name and the color of their ramp.
#[test]
fn tones_are_dragged_to_other_ramps() {
    let mut panel = Panel::new();
    panel.split();
    let (cap, stem) = (panel.text("cap"), panel.text("stem"));
    let tone = egui::pos2(150.0, stem.y);
    panel.drag(tone, cap);
    assert_eq!(panel.palette().ramps().len(), 1);
    assert_eq!(panel.palette().ramps()[0].tones, [0, 1]);
}

/// A click on a tone opens its picker, although tones can be dragged.
#[test]
fn tones_are_edited_by_a_click() {
    let mut panel = Panel::new();
    panel.split();
    let tone = egui::pos2(150.0, panel.text("stem").y);
    assert!(!egui::Popup::is_any_open(&panel.context));
    panel.drag(tone, tone);
    assert!(egui::Popup::is_any_open(&panel.context));
}

#[test]
fn ramps_are_reset_as_a_whole() {
    let mut panel = Panel::new();
    panel.split();
    let original = panel.shown();
    let red = Color::srgb(0.7, 0.1, 0.1);
    for own in [false, true] {
        if own {
            panel.click("Override colors");
            let mut own = panel.world.get_mut::<PaletteOverride>(panel.prop).unwrap();
            own.set_ramp("cap", red);
            own.set(0, red);
        } else {
            panel.world.resource_mut::<Palettes>().get_mut(&panel.field).unwrap().set_ramp(0, red);
        }
        panel.click("Reset");
        assert_eq!(panel.shown(), original);
        let own = panel.world.get::<PaletteOverride>(panel.prop);
        assert!(own.is_none_or(|own| own.shown(panel.palette()) == original));
    }
}
