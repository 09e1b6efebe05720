//! Declares the types of handles for C: opaque numbers, each in a struct of its own.

/// Handle of a world of any role. 0 is null.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdWorld {
    /// Opaque number.
    pub v: u64,
}

/// Id of a body. 0 is null. A body has one id for as long as the world's handle lives, whichever region owns it. Other processes,
/// and later handles of the same world, know it by other ids. An id of another world is stale in this world.
///
/// An id is not given again, so that the id of a destroyed body stays stale for ever. Forget ids at DCD_CHANGE_REMOVED, because there
/// are exceptions:
/// - dcd_checkpoint_restore goes back to a time before the id was given.
/// - A client that leaves and joins again with its identity file numbers new avatars from those on that are left of its last stay.
///   A new avatar may get the id of a destroyed one.
/// - After its server was started again, a builder may get the id of a destroyed body for what it makes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdBodyId {
    /// Opaque number.
    pub v: u64,
}

/// Id of a shape of one world. 0 is null.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdShapeId {
    /// Opaque number.
    pub v: u64,
}

/// Id of a joint. 0 is null. An id is not given again, except after dcd_checkpoint_restore and for the joints of builders, as with
/// DcdBodyId.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdJointId {
    /// Opaque number.
    pub v: u64,
}

/// Id of a connection of one world with another process. 0 is null. It stays the same when the link breaks and is made anew.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdConnectionId {
    /// Opaque number.
    pub v: u64,
}

/// Id of a checkpoint: a local world as it was between two steps. 0 is null. An id is never given again.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdCheckpointId {
    /// Opaque number.
    pub v: u64,
}

/// Id of an open query: rays, casts or overlaps that were submitted and whose answer was not fetched yet. 0 is null. An id is never
/// given again.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcdQueryId {
    /// Opaque number.
    pub v: u64,
}
