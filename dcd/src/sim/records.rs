//! Records the nodes of a simulated cluster, and flips a bit of a body on one of them, to see that a replay finds it.

use std::io::{self, Write};
use std::sync::{Arc, Mutex, PoisonError};

use super::{Engine, Random};
use crate::cluster::NodeConfig;
use crate::protocol::{Check, Velocity, WorldPose};
use crate::recording::{FIELDS, Recorder};
use crate::space::{BodyId, NodeId, RegionId, Tick};

/// A recording in memory.
#[derive(Clone, Debug, Default)]
pub struct Tape(Arc<Mutex<Vec<u8>>>);

impl Tape {
    /// Returns what is recorded so far.
    pub fn bytes(&self) -> Vec<u8> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(super) fn recorder(&self, config: &NodeConfig, stand_in: bool) -> Recorder {
        Recorder::of_node(self.clone(), config, stand_in).expect("memory can be written")
    }
}

impl Write for Tape {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A bit that is flipped on one node, which goes on with it as if nothing had happened.
#[derive(Clone, Debug, PartialEq)]
pub struct Flipped {
    /// On which node.
    pub node: NodeId,
    /// After which tick.
    pub tick: Tick,
    /// Of which region.
    pub region: RegionId,
    /// Of which body.
    pub body: BodyId,
    /// Of which field.
    pub field: &'static str,
    /// What the field was, and is.
    pub values: [f64; 2],
}

/// Flips a random bit of a random body, one that leaves a place near the world and a speed that can be told; `None` where there is no body.
pub(super) fn flip(
    physics: &mut dyn Engine,
    node: NodeId,
    tick: Tick,
    random: &mut Random,
) -> Option<Flipped> {
    let regions = physics.regions().into_iter();
    let owned: Vec<_> =
        regions.flat_map(|region| physics.bodies(region).map(move |body| (region, body))).collect();
    if owned.is_empty() {
        return None;
    }
    loop {
        let (region, (body, before)) = owned[random.below(owned.len() as u64) as usize];
        let after = before.flipped(random.below(512) as usize);
        let field = after.first_difference(&before)?;
        let values = [before.value(field), after.value(field)];
        let pose = WorldPose { translation: after.translation_f64(), rotation: after.rotation() };
        let velocity = Velocity { linear: after.linvel(), angular: after.angvel() };
        // Others refuse what is no number or no rotation.
        if values[1].abs() < 30.0 && pose.check().is_ok() && velocity.check().is_ok() {
            physics.set(body, &after);
            return Some(Flipped { node, tick, region, body, field: FIELDS[field].0, values });
        }
    }
}
