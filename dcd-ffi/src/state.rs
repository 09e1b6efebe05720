//! Declares the state of many bodies at a time: lent to C as arrays, or copied by a list of ids.

mod calls;
mod slots;

use dcd::{MovableBody, ViewTime, World as Dcd};

use crate::handle::Mark;
use crate::ids::DcdBodyId;
use crate::pinned::Pinned;
use crate::pointer::Sized32;
use crate::types::{DcdPose, DcdVelocity};
pub use calls::*;
use slots::BodySlots;

/// In DcdStateView.flags: the body sleeps.
pub const DCD_STATE_SLEEPING: u32 = 1;
/// In DcdStateView.flags: this process's interest does not reach the body (dcd_interest_set). The state is that last heard of.
pub const DCD_STATE_OUTSIDE: u32 = 2;

/// Field of a body that dcd_state_read and dcd_state_write copy.
pub type DcdField = u32;

/// The pose: a DcdPose.
pub const DCD_FIELD_POSE: DcdField = 0;
/// The velocity: a DcdVelocity.
pub const DCD_FIELD_VELOCITY: DcdField = 1;
/// The user data: a uint64_t.
pub const DCD_FIELD_USER_DATA: DcdField = 2;
/// The force and torque: a DcdForce, as dcd_body_set_force sets it.
pub const DCD_FIELD_FORCE: DcdField = 3;
/// The kinematic target: a DcdPose, as dcd_body_set_target takes it. It can only be written.
pub const DCD_FIELD_TARGET: DcdField = 4;

/// Force and torque on a body in every step, in world axes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdForce {
    /// Force at the centre of mass, newtons.
    pub force: [f32; 3],
    /// Torque, newton metres.
    pub torque: [f32; 3],
}

/// State of every movable body after a step. Entry i of each array belongs to ids[i]. The order only changes where bodies are made
/// or destroyed. Start from DCD_STATE_VIEW_INIT. The arrays are null when `count` is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdStateView {
    /// Size of this struct: sizeof(DcdStateView).
    pub struct_size: u32,
    /// Length that an array of the program's own, indexed by slot, needs: above every slot of every view up to now.
    pub slot_count: u32,
    /// Number of the step after which the bodies were in this state.
    pub tick: u64,
    /// Length of each array.
    pub count: usize,
    /// Ids of the bodies.
    pub ids: *const DcdBodyId,
    /// Poses of the bodies.
    pub poses: *const DcdPose,
    /// Velocities of the bodies.
    pub velocities: *const DcdVelocity,
    /// User data of the bodies.
    pub user_data: *const u64,
    /// DCD_STATE_… bits of the bodies.
    pub flags: *const u32,
    /// Regions that own the bodies, as in DcdRegionInfo. For a server, which is told no owners, the regions that they lie in.
    pub regions: *const u32,
    /// Slots of the bodies: indices below `slot_count`, by which the program may keep its own data of each body in an array beside
    /// these.
    ///
    /// A body has the same slot in every view of its world (dcd_state_view and dcd_view_state alike) for as long as views show it,
    /// whatever its place in them. Low slots are given first. A slot that becomes free in a view is given anew in a later one, so
    /// no slot belongs to two bodies in two successive views. A program that leaves views out, or calls dcd_checkpoint_restore,
    /// must compare ids.
    pub slots: *const u32,
}

// SAFETY: begins with `struct_size`; every other member is a number or a raw pointer.
unsafe impl Sized32 for DcdStateView {
    const NAME: &'static str = "DcdStateView";
}

/// Arrays that are lent to C, and the slots of the bodies in them.
#[derive(Default)]
pub(crate) struct StateBuffers {
    /// Two sets in turn for dcd_state_view, so that one may be read while the next step fills the other.
    sets: [StateArrays; 2],
    newest: usize,
    /// Says whether the program ever asked for a view. Until then no step fills the arrays.
    wanted: bool,
    /// Arrays that dcd_view_state lends.
    shown: StateArrays,
    slots: BodySlots,
}

#[derive(Default)]
struct StateArrays {
    tick: u64,
    ids: Pinned<DcdBodyId>,
    poses: Pinned<DcdPose>,
    velocities: Pinned<DcdVelocity>,
    user_data: Pinned<u64>,
    flags: Pinned<u32>,
    regions: Pinned<u32>,
    slots: Pinned<u32>,
}

impl StateArrays {
    /// Writes bodies, which come in id order, into the arrays.
    fn fill(
        &mut self,
        world: &Dcd,
        mark: Mark,
        body_slots: &mut BodySlots,
        bodies: impl Iterator<Item = MovableBody>,
    ) {
        // An iterator that knows its exact count spares counting all bodies once more.
        let count = match bodies.size_hint() {
            (least, Some(most)) if least == most => least,
            _ => world.movable_count(),
        };
        self.tick = world.tick().0;
        let ids = self.ids.refill(count);
        let poses = self.poses.refill(count);
        let velocities = self.velocities.refill(count);
        let user_data = self.user_data.refill(count);
        let flags = self.flags.refill(count);
        let regions = self.regions.refill(count);
        let slots = self.slots.refill(count);
        // No more than `count` items, so that the arrays stay where they are.
        bodies.take(count).for_each(|row| {
            ids.push(mark.body(row.id));
            poses.push(row.pose.into());
            velocities.push(row.velocity.into());
            user_data.push(row.user_data as u64);
            let flag = |is: bool, bit: u32| if is { bit } else { 0 };
            flags.push(flag(row.sleeping, DCD_STATE_SLEEPING) | flag(row.outside, DCD_STATE_OUTSIDE));
            regions.push(row.region.0);
            slots.push(body_slots.next(row.id));
        });
        body_slots.end_view();
    }

    fn lend(&self, slot_count: u32) -> DcdStateView {
        DcdStateView {
            struct_size: size_of::<DcdStateView>() as u32,
            slot_count,
            tick: self.tick,
            count: self.ids.len(),
            ids: self.ids.as_ptr(),
            poses: self.poses.as_ptr(),
            velocities: self.velocities.as_ptr(),
            user_data: self.user_data.as_ptr(),
            flags: self.flags.as_ptr(),
            regions: self.regions.as_ptr(),
            slots: self.slots.as_ptr(),
        }
    }
}

impl StateBuffers {
    pub(crate) fn after_step(&mut self, world: &Dcd, mark: Mark) {
        if self.wanted {
            self.newest = 1 - self.newest;
            self.fill_newest(world, mark);
        }
    }

    fn view(&mut self, world: &Dcd, mark: Mark) -> DcdStateView {
        // Before the first step there is no state "after the last step", so the view shows what was made up to now.
        if !self.wanted || world.tick().0 == 0 {
            self.wanted = true;
            self.fill_newest(world, mark);
        }
        self.sets[self.newest].lend(self.slots.count())
    }

    fn fill_newest(&mut self, world: &Dcd, mark: Mark) {
        self.sets[self.newest].fill(world, mark, &mut self.slots, world.movable_bodies());
    }

    /// Writes the bodies as they are shown into the arrays, and lends them.
    pub(crate) fn show(&mut self, world: &Dcd, mark: Mark, time: &ViewTime) -> DcdStateView {
        self.shown.fill(world, mark, &mut self.slots, world.movable_bodies_at(time));
        self.shown.lend(self.slots.count())
    }
}
