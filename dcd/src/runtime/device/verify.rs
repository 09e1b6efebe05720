//! Computes once more, apart from the regions of a node, what another member computes.

use tracing::warn;

use super::{DeviceError, PhysicsDevice};
use crate::cluster::{PhysicsCommand, PhysicsEvent};

impl PhysicsDevice {
    /// Carries out a command of what is computed once more, which no failure of that keeps from anything.
    pub(super) fn verify(&mut self, run: u64, command: Option<Box<PhysicsCommand>>) -> Option<PhysicsEvent> {
        let Some(command) = command else {
            self.runs.remove(&run);
            return None;
        };
        if !self.runs.contains_key(&run) {
            let twin = self.twin().inspect_err(|error| warn!(%error, "a participant is not verified"));
            self.runs.insert(run, twin.ok());
        }
        let device = self.runs.get_mut(&run)?;
        let twin = device.as_mut()?;
        if let PhysicsCommand::Repartition { changes, .. } = &*command
            && twin.host.as_ref().is_some_and(|host| host.gives_up_bodies(changes))
        {
            *device = None;
            return Some(PhysicsEvent::Verified { run, event: None });
        }
        match twin.run(*command) {
            Ok(event) => event.map(|event| PhysicsEvent::Verified { run, event: Some(Box::new(event)) }),
            Err(error) => {
                warn!(%error, "a participant is verified no longer");
                *device = None;
                None
            }
        }
    }

    /// Makes a device that knows the world, its shapes and what does not move, and computes nothing yet.
    fn twin(&self) -> Result<Self, DeviceError> {
        let world = self.world.clone().expect("a world comes before commands");
        let mut twin = Self::new(1);
        twin.run(PhysicsCommand::World(world))?;
        if let Some(own) = &self.host {
            let host = twin.world();
            *host.shapes_mut() = own.shapes().clone();
            host.insert(own.scenery().cloned().collect(), &[])?;
        }
        Ok(twin)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::protocol::{BodyKind, Chunk};
    use crate::sim::{sim_body, sim_world};
    use crate::space::BodyId;

    #[test]
    fn what_is_computed_once_more_knows_what_does_not_move_as_it_was_at_its_beginning_and_the_rest_in_turn() {
        let mut physics = PhysicsDevice::new(1);
        physics.run(PhysicsCommand::World(sim_world(2))).unwrap();
        let load = |id| {
            let mut body = sim_body(BodyId::persistent(id), [0.0; 3]);
            Arc::make_mut(&mut body.traits).kind = BodyKind::Fixed;
            PhysicsCommand::Load(Chunk::Bodies(vec![body]))
        };
        let verify = |command| PhysicsCommand::Verify { run: 1, command: Some(Box::new(command)) };
        let known = |physics: &PhysicsDevice| {
            let twin = physics.runs[&1].as_ref().and_then(PhysicsDevice::host).expect("it is computed");
            twin.scenery().map(|body| body.id.bits()).collect::<Vec<_>>()
        };
        physics.run(load(1)).unwrap();
        physics.run(verify(PhysicsCommand::Load(Chunk::Shapes(Vec::new())))).unwrap();
        physics.run(load(2)).unwrap();
        assert_eq!(known(&physics), [1], "it has not come to that tick");
        physics.run(verify(load(2))).unwrap();
        assert_eq!(known(&physics), [1, 2]);
    }
}
