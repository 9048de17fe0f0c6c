//! The game: a brush, toys to paint with it, and the orders for them.

use bevy::{picking::pointer::PointerInteraction, prelude::*};
use bevy_plenoctree::{BlendSpace, FieldPalette, PaletteOverride, Palettes, Prop, PropHit};

pub fn plugin(app: &mut App) {
    app.init_resource::<Brush>().add_systems(Update, (show_orders, deliver, hop, dry, (preview, lift_tins)).chain());
}

/// The paints, one per tin.
pub const PAINTS: [Color; 6] = [
    Color::srgb(0.18, 0.40, 0.86),
    Color::srgb(0.53, 0.29, 0.80),
    Color::srgb(0.94, 0.38, 0.62),
    Color::srgb(0.95, 0.52, 0.13),
    Color::srgb(0.98, 0.80, 0.18),
    Color::srgb(0.16, 0.66, 0.52),
];
pub const BLUE: usize = 0;
pub const VIOLET: usize = 1;
pub const PINK: usize = 2;
pub const ORANGE: usize = 3;
pub const YELLOW: usize = 4;
pub const MINT: usize = 5;

/// The paint on the brush.
#[derive(Resource, Default)]
pub struct Brush {
    pub paint: usize,
}

/// The paint on each color of a toy's palette. `None` is bare wood.
pub type Coat = [Option<usize>; 6];

/// A toy to paint.
#[derive(Component)]
pub struct Toy {
    coat: Coat,
    orders: &'static [Coat],
    /// The number of orders delivered so far.
    delivered: usize,
    /// The picture on the wall that shows the current order.
    picture: Entity,
    home: Transform,
}

impl Toy {
    pub fn new(orders: &'static [Coat], picture: Entity, home: Transform) -> Self {
        Self { coat: [None; 6], orders, delivered: 0, picture, home }
    }

    fn order(&self) -> &'static Coat {
        &self.orders[self.delivered % self.orders.len()]
    }
}

/// A tin of paint.
#[derive(Component)]
pub struct Tin {
    pub paint: usize,
    pub home: Transform,
}

/// Makes a toy that matches its order hop for joy. Holds the progress of the hop, from 0 to 1.
#[derive(Component, Default)]
struct Hopping(f32);

/// The duration of a hop, in seconds.
const HOP: f32 = 0.9;

/// Dips the brush into a tin that is clicked.
pub fn dip(click: On<Pointer<Click>>, tins: Query<&Tin>, mut brush: ResMut<Brush>) {
    if let Ok(tin) = tins.get(click.entity) {
        brush.paint = tin.paint;
    }
}

/// Paints the region of a toy that is clicked, along with all other regions of its color.
pub fn paint(click: On<Pointer<Click>>, brush: Res<Brush>, mut toys: Query<&mut Toy>) {
    let hit = click.hit.extra_as::<PropHit>();
    if let (Ok(mut toy), Some(color)) = (toys.get_mut(click.entity), hit.and_then(region)) {
        toy.coat[color] = painted(toy.coat[color], &brush);
    }
}

/// Returns the palette color of the region that was hit.
fn region(hit: &PropHit) -> Option<usize> {
    hit.label.map(|label| label.main_color()).filter(|color| *color < 6)
}

/// Returns the coat after a stroke. Applying the same paint again washes it off.
fn painted(coat: Option<usize>, brush: &Brush) -> Option<usize> {
    (coat != Some(brush.paint)).then_some(brush.paint)
}

/// Returns a palette color with a coat on it.
fn covered(palette: &FieldPalette, color: usize, coat: Option<usize>) -> Option<Color> {
    let bare = *palette.source().get(color)?;
    Some(coat.map_or(bare, |paint| PAINTS[paint]))
}

