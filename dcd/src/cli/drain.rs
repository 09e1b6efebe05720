//! Implements `dcd drain`: takes a node out of a served world.

use std::path::PathBuf;
use std::process::ExitCode;

use super::common::{Common, print};
use super::failure::Failure;
use super::requests::{Verb, ask, node};
use crate::space::NodeId;

/// Takes a node out of a served world, which goes on
///
/// The other nodes take over its regions, as when the node leaves by itself. Then the node ends, with exit
/// code 0, or with 3 if its --record is not whole. Started again with its --identity, it is let in again
/// under the same name. The last node cannot be drained: start another one first.
///
/// Example:
///   dcd drain --data /var/lib/dcd n2
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Drain {
    /// The server's data folder
    #[arg(long, value_name = "DIR", default_value = "dcd-data")]
    data: PathBuf,
    /// The node, by the name that `dcd status` shows
    #[arg(value_parser = node)]
    node: NodeId,
}

impl Drain {
    pub(super) fn execute(self, _common: &Common) -> Result<ExitCode, Failure> {
        print(&ask(&self.data, Verb::Drain, &self.node.to_string())?)?;
        Ok(ExitCode::SUCCESS)
    }
}
