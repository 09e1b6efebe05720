//! Computes the worlds of replays: the physics of nodes, and local worlds whose operations are repeated.

use std::any::Any;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

use rapier3d::prelude::*;

use super::recorded::{bodies_of, touching_in};
use super::{LocalWorld, PhysicsDevice, WorldError};
use crate::cluster::CanBuild;
use crate::physics::{RegionHost, RepeatedHooks, can_build};
use crate::protocol::{HookAnswer, HookCall, read_state};
use crate::recording::{
    BodyBits, Computers, LocalPhysics, Operation, Physics, Readout, RecordingError, Replayed, last_tick, open,
};
use crate::space::{BodyId, RegionId, Tick};

/// Opens a recording of a local world or of a node, which `threads` threads will compute. `stand_in` makes the
/// physics of simulated nodes; without it, recordings of these are refused.
pub fn open_recording(
    path: &Path,
    threads: usize,
    stand_in: Option<MakePhysics>,
) -> Result<Box<dyn Replayed>, RecordingError> {
    open(read(path)?, &Here { threads, stand_in })
}

/// Returns the last tick of a recording, as far as it can be read.
pub fn last_recorded_tick(path: &Path) -> Result<Tick, RecordingError> {
    last_tick(read(path)?)
}

fn read(path: &Path) -> std::io::Result<BufReader<File>> {
    Ok(BufReader::with_capacity(1 << 18, File::open(path)?))
}

/// Returns the regions that a replay computes. `None` before there are any, and for simulated nodes, whose
/// bodies are points.
pub fn replayed_regions(replayed: &dyn Replayed) -> Option<&RegionHost> {
    let computer: &dyn Any = replayed.readout();
    match computer.downcast_ref::<PhysicsDevice>() {
        Some(device) => device.host(),
        None => Some(computer.downcast_ref::<LocalComputer>()?.world.as_ref()?.host()),
    }
}

/// Makes the physics of one node.
pub type MakePhysics = fn() -> Box<dyn Physics>;

pub(super) struct Here {
    pub(super) threads: usize,
    pub(super) stand_in: Option<MakePhysics>,
}

impl Computers for Here {
    fn node(&self, stand_in: bool) -> Option<Box<dyn Physics>> {
        match stand_in {
            true => self.stand_in.map(|make| make()),
            false => Some(Box::new(PhysicsDevice::new(self.threads))),
        }
    }

    fn can_build(&self) -> Option<CanBuild> {
        Some(can_build)
    }

    fn local(&self) -> Option<Box<dyn LocalPhysics>> {
        Some(Box::new(LocalComputer::new(self.threads)))
    }
}

/// A local world in which a recording is repeated.
struct LocalComputer {
    threads: usize,
    world: Option<LocalWorld>,
    /// The answers of the program's hooks in the step that follows.
    answers: Vec<(HookCall, HookAnswer)>,
}

impl LocalComputer {
    fn new(threads: usize) -> Self {
        Self { threads, world: None, answers: Vec::new() }
    }

    fn world(&mut self) -> Result<&mut LocalWorld, String> {
        self.world.as_mut().ok_or_else(|| "it has no beginning".to_owned())
    }
}

impl Readout for LocalComputer {
    fn regions(&self) -> Vec<RegionId> {
        self.world.iter().flat_map(|world| world.regions()).map(|region| region.id()).collect()
    }

    fn bodies(&self, region: RegionId) -> Box<dyn Iterator<Item = (BodyId, BodyBits)> + '_> {
        let regions = self.world.iter().flat_map(|world| world.regions());
        Box::new(regions.filter(move |one| one.id() == region).flat_map(bodies_of))
    }

    fn set(&mut self, body: BodyId, bits: &BodyBits) -> bool {
        self.world.as_mut().is_some_and(|world| super::recorded::disturb(world.host_mut(), body, bits))
    }

    fn touching(&self, body: BodyId) -> Vec<BodyId> {
        let owned = self.world.as_ref().and_then(|world| world.host().owned(body));
        owned.map_or_else(Vec::new, |(region, handle)| touching_in(region, handle))
    }
}

