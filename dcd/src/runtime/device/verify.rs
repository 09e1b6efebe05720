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
