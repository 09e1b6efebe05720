//! Declares the roles of a process as C sees them.

use dcd::Role;

/// The role of a process in a world.
pub type DcdRole = u32;

/// Computes all of it.
pub const DCD_ROLE_LOCAL: DcdRole = 0;
/// Hosts avatars in it; others compute it.
pub const DCD_ROLE_CLIENT: DcdRole = 1;
/// Hosts avatars in it, and computes a share of it.
pub const DCD_ROLE_PARTICIPANT: DcdRole = 2;
/// Holds it: decides who computes what, and lets others in.
pub const DCD_ROLE_SERVER: DcdRole = 3;
/// Computes a share of it.
pub const DCD_ROLE_NODE: DcdRole = 4;
/// Hosts avatars in it as a client, and may change what is the world's own as the server's program does.
pub const DCD_ROLE_BUILDER: DcdRole = 5;

/// The number of a role.
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
