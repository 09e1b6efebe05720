//! Describes the build and the machine that made a recording.

use std::fmt;

use bincode::{Decode, Encode};

use crate::protocol::VERSION;

/// The build and the machine that made a recording. They must be alike for equal bits.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Maker {
    /// The version of dcd.
    pub dcd: String,
    /// The commit that dcd was built from: the value of `DCD_COMMIT` when it was compiled; empty if there was
    /// none.
    pub commit: String,
    /// The version of Rapier.
    pub rapier: String,
    /// The version of the protocol, and so of the form of messages.
    pub protocol: u32,
    /// The features that change what is computed.
    pub features: Vec<String>,
    /// The architecture and the operating system.
    pub platform: String,
    /// The processor's name, where the system tells it.
    pub cpu: String,
}

impl Maker {
    /// Returns the description of this build on this machine.
    pub fn here() -> Self {
        let mut features = Vec::new();
        if cfg!(feature = "enhanced-determinism") {
            features.push("enhanced-determinism".to_owned());
        }
        Self {
            dcd: env!("CARGO_PKG_VERSION").to_owned(),
            // No build script asks git: that would compile dcd anew after each commit, or name an older one.
            commit: option_env!("DCD_COMMIT").unwrap_or_default().to_owned(),
            rapier: rapier(),
            protocol: VERSION,
            features,
            platform: format!("{} {}", std::env::consts::ARCH, std::env::consts::OS),
            cpu: cpu(),
        }
    }

    /// Returns in words how this maker differs from another, as far as bits may depend on it; `None` if it
    /// does not.
    pub fn unlike(&self, other: &Self) -> Option<String> {
        let mut alike = other.clone();
        // A commit that one of them does not know is no difference.
        if self.commit.is_empty() || other.commit.is_empty() {
            alike.commit.clone_from(&self.commit);
        }
        (*self != alike).then(|| format!("made by {self}, this is {other}: bits may differ"))
    }
}

impl fmt::Display for Maker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "dcd {}", self.dcd)?;
        if !self.commit.is_empty() {
            write!(f, " at {}", self.commit)?;
        }
        write!(
            f,
            " (protocol {}) with Rapier {} on {} ({})",
            self.protocol, self.rapier, self.platform, self.cpu
        )?;
        self.features.iter().try_for_each(|feature| write!(f, ", {feature}"))
    }
}

#[cfg(feature = "physics")]
fn rapier() -> String {
    rapier3d::VERSION.to_owned()
}

#[cfg(not(feature = "physics"))]
fn rapier() -> String {
    "none".to_owned()
}

/// Returns the processor's name as Linux gives it.
fn cpu() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| "unknown processor".to_owned(), |(_, name)| name.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builds_of_two_commits_are_unlike_and_one_of_no_known_commit_is_like_either() {
        let at = |commit: &str| Maker { commit: commit.to_owned(), ..Maker::here() };
        let said = at("4cfee01").unlike(&at("e958bcf")).expect("two commits");
        assert!(said.contains(" at 4cfee01 (") && said.contains(" at e958bcf ("), "{said}");
        for [one, other] in [["4cfee01", "4cfee01"], ["4cfee01", ""], ["", "e958bcf"], ["", ""]] {
            assert_eq!(at(one).unlike(&at(other)), None, "{one:?}, {other:?}");
        }
        assert!(Maker { dcd: "0.0.9".into(), ..at("") }.unlike(&at("e958bcf")).is_some());
    }
}
