//! Implements `dcd token`: prints tokens with which processes join a server.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, SystemTime};

use super::common::{Common, print};
use super::failure::Failure;
use super::values::{duration, is_used};
use crate::net::{Authority, JoinRole};

/// Prints tokens, one per line; each lets one process (or --uses many) join the server of a data folder
///
/// The server counts joins durably. It need not run for this command. Whoever may read the folder may make
/// tokens.
///
/// Example:
///   dcd node --server 192.0.2.7:7420 --token $(dcd token --role node)
#[derive(clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Token {
    /// The server's data folder
    #[arg(long, value_name = "DIR", default_value = "dcd-data")]
    data: PathBuf,
    /// What the process joins as: node, client, participant (both in one process), or builder (a client that may change the world as the
    /// server's program does)
    #[arg(long, value_parser = role)]
    role: JoinRole,
    /// How long the token can be used: 90s, 10m, 2h, 1d
    #[arg(long, value_name = "TIME", default_value = "10m", value_parser = duration)]
    valid: Duration,
    /// How many tokens
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=10_000))]
    count: u16,
    /// How many processes each token lets join, as nodes that are made from one image, or by one unit file
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    uses: u32,
    /// Make the folder, for a server that is still to be started
    #[arg(long)]
    new: bool,
}

impl Token {
    pub(super) fn execute(self, _common: &Common) -> Result<ExitCode, Failure> {
        let Self { data, role, valid, count, uses, new } = self;
        if !new && !is_used(&data)? {
            return Err(Failure::usage(format!(
                "no server has used {}; name the folder that its server was started with (--data), or give --new to make \
                 one for a server to come",
                data.display()
            )));
        }
        let authority = Authority::load_or_create(&data)?;
        for _ in 0..count {
            print(&authority.issue_token_for(uses, role, valid, SystemTime::now())?.to_string())?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn role(text: &str) -> Result<JoinRole, String> {
    match text.parse() {
        Ok(JoinRole::Server) | Err(_) => Err("write node, client, participant or builder".to_owned()),
        Ok(role) => Ok(role),
    }
}
