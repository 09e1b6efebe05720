//! Moves, pushes and drives bodies of a local world.

use super::LocalWorld;
use crate::physics::HostError;
use crate::protocol::{Check, Drive, Push, Velocity, WorldPose};
use crate::recording::Operation;
use crate::runtime::WorldError;
use crate::runtime::config::check_speed;
use crate::space::BodyId;

impl LocalWorld {
    /// Pushes a dynamic body, and wakes it.
    pub fn push(&mut self, push: &Push) -> Result<(), WorldError> {
        let refused = |range| {
            let Push { body, linear, angular, .. } = push;
            let value = match push.lasts {
                true => format!("a force of {linear:?} N and {angular:?} N m on {body}"),
                false => format!("an impulse of {linear:?} N s and {angular:?} N m s on {body}"),
            };
            Err(WorldError::Setting { what: "push", value, range })
        };
        if push.check().is_err() {
            return refused("give finite numbers");
        }
        self.host.attend(push.body)?;
        if self.host.is_too_much(push) {
            return refused("it would make the body faster than 1e6 m/s or 1e6 rad/s; push it less");
        }
        let done = self.host.push(push);
        self.tape(done, || Operation::Push(*push));
        if done { Ok(()) } else { Err(WorldError::NoBody(push.body)) }
    }

    /// Moves a body to a pose at once.
    pub fn set_pose(&mut self, body: BodyId, pose: WorldPose) -> Result<(), WorldError> {
        if pose.is_valid() && self.contains(body) {
            self.host.attend(body)?;
            self.host.attend_at(pose.translation)?;
        }
        let done = self.or_spoil(|world| Ok(world.host.teleport(body, pose)?))?;
        self.tape(done, || Operation::SetPose(body, pose));
        if done { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Sets the kinematic target of a position-based kinematic body, which it reaches at the end of the next
    /// tick.
    pub fn set_next_pose(&mut self, body: BodyId, pose: WorldPose) -> Result<(), WorldError> {
        if pose.is_valid() {
            self.host.attend(body)?;
        }
        let done = self.host.send_to(body, pose)?;
        self.tape(done, || Operation::SetNextPose(body, pose));
        if done { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Sets a body's velocity and wakes it.
    pub fn set_velocity(&mut self, body: BodyId, velocity: Velocity) -> Result<(), WorldError> {
        if !velocity.is_finite() {
            return Err(HostError::NotFinite(body).into());
        }
        let limit_m_s = self.host.settings().speed_limit_m_s();
        if !velocity.is_within(limit_m_s)
            && let Some(mut record) = self.host.record(body)
        {
            record.state.velocity = velocity;
            check_speed(&record, limit_m_s)?;
        }
        self.host.attend(body)?;
        let done = self.host.steer(body, &velocity);
        self.tape(done, || Operation::SetVelocity(body, velocity));
        if done { Ok(()) } else { Err(WorldError::NoBody(body)) }
    }

    /// Sets what the driver of a vehicle does from now on, and wakes the vehicle.
    pub(crate) fn drive(&mut self, body: BodyId, drive: &Drive) -> Result<(), WorldError> {
        if self.host.traits(body).is_some_and(|traits| traits.vehicle.is_some()) {
            self.host.attend(body)?;
        }
        let done = self.host.drive(body, drive);
        self.tape(done, || Operation::Drive(body, *drive));
        match done {
            true => Ok(()),
            false if self.contains(body) => Err(WorldError::NoVehicle(body)),
            false => Err(WorldError::NoBody(body)),
        }
    }
}
