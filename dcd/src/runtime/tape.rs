//! Keeps the recording of a local world: what it has already, and what it needs next.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use crate::fidelity::Pace;
use crate::physics::{ContactHooks, NotedHooks, ShapeLibrary};
use crate::protocol::{BodyRecord, ShapeHash, encoded_len, write_state};
use crate::recording::{Operation, Recorder, RecordingError};
use crate::space::{RegionId, Tick};

/// Shapes of more bytes than this are recorded by a snapshot.
const LARGE: usize = 1 << 20;
/// The number of answers of hooks in an entry: a few megabytes.
const ANSWERS: usize = 1 << 14;
/// The bytes of each part of a snapshot.
const PART: usize = 1 << 20;

/// The recording of a local world.
pub(super) struct Tape {
    pub(super) recorder: Recorder,
    /// The path of the file that is written, if it is known.
    path: Option<PathBuf>,
    since: Instant,
    /// The shapes that the recording has.
    known: BTreeSet<ShapeHash>,
    /// The paces of regions that were recorded last.
    paces: BTreeMap<RegionId, Pace>,
    /// Says whether something happened that only a snapshot can record.
    is_stale: bool,
    /// The program's hooks, with a note of what they answer.
    hooks: Option<Arc<NotedHooks>>,
}

impl Tape {
    pub(super) fn new(recorder: Recorder, path: Option<PathBuf>) -> Self {
        let (known, paces) = (BTreeSet::new(), BTreeMap::new());
        Self { recorder, path, since: Instant::now(), known, paces, is_stale: true, hooks: None }
    }

    /// Records an operation, unless a snapshot will follow that includes it.
    pub(super) fn note(&mut self, operation: Operation) {
        // Otherwise, without steps, a recording in memory would grow without end.
        self.is_stale |= self.recorder.wants_segment();
        if !self.is_stale {
            // What the operation was done to has perhaps been brought to the present first, and hooks were asked.
            self.note_answers();
            self.put(operation);
        }
    }

    fn put(&mut self, operation: Operation) {
        self.recorder.operation(self.since.elapsed(), operation);
    }

    /// Records the insertion of bodies, with their new shapes.
    pub(super) fn note_bodies(&mut self, bodies: Vec<BodyRecord>, shapes: &ShapeLibrary) {
        let used = shapes.records_of(&bodies).into_iter();
        let new = used.filter(|(hash, _)| self.known.insert(*hash));
        let new: Vec<_> = new.map(|(_, shape)| shape.clone()).collect();
        // A snapshot is written in parts, but an entry is not.
        if new.iter().map(encoded_len).sum::<usize>() > LARGE {
            return self.spoil();
        }
        self.note(Operation::Insert { bodies, shapes: new });
    }

    /// Begins to note what these hooks answer. Returns the hooks that are to be called in their place.
    pub(super) fn listen_to(
        &mut self,
        hooks: Option<Arc<dyn ContactHooks>>,
    ) -> Option<Arc<dyn ContactHooks>> {
        self.hooks = hooks.map(|hooks| Arc::new(NotedHooks::new(hooks)));
        self.hooks.clone().map(|hooks| hooks as Arc<dyn ContactHooks>)
    }

    /// Returns the program's hooks.
    pub(super) fn hooks(&self) -> Option<Arc<dyn ContactHooks>> {
        self.hooks.as_ref().map(|hooks| Arc::clone(hooks.program()))
    }

    /// Records what hooks have answered in a step, or in those that an operation begins with.
    pub(super) fn note_answers(&mut self) {
        let answers = self.hooks.as_ref().map(|hooks| hooks.take()).unwrap_or_default();
        for some in answers.chunks(ANSWERS) {
            self.put(Operation::Answers(some.to_vec()));
        }
    }

    /// Records the paces of regions in a step, if they differ from those before.
    pub(super) fn note_paces(&mut self, paces: &BTreeMap<RegionId, Pace>) {
        if *paces != self.paces {
            self.paces.clone_from(paces);
            self.put(Operation::Paces(self.paces.clone()));
        }
    }

    /// Records the digests of the regions after a step.
    pub(super) fn note_step(&mut self, tick: Tick, digests: &[(RegionId, u64)]) {
        self.recorder.stepped(self.since.elapsed(), tick, digests);
    }

    /// Returns whether a snapshot must be recorded before the next step.
    pub(super) fn wants_seed(&self) -> bool {
        !self.recorder.has_failed() && (self.is_stale || self.recorder.wants_segment())
    }

    /// Records a snapshot, which `save` writes, of a world with these shapes.
    pub(super) fn seed<E>(
        &mut self,
        shapes: &ShapeLibrary,
        save: impl FnOnce(&mut Parts<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        self.is_stale = false;
        self.paces.clear();
        // Drops the answers of a step that failed, which no replay does.
        self.hooks.iter().for_each(|hooks| drop(hooks.take()));
        self.recorder.begin_segment();
        let mut parts = Parts { tape: self, part: Vec::with_capacity(PART) };
        save(&mut parts)?;
        parts.end();
        self.known = shapes.records().iter().map(|shape| shape.hash()).collect();
        self.put(Operation::Restore);
        Ok(())
    }

    /// Ends the recording, and waits until it is written.
    pub(super) fn finish(self) -> Result<(), RecordingError> {
        self.recorder.finish().map_err(|error| match self.path {
            Some(path) => RecordingError::NotWhole { path, error },
            None => error.into(),
        })
    }

    /// Notes that the world was changed in a way for which there is no operation.
    pub(super) fn spoil(&mut self) {
        self.is_stale = true;
    }
}

/// The state of each copy of a Rapier value after a program's code has changed it, if anything is recorded.
pub(super) struct Copies(pub(super) Option<Vec<Vec<u8>>>);

impl Copies {
    /// Makes an empty collection. `is_wanted` tells whether anything is recorded.
    pub(super) fn new(is_wanted: bool) -> Self {
        Self(is_wanted.then(Vec::new))
    }

    pub(super) fn note(&mut self, value: &impl Serialize) {
        if let Some(copies) = &mut self.0 {
            let mut bytes = Vec::new();
            write_state(value, &mut bytes).expect("plain values in memory encode");
            copies.push(bytes);
        }
    }
}

/// A writer that records a snapshot in parts.
pub(super) struct Parts<'a> {
    tape: &'a mut Tape,
    part: Vec<u8>,
}

impl Parts<'_> {
    fn end(&mut self) {
        if !self.part.is_empty() {
            let part = std::mem::take(&mut self.part);
            self.tape.put(Operation::Seed(part));
        }
    }
}

impl Write for Parts<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = bytes.len().min(PART - self.part.len());
        self.part.extend_from_slice(&bytes[..count]);
        if self.part.len() == PART {
            self.end();
        }
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
