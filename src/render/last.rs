//! Orders systems last in a system set, whatever other plugins add to the set.

use bevy::{
    ecs::{
        schedule::{
            FlattenedDependencies, NodeId, ScheduleBuildError, ScheduleBuildPass, ScheduleGraph, SystemKey,
            SystemSetKey, graph::DiGraph,
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
    let sets = &mut schedule.graph_mut().system_sets;
    let pass = LastInSet { set: sets.get_key_or_insert(set.intern()), last: sets.get_key_or_insert(last.intern()) };
    schedule.add_build_pass(pass);
}

/// Adds the dependencies when the schedule is built. The other systems in the set are not yet known when plugins are
/// built.
#[derive(Debug)]
struct LastInSet {
    set: SystemSetKey,
    last: SystemSetKey,
}

impl ScheduleBuildPass for LastInSet {
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
        let last = systems_in(graph, self.last);
        for other in systems_in(graph, self.set).difference(&last) {
            for system in &last {
                dependencies.add_edge(*other, *system);
            }
        }
        Ok(())
    }
}

/// Returns the systems in a set and in its nested sets.
fn systems_in(graph: &ScheduleGraph, set: SystemSetKey) -> HashSet<SystemKey> {
    let mut systems = HashSet::default();
    let mut sets = vec![NodeId::Set(set)];
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
