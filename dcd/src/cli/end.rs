//! Implements `dcd end`: ends the world that a data folder keeps, for all its nodes and clients.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use super::common::{Common, print};
use super::failure::Failure;
use super::values::{of_folder, stands_by};
use crate::cluster::directory::DirectoryError;
use crate::runtime::{ProcessError, WorldEnd, end_world};

/// The most time for a server to end its world: it asks all nodes what they own, and waits for those that
/// hang.
const WAIT: Duration = Duration::from_secs(20);

/// Ends the world of a data folder for all
///
/// A running server tells its nodes and clients, prints its summary and stops. If none runs, the world is
/// removed from the folder. Nodes that still compute it wait for a server without end, or as long as their
/// --give-up says. Keys and used tokens stay.
///
/// Example:
///   dcd end --data /var/lib/dcd
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct End {
    /// The server's data folder
    #[arg(long, value_name = "DIR", default_value = "dcd-data")]
    data: PathBuf,
}

impl End {
    pub(super) fn execute(self, _common: &Common) -> Result<ExitCode, Failure> {
        let data = self.data.display();
        let failed = |error| match error {
            DirectoryError::Unreadable { .. } => of_folder(&error),
            error => ProcessError::from(error).into(),
        };
        match end_world(&self.data, WAIT).map_err(failed)? {
            WorldEnd::ByServer => print("the world has ended, and its server has stopped")?,
            WorldEnd::Removed => {
                print("the world has ended: no server ran, and the folder keeps it no longer")?
            }
            WorldEnd::Nothing => {
                return Err(Failure::usage(format!(
                    "{data} keeps no world; name the folder that its server was started with (--data), and if the world is in etcd, \
                     start its server again and end it then"
                )));
            }
            WorldEnd::StandsBy => return Err(stands_by(&self.data)),
            WorldEnd::Kept => {
                return Err(Failure::run(format!(
                    "the server of {data} has stopped before it ended its world, which is in etcd: if another server goes on with it, end it there \
                     (`dcd end` beside that one), else start this one again and end it then"
                )));
            }
            WorldEnd::Underway => {
                return Err(Failure::run(format!(
                    "the server of {data} has been told to end its world, and is not done; see its log"
                )));
            }
            WorldEnd::Unheard => {
                return Err(Failure::run(format!(
                    "the server of {data} does not answer, and its world goes on; see its log, and whether it hangs"
                )));
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}
