//! Reports how many bytes a client was sent, and what for.

use serde::Serialize;

use crate::runtime::Bandwidth;

/// The width of the longest bar, characters.
const BAR: f64 = 24.0;

/// Bytes by what messages are about, by the fields of states, and by body.
#[derive(Serialize)]
pub(super) struct Report {
    messages: Vec<Cost>,
    fields: Vec<Cost>,
    bodies: Vec<Cost>,
}

#[derive(Serialize)]
struct Cost {
    name: String,
    bytes: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    messages: Option<u64>,
}

impl Report {
    pub(super) fn of(bandwidth: &Bandwidth) -> Self {
        let of_messages = bandwidth.messages.iter().map(|(subject, count)| Cost {
            name: subject.name().into(),
            bytes: count.bytes as f64,
            messages: Some(count.messages),
        });
        let quic = Cost { name: "quic".into(), bytes: bandwidth.quic_bytes() as f64, messages: None };
        let bare = |name: String, bytes: f64| Cost { name, bytes, messages: None };
        Self {
            messages: of_messages.chain([quic]).filter(|cost| cost.bytes > 0.0).collect(),
            fields: bandwidth.fields().map(|(field, bytes)| bare(field.name().into(), bytes)).collect(),
            bodies: bandwidth.bodies.iter().map(|(id, bytes)| bare(id.to_string(), *bytes)).collect(),
        }
    }

    /// Returns a line for each cost, with a bar as long as its share of the largest one.
    pub(super) fn rows(&self) -> Vec<(&'static str, String)> {
        let part = |title: &'static str, costs: &[Cost]| {
            let most = costs.iter().map(|cost| cost.bytes).fold(1.0, f64::max);
            let line = move |(i, cost): (usize, &Cost)| {
                let bar = "█".repeat((BAR * cost.bytes / most).round() as usize);
                let messages = cost.messages.map(|count| format!(" in {count}")).unwrap_or_default();
                let text = format!("{:<10}{:>10.0} B{messages} {bar}", cost.name, cost.bytes);
                (if i == 0 { title } else { "" }, text)
            };
            costs.iter().enumerate().map(line).collect::<Vec<_>>()
        };
        let all = [("messages", &self.messages), ("fields", &self.fields), ("bodies", &self.bodies)];
        all.into_iter().flat_map(|(title, costs)| part(title, costs)).collect()
    }
}
