//! Describes the build and the machine that made a recording.

use std::fmt;

use bincode::{Decode, Encode};

use crate::protocol::VERSION;

/// The build and the machine that made a recording: what must be alike for equal bits.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Maker {
    /// Version of dcd.
    pub dcd: String,
    /// Version of Rapier.
    pub rapier: String,
    /// Version of the protocol: the form of messages.
    pub protocol: u32,
    /// Features that change what is computed.
    pub features: Vec<String>,
    /// Architecture and operating system.
    pub platform: String,
    /// The processor's name, where the system says it.
    pub cpu: String,
}

impl Maker {
    /// Returns this build on this machine.
    pub fn here() -> Self {
        let mut features = Vec::new();
        if cfg!(feature = "enhanced-determinism") {
            features.push("enhanced-determinism".to_owned());
        }
        Self {
            dcd: env!("CARGO_PKG_VERSION").to_owned(),
            rapier: rapier(),
            protocol: VERSION,
            features,
            platform: format!("{} {}", std::env::consts::ARCH, std::env::consts::OS),
            cpu: cpu(),
        }
    }

    /// Returns how this maker differs from another, as far as bits may depend on it; `None` if it does not.
    pub fn unlike(&self, other: &Self) -> Option<String> {
        (self != other).then(|| format!("made by {self}, this is {other}: bits may differ"))
    }
}

impl fmt::Display for Maker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "dcd {} (protocol {}) with Rapier {} on {} ({})",
            self.dcd, self.protocol, self.rapier, self.platform, self.cpu
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
