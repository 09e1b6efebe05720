//! Describes faults in words, for people who read about a failing seed.

use std::fmt;

use super::{Fault, Island, Moment, Planned, ProcessKind, Victim, Ways};

impl fmt::Display for Planned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at {:.3} s", self.at.as_secs_f64())?;
        match self.moment {
            Moment::Any => {}
            Moment::Changing(events) => write!(f, ", {events} events after the next view change")?,
            Moment::Transferring(events) => write!(f, ", {events} events after the next transfer")?,
        }
        write!(f, ": {}", self.fault)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cut { island, ways, time } => {
                let ways = match ways {
                    Ways::Both => "is",
                    Ways::Out => "is not heard and",
                    Ways::In => "does not hear and",
                };
                write!(f, "{island} {ways} cut off for {} ms", time.as_millis())
            }
            Self::Kill { victim, back_after } => {
                write!(f, "{victim} is killed; a successor begins after {} ms", back_after.as_millis())
            }
            Self::Stop { victim, time } => write!(f, "{victim} is stopped for {} ms", time.as_millis()),
            Self::Slow { victim, cost, time } => {
                let (cost, time) = (cost.as_micros(), time.as_millis());
                write!(f, "{victim} takes {cost} us an event for {time} ms")
            }
        }
    }
}

impl fmt::Display for Victim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.role {
            ProcessKind::Server => "the server",
            ProcessKind::Leader => "the leader",
            ProcessKind::Member => "a node",
            ProcessKind::Client => "a client",
        })
    }
}

impl fmt::Display for Island {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::One(victim) => victim.fmt(f),
            Self::Nodes { count, with_server: true, .. } => write!(f, "the server with {count} nodes"),
            Self::Nodes { count, with_server: false, .. } => write!(f, "a set of {count} nodes"),
            Self::Pair(_) => f.write_str("a node from another"),
        }
    }
}
