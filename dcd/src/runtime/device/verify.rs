//! Verifies what other members compute: computes the same once more, apart from the node's own regions, on a
//! thread of its own that nothing waits for.

use std::sync::Arc;
use std::sync::mpsc::{self, Sender};
use std::thread;

use tracing::warn;

use super::{DeviceError, PhysicsDevice};
use crate::cluster::{PhysicsCommand, PhysicsEvent};

/// Receives the results of repeated computations that run on threads of their own.
pub(super) type Listener = Arc<dyn Fn(PhysicsEvent) + Send + Sync>;

/// A repeated computation of what another member computes.
pub(super) enum Twin {
    /// Runs within [`PhysicsDevice::run`], so that each command is done before the next one comes.
    /// Simulations and replays need that, since they must give the same results again.
    Here(Box<PhysicsDevice>),
    /// Runs on a thread of its own, which takes its commands from this channel.
    Apart(Sender<PhysicsCommand>),
}

impl PhysicsDevice {
    /// Makes repeated computations run on threads of their own, which report to `tell`.
    #[cfg(any(test, feature = "net"))]
    pub(in crate::runtime) fn with_twins_apart(
        self,
        tell: impl Fn(PhysicsEvent) + Send + Sync + 'static,
    ) -> Self {
        Self { apart: Some(Arc::new(tell)), ..self }
    }

    /// Carries out a command of a repeated computation; `None` ends the computation. A failure ends nothing
    /// else.
    pub(super) fn verify(&mut self, run: u64, command: Option<Box<PhysicsCommand>>) -> Option<PhysicsEvent> {
        let Some(command) = command else {
            self.runs.remove(&run);
            return None;
        };
        if *command == PhysicsCommand::Anew {
            let twin = self.begin(run).inspect_err(|error| warn!(error, "a participant is not verified"));
            self.runs.insert(run, twin.ok());
            return None;
        }
        let twin = self.runs.get_mut(&run)?;
        let (event, goes_on) = match twin.as_mut()? {
            Twin::Here(device) => device.repeat(run, *command),
            // A thread that has ended answers no more.
            Twin::Apart(commands) => (None, commands.send(*command).is_ok()),
        };
        if !goes_on {
            *twin = None;
        }
        event
    }

    fn begin(&self, run: u64) -> Result<Twin, String> {
        let mut device = Box::new(self.twin(1).map_err(|error| error.to_string())?);
        let Some(tell) = self.apart.clone() else { return Ok(Twin::Here(device)) };
        let (sender, commands) = mpsc::channel();
        let repeat = move || {
            for command in commands {
                let (event, goes_on) = device.repeat(run, command);
                event.into_iter().for_each(|event| tell(event));
                if !goes_on {
                    return;
                }
            }
        };
        let thread = thread::Builder::new().name("dcd-verify".into()).spawn(repeat);
        thread.map(|_| Twin::Apart(sender)).map_err(|error| error.to_string())
    }

    /// Carries out a command as another member does. Returns the result, and whether the computation can go
    /// on.
    fn repeat(&mut self, run: u64, command: PhysicsCommand) -> (Option<PhysicsEvent>, bool) {
        if let PhysicsCommand::Repartition { changes, .. } = &command
            && self.host.as_ref().is_some_and(|host| host.gives_up_bodies(changes))
        {
            return (Some(PhysicsEvent::Verified { run, event: None }), false);
        }
        match self.run(command) {
            Ok(event) => {
                let event = event.map(Box::new);
                (event.map(|event| PhysicsEvent::Verified { run, event: Some(event) }), true)
            }
            Err(error) => {
                warn!(%error, "a participant is verified no longer");
                (None, false)
            }
        }
    }

    /// Forgets all bodies, keeping the world, its shapes and its scenery.
    pub(super) fn begin_anew(&mut self) -> Result<(), DeviceError> {
        let twin = self.twin(self.threads)?;
        let (runs, apart) = (std::mem::take(&mut self.runs), self.apart.take());
        *self = Self { runs, apart, ..twin };
        Ok(())
    }

    /// Makes a device that knows the world, its shapes and what does not move, and computes nothing yet.
    fn twin(&self, threads: usize) -> Result<Self, DeviceError> {
        let world = self.world.clone().expect("a world comes before commands");
        let mut twin = Self::new(threads);
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
    use std::time::Duration;

    use super::*;
    use crate::cluster::Sampling;
    use crate::protocol::{BodyKind, Chunk, Placed};
    use crate::sim::{sim_body, sim_world};
    use crate::space::{BodyId, Tick};

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
            let Some(Twin::Here(twin)) = &physics.runs[&1] else { panic!("it is computed here") };
            let twin = twin.host().expect("it has a world");
            twin.scenery().map(|body| body.id.bits()).collect::<Vec<_>>()
        };
        physics.run(load(1)).unwrap();
        physics.run(verify(PhysicsCommand::Anew)).unwrap();
        physics.run(load(2)).unwrap();
        assert_eq!(known(&physics), [1], "it has not come to that tick");
        physics.run(verify(load(2))).unwrap();
        assert_eq!(known(&physics), [1, 2]);
    }

    #[test]
    fn a_thread_of_its_own_computes_the_same_while_nobody_waits_for_it() {
        let world = sim_world(1);
        let (tree, regions) = (world.tree.clone(), world.tree.leaves().collect::<Vec<_>>());
        let body = sim_body(BodyId::persistent(1), [0.5; 3]);
        let placed = vec![Placed { region: regions[0], body }];
        let (joints, drop) = (Vec::new(), Vec::new());
        let rebuild = PhysicsCommand::Rebuild { tick: Tick(5), tree, regions, placed, joints, drop };
        let accept = |tick, incoming| PhysicsCommand::Accept {
            tick,
            round: 0,
            incoming,
            report: Sampling::All,
            checkpoint: Sampling::All,
            load: false,
        };
        let step = PhysicsCommand::Step { tick: Tick(6), rounds: 1, ops: Vec::new() };
        let commands = [rebuild, accept(Tick(5), Vec::new()), step, accept(Tick(6), Vec::new())];
        let verify = |command| PhysicsCommand::Verify { run: 1, command: Some(Box::new(command)) };
        let (told, events) = mpsc::channel();
        let apart = PhysicsDevice::new(1).with_twins_apart(move |event| told.send(event).unwrap());
        let [mut here, mut apart] = [PhysicsDevice::new(1), apart];
        for device in [&mut here, &mut apart] {
            device.run(PhysicsCommand::World(world.clone())).unwrap();
            device.run(verify(PhysicsCommand::Anew)).unwrap();
        }
        for command in commands {
            let answer = here.run(verify(command.clone())).unwrap().expect("it has an answer");
            assert_eq!(apart.run(verify(command)).unwrap(), None);
            let told = events.recv_timeout(Duration::from_secs(60)).expect("its thread answers");
            assert_eq!(timeless(told), timeless(answer));
        }
        apart.run(PhysicsCommand::Verify { run: 1, command: None }).unwrap();
        std::mem::drop(apart);
        let ended = events.recv_timeout(Duration::from_secs(60));
        assert_eq!(ended, Err(mpsc::RecvTimeoutError::Disconnected), "the thread has ended");
    }

    /// Removes the time that the computation took.
    fn timeless(mut event: PhysicsEvent) -> PhysicsEvent {
        if let PhysicsEvent::Verified { event: Some(event), .. } = &mut event
            && let PhysicsEvent::Settled { stats, .. } = &mut **event
        {
            stats.compute_us = 0;
        }
        event
    }
}
