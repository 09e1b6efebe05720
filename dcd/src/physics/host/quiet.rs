//! Tests that the cost of a tick of many regions depends on what moves in it, not on how much there is.

use rapier3d::prelude::*;

use super::RegionHost;
use crate::physics::coupling::looks;
use crate::physics::{Coupling, Partition, Region, StepSettings};
use crate::protocol::{BodyRecord, Velocity, WorldPose};
use crate::space::{Axis, BodyId, Bounds, DistributionTree, RegionId, TreeChange};

const REGIONS: usize = 64;

fn described(host: &mut RegionHost, id: u32, at: [f64; 3]) -> BodyRecord {
    let (body, collider) = match id {
        0 => (RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(400.0, 0.5, 400.0)),
        _ => (RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(0.5, 0.5, 0.5)),
    };
    let id = BodyId::persistent(id);
    host.shapes_mut().describe(id, WorldPose::at(at), &body.build(), &[collider]).unwrap()
}

/// Makes a host with a sleeping box in each of many regions, and some regions without one.
fn asleep(coupling: Coupling) -> RegionHost {
    let bounds = Bounds::new([-400.0, -1.0, -400.0], [400.0, 50.0, 400.0]);
    let partition = Partition::new(DistributionTree::halved(bounds, REGIONS).unwrap(), None);
    let leaves = partition.leaves().to_vec();
    let centres: Vec<_> = leaves.iter().map(|&leaf| partition.tree().part(leaf).centre()).collect();
    let settings = StepSettings::default().with_coupling(coupling);
    let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
    let mut bodies = vec![described(&mut host, 0, [0.0, -0.5, 0.0])];
    for (id, [x, _, z]) in (1..).zip(centres.into_iter().take(60)) {
        bodies.push(described(&mut host, id, [x, 0.5, z]));
    }
    host.insert(bodies, &[]).unwrap();
    for _ in 0..300 {
        host.step().unwrap();
    }
    assert!(host.awake_bodies().is_empty());
    host
}

/// Steps a host, and returns how often it looked at what others' bodies reach, at all borders of a region,
/// and at all cells.
fn step(host: &mut RegionHost) -> [usize; 3] {
    let before = looks();
    host.step().unwrap();
    let after = looks();
    assert!(host.sides.iter().all(super::Side::remembers_right));
    std::array::from_fn(|i| after[i] - before[i])
}

#[test]
fn a_tick_of_many_regions_looks_at_those_in_which_something_moves() {
    for coupling in [Coupling::Auto, Coupling::Owner] {
        let mut host = asleep(coupling);
        for _ in 0..9 {
            assert_eq!(step(&mut host), [0, 0, 0], "{coupling:?}: nothing moves");
        }
        // A body that comes, and one that is put elsewhere, change no cell.
        let newcomer = described(&mut host, 100, [30.0, 5.0, 30.0]);
        host.insert(vec![newcomer], &[]).unwrap();
        let [_, _, cells] = step(&mut host);
        assert_eq!(cells, 0, "{coupling:?}");
        host.teleport(BodyId::persistent(1), WorldPose::at([-30.0, 9.0, 30.0])).unwrap();
        assert_eq!(step(&mut host)[2], 0, "{coupling:?}");
        // Bodies that fly over borders.
        for id in 1..6 {
            host.steer(BodyId::persistent(id), &Velocity { linear: [40.0, 3.0, 9.0], ..Velocity::default() });
        }
        let mut reached = 0;
        for _ in 0..120 {
            let [looks, ..] = step(&mut host);
            reached = reached.max(looks);
        }
        assert!(reached < 40 * REGIONS, "{coupling:?}: {reached} looks");
        // A plane that moves changes cells.
        let (axis, at) = host.partition().tree().cut_of(RegionId(0)).unwrap();
        assert!(axis != Axis::Y);
        host.repartition(&[TreeChange::Move { vertex: RegionId(0), at: at + 1.0 }], true).unwrap();
        assert_eq!(step(&mut host)[2], REGIONS, "{coupling:?}");
    }
}

