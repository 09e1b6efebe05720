//! Provides the world and the bodies of simulated clusters.

use std::sync::Arc;

use super::Random;
use crate::protocol::{
    BodyKind, BodyRecord, BodyState, BodyTraits, Coupling, EnvironmentProperties, Pace, StepRecord,
    SyncProtocol, Thresholds, Velocity, WorldPose,
};
use crate::space::{BodyId, Bounds, DistributionTree, Epoch};

/// Returns a world of 16 × 8 × 8 m with this number of regions, without gravity.
pub fn sim_world(regions: usize) -> EnvironmentProperties {
    let bounds = Bounds::new([0.0; 3], [16.0, 8.0, 8.0]);
    EnvironmentProperties {
        world: 1,
        step: StepRecord {
            gravity: [0.0; 3],
            dt_s: 1.0 / 60.0,
            solver_iterations: 4,
            coupling: Coupling::Owner,
            exchanges: 1,
            depth: 2,
            island_limit: 256,
            tolerance_m_s: 0.03,
            speed_limit_m_s: 400.0,
        },
        tree: DistributionTree::halved(bounds, regions).expect("a small number of regions"),
        balance: None,
        fidelity: crate::fidelity::Fidelity::Off,
        viewpoints: Vec::new(),
        halo_m: Some(1.0),
        avatar_speed_limit: 20.0,
        protocol: SyncProtocol::Synchronised,
        thresholds: Thresholds::default(),
        pace: Pace::RealTime,
        state_every: 3,
        last_tick: None,
        relays_above: None,
    }
}

/// Returns whether two velocities are of the same size along each axis, as precisely as clients are told. The
/// signs may differ, since a body may have bounced.
pub(super) fn as_fast(one: Velocity, other: Velocity) -> bool {
    (0..3).all(|axis| (one.linear[axis].abs() - other.linear[axis].abs()).abs() <= 0.001)
}

/// Returns a body at rest without colliders, which is all that the stand-in needs.
pub fn sim_body(id: BodyId, translation: [f64; 3]) -> BodyRecord {
    let traits = BodyTraits {
        kind: BodyKind::Dynamic,
        enabled: true,
        linear_damping: 0.0,
        angular_damping: 0.0,
        gravity_scale: 1.0,
        locked_axes: 0,
        dominance: 0,
        ccd: false,
        soft_ccd_m: 0.0,
        fast_rotation: false,
        gyroscopic: false,
        extra_solver_iterations: 0,
        extra_pgs_iterations: 0,
        sleep_linear_threshold: 0.4,
        sleep_angular_threshold: 0.5,
        sleep_after_s: 2.0,
        extra_mass: None,
        character: None,
        vehicle: None,
        colliders: Vec::new(),
    };
    let state = BodyState {
        pose: WorldPose::at(translation),
        velocity: Velocity::default(),
        force: [0.0; 3],
        torque: [0.0; 3],
        sleeping: false,
        still_s: 0.0,
        gait: None,
        drive: None,
        contact_offset: None,
    };
    BodyRecord { id, epoch: Epoch(0), state, traits: Arc::new(traits), user_data: 0 }
}

/// Returns a body at a random place in the world, with a random speed of at most `most_m_s` along each axis.
pub(super) fn drifting(id: BodyId, most_m_s: f64, random: &mut Random) -> BodyRecord {
    let mut body = sim_body(id, [random.unit() * 16.0, random.unit() * 8.0, random.unit() * 8.0]);
    body.state.velocity.linear = std::array::from_fn(|_| ((random.unit() * 2.0 - 1.0) * most_m_s) as f32);
    body
}

/// Returns an ordinary collider of this shape.
#[cfg(test)]
pub(crate) fn sim_collider(shape: &crate::protocol::ShapeRecord) -> crate::protocol::ColliderRecord {
    use crate::protocol::{ColliderMass, ColliderRecord, CombineRule, Groups, Pose};
    let all = Groups { memberships: u32::MAX, filter: u32::MAX, any: false };
    ColliderRecord {
        shape: shape.hash(),
        pose: Pose { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] },
        mass: ColliderMass::Density(1.0),
        friction: 0.5,
        friction_rule: CombineRule::Average,
        restitution: 0.0,
        restitution_rule: CombineRule::Average,
        sensor: false,
        enabled: true,
        collision_groups: all,
        solver_groups: all,
        collision_types: 0,
        events: 0,
        hooks: 0,
        force_event_threshold_n: 0.0,
        contact_skin_m: 0.0,
        user_data: 0,
    }
}
