//! Combines the summaries of the demo's processes into its result: a text for people, and the object that `dcd demo --json`
//! prints.

use serde::Serialize;
use serde_json::Value;

use crate::cli::failure::Failure;
use crate::cli::summary::Summary;
use crate::scene::AvatarHint;

/// The participants of the demo, and what happened to them.
pub(super) struct Cast {
    pub address: String,
    pub scene: String,
    /// The first membership, as the server printed it.
    pub view: String,
    pub hint: AvatarHint,
    pub nodes: u8,
    pub takeover: Option<Takeover>,
    pub restart: Option<Restart>,
}

/// The death of a node and the takeover of its regions.
pub(super) struct Takeover {
    pub killed: String,
    pub after_s: f64,
    pub took_s: f64,
    /// The next membership, as the server printed it.
    pub view: String,
}

/// The death of the server and its restart.
pub(super) struct Restart {
    pub after_s: f64,
    pub took_s: f64,
    /// The next membership, as the server printed it.
    pub view: String,
}

/// The participants and the result.
pub(super) struct Played {
    pub cast: Cast,
    pub result: Outcome,
}

/// The object that `dcd demo --json` prints.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Outcome {
    pub nodes: u8,
    pub regions: u64,
    pub bodies: u64,
    pub ticks: u64,
    pub tick_ms: Times,
    pub transfers: u64,
    pub ghosts_mean: f64,
    pub lost: u64,
    pub doubled: u64,
    pub client_updates: u64,
    pub client_contacts: u64,
    pub avatar_moved_m: f64,
    pub bytes_per_s: f64,
}

/// Times per tick of the slowest node, milliseconds.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Times {
    pub p50: Option<f64>,
    pub p99: Option<f64>,
}

impl Summary for Outcome {
    fn rows(&self) -> Vec<(&'static str, String)> {
        let ms = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
        vec![
            ("avatar", format!("moved {:.1} m", self.avatar_moved_m)),
            ("heard", format!("{} updates, {} contacts", self.client_updates, self.client_contacts)),
            ("world", format!("{} ticks of {} bodies in {} regions", self.ticks, self.bodies, self.regions)),
            ("borders", format!("{} bodies changed regions, {:.1} ghosts", self.transfers, self.ghosts_mean)),
            ("tick", format!("{} ms median, {} at 99 %", ms(self.tick_ms.p50), ms(self.tick_ms.p99))),
            ("traffic", format!("{:.0} kB/s at server and nodes", self.bytes_per_s / 1e3)),
            ("lost", self.lost.to_string()),
            ("doubled", self.doubled.to_string()),
        ]
    }
}

impl Played {
    /// Combines the summaries of the processes.
    pub(super) fn new(cast: Cast, joined: &str, served: &Value, computed: &[Value]) -> Result<Self, Failure> {
        let heard = |key: &str| {
            let value = joined.split_whitespace().find_map(|word| word.strip_prefix(key)?.strip_prefix('='));
            let value: Option<f64> = value.and_then(|value| value.parse().ok());
            value.ok_or_else(|| Failure::run(format!("the C program did not say `{key}=`, but: {joined}")))
        };
        if served["audited"] != true {
            return Err(Failure::run(
                "the nodes did not say at the end what they own, so nobody knows whether bodies are lost; run with -vv to see why",
            ));
        }
        let count = |key: &str| served[key].as_u64().unwrap_or_default();
        let slowest = |key: &str| {
            computed.iter().filter_map(|node| node["tick_ms"][key].as_f64()).max_by(f64::total_cmp)
        };
        let sum = |key: &str| computed.iter().filter_map(|node| node[key].as_f64()).sum::<f64>();
        let seconds = served["seconds"].as_f64().unwrap_or_default().max(f64::MIN_POSITIVE);
        let result = Outcome {
            nodes: cast.nodes,
            regions: count("regions"),
            bodies: count("bodies"),
            ticks: count("tick"),
            tick_ms: Times { p50: slowest("p50"), p99: slowest("p99") },
            transfers: sum("transfers") as u64,
            ghosts_mean: sum("ghosts_mean"),
            lost: count("lost"),
            doubled: count("doubled"),
            client_updates: heard("updates")? as u64,
            client_contacts: heard("contacts")? as u64,
            avatar_moved_m: heard("moved_m")?,
            bytes_per_s: count("bytes") as f64 / seconds + sum("bytes_per_s"),
        };
        Ok(Self { cast, result })
    }
}

