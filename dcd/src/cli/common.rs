//! Defines the arguments of every subcommand (`--verbose`, `--quiet`), and prints by them: log, messages, progress bars, results.

use std::io::{IsTerminal, Write};
use std::process::ExitCode;

use indicatif::{ProgressBar, ProgressStyle};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::Directive;

use super::failure::Failure;

/// The log target of messages and failures with `--log-format json`. No filter leaves them out, just as none
/// leaves out lines for people.
const SAID: &str = "dcd::said";

/// Arguments of every subcommand.
#[derive(clap::Args)]
pub(super) struct Common {
    /// Say more on standard error: -v what is done, -vv details, -vvv everything (RUST_LOG overrides it)
    #[arg(short, long, action = clap::ArgAction::Count, global = true, display_order = 900)]
    verbose: u8,
    /// How the log on standard error is written: for people, or a JSON object per line
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t, global = true, display_order = 902)]
    log_format: LogFormat,
    /// Show no progress
    #[arg(short, long, global = true, display_order = 901)]
    quiet: bool,
}

/// The forms of a log.
#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum LogFormat {
    /// Lines for people
    #[default]
    Text,
    /// JSON objects
    Json,
}

impl Common {
    pub(super) fn start_log(&self) {
        let level = match self.verbose {
            0 => "warn",
            1 => "warn,dcd=info",
            2 => "info,dcd=debug",
            _ => "trace",
        };
        // Files of units and containers set it empty where nobody wants a filter.
        let asked = std::env::var(EnvFilter::DEFAULT_ENV).ok().filter(|asked| !asked.trim().is_empty());
        let (filter, unread) = match asked.map(EnvFilter::try_new) {
            None => (EnvFilter::new(level), None),
            Some(Ok(filter)) => (filter, None),
            Some(Err(error)) => (EnvFilter::new(level), Some(error)),
        };
        let said: Directive = format!("{SAID}=info").parse().expect("it is a directive");
        let filter = filter.add_directive(said);
        // Fails only if there is a log already, which then stays in use.
        let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
        let log = log.log_internal_errors(false);
        let _ = match self.log_format {
            LogFormat::Text => log.try_init(),
            LogFormat::Json => log.json().flatten_event(true).with_span_list(false).try_init(),
        };
        if let Some(error) = unread {
            tracing::warn!(%error, "RUST_LOG cannot be read, so that -v counts; write it as warn,dcd=debug");
        }
    }

    /// Returns whether `--quiet` is given: people want to see nothing but the result.
    pub(super) fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Returns whether `--verbose` is given: people want to see details.
    pub(super) fn is_verbose(&self) -> bool {
        self.verbose > 0
    }

    /// Prints a message for people on standard error, unless `--quiet` is given. With `--log-format json` it
    /// is an object of the log. A terminal that is gone is no error.
    pub(super) fn say(&self, text: &str) {
        if !self.quiet {
            self.tell(text);
        }
    }

    /// Does the same even with `--quiet`.
    pub(super) fn tell(&self, text: &str) {
        match self.log_format {
            LogFormat::Text => drop(writeln!(std::io::stderr(), "{text}")),
            LogFormat::Json => tracing::info!(target: SAID, "{text}"),
        }
    }

    /// Prints a failure on standard error, as an object with `--log-format json`, and returns the exit code.
    pub(super) fn report(&self, failure: Failure) -> ExitCode {
        match self.log_format {
            LogFormat::Text => failure.report(),
            LogFormat::Json => {
                tracing::error!(target: SAID, "{}", failure.message());
                failure.exit_code()
            }
        }
    }

    /// Returns a bar on standard error, hidden unless a person is looking on.
    pub(super) fn progress(&self, length: u64, unit: &str, json: bool) -> ProgressBar {
        if json || self.quiet || !std::io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let template = format!("{{bar:30}} {{pos}}/{{len}} {unit}, {{per_sec}}, {{eta}} left");
        let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
        ProgressBar::new(length).with_style(style)
    }
}

/// Writes to standard output. A reader that has gone away is not an error.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    print_to_reader(text).map(drop)
}

/// Writes to standard output; returns whether there still is a reader.
pub(super) fn print_to_reader(text: &str) -> Result<bool, Failure> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(false),
        Err(error) => Err(Failure::run(format!(
            "cannot write to standard output: {error}; give it a place that can be written to"
        ))),
        Ok(()) => Ok(true),
    }
}
