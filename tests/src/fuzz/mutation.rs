//! Mutates inputs at random: numbers that are too large, missing bytes, events that come twice, too early or
//! from another process.

use dcd::sim::Random;

use super::Form;
use super::script::{Event, events, put_event};

/// The longest mutated input, bytes.
const MOST_BYTES: usize = 256 << 10;

/// Rarely sent numbers in the encodings of messages: bincode's variable-length integers, and floats.
const NUMBERS: [&[u8]; 14] = [
    &[0],
    &[250],
    &[251, 255, 255],
    &[252, 255, 255, 255, 255],
    &[252, 0, 0, 0, 128],
    &[253, 255, 255, 255, 255, 255, 255, 255, 255],
    &[253, 0, 0, 0, 0, 0, 0, 0, 128],
    &[0, 0, 192, 127],
    &[0, 0, 128, 127],
    &[255, 255, 127, 127],
    &[1, 0, 0, 0],
    &[0, 0, 0, 0, 0, 0, 248, 127],
    &[0, 0, 0, 0, 0, 0, 240, 127],
    &[255, 255, 255, 255, 255, 255, 239, 127],
];

/// The same for texts: rare numbers and stray delimiters.
const WORDS: [&str; 14] =
    ["-1", "0", "1e999", "-1e38", "nan", "inf", "18446744073709551616", "[", "]", "\"", "\n", "<", ">", "="];

/// Returns an input with some mutations, which may insert parts of `other`.
#[must_use]
pub fn changed(input: &[u8], other: &[u8], form: Form, seed: u64) -> Vec<u8> {
    let random = &mut Random::new(seed);
    let mut bytes = input.to_vec();
    for _ in 0..=random.below(3) {
        bytes = match form {
            Form::Script if random.chance(0.9) => changed_script(&bytes, other, random),
            Form::Script | Form::Value => changed_bytes(&bytes, other, false, random),
            Form::Text => changed_bytes(&bytes, other, true, random),
        };
    }
    bytes.truncate(MOST_BYTES);
    bytes
}

/// Returns a random position in a list of this length, its end included.
fn place(length: usize, random: &mut Random) -> usize {
    random.below(length as u64 + 1) as usize
}

fn changed_bytes(bytes: &[u8], other: &[u8], is_text: bool, random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let at = place(bytes.len().saturating_sub(1), random);
    let until = (at + 1 + random.below(16) as usize).min(bytes.len());
    match random.below(8) {
        0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
        1 if at < bytes.len() => bytes[at] = random.bits() as u8,
        2 if at < bytes.len() => drop(bytes.drain(at..until)),
        3 if at < bytes.len() => {
            let part = bytes[at..until].to_vec();
            bytes.splice(at..at, part);
        }
        4 => bytes.truncate(at),
        5 if !other.is_empty() => {
            let from = place(other.len() - 1, random);
            let to = (from + 1 + random.below(64) as usize).min(other.len());
            bytes.splice(at..at, other[from..to].iter().copied());
        }
        _ => {
            let words: Vec<_> = WORDS.iter().map(|word| word.as_bytes()).collect();
            let number = random.pick(if is_text { &words } else { &NUMBERS }).unwrap_or_default();
            // It replaces no byte, one byte, or as many bytes as it has.
            let replaced = random.pick(&[0, 1, number.len()]).unwrap_or_default();
            let end = (at + replaced).min(bytes.len());
            bytes.splice(at.min(end)..end, number.iter().copied());
        }
    }
    bytes
}

fn changed_script(script: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut all: Vec<_> = events(script).collect();
    if all.is_empty() {
        return script.to_vec();
    }
    let (at, to) = (place(all.len() - 1, random), place(all.len() - 1, random));
    let bytes;
    match random.below(9) {
        0 => drop(all.remove(at)),
        1 => all.insert(to, all[at]),
        2 => all.swap(at, to),
        3 => all[at].from = random.bits() as u8,
        4 => all[at].kind = random.bits() as u8,
        5 => all[at].after_ms = random.bits() as u8,
        6 => {
            let others: Vec<_> = events(other).collect();
            if let Some(event) = random.pick(&others) {
                all.insert(at, event);
            }
        }
        _ => {
            bytes = changed_bytes(all[at].bytes, all[to].bytes, false, random);
            all[at].bytes = &bytes;
        }
    }
    written(&all)
}

fn written(events: &[Event<'_>]) -> Vec<u8> {
    let mut script = Vec::new();
    events.iter().for_each(|event| put_event(&mut script, event));
    script
}
