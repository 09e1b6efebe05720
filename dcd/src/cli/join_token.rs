//! Reads the token with which a process joins: from an option, or from a file, which lists of processes do
//! not show.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::PathBuf;

use super::failure::Failure;

/// The longest file that is read: a token takes some two hundred bytes.
const MOST_BYTES: u64 = 4096;
/// The beginning of all tokens.
const TOKEN_BEGINS: &str = "dcd1-";

#[derive(clap::Args)]
pub(super) struct TokenArgs {
    /// Token from `dcd token --role ROLE`: node, client (or builder), or participant with --compute. Whoever
    /// may list processes sees it, which --token-file avoids
    #[arg(long, required_unless_present_any = ["token_file", "identity"])]
    token: Option<String>,
    /// File with the token. A node whose --identity file exists needs neither option and uses up no token:
    /// the file with the token may be gone
    #[arg(long, value_name = "FILE", conflicts_with = "token")]
    token_file: Option<PathBuf>,
}

impl TokenArgs {
    /// Returns the token; an empty one if none is needed and none is given, or its file is gone.
    pub(super) fn read(self, is_needed: bool) -> Result<String, Failure> {
        let Some(path) = &self.token_file else {
            return match self.token {
                None if is_needed => Err(Failure::usage(
                    "no token is given, and only a node whose --identity has its file already needs none; give --token or \
                     --token-file with one of `dcd token`",
                )),
                token => Ok(token.unwrap_or_default()),
            };
        };
        if path.to_string_lossy().starts_with(TOKEN_BEGINS) {
            return Err(Failure::usage(
                "--token-file names a file, and was given a token itself; give that by --token",
            ));
        }
        let mut text = String::new();
        match File::open(path).and_then(|file| file.take(MOST_BYTES).read_to_string(&mut text)) {
            Err(error) if error.kind() == ErrorKind::NotFound && !is_needed => return Ok(String::new()),
            Err(error) => {
                let path = path.display();
                return Err(Failure::usage(format!("{path}: {error}; write a token of `dcd token` to it")));
            }
            Ok(_) => {}
        }
        let mut words = text.split_whitespace();
        match (words.next(), words.next()) {
            (Some(token), None) => Ok(token.to_owned()),
            _ => Err(Failure::usage(format!(
                "{} does not have one token; write what `dcd token` prints to it",
                path.display()
            ))),
        }
    }
}
