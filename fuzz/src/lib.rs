//! Lets libFuzzer run the targets of `dcd_tests::fuzz`, and change their inputs as that module does.

pub use dcd_tests::fuzz;
pub use libfuzzer_sys;

/// Changes an input in place, and returns its new length. Half of the changes are libFuzzer's own.
pub fn change(name: &str, data: &mut [u8], length: usize, room: usize, seed: u32) -> usize {
    if seed % 2 == 0 {
        return libfuzzer_sys::fuzzer_mutate(data, length, room);
    }
    let target = fuzz::target(name).expect("it is a target");
    let input = data[..length].to_vec();
    let changed = fuzz::changed(&input, &input, target.form, seed.into());
    let length = changed.len().min(room);
    data[..length].copy_from_slice(&changed[..length]);
    length
}

/// Makes the program of one target.
#[macro_export]
macro_rules! fuzz_by {
    ($name:literal) => {
        use $crate::libfuzzer_sys;

        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
            static TARGET: std::sync::LazyLock<&$crate::fuzz::Target> =
                std::sync::LazyLock::new(|| $crate::fuzz::target($name).expect("it is a target"));
            (TARGET.run)(bytes);
        });

        libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], length: usize, room: usize, seed: u32| {
            $crate::change($name, data, length, room, seed)
        });
    };
}
