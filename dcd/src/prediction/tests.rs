use super::*;
use crate::physics::StepSettings;
use crate::space::Bounds;
use rapier3d::prelude::*;

fn host() -> RegionHost {
    let bounds = Bounds::around([0.0; 3], [64.0; 3]);
    let tree = DistributionTree::halved(bounds, 1).unwrap();
    let regions: Vec<_> = tree.leaves().collect();
    RegionHost::new(Partition::new(tree, None), StepSettings::default(), 1, &regions).unwrap()
}

fn stack(host: &mut RegionHost) -> Vec<BodyRecord> {
    let mut bodies = Vec::new();
    let shapes = host.shapes_mut();
    let at = |x: f64, y: f64| crate::protocol::WorldPose::at([x, y, 0.0]);
    let cube = [ColliderBuilder::cuboid(0.5, 0.5, 0.5)];
    let floor = [ColliderBuilder::cuboid(30.0, 0.5, 30.0)];
    bodies.push(
        shapes
            .describe(BodyId::persistent(0), at(0.0, 0.0), &RigidBodyBuilder::fixed().build(), &floor)
            .unwrap(),
    );
    for i in 0..10 {
        let body = RigidBodyBuilder::dynamic().build();
        bodies.push(
            shapes.describe(BodyId::persistent(i + 1), at(0.0, 1.0 + f64::from(i)), &body, &cube).unwrap(),
        );
    }
    let body = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::new(2.0, 0.0, 0.0)).build();
    bodies.push(shapes.describe(BodyId::persistent(11), at(-2.0, 1.2), &body, &cube).unwrap());
    bodies
}

fn states(host: &RegionHost) -> BTreeMap<BodyId, BodyState> {
    host.owned_bodies().map(|(id, region, handle)| (id, region.body_state(handle))).collect()
}

#[test]
fn experiment() {
    let mut truth = host();
    let bodies = stack(&mut truth);
    truth.insert(bodies.clone(), &[]).unwrap();
    let mut history = vec![states(&truth)];
    for _ in 0..240 {
        truth.step().unwrap();
        history.push(states(&truth));
    }
    let worst = |host: &RegionHost, tick: usize| {
        states(host)
            .iter()
            .map(|(id, state)| Motion::of(state).distance_m(&Motion::of(&history[tick][id])))
            .fold(0.0, f64::max)
    };
    let quantised = |state: &BodyState| {
        let mut state = *state;
        let round = |v: f64, step: f64| (v / step).round() * step;
        state.pose.translation = state.pose.translation.map(|v| round(v, 0.0015));
        state.velocity.linear = state.velocity.linear.map(|v| round(f64::from(v), 0.01) as f32);
        state.velocity.angular = state.velocity.angular.map(|v| round(f64::from(v), 0.02) as f32);
        let q = state.pose.rotation.map(|v| round(f64::from(v), 0.003));
        let n = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        state.pose.rotation = q.map(|v| (v / n) as f32);
        state
    };
    for variant in
        ["fresh exact", "fresh quantised", "warm exact", "warm quantised", "warm18 exact", "warm18 quantised"]
    {
        let mut errors = Vec::new();
        for from in (70..200).step_by(5) {
            let mut host = host();
            stack(&mut host);
            if variant.starts_with("fresh") {
                let mut bodies = bodies.clone();
                for body in bodies.iter_mut().skip(1) {
                    body.state = history[from][&body.id];
                    if variant.ends_with("quantised") {
                        body.state = quantised(&body.state);
                    }
                }
                host.insert(bodies, &[]).unwrap();
            } else {
                host.insert(bodies.clone(), &[]).unwrap();
                let until = if variant.starts_with("warm18") { from + 18 } else { from };
                for _ in 0..until {
                    host.step().unwrap();
                }
                let put: Vec<_> = history[from]
                    .iter()
                    .map(|(id, state)| {
                        (*id, if variant.ends_with("quantised") { quantised(state) } else { *state })
                    })
                    .collect();
                host.put(Tick(from as u64), put.iter().map(|(id, state)| (*id, state)));
            }
            for _ in 0..18 {
                host.step().unwrap();
            }
            errors.push(worst(&host, from + 18));
        }
        errors.sort_by(f64::total_cmp);
        println!(
            "{variant}: median {:.4} p90 {:.4} max {:.4}",
            errors[errors.len() / 2],
            errors[errors.len() * 9 / 10],
            errors[errors.len() - 1]
        );
    }
}