/// Fades every color of a toy's palette to the color of its coat.
fn dry(time: Res<Time>, mut palettes: ResMut<Palettes>, toys: Query<(&Prop, &Toy)>) {
    let share = 1.0 - (-9.0 * time.delta_secs()).exp();
    for (prop, toy) in &toys {
        let Some(palette) = palettes.get_mut(&prop.0) else {
            continue;
        };
        for (color, coat) in toy.coat.iter().enumerate() {
            if let (Some(&shown), Some(goal)) = (palette.shown().get(color), covered(palette, color, *coat)) {
                palette.set(color, BlendSpace::Oklab.mix(shown, goal, share));
            }
        }
    }
}

/// Hints at what a click would do to the region under the pointer.
fn preview(
    time: Res<Time>,
    brush: Res<Brush>,
    palettes: Res<Palettes>,
    pointers: Query<&PointerInteraction>,
    mut toys: Query<(Entity, &Prop, &Toy, &mut PaletteOverride)>,
) {
    let share = 0.45 + 0.15 * (7.0 * time.elapsed_secs()).sin();
    for (entity, prop, toy, mut colors) in &mut toys {
        colors.reset();
        let hit = pointers.iter().filter_map(pointed).find(|hit| hit.entity == entity);
        if let (Some(color), Some(palette)) = (hit.and_then(region), palettes.get(&prop.0))
            && let Some(goal) = covered(palette, color, painted(toy.coat[color], &brush))
            && let Some(&shown) = palette.shown().get(color)
        {
            colors.set(color, BlendSpace::Oklab.mix(shown, goal, share));
        }
    }
}

/// Returns the hit under a pointer, if it is over a prop.
pub fn pointed(pointer: &PointerInteraction) -> Option<&PropHit> {
    pointer.get_nearest_hit().and_then(|(_, hit)| hit.extra_as())
}

/// Shows the current orders in the pictures on the wall.
fn show_orders(
    palettes: Res<Palettes>,
    toys: Query<(&Prop, &Toy), Without<Hopping>>,
    mut pictures: Query<&mut PaletteOverride>,
) {
    for (prop, toy) in &toys {
        if let (Some(palette), Ok(mut colors)) = (palettes.get(&prop.0), pictures.get_mut(toy.picture)) {
            for (color, coat) in toy.order().iter().enumerate() {
                if let Some(goal) = covered(palette, color, *coat) {
                    colors.set(color, goal);
                }
            }
        }
    }
}

fn deliver(mut commands: Commands, mut toys: Query<(Entity, &mut Toy), Without<Hopping>>) {
    for (entity, mut toy) in &mut toys {
        if toy.coat == *toy.order() {
            toy.delivered += 1;
            commands.entity(entity).insert(Hopping::default());
        }
    }
}

fn hop(time: Res<Time>, mut commands: Commands, mut toys: Query<(Entity, &Toy, &mut Hopping, &mut Transform)>) {
    for (entity, toy, mut hopping, mut transform) in &mut toys {
        hopping.0 += time.delta_secs() / HOP;
        let t = hopping.0.min(1.0);
        let (height, turn) = (2.4 * t * (1.0 - t), t * t * (3.0 - 2.0 * t));
        *transform = toy.home;
        transform.translation.y += height;
        transform.rotate_y(std::f32::consts::TAU * turn);
        if t == 1.0 {
            commands.entity(entity).remove::<Hopping>();
        }
    }
}

/// Raises the tin in use, and slightly the tin under the pointer.
fn lift_tins(
    time: Res<Time>,
    brush: Res<Brush>,
    pointers: Query<&PointerInteraction>,
    mut tins: Query<(Entity, &Tin, &mut Transform)>,
) {
    let share = 1.0 - (-12.0 * time.delta_secs()).exp();
    for (entity, tin, mut transform) in &mut tins {
        let is_pointed = pointers.iter().filter_map(pointed).any(|hit| hit.entity == entity);
        let lift = if tin.paint == brush.paint { 0.16 } else { 0.0 } + if is_pointed { 0.06 } else { 0.0 };
        let goal = tin.home.translation + lift * Vec3::Y;
        transform.translation = transform.translation.lerp(goal, share);
    }
}