/// Returns what happened, as text for people.
pub(super) fn told(played: &Played) -> String {
    let Cast { address, scene, view, hint, nodes, takeover, restart } = &played.cast;
    let place = hint.pose.translation;
    let mut rows = vec![
        ("server", format!("held {scene} on {address}")),
        ("nodes", format!("{nodes} processes: {view}")),
        (
            "C program",
            format!(
                "joined with an avatar at ({}, {}, {}) that goes {:?} m/s",
                place[0], place[1], place[2], hint.drive_m_s
            ),
        ),
    ];
    if let Some(Restart { after_s, took_s, view }) = restart {
        rows.push((
            "restarted",
            format!(
                "the server, killed after {after_s:.1} s; back within {took_s:.2} s of its start: {view}"
            ),
        ));
    }
    if let Some(Takeover { killed, after_s, took_s, view }) = takeover {
        rows.push((
            "killed",
            format!("{killed} after {after_s:.1} s; taken over within {took_s:.2} s: {view}"),
        ));
    }
    rows.extend(played.result.rows());
    let lines = rows.iter().map(|(name, value)| format!("{name:<12}{value}"));
    format!(
        "One world, computed by {nodes} processes and played in by a C program\n\n{}",
        lines.collect::<Vec<_>>().join("\n")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::WorldPose;
    use serde_json::json;

    #[test]
    fn the_outcome_is_of_all_processes() {
        let hint = AvatarHint {
            pose: WorldPose::at([0.0; 3]),
            half_size_m: [0.5; 3],
            mass_kg: 1.0,
            drive_m_s: [1.0, 0.0, 0.0],
        };
        let cast = || Cast {
            address: "a".into(),
            scene: "s".into(),
            view: "view 1".into(),
            hint,
            nodes: 2,
            takeover: None,
            restart: None,
        };
        let served = json!({"tick": 60, "bodies": 9, "regions": 2, "lost": 0, "doubled": 1, "audited": true, "bytes": 100, "seconds": 2.0});
        let node = |p50, transfers| {
            json!({"tick_ms": {"p50": p50, "p99": null}, "transfers": transfers,
            "ghosts_mean": 1.5, "bytes_per_s": 10.0})
        };
        let nodes = [node(1.0, 3), node(2.0, 4)];
        let played =
            Played::new(cast(), "join: updates=7 contacts=2 moved_m=3.5 bodies=10", &served, &nodes).unwrap();
        let expected = Outcome {
            nodes: 2,
            regions: 2,
            bodies: 9,
            ticks: 60,
            tick_ms: Times { p50: Some(2.0), p99: None },
            transfers: 7,
            ghosts_mean: 3.0,
            lost: 0,
            doubled: 1,
            client_updates: 7,
            client_contacts: 2,
            avatar_moved_m: 3.5,
            bytes_per_s: 70.0,
        };
        assert_eq!(played.result, expected);
        assert!(told(&played).contains("doubled     1"));
        assert!(Played::new(cast(), "join: updates=7", &served, &nodes).is_err());
        let unaudited = json!({"lost": 0, "doubled": 0, "audited": false});
        let said =
            Played::new(cast(), "join: updates=7 contacts=2 moved_m=3.5 bodies=10", &unaudited, &nodes);
        assert!(said.is_err(), "nobody looked");
    }
}
