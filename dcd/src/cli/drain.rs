//! Implements `dcd drain`: takes a node out of a served world.

use std::path::PathBuf;
use std::process::ExitCode;

use super::common::{Common, print};
use super::failure::Failure;
use super::requests::{Verb, ask, node};
use crate::space::NodeId;

/// Takes a node out of a served world, which goes on
///
/// The other nodes take its regions over, as when it leaves by itself; then it ends, with exit code 0, or 3 where its
/// --record is not whole. Started again with its --identity it is let in again, under the same name. The last node is not drained: start another one first.
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
