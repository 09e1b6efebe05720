//! Takes options of a subcommand from a TOML file (`--config`). Keys are the long names of options, or the
//! names of arguments without one. The options are put on the command line before it is parsed, unless it has
//! them already.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};

use super::failure::Failure;
use crate::scene::nearest;

/// The option that names the file, for subcommands that have it.
#[derive(clap::Args)]
pub(super) struct ConfigArgs {
    /// Take options from a TOML file: `listen = "0.0.0.0:7420"`, `unpaced = true`, `set = ["n=3", "mass=2"]`;
    /// options on the command line count instead
    #[arg(id = "config", long = "config", value_name = "FILE")]
    _file: Option<PathBuf>,
}

/// The id of that option.
const CONFIG: &str = "config";
/// The option that forgets a stored world. It is refused in a file, which would forget a world at each start.
const FRESH: &str = "fresh";

/// Returns the arguments, with those of the file that `--config` names added.
pub(super) fn expand(mut command: Command, args: Vec<OsString>) -> Result<Vec<OsString>, Failure> {
    // Errors in the other arguments are reported once those of the file are added.
    let lenient = command.clone().ignore_errors(true);
    let Ok(matches) = lenient.try_get_matches_from(&args) else { return Ok(args) };
    command.build();
    let Some((name, given)) = matches.subcommand() else { return Ok(args) };
    let Ok(Some(path)) = given.try_get_one::<PathBuf>(CONFIG) else { return Ok(args) };
    let subcommand = command.find_subcommand(name).expect("it was parsed by it");
    let added = File { path, subcommand, given }.arguments()?;
    Ok(added.into(args, name))
}

/// Arguments that a file adds.
#[derive(Default)]
struct Added {
    positional: Vec<OsString>,
    options: Vec<OsString>,
}

impl Added {
    /// Inserts them where none is taken for the value of an option on the command line.
    fn into(self, mut args: Vec<OsString>, name: &str) -> Vec<OsString> {
        let end = args.iter().position(|arg| arg == OsStr::new("--")).unwrap_or(args.len());
        args.splice(end..end, self.options);
        let begin =
            args.iter().skip(1).position(|arg| arg == OsStr::new(name)).map_or(args.len(), |at| at + 2);
        args.splice(begin..begin, self.positional);
        args
    }
}

/// A file, the subcommand that it is for, and the arguments on the command line.
struct File<'a> {
    path: &'a Path,
    subcommand: &'a Command,
    given: &'a ArgMatches,
}

