//! Computes the digest of a region: the sum of the hashes of its bodies' states. A sum identifies the
//! culprit: if a single bit of a single body differs, the difference of two digests is that of two hashes,
//! and trying all bits of all bodies finds it.

use crate::space::{BodyId, drawn, mixed};

/// The number of 32-bit words of a body's state.
const WORDS: usize = 16;

/// The fields of a body's state: name, first word, and number of words. An f64 takes two words, an f32 the
/// lower one of two, or one.
pub const FIELDS: [(&str, usize, usize); 13] = [
    ("translation.x", 0, 2),
    ("translation.y", 2, 2),
    ("translation.z", 4, 2),
    ("rotation.i", 6, 1),
    ("rotation.j", 7, 1),
    ("rotation.k", 8, 1),
    ("rotation.w", 9, 1),
    ("linvel.x", 10, 1),
    ("linvel.y", 11, 1),
    ("linvel.z", 12, 1),
    ("angvel.x", 13, 1),
    ("angvel.y", 14, 1),
    ("angvel.z", 15, 1),
];

/// The bits of a body's pose and velocity, as its region computes with them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BodyBits([u32; WORDS]);

impl BodyBits {
    /// Returns the bits of a state whose position is in f32, relative to its region.
    pub fn of_f32(translation: [f32; 3], rotation: [f32; 4], linvel: [f32; 3], angvel: [f32; 3]) -> Self {
        Self::of(translation.map(|v| u64::from(v.to_bits())), rotation, linvel, angvel)
    }

    /// Returns the bits of a state whose position is in f64.
    pub fn of_f64(translation: [f64; 3], rotation: [f32; 4], linvel: [f32; 3], angvel: [f32; 3]) -> Self {
        Self::of(translation.map(f64::to_bits), rotation, linvel, angvel)
    }

    fn of(translation: [u64; 3], rotation: [f32; 4], linvel: [f32; 3], angvel: [f32; 3]) -> Self {
        let mut words = [0; WORDS];
        for (pair, v) in words.chunks_exact_mut(2).zip(translation) {
            pair.copy_from_slice(&[v as u32, (v >> 32) as u32]);
        }
        let rest = rotation.iter().chain(&linvel).chain(&angvel);
        words[6..].iter_mut().zip(rest).for_each(|(word, v)| *word = v.to_bits());
        Self(words)
    }

    /// Returns the position as f32.
    pub fn translation_f32(&self) -> [f32; 3] {
        [0, 2, 4].map(|at| f32::from_bits(self.0[at]))
    }

    /// Returns the position as f64.
    pub fn translation_f64(&self) -> [f64; 3] {
        [0, 2, 4].map(|at| f64::from_bits(self.pair(at)))
    }

    /// Returns the rotation, as i, j, k, w.
    pub fn rotation(&self) -> [f32; 4] {
        [6, 7, 8, 9].map(|at| f32::from_bits(self.0[at]))
    }

    /// Returns the linear velocity, m/s.
    pub fn linvel(&self) -> [f32; 3] {
        [10, 11, 12].map(|at| f32::from_bits(self.0[at]))
    }

    /// Returns the angular velocity, rad/s.
    pub fn angvel(&self) -> [f32; 3] {
        [13, 14, 15].map(|at| f32::from_bits(self.0[at]))
    }

    /// Returns these bits with one of the 512 flipped.
    #[must_use]
    pub fn flipped(mut self, bit: usize) -> Self {
        self.0[bit / 32] ^= 1 << (bit % 32);
        self
    }

    /// Returns the value of the field at this index of [`FIELDS`].
    pub fn value(&self, field: usize) -> f64 {
        let (_, at, words) = FIELDS[field];
        // The upper half of an f64 is zero only for 0 and for values too small to matter. A number whose
        // upper half is zero is read as an f32.
        if words == 2 && self.0[at + 1] != 0 {
            f64::from_bits(self.pair(at))
        } else {
            f32::from_bits(self.0[at]).into()
        }
    }

