//! Runs this program once more, as a process that answers each line of its standard input with a line, until
//! the input ends.

use std::error::Error;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, ChildStdout, Command, Stdio};

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A process that runs until its standard input is closed.
pub(crate) struct Child {
    child: std::process::Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Child {
    /// Starts the process with these arguments.
    pub(crate) fn start(arguments: &[&str]) -> Result<Self, Box<dyn Error>> {
        let mut child = Command::new(std::env::current_exe()?)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|error| format!("cannot start a process: {error}"))?;
        let output = child.stdout.take().ok_or("it has no standard output")?;
        Ok(Self { input: child.stdin.take(), child, output: BufReader::new(output) })
    }

    /// Returns the id of the process.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Asks the process what it has done so far.
    pub(crate) fn read<Reading: DeserializeOwned>(&mut self) -> Result<Reading, Box<dyn Error>> {
        self.write("\n")?;
        Ok(serde_json::from_str(&self.line()?)?)
    }

    /// Ends the process; returns an error if it went wrong.
    pub(crate) fn end(mut self) -> Result<(), Box<dyn Error>> {
        self.input = None;
        self.output.read_to_string(&mut String::new())?;
        match self.child.wait()? {
            status if status.success() => Ok(()),
            status => Err(format!("a process ended with {status}").into()),
        }
    }

    /// Writes text to the process.
    pub(crate) fn write(&mut self, text: &str) -> Result<(), Box<dyn Error>> {
        Ok(self.input.as_mut().ok_or("it is ending")?.write_all(text.as_bytes())?)
    }

    /// Waits for the next line that the process writes.
    pub(crate) fn line(&mut self) -> Result<String, Box<dyn Error>> {
        let mut line = String::new();
        match self.output.read_line(&mut line)? {
            0 => Err("a process ended early".into()),
            _ => Ok(line.trim_end().to_owned()),
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Answers each line of standard input with a reading, until the input ends.
pub(crate) fn answer<Reading: Serialize>(mut read: impl FnMut() -> Reading) -> Result<(), Box<dyn Error>> {
    for line in std::io::stdin().lines() {
        line?;
        println!("{}", serde_json::to_string(&read())?);
    }
    Ok(())
}
