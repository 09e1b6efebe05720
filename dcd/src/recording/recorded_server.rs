//! Gives a server's state machine its events, and records them.

use std::io;
use std::ops::Deref;
use std::time::Duration;

use super::{Recorder, Sent};
use crate::cluster::{RestoreError, Server, ServerConfig, ServerEvent, ServerOrigin, ServerOutput};
use crate::space::Tick;

/// A server's state machine, with a recorder if it is recorded. It dereferences to the server for reading.
/// Changes go through its methods, which record them.
#[derive(Debug)]
pub struct RecordedServer {
    server: Server,
    recording: Option<Recording>,
}

#[derive(Debug)]
struct Recording {
    recorder: Recorder,
    sent: Sent,
    now: Duration,
    /// The tick of the last digest.
    told: Tick,
}

impl Recording {
    fn tell(&mut self, tick: Tick) {
        self.told = tick;
        self.recorder.server_told(self.now, tick, self.sent.digest());
    }
}

impl Deref for RecordedServer {
    type Target = Server;

    fn deref(&self) -> &Server {
        &self.server
    }
}

impl RecordedServer {
    /// Begins a server. `recorder` was begun with the same configuration and origin.
    pub fn begin(
        config: ServerConfig,
        origin: ServerOrigin,
        recorder: Option<Recorder>,
    ) -> Result<Self, RestoreError> {
        let server = Server::of(config, origin)?;
        let (sent, now, told) = (Sent::default(), Duration::ZERO, server.tick());
        let recording = recorder.map(|recorder| Recording { recorder, sent, now, told });
        Ok(Self { server, recording })
    }

    /// Takes in an event.
    pub fn handle(&mut self, now: Duration, event: ServerEvent) {
        if let Some(recording) = &mut self.recording {
            recording.now = now;
            recording.recorder.server_event(now, &event);
        }
        self.server.handle(now, event);
    }

    /// Does what is due at this time.
    pub fn handle_timeout(&mut self, now: Duration) {
        if let Some(recording) = &mut self.recording {
            recording.now = now;
            recording.recorder.server_timeout(now);
        }
        self.server.handle_timeout(now);
    }

    /// Returns the next output; `None` if there is none.
    pub fn poll_output(&mut self) -> Option<ServerOutput> {
        let output = self.server.poll_output();
        if let Some(recording) = &mut self.recording {
            match &output {
                Some(output) => recording.sent.add(output),
                None if recording.told != self.server.tick() => recording.tell(self.server.tick()),
                None => {}
            }
        }
        output
    }

    /// Ends the recording. Returns an error if any of it could not be written.
    pub fn finish(&mut self) -> io::Result<()> {
        let Some(mut recording) = self.recording.take() else { return Ok(()) };
        // A replay also takes the outputs that nobody takes any more here.
        while let Some(output) = self.server.poll_output() {
            recording.sent.add(&output);
        }
        recording.tell(self.server.tick());
        recording.recorder.finish()
    }
}
