//! Implements `dcd backup`: copies the data folder of a running server.

use std::path::PathBuf;
use std::process::ExitCode;

use super::common::{Common, print};
use super::failure::Failure;
use super::requests::{Verb, ask_about_file};
use super::values::{is_used, of_folder};
use crate::runtime::{is_served, is_standby};

/// Copies the data folder of a running server: world, keys and joins
///
/// A server with the copy as its --data goes on as this one would if it died now: nodes and clients keep
/// their identities, and used tokens stay used. The world runs on meanwhile. The server writes the copy, so
/// it needs the permissions for that. If no server runs, copy the folder yourself.
///
/// `dcd save` writes only the bodies of the world, as they are after one tick.
///
/// Example:
///   dcd backup --data /var/lib/dcd /var/lib/dcd-backup/monday
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Backup {
    /// The server's data folder
    #[arg(long, value_name = "DIR", default_value = "dcd-data")]
    data: PathBuf,
    /// The folder to create; it must not exist yet. Whoever can read it can let processes in
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

impl Backup {
    pub(super) fn execute(self, _common: &Common) -> Result<ExitCode, Failure> {
        if is_used(&self.data)?
            && !is_standby(&self.data)
            && !is_served(&self.data).map_err(|error| of_folder(&error))?
        {
            return Err(Failure::usage(format!(
                "no server serves the world of {}: copy the folder as it is (cp -a), or ask beside the server that has the world in etcd",
                self.data.display()
            )));
        }
        print(&ask_about_file(&self.data, Verb::Backup, &self.folder)?)?;
        Ok(ExitCode::SUCCESS)
    }
}