impl File<'_> {
    fn arguments(&self) -> Result<Added, Failure> {
        let text = std::fs::read_to_string(self.path).map_err(|error| {
            self.wrong(&format!("{error}; give --config a file of options that this user may read"))
        })?;
        let table: toml::Table = text.parse().map_err(|error| self.unreadable(&text, &error))?;
        let mut added = Added::default();
        for (key, value) in &table {
            let arg = self.named(key)?;
            if self.is_given(arg) {
                continue;
            }
            let texts = self.texts(key, arg, value)?;
            if arg.is_positional() {
                added.positional.extend(texts.into_iter().flatten().map(OsString::from));
                continue;
            }
            for text in texts {
                let option = match text {
                    Some(text) => format!("--{key}={text}"),
                    None => format!("--{key}"),
                };
                self.check(&option)?;
                added.options.push(option.into());
            }
        }
        Ok(added)
    }

    /// Returns the argument of this name.
    fn named(&self, key: &str) -> Result<&Arg, Failure> {
        if key == FRESH && self.subcommand.get_arguments().any(|arg| arg.get_id() == FRESH) {
            return Err(self.wrong(
                "`fresh` would begin the world anew each time that its server is started, after a crash too; take it out, and write \
                 --fresh on the command line once",
            ));
        }
        let name = |arg: &Arg| match arg.is_positional() {
            true => Some(arg.get_id().to_string()),
            false => arg.get_long().map(str::to_owned),
        };
        let can_be = |arg: &&Arg| {
            let acts = matches!(arg.get_action(), ArgAction::Help | ArgAction::HelpLong | ArgAction::Version);
            !acts && arg.get_id() != CONFIG && arg.get_id() != FRESH
        };
        let arguments = || self.subcommand.get_arguments().filter(can_be);
        if let Some(arg) = arguments().find(|arg| name(arg).as_deref() == Some(key)) {
            return Ok(arg);
        }
        let names: Vec<_> = arguments().filter(|arg| !arg.is_hide_set()).filter_map(name).collect();
        let hint = nearest(key, names.iter().map(String::as_str));
        let hint = hint.map(|name| format!(" (did you mean `{name}`?)")).unwrap_or_default();
        let command = self.subcommand.get_name();
        Err(self.wrong(&format!(
            "`{key}` is no option of `dcd {command}`{hint}; `dcd {command} --help` lists them"
        )))
    }

    /// Returns whether the command line has an argument, or another one that excludes it.
    fn is_given(&self, arg: &Arg) -> bool {
        let is_on_line =
            |arg: &Arg| self.given.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
        let excludes = |a: &Arg, b: &Arg| self.subcommand.get_arg_conflicts_with(a).contains(&b);
        let mut others = self.subcommand.get_arguments().filter(|other| is_on_line(other));
        is_on_line(arg) || others.any(|other| excludes(arg, other) || excludes(other, arg))
    }

    /// Returns one item for each time that the option is to be written: its value, or `None` for an option
    /// alone.
    fn texts(&self, key: &str, arg: &Arg, value: &toml::Value) -> Result<Vec<Option<String>>, Failure> {
        // The message names the type, not the value, which may be a token.
        let is = value.type_str();
        let unfit = |wanted: &str| {
            Err(self.wrong(&format!("`{key}` wants {wanted}, and has a value of the type {is}")))
        };
        let may_be_alone = arg.get_num_args().is_some_and(|counts| counts.min_values() == 0);
        match (arg.get_action(), value) {
            (ArgAction::SetTrue, toml::Value::Boolean(on)) => Ok(vec![None; usize::from(*on)]),
            (ArgAction::SetTrue, _) => unfit("true or false"),
            (ArgAction::Count, toml::Value::Integer(times @ 0..=9)) => Ok(vec![None; *times as usize]),
            (ArgAction::Count, _) => unfit("a number from 0 to 9"),
            (_, toml::Value::Boolean(on)) if may_be_alone => Ok(vec![None; usize::from(*on)]),
            (ArgAction::Append, toml::Value::Array(values)) => {
                let texts = values.iter().map(plain).collect::<Option<Vec<_>>>();
                texts.map_or_else(
                    || unfit("texts or numbers"),
                    |texts| Ok(texts.into_iter().map(Some).collect()),
                )
            }
            (ArgAction::Append, value) => plain(value).map_or_else(
                || unfit("a text, a number, or several in brackets"),
                |text| Ok(vec![Some(text)]),
            ),
            (_, value) => {
                plain(value).map_or_else(|| unfit("a text or a number"), |text| Ok(vec![Some(text)]))
            }
        }
    }

    /// Checks that the value of an option can be read; if not, the error names the file.
    fn check(&self, option: &str) -> Result<(), Failure> {
        let alone = self.subcommand.clone().mut_args(|arg| arg.required(false));
        match alone.try_get_matches_from(["dcd", option]) {
            Err(error)
                if !matches!(
                    error.kind(),
                    ErrorKind::MissingRequiredArgument | ErrorKind::ArgumentConflict
                ) =>
            {
                let text = error.to_string();
                let cause = text.split("\n\n").next().unwrap_or_default();
                Err(self.wrong(cause.trim_start_matches("error: ")))
            }
            _ => Ok(()),
        }
    }

    /// Returns a failure that says in which line the file is no TOML, but not what is there, which may be a
    /// token.
    fn unreadable(&self, text: &str, error: &toml::de::Error) -> Failure {
        let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
        let line = before.matches('\n').count() + 1;
        let cause = error.message();
        self.wrong(&format!("line {line}: {cause}; write `option = value`, as TOML has it"))
    }

    fn wrong(&self, what: &str) -> Failure {
        Failure::usage(format!("{}: {what}", self.path.display()))
    }
}

/// Returns a value as it is written on a command line.
fn plain(value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::String(text) => Some(text.clone()),
        toml::Value::Integer(number) => Some(number.to_string()),
        toml::Value::Float(number) => Some(number.to_string()),
        _ => None,
    }
}
