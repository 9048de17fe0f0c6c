//! Orders the plugin's passes among those of other plugins, which are not known when the plugin is built.

use bevy::{
    core_pipeline::{
        core_3d::{main_opaque_pass_3d, main_transparent_pass_3d},
        schedule::Core3dSystems,
    },
    ecs::{
        schedule::{
            FlattenedDependencies, InternedSystemSet, NodeId, ScheduleBuildError, ScheduleBuildPass, ScheduleGraph,
            SystemKey, SystemSetKey,
            graph::{DiGraph, Direction},
        },
        world::World,
    },
    platform::{collections::HashSet, hash::FixedHasher},
    prelude::*,
};
use indexmap::IndexSet;

/// Orders the systems that draw props, when the schedule is built. An order that another plugin requests takes
/// precedence.
#[derive(Debug)]
pub(super) struct OrderPasses {
    /// Makes these the last ones that draw opaque things. They run between the opaque and the transparent main pass:
    /// before the main pass's own systems there, such as the one for objects that transmit light, which copies what is
    /// behind them; and after all others, such as the one that draws the sky.
    pub scene: InternedSystemSet,
    /// Makes these the last ones of post-processing. Tonemapping and effects of other plugins swap the view's textures,
    /// so a pass that is not ordered relative to them may draw to the wrong texture.
    pub display: InternedSystemSet,
}

impl ScheduleBuildPass for OrderPasses {
    type EdgeOptions = ();

    fn add_dependency(&mut self, _: NodeId, _: NodeId, _: Option<&()>) {}

    fn collapse_set(
        &mut self,
        _: SystemSetKey,
        _: &IndexSet<SystemKey, FixedHasher>,
        _: &DiGraph<NodeId>,
    ) -> impl Iterator<Item = (NodeId, NodeId)> {
        std::iter::empty()
    }

    fn build(
        &mut self,
        _: &mut World,
        graph: &mut ScheduleGraph,
        mut dependencies: FlattenedDependencies<'_>,
    ) -> Result<(), ScheduleBuildError> {
        let known = dependencies.analyze().map_err(ScheduleBuildError::FlatDependencySort)?;
        let known = known.transitive_closure();
        let mut pairs = after_opaque(graph, known, self.scene);
        pairs.extend(last_in(graph, known, Core3dSystems::PostProcess.intern(), self.display));
        for (first, second) in pairs {
            dependencies.add_edge(first, second);
        }
        Ok(())
    }
}

/// Returns pairs of systems, the first of which must run before the second, so that those in `last` are the last ones
/// in `set`. `known` has an edge from every system to each that runs after it.
fn last_in(
    graph: &mut ScheduleGraph,
    known: &DiGraph<SystemKey>,
    set: InternedSystemSet,
    last: InternedSystemSet,
) -> Vec<(SystemKey, SystemKey)> {
    let last = systems_in(graph, last);
    let later = linked(known, &last, Direction::Outgoing);
    let others = systems_in(graph, set);
    let others = others.difference(&last).filter(|other| !later.contains(*other));
    others.flat_map(|other| last.iter().map(|system| (*other, *system))).collect()
}

/// Returns the systems that must run before these, or after them.
fn linked(known: &DiGraph<SystemKey>, systems: &HashSet<SystemKey>, direction: Direction) -> HashSet<SystemKey> {
    systems.iter().flat_map(|system| known.neighbors_directed(*system, direction)).collect()
}

/// Returns such pairs that make the systems in `props` the last ones that draw opaque things.
fn after_opaque(
    graph: &mut ScheduleGraph,
    known: &DiGraph<SystemKey>,
    props: InternedSystemSet,
) -> Vec<(SystemKey, SystemKey)> {
    let props = systems_in(graph, props);
    let opaque = systems_in(graph, main_opaque_pass_3d.into_system_set().intern());
    let transparent = systems_in(graph, main_transparent_pass_3d.into_system_set().intern());
    let main_pass = systems_in(graph, Core3dSystems::MainPass.intern());
    let linked = |systems, direction| linked(known, systems, direction);
    let (earlier, later) = (linked(&props, Direction::Incoming), linked(&props, Direction::Outgoing));
    let after_opaque = linked(&opaque, Direction::Outgoing);
    let before_transparent = linked(&transparent, Direction::Incoming);
    let between = after_opaque.intersection(&before_transparent);
    let free = between.filter(|other| ![&props, &earlier, &later].iter().any(|set| set.contains(*other)));
    let free: HashSet<_> = free.copied().collect();
    let in_main_pass: HashSet<_> = free.intersection(&main_pass).copied().collect();
    // What must run after a system that runs after props does so, too.
    let after_props = &in_main_pass | &linked(&in_main_pass, Direction::Outgoing);
    let pair = |other, system| if after_props.contains(&other) { (system, other) } else { (other, system) };
    free.iter().flat_map(|other| props.iter().map(|system| pair(*other, *system))).collect()
}

/// Returns the systems in a set and in its nested sets.
fn systems_in(graph: &mut ScheduleGraph, set: InternedSystemSet) -> HashSet<SystemKey> {
    let mut systems = HashSet::default();
    let mut sets = vec![NodeId::Set(graph.system_sets.get_key_or_insert(set))];
    while let Some(set) = sets.pop() {
        for node in graph.hierarchy().neighbors(set) {
            match node {
                NodeId::System(system) => {
                    systems.insert(system);
                }
                NodeId::Set(_) => sets.push(node),
            }
        }
    }
    systems
}
