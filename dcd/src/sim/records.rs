//! Records the nodes of a simulated cluster, and flips a bit of a body on one of them, so that tests see
//! whether a replay finds it.

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

/// A bit that was flipped on one node, which goes on as if nothing had happened.
#[derive(Clone, Debug, PartialEq)]
pub struct Flipped {
    /// The node.
    pub node: NodeId,
    /// The tick after which the bit was flipped.
    pub tick: Tick,
    /// The region that owns the body.
    pub region: RegionId,
    /// The body.
    pub body: BodyId,
    /// The name of the field that changed.
    pub field: &'static str,
    /// The value of the field before and after.
    pub values: [f64; 2],
}

/// Flips a random bit of a random body, such that its place stays near the world and its speed can be told.
/// Returns `None` if there is no body.
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
        // Other members refuse values that are no numbers or no rotations.
        if values[1].abs() < 30.0 && pose.check().is_ok() && velocity.check().is_ok() {
            physics.set(body, &after);
            return Some(Flipped { node, tick, region, body, field: FIELDS[field].0, values });
        }
    }
}