impl LocalPhysics for LocalComputer {
    fn restore(&mut self, snapshot: &[u8]) -> Result<(), String> {
        let mut world = LocalWorld::restore(snapshot, self.threads).map_err(|error| error.to_string())?;
        if world.follows_times() {
            world.host_mut().hold_cut();
        }
        self.world = Some(world);
        Ok(())
    }

    fn step(&mut self) -> Result<Tick, String> {
        self.with_answers(|world| world.step().map_err(|error| error.to_string()).map(|()| world.tick()))
    }

    fn repeat(&mut self, operation: Operation) -> Result<(), String> {
        match operation {
            Operation::Answers(answers) => {
                self.answers.extend(answers);
                Ok(())
            }
            Operation::Paces(paces) => {
                let can_be = self.world()?.host_mut().follow_paces(paces);
                can_be.then_some(()).ok_or_else(|| "regions are stepped at no such pace".to_owned())
            }
            operation => self.with_answers(|world| repeat(world, operation)),
        }
    }
}

impl LocalComputer {
    /// Has the world do something in which hooks give the answers that were recorded before it.
    fn with_answers<T>(
        &mut self,
        act: impl FnOnce(&mut LocalWorld) -> Result<T, String>,
    ) -> Result<T, String> {
        let answers = std::mem::take(&mut self.answers);
        let world = self.world()?;
        if answers.is_empty() {
            return act(world);
        }
        world.set_hooks(Some(Arc::new(RepeatedHooks::new(answers))));
        let done = act(world);
        world.set_hooks(None);
        done
    }
}

/// Does once more what a program did to its world.
fn repeat(world: &mut LocalWorld, operation: Operation) -> Result<(), String> {
    let done = match operation {
        Operation::Insert { bodies, shapes } => {
            let known =
                shapes.into_iter().try_for_each(|shape| world.host_mut().shapes_mut().add(shape).map(drop));
            known.map_err(|error| error.to_string())?;
            let host = world.host_mut();
            let attended = bodies.iter().try_for_each(|body| host.attend_new(body));
            let inserted = attended.and_then(|()| host.insert(bodies, &[]));
            return inserted.map_err(|error| error.to_string());
        }
        Operation::InsertJoint(joint) => {
            let host = world.host_mut();
            let tied = host.attend_ends(&joint).and_then(|()| host.tie(*joint));
            return tied.map_err(|error| error.to_string());
        }
        Operation::Update { body, copies } => {
            let mut copies = copies.iter();
            world.update(body, |body| assign::<RigidBody>(body, copies.next())).map(drop)
        }
        Operation::UpdateJoint { joint, copies } => {
            let mut copies = copies.iter();
            world.update_joint(joint, |joint| assign::<GenericJoint>(joint, copies.next()))
        }
        // Shapes that no body has any more are kept: bodies with such a shape that come later were
        // recorded without it.
        Operation::Remove(body) => {
            let host = world.host_mut();
            let removed = host.attend(body).map(|()| host.remove(body));
            let removed = removed.map_err(WorldError::from);
            removed.and_then(|held| held.then_some(()).ok_or(WorldError::NoBody(body)))
        }
        Operation::RemoveJoint(joint) => world.remove_joint(joint),
        Operation::Push(push) => world.push(&push),
        Operation::SetPose(body, pose) => world.set_pose(body, pose),
        Operation::SetNextPose(body, pose) => world.set_next_pose(body, pose),
        Operation::SetVelocity(body, velocity) => world.set_velocity(body, velocity),
        Operation::Drive(body, drive) => world.drive(body, &drive),
        Operation::MovePlane(vertex, at) => world.move_plane(vertex, at),
        Operation::Look(viewpoints) => world.set_viewpoints(&viewpoints),
        Operation::Answers(_) | Operation::Paces(_) | Operation::Seed(_) | Operation::Restore => Ok(()),
    };
    done.map_err(|error| error.to_string())
}

/// Gives a copy the state that it had after a program's change.
fn assign<T: serde::de::DeserializeOwned>(to: &mut T, bytes: Option<&Vec<u8>>) {
    if let Some(value) = bytes.and_then(|bytes| read_state(&mut &bytes[..]).ok()) {
        *to = value;
    }
}