    /// Returns the index in [`FIELDS`] of the first field in which two states differ.
    pub fn first_difference(&self, other: &Self) -> Option<usize> {
        FIELDS.iter().position(|&(_, at, words)| self.0[at..at + words] != other.0[at..at + words])
    }

    fn pair(&self, at: usize) -> u64 {
        u64::from(self.0[at]) | u64::from(self.0[at + 1]) << 32
    }

    fn hash(&self, id: BodyId) -> u64 {
        let start = drawn(id.bits());
        (0..WORDS).step_by(2).fold(start, |hash, at| mixed(hash ^ self.pair(at)).wrapping_add(at as u64))
    }
}

/// Returns the digest of these bodies, in any order.
pub fn digest(bodies: impl IntoIterator<Item = (BodyId, BodyBits)>) -> u64 {
    bodies.into_iter().fold(0, |sum, (id, bits)| sum.wrapping_add(bits.hash(id)))
}

/// A body whose recorded state is not the replayed one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Changed {
    /// The body.
    pub body: BodyId,
    /// The recorded state; `None` if the body was not there.
    pub recorded: Option<BodyBits>,
    /// The replayed state; `None` if the body is not there.
    pub replayed: Option<BodyBits>,
}

/// Returns the one body by which these digests differ, if a single bit of its state differs, or if it exists
/// in the replay only. `bodies` are those of the replay.
pub fn find_changed(
    recorded: u64,
    replayed: u64,
    bodies: impl IntoIterator<Item = (BodyId, BodyBits)>,
) -> Option<Changed> {
    let sought = recorded.wrapping_sub(replayed);
    bodies.into_iter().find_map(|(body, bits)| {
        let hash = bits.hash(body);
        let changed = |recorded| Changed { body, recorded, replayed: Some(bits) };
        if hash.wrapping_neg() == sought {
            return Some(changed(None));
        }
        let flips = (0..32 * WORDS).map(|bit| bits.flipped(bit));
        let found = flips.into_iter().find(|flipped| flipped.hash(body).wrapping_sub(hash) == sought)?;
        Some(changed(Some(found)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bodies() -> Vec<(BodyId, BodyBits)> {
        let of = |i: u32| {
            let v = i as f32;
            let bits = BodyBits::of_f64(
                [f64::from(i), 0.5, -1.0 / 3.0],
                [0.0, 0.0, 0.0, 1.0],
                [v, -v, 0.1],
                [0.0, v * 0.3, 2.0],
            );
            (BodyId::persistent(i), bits)
        };
        (0..500).map(of).collect()
    }

    #[test]
    fn each_single_bit_of_a_body_is_found_with_its_body_and_its_field() {
        let truth = bodies();
        let replayed = digest(truth.iter().copied());
        for bit in 0..512 {
            let mut disturbed = truth.clone();
            let at = bit % disturbed.len();
            disturbed[at].1 = disturbed[at].1.flipped(bit);
            let recorded = digest(disturbed.iter().rev().copied());
            let found = find_changed(recorded, replayed, truth.iter().copied()).unwrap();
            let expected =
                Changed { body: truth[at].0, recorded: Some(disturbed[at].1), replayed: Some(truth[at].1) };
            assert_eq!(found, expected);
            let field = disturbed[at].1.first_difference(&truth[at].1).unwrap();
            let (_, first, words) = FIELDS[field];
            assert!((first..first + words).contains(&(bit / 32)), "bit {bit} is not in field {field}");
        }
        assert_eq!(find_changed(replayed, replayed, truth.iter().copied()), None);
    }

    #[test]
    fn a_body_too_many_is_found() {
        let truth = bodies();
        let recorded = digest(truth[1..].iter().copied());
        let found = find_changed(recorded, digest(truth.iter().copied()), truth.iter().copied()).unwrap();
        assert_eq!(found, Changed { body: truth[0].0, recorded: None, replayed: Some(truth[0].1) });
    }
}
