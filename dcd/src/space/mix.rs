//! Mixes the bits of 64-bit numbers.

/// Mixes the bits of a number so that all bits of the result depend on all of them: the finaliser of
/// SplitMix64 (Steele, Lea and Flood, 2014).
pub const fn mixed(v: u64) -> u64 {
    let v = (v ^ (v >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let v = (v ^ (v >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    v ^ (v >> 31)
}

/// Returns the number that SplitMix64 generates from this state. Passing it back as the next state gives a
/// sequence.
pub const fn drawn(state: u64) -> u64 {
    mixed(state.wrapping_add(0x9e37_79b9_7f4a_7c15))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the first outputs of SplitMix64 from the state 1234567, as the authors' own code prints
    /// them.
    #[test]
    fn it_is_the_finaliser_of_splitmix64() {
        let mut state = 1_234_567_u64;
        let mut next = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            mixed(state)
        };
        assert_eq!([next(), next()], [6_457_827_717_110_365_317, 3_203_168_211_198_807_973]);
    }
}
