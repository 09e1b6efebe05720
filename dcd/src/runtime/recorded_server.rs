//! Gives a server's state machine its events, and records them.

use std::ops::Deref;
use std::path::PathBuf;
use std::time::Duration;

use super::ProcessError;
use crate::cluster::{Server, ServerConfig, ServerEvent, ServerOrigin, ServerOutput};
use crate::recording::{Background, Recorder, Sent};
use crate::space::Tick;

/// A server's state machine, recorded if it is to be. It is read as it is, and changed by what is recorded.
pub(super) struct RecordedServer {
    server: Server,
    recording: Option<Recording>,
}

struct Recording {
    path: PathBuf,
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
    pub(super) fn begin(
        config: ServerConfig,
        origin: ServerOrigin,
        record: Option<PathBuf>,
    ) -> Result<Self, ProcessError> {
        let begun = record.map(|path| {
            let file = Background::create(&path);
            let recorder = file.and_then(|file| Recorder::of_server(file, &config, &origin));
            match recorder {
                Ok(recorder) => Ok((path, recorder)),
                Err(cause) => Err(ProcessError::Record { path, cause }),
            }
        });
        let begun = begun.transpose()?;
        let server = Server::of(config, origin)?;
        let told = server.tick();
        let recording = begun.map(|(path, recorder)| Recording {
            path,
            recorder,
            sent: Sent::default(),
            now: Duration::ZERO,
            told,
        });
        Ok(Self { server, recording })
    }

    pub(super) fn handle(&mut self, now: Duration, event: ServerEvent) {
        if let Some(recording) = &mut self.recording {
            recording.now = now;
            recording.recorder.server_event(now, &event);
        }
        self.server.handle(now, event);
    }

    pub(super) fn handle_timeout(&mut self, now: Duration) {
        if let Some(recording) = &mut self.recording {
            recording.now = now;
            recording.recorder.server_timeout(now);
        }
        self.server.handle_timeout(now);
    }

    pub(super) fn poll_output(&mut self) -> Option<ServerOutput> {
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

    /// Ends the recording; returns what of it could not be written.
    pub(super) fn finish(&mut self) -> Result<(), ProcessError> {
        let Some(mut recording) = self.recording.take() else { return Ok(()) };
        // What nobody takes any more was not sent.
        while let Some(output) = self.server.poll_output() {
            recording.sent.add(&output);
        }
        recording.tell(self.server.tick());
        let Recording { path, recorder, .. } = recording;
        recorder.finish().map_err(|cause| ProcessError::Record { path, cause })
    }
}
