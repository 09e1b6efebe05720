//! Declares the roles of a process for C.

use dcd::Role;

/// Role of a process in a world.
pub type DcdRole = u32;

/// Local: the process computes all of the world.
pub const DCD_ROLE_LOCAL: DcdRole = 0;
/// Client: hosts avatars in the world, which others compute.
pub const DCD_ROLE_CLIENT: DcdRole = 1;
/// Participant: hosts avatars in the world, and computes a share of it.
pub const DCD_ROLE_PARTICIPANT: DcdRole = 2;
/// Server: holds the world, decides which process computes what, and lets others in.
pub const DCD_ROLE_SERVER: DcdRole = 3;
/// Node: computes a share of the world.
pub const DCD_ROLE_NODE: DcdRole = 4;
/// Builder: a client that hosts avatars and may also change what is the world's own, as the server's program does.
pub const DCD_ROLE_BUILDER: DcdRole = 5;

/// Returns the number of a role.
pub(crate) fn number_of(role: Role) -> DcdRole {
    match role {
        Role::Local => DCD_ROLE_LOCAL,
        Role::Client => DCD_ROLE_CLIENT,
        Role::Participant => DCD_ROLE_PARTICIPANT,
        Role::Server => DCD_ROLE_SERVER,
        Role::Node => DCD_ROLE_NODE,
        Role::Builder => DCD_ROLE_BUILDER,
        _ => unreachable!("dcd and dcd-ffi are of one version"),
    }
}
