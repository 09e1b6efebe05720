//! Reads the processor time of a process's threads, by name, as Linux counts it.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;

/// Milliseconds of processor time by the name of the thread.
#[derive(Clone, Debug, Default)]
pub(crate) struct Usage(BTreeMap<String, f64>);

impl Usage {
    /// Returns what the living threads of a process have used.
    pub(crate) fn of(process: u32) -> Result<Self, Box<dyn Error>> {
        let folder = format!("/proc/{process}/task");
        let threads = fs::read_dir(&folder).map_err(|error| format!("cannot read {folder}: {error}"))?;
        let mut usage = Self::default();
        for thread in threads {
            let path = thread?.path();
            // A thread that has ended meanwhile has nothing to say.
            let (Ok(name), Ok(times)) =
                (fs::read_to_string(path.join("comm")), fs::read_to_string(path.join("schedstat")))
            else {
                continue;
            };
            let ns: f64 = times.split(' ').next().unwrap_or_default().parse()?;
            *usage.0.entry(name.trim_end().to_owned()).or_default() += ns / 1e6;
        }
        Ok(usage)
    }

    pub(crate) fn add(&mut self, other: &Self) {
        for (name, ms) in &other.0 {
            *self.0.entry(name.clone()).or_default() += ms;
        }
    }

    /// Returns what was used since an earlier moment.
    pub(crate) fn since(&self, before: &Self) -> Self {
        let used = |(name, ms): (&String, &f64)| (name.clone(), ms - before.0.get(name).unwrap_or(&0.0));
        Self(self.0.iter().map(used).collect())
    }

    /// Returns the milliseconds of the threads whose names begin so.
    pub(crate) fn of_threads(&self, name: &str) -> f64 {
        self.0.iter().filter(|(thread, _)| thread.starts_with(name)).map(|(_, ms)| ms).sum()
    }

    pub(crate) fn all(&self) -> f64 {
        self.0.values().sum()
    }
}
