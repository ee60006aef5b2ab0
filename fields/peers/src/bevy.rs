//! bevy_ecs: a system that copies by a table of routes in topological order, and observers that tell each other of writes.

use bevy_ecs::prelude::*;

use crate::fastest;

#[derive(Component)]
struct X(f32);

#[derive(Component)]
struct Targets(Vec<Entity>);

#[derive(Resource)]
struct Routes(Vec<(Entity, Entity)>);

#[derive(EntityEvent)]
struct Written {
    entity: Entity,
}

fn copy(routes: Res<Routes>, mut values: Query<&mut X>) {
    for (from, to) in &routes.0 {
        let Ok(value) = values.get(*from).map(|x| x.0) else { continue };
        if let Ok(mut target) = values.get_mut(*to)
            && target.0 != value
        {
            target.0 = value;
        }
    }
}

/// What a write does: the targets take the value, and tell theirs.
fn pass_on(written: On<Written>, mut values: Query<&mut X>, targets: Query<&Targets>, mut commands: Commands) {
    let Ok(value) = values.get(written.entity).map(|x| x.0) else { return };
    let Ok(targets) = targets.get(written.entity) else { return };
    for target in &targets.0 {
        if let Ok(mut x) = values.get_mut(*target)
            && x.0 != value
        {
            x.0 = value;
            commands.trigger(Written { entity: *target });
        }
    }
}

fn world_of(count: usize) -> (World, Vec<Entity>) {
    let mut world = World::new();
    let entities = (0..count).map(|_| world.spawn(X(0.0)).id()).collect();
    (world, entities)
}

fn by_system(mut world: World, source: Entity, routes: Vec<(Entity, Entity)>) -> f64 {
    let count = routes.len();
    let last = routes[count - 1].1;
    world.insert_resource(Routes(routes));
    let mut schedule = Schedule::default();
    schedule.add_systems(copy);
    let ns = fastest(|round| {
        world.get_mut::<X>(source).expect("the source lives").0 = round as f32 + 0.5;
        schedule.run(&mut world);
    });
    let value = |entity| world.get::<X>(entity).expect("it lives").0;
    assert_eq!(value(last), value(source));
    ns / count as f64
}

/// Observers call each other, so a long chain needs a deep stack.
fn by_observers(mut world: World, source: Entity, last: Entity, count: usize) -> f64 {
    let run = move || {
        world.add_observer(pass_on);
        world.flush();
        let ns = fastest(|round| {
            world.get_mut::<X>(source).expect("the source lives").0 = round as f32 + 0.5;
            world.trigger(Written { entity: source });
            world.flush();
        });
        let value = |entity| world.get::<X>(entity).expect("it lives").0;
        assert_eq!(value(last), value(source));
        ns / count as f64
    };
    let thread = std::thread::Builder::new().stack_size(1 << 28).spawn(run).expect("a thread");
    thread.join().expect("it measures")
}

pub(crate) fn chain_by_system(length: usize) -> f64 {
    let (world, entities) = world_of(length + 1);
    by_system(world, entities[0], entities.windows(2).map(|pair| (pair[0], pair[1])).collect())
}

pub(crate) fn fan_out_by_system(targets: usize) -> f64 {
    let (world, entities) = world_of(targets + 1);
    by_system(world, entities[0], entities[1..].iter().map(|target| (entities[0], *target)).collect())
}

pub(crate) fn chain_by_observers(length: usize) -> f64 {
    let (mut world, entities) = world_of(length + 1);
    for pair in entities.windows(2) {
        world.entity_mut(pair[0]).insert(Targets(vec![pair[1]]));
    }
    by_observers(world, entities[0], entities[length], length)
}

pub(crate) fn fan_out_by_observers(targets: usize) -> f64 {
    let (mut world, entities) = world_of(targets + 1);
    world.entity_mut(entities[0]).insert(Targets(entities[1..].to_vec()));
    by_observers(world, entities[0], entities[targets], targets)
}
