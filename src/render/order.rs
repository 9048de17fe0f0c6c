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

/// Orders the systems in `last` after all other systems in `set`, including those that are added later.
pub(super) fn order_last(schedule: &mut Schedule, last: impl SystemSet, set: impl SystemSet) {
    schedule.configure_sets(last.intern().in_set(set.intern()));
    schedule.add_build_pass(OrderPass(LastInSet { set: set.intern(), last: last.intern() }));
}

/// Makes the systems in `props` the last ones that draw opaque things. They run between the opaque and the transparent
/// main pass: before the main pass's own systems there, such as the one for objects that transmit light, which copies
/// what is behind them; and after all others, such as the one that draws the sky.
///
/// An order that another plugin requests takes precedence.
pub(super) fn order_after_opaque(schedule: &mut Schedule, props: impl SystemSet) {
    schedule.configure_sets(
        props.intern().after(main_opaque_pass_3d).before(main_transparent_pass_3d).in_set(Core3dSystems::MainPass),
    );
    schedule.add_build_pass(OrderPass(AfterOpaque(props.intern())));
}

/// Adds dependencies when the schedule is built.
trait Order: std::fmt::Debug + Send + Sync + 'static {
    /// Returns pairs of systems, the first of which must run before the second.
    fn pairs(&self, graph: &mut ScheduleGraph, known: &DiGraph<SystemKey>) -> Vec<(SystemKey, SystemKey)>;
}

#[derive(Debug)]
struct OrderPass<T>(T);

impl<T: Order> ScheduleBuildPass for OrderPass<T> {
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
        for (first, second) in self.0.pairs(graph, dependencies.graph()) {
            dependencies.add_edge(first, second);
        }
        Ok(())
    }
}

#[derive(Debug)]
struct LastInSet {
    set: InternedSystemSet,
    last: InternedSystemSet,
}

impl Order for LastInSet {
    fn pairs(&self, graph: &mut ScheduleGraph, _: &DiGraph<SystemKey>) -> Vec<(SystemKey, SystemKey)> {
        let last = systems_in(graph, self.last);
        let others = systems_in(graph, self.set);
        others.difference(&last).flat_map(|other| last.iter().map(|system| (*other, *system))).collect()
    }
}

#[derive(Debug)]
struct AfterOpaque(InternedSystemSet);

impl Order for AfterOpaque {
    fn pairs(&self, graph: &mut ScheduleGraph, known: &DiGraph<SystemKey>) -> Vec<(SystemKey, SystemKey)> {
        let props = systems_in(graph, self.0);
        let opaque = systems_in(graph, main_opaque_pass_3d.into_system_set().intern());
        let transparent = systems_in(graph, main_transparent_pass_3d.into_system_set().intern());
        let main_pass = systems_in(graph, Core3dSystems::MainPass.intern());
        let (earlier, later) = (linked(known, &props, Direction::Incoming), linked(known, &props, Direction::Outgoing));
        let after_opaque = linked(known, &opaque, Direction::Outgoing);
        let before_transparent = linked(known, &transparent, Direction::Incoming);
        let between = after_opaque.intersection(&before_transparent);
        let free = between.filter(|other| ![&props, &earlier, &later].iter().any(|set| set.contains(*other)));
        let pair = |other, system| if main_pass.contains(&other) { (system, other) } else { (other, system) };
        free.flat_map(|other| props.iter().map(move |system| pair(*other, *system))).collect()
    }
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

/// Returns the systems that run before (incoming) or after (outgoing) any of `systems`.
fn linked(known: &DiGraph<SystemKey>, systems: &HashSet<SystemKey>, direction: Direction) -> HashSet<SystemKey> {
    let mut found = HashSet::default();
    let mut next: Vec<_> = systems.iter().copied().collect();
    while let Some(system) = next.pop() {
        next.extend(known.neighbors_directed(system, direction).filter(|neighbor| found.insert(*neighbor)));
    }
    found
}
