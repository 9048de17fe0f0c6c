//! Systems that run last in a set, whatever else is in it.

use bevy::{
    ecs::{
        schedule::{
            FlattenedDependencies, NodeId, ScheduleBuildError, ScheduleBuildPass, ScheduleGraph, SystemKey,
            SystemSetKey, graph::DiGraph,
        },
        world::World,
    },
    platform::hash::FixedHasher,
    prelude::*,
};
use indexmap::IndexSet;

/// Orders the systems that are in `last` after all others of `set`, also those that are added later.
pub(super) fn order_last(schedule: &mut Schedule, last: impl SystemSet, set: impl SystemSet) {
    schedule.configure_sets(last.intern().in_set(set.intern()));
    let graph = schedule.graph_mut();
    let set = graph.system_sets.get_key_or_insert(set.intern());
    let last = NodeId::Set(graph.system_sets.get_key_or_insert(last.intern()));
    let last = graph.hierarchy().neighbors(last).filter_map(|node| node.as_system()).collect();
    schedule.add_build_pass(LastInSet { set, last });
}

/// A set cannot be ordered after all that is in another, since no one knows it when plugins are built.
#[derive(Debug)]
struct LastInSet {
    set: SystemSetKey,
    last: Vec<SystemKey>,
}

impl ScheduleBuildPass for LastInSet {
    type EdgeOptions = ();

    fn add_dependency(&mut self, _: NodeId, _: NodeId, _: Option<&()>) {}

    fn collapse_set(
        &mut self,
        set: SystemSetKey,
        systems: &IndexSet<SystemKey, FixedHasher>,
        _: &DiGraph<NodeId>,
    ) -> impl Iterator<Item = (NodeId, NodeId)> {
        let last = if set == self.set { self.last.as_slice() } else { &[] };
        let others = systems.iter().filter(move |system| !last.contains(system));
        others.flat_map(move |other| last.iter().map(|last| (NodeId::System(*other), NodeId::System(*last))))
    }

    fn build(
        &mut self,
        _: &mut World,
        _: &mut ScheduleGraph,
        _: FlattenedDependencies<'_>,
    ) -> Result<(), ScheduleBuildError> {
        Ok(())
    }
}
