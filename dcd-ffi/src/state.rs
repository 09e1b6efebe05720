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
/// In DcdStateView.flags: your interest does not reach the body (dcd_interest_set); the state is that last heard of.
pub const DCD_STATE_OUTSIDE: u32 = 2;

/// The field of a body that dcd_state_read and dcd_state_write copy.
pub type DcdField = u32;

/// A DcdPose.
pub const DCD_FIELD_POSE: DcdField = 0;
/// A DcdVelocity.
pub const DCD_FIELD_VELOCITY: DcdField = 1;
/// A uint64_t.
pub const DCD_FIELD_USER_DATA: DcdField = 2;
/// A DcdForce, as dcd_body_set_force sets it.
pub const DCD_FIELD_FORCE: DcdField = 3;
/// A DcdPose, as dcd_body_set_target takes it; to be written only.
pub const DCD_FIELD_TARGET: DcdField = 4;

/// The force and torque on a body in every step, in world axes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdForce {
    /// At the centre of mass, newtons.
    pub force: [f32; 3],
    /// Newton metres.
    pub torque: [f32; 3],
}

/// The state of every movable body after a step: entry i of each array belongs to ids[i], in an order that only changes where bodies are
/// made or destroyed. Start from DCD_STATE_VIEW_INIT. The arrays are null when `count` is 0.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdStateView {
    /// sizeof(DcdStateView).
    pub struct_size: u32,
    /// Above every slot of every view up to now: the length that an array of yours by slot needs.
    pub slot_count: u32,
    /// After which step.
    pub tick: u64,
    /// Length of each array.
    pub count: usize,
    /// Which bodies.
    pub ids: *const DcdBodyId,
    /// Where they are.
    pub poses: *const DcdPose,
    /// How they move.
    pub velocities: *const DcdVelocity,
    /// Your own.
    pub user_data: *const u64,
    /// DCD_STATE_… bits.
    pub flags: *const u32,
    /// Their owners, as in DcdRegionInfo; of a server, which is told no owners, the regions that they lie in.
    pub regions: *const u32,
    /// Where you may keep your own of the bodies, in an array beside: a body has its slot, below `slot_count`, in every view of its
    /// world (dcd_state_view and dcd_view_state alike) for as long as views show it, whatever its place in them. Low slots are given
    /// first. A slot that becomes free in a view is given anew in a later one, so none is of two bodies in two successive views; who
    /// leaves views out, or calls dcd_checkpoint_restore, compares ids.
    pub slots: *const u32,
}

// SAFETY: begins with `struct_size`; every other member is a number or a raw pointer.
unsafe impl Sized32 for DcdStateView {
    const NAME: &'static str = "DcdStateView";
}

/// The arrays that are lent to C, and the slots of the bodies in them.
#[derive(Default)]
pub(crate) struct StateBuffers {
    /// Two in turn for dcd_state_view, so that one may be read while the next step fills the other.
    sets: [StateArrays; 2],
    newest: usize,
    /// Whether anybody ever asked; nobody pays who does not.
    wanted: bool,
    /// What dcd_view_state lends.
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
    /// Takes down bodies, which come in id order.
    fn fill(
        &mut self,
        world: &Dcd,
        mark: Mark,
        body_slots: &mut BodySlots,
        bodies: impl Iterator<Item = MovableBody>,
    ) {
        // Who has them counted already need not be asked for all of them once more.
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
        // No more than `count`, which keeps the arrays where they are.
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
        // Before the first step there is no "after the last step", so it shows what was made up to now.
        if !self.wanted || world.tick().0 == 0 {
            self.wanted = true;
            self.fill_newest(world, mark);
        }
        self.sets[self.newest].lend(self.slots.count())
    }

    fn fill_newest(&mut self, world: &Dcd, mark: Mark) {
        self.sets[self.newest].fill(world, mark, &mut self.slots, world.movable_bodies());
    }

    /// Takes down the bodies as they are shown, and lends them.
    pub(crate) fn show(&mut self, world: &Dcd, mark: Mark, time: &ViewTime) -> DcdStateView {
        self.shown.fill(world, mark, &mut self.slots, world.movable_bodies_at(time));
        self.shown.lend(self.slots.count())
    }
}
