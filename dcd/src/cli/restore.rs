//! Implements `dcd restore`: lets a running server go back to a saved world.

use std::path::PathBuf;
use std::process::ExitCode;

use super::common::{Common, print};
use super::failure::Failure;
use super::requests::{Verb, ask_about_file};

/// Lets a running server go back to a saved world, or on with another one, for all its nodes and clients
///
/// The file is from `dcd save`, `dcd run --save` or a program, by the same version of dcd, with the same tick
/// length and gravity. Avatars belong to their clients: those that are in both worlds go back to where they
/// were, and none comes or goes. Do not restore files of people whom you do not trust.
///
/// Example:
///   dcd restore --data /var/lib/dcd before-the-boss.dcd
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Restore {
    /// The server's data folder
    #[arg(long, value_name = "DIR", default_value = "dcd-data")]
    data: PathBuf,
    /// The saved world
    file: PathBuf,
}

impl Restore {
    pub(super) fn execute(self, _common: &Common) -> Result<ExitCode, Failure> {
        print(&ask_about_file(&self.data, Verb::Restore, &self.file)?)?;
        Ok(ExitCode::SUCCESS)
    }
}
