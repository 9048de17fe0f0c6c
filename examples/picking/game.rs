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

/// The paint on each part of a toy. `None` is bare.
pub type Coat = [Option<usize>; 3];

/// The ramps of a toy's palette that can be painted, by name.
pub type Parts = [&'static str; 3];

/// A toy to paint.
#[derive(Component)]
pub struct Toy {
    parts: Parts,
    coat: Coat,
    /// The color that each part shows, on its way to that of its coat.
    shown: [Option<Color>; 3],
    orders: &'static [Coat],
    /// The number of orders delivered so far.
    delivered: usize,
    /// The picture on the wall that shows the current order.
    picture: Entity,
    home: Transform,
}

impl Toy {
    pub fn new(parts: Parts, orders: &'static [Coat], picture: Entity, home: Transform) -> Self {
        Self { parts, coat: [None; 3], shown: [None; 3], orders, delivered: 0, picture, home }
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

/// Paints the part of a toy that is clicked.
pub fn paint(
    click: On<Pointer<Click>>,
    brush: Res<Brush>,
    palettes: Res<Palettes>,
    mut toys: Query<(&Prop, &mut Toy)>,
) {
    let hit = click.hit.extra_as::<PropHit>();
    if let Ok((prop, mut toy)) = toys.get_mut(click.entity)
        && let Some(part) = hit.and_then(|hit| part(hit, palettes.get(&prop.0)?, toy.parts))
    {
        toy.coat[part] = painted(toy.coat[part], &brush);
    }
}

/// Returns the part that was hit, by the ramp of its palette color.
fn part(hit: &PropHit, palette: &FieldPalette, parts: Parts) -> Option<usize> {
    let ramp = palette.palette().ramp_of(hit.label?.main_color())?;
    parts.iter().position(|part| palette.ramp(part) == Some(ramp))
}

/// Returns the coat after a stroke. Applying the same paint again washes it off.
fn painted(coat: Option<usize>, brush: &Brush) -> Option<usize> {
    (coat != Some(brush.paint)).then_some(brush.paint)
}

/// Returns the color of a part with a coat on it.
fn covered(palette: &FieldPalette, part: &str, coat: Option<usize>) -> Option<Color> {
    coat.map(|paint| PAINTS[paint]).or_else(|| palette.ramp_color(palette.ramp(part)?))
}

/// Fades every part of a toy to the color of its coat.
fn dry(time: Res<Time>, mut palettes: ResMut<Palettes>, mut toys: Query<(&Prop, &mut Toy)>) {
    let share = 1.0 - (-9.0 * time.delta_secs()).exp();
    for (prop, mut toy) in &mut toys {
        let Some(palette) = palettes.get_mut(&prop.0) else {
            continue;
        };
        let Toy { parts, coat, shown, .. } = &mut *toy;
        for ((part, coat), shown) in parts.iter().zip(coat).zip(shown) {
            if let (Some(ramp), Some(goal)) = (palette.ramp(part), covered(palette, part, *coat)) {
                let from = shown.or_else(|| palette.ramp_color(ramp)).unwrap_or(goal);
                palette.set_ramp(ramp, *shown.insert(BlendSpace::Oklab.mix(from, goal, share)));
            }
        }
    }
}

/// Hints at what a click would do to the part under the pointer.
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
        if let (Some(hit), Some(palette)) = (hit, palettes.get(&prop.0))
            && let Some(index) = part(hit, palette, toy.parts)
            && let Some(goal) = covered(palette, toy.parts[index], painted(toy.coat[index], &brush))
            && let Some(shown) = toy.shown[index]
        {
            colors.set_ramp(toy.parts[index], BlendSpace::Oklab.mix(shown, goal, share));
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
            for (part, coat) in toy.parts.iter().zip(toy.order()) {
                if let Some(goal) = covered(palette, part, *coat) {
                    colors.set_ramp(part, goal);
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
