//! Opens the span of all that a process logs: which process it is, and how far its world has come.

use tracing::field::display;
use tracing::span::EnteredSpan;
use tracing::{Span, error_span};

use crate::net::PeerName;
use crate::space::Tick;

/// The span of a process. It is made anew whenever the world has gone on: if its fields were recorded again,
/// a subscriber that writes text would add them and not replace them.
pub(super) struct LogSpan {
    who: PeerName,
    at: Option<(Option<u64>, Tick)>,
    span: Span,
}

impl LogSpan {
    pub(super) fn new(who: PeerName) -> Self {
        Self { who, at: None, span: Span::none() }
    }

    /// Enters the span at this view, if the process is in one or keeps one, and at this tick, the last
    /// complete one.
    pub(super) fn enter(&mut self, view: Option<u64>, tick: Tick) -> EnteredSpan {
        if self.at != Some((view, tick)) {
            let (node, client) = (self.who.node().map(display), self.who.client().map(display));
            let role = self.who.role();
            self.span = error_span!("process", %role, node, client, view, tick = tick.0);
            self.at = Some((view, tick));
        }
        self.span.clone().entered()
    }
}