/// Of sixteen regions with a sleeping box each, the others rest while a box slides over one border, and the one wakes
/// whose box is hit.
#[test]
fn regions_rest_beside_those_that_something_passes_between() {
    let bounds = Bounds::new([-40.0, -1.0, -40.0], [40.0, 5.0, 40.0]);
    let partition = Partition::new(DistributionTree::halved(bounds, 16).unwrap(), None);
    let leaves = partition.leaves().to_vec();
    let centres: Vec<_> = leaves.iter().map(|&leaf| partition.tree().part(leaf).centre()).collect();
    let settings = StepSettings::default().with_coupling(Coupling::Auto);
    let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
    let mut bodies = vec![described(&mut host, 0, [0.0, -0.5, 0.0])];
    for (id, [x, _, z]) in (1..).zip(centres) {
        bodies.push(described(&mut host, id, [x, 0.5, z]));
    }
    host.insert(bodies, &[]).unwrap();
    for _ in 0..300 {
        host.step().unwrap();
    }
    let resting = |host: &RegionHost| host.sides.iter().filter(|side| side.is_idle()).count();
    assert_eq!(resting(&host), 16);
    let flier = described(&mut host, 100, [-5.0, 2.0, -10.0]);
    host.insert(vec![flier], &[]).unwrap();
    host.step().unwrap();
    let mut least = 16;
    for tick in 0..60 {
        // It flies from one inner region into the next, and on to the box there.
        host.steer(BodyId::persistent(100), &Velocity { linear: [10.0, 0.3, 0.0], ..Velocity::default() });
        host.step().unwrap();
        if tick > 1 {
            least = least.min(resting(&host));
        }
    }
    assert!((13..=14).contains(&least), "{least} of 16 regions rest");
}

/// Makes a host with bricks in three courses, cut so that no island lies whole in one region.
fn cut_wall(exchanges: usize) -> RegionHost {
    let bounds = Bounds::new([-4.0, -1.0, -2.0], [4.0, 6.0, 2.0]);
    let partition = Partition::new(DistributionTree::halved(bounds, 4).unwrap(), None);
    let leaves = partition.leaves().to_vec();
    let settings = StepSettings::default().with_coupling(Coupling::Overlap);
    let settings = StepSettings { island_limit: 0, exchanges, ..settings };
    let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
    let mut bodies = vec![described(&mut host, 0, [0.0, -0.5, 0.0])];
    for brick in 0..24 {
        let at = [f64::from(brick % 8) - 3.5, 0.5 + f64::from(brick / 8), 0.0];
        bodies.push(described(&mut host, 1 + brick, at));
    }
    host.insert(bodies, &[]).unwrap();
    host
}

/// The same to the bit with one exchange per tick. With more, a region that is woken by what another one says
/// in the first exchange rests in the others.
#[test]
fn regions_rest_that_share_bodies_asleep_and_one_that_is_pushed_wakes_the_others_as_ever() {
    for exchanges in [1, 2] {
        let (mut host, mut restless) = (cut_wall(exchanges), cut_wall(exchanges));
        let resting = |host: &RegionHost| host.sides.iter().filter(|side| side.is_idle()).count();
        for kick_m_s in [0.5, 3.0, 9.0] {
            for _ in 0..900 {
                host.step().unwrap();
                restless.step().unwrap();
                restless.sides.iter_mut().for_each(super::Side::end_silence);
                let is_alike = exchanges > 1 || host.states().eq(restless.states());
                assert!(is_alike, "before {kick_m_s} m/s, tick {}", host.tick().0);
            }
            assert_eq!(host.validate(), []);
            let shares = |region: &Region| region.ghost_count() > 0;
            assert!(host.awake_bodies().is_empty() && host.regions().all(shares));
            assert_eq!([resting(&host), resting(&restless)], [4, 0]);
            let kick = Velocity { linear: [kick_m_s, 0.0, 0.0], ..Velocity::default() };
            for host in [&mut host, &mut restless] {
                host.steer(BodyId::persistent(17), &kick);
            }
        }
    }
}
