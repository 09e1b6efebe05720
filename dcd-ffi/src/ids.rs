//! Declares the types of handles as C sees them: opaque numbers, each in a struct of its own.

/// A world, whatever its role. 0 is null.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdWorld {
    /// Opaque.
    pub v: u64,
}

/// A body. 0 is null. An id is not given again, so that of a destroyed body stays stale for ever, unless dcd_checkpoint_restore
/// goes back to before it was given, and but for avatars: a client that leaves and joins again with its identity file numbers new ones from those on
/// that are left of its last stay, so that one may get the id of one that was destroyed. Forget ids at DCD_BODY_REMOVED. So may what a
/// builder makes after its server was started again. An id of another world is stale in this one. A body has one id for as long as the world's
/// handle lives, whoever owns it; other processes, and later handles of the same world, know it by other ids.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdBodyId {
    /// Opaque.
    pub v: u64,
}

/// A shape of one world. 0 is null.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdShapeId {
    /// Opaque.
    pub v: u64,
}

/// A joint. 0 is null; an id is not given again, but after dcd_checkpoint_restore, and of builders' joints, as for bodies.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdJointId {
    /// Opaque.
    pub v: u64,
}

/// A connection of one world with another process; 0 is null. It outlives a link that breaks and is made anew.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdConnectionId {
    /// Opaque.
    pub v: u64,
}

/// A local world as it was between two steps. 0 is null; an id is never given again.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdCheckpointId {
    /// Opaque.
    pub v: u64,
}

/// Rays, casts or overlaps that were submitted and whose answer was not fetched yet. 0 is null; an id is never given again.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdQueryId {
    /// Opaque.
    pub v: u64,
}
