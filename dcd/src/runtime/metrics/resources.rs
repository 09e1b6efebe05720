//! Writes what a process uses of its machine, under Prometheus' names for that; on Linux, where the system
//! reports it.

use crate::metrics::Text;

/// The ticks per second of the clock by which Linux counts processor time. This is fixed for all that
/// programs see.
const CLOCK_TICKS_PER_S: f64 = 100.0;

pub(super) fn write(text: &mut Text) {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    if let Some(seconds) = cpu_seconds(&stat) {
        text.counter("process_cpu_seconds_total", "Time that all threads of this process have computed.")
            .is(seconds);
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    if let Some(bytes) = resident_bytes(&status) {
        text.gauge("process_resident_memory_bytes", "Memory that this process has now.").is(bytes);
    }
}

/// Reads the 14th and 15th field of a process's `stat`: the time in its own code, and in the system's. The
/// second field, a name in parentheses, may contain anything.
fn cpu_seconds(stat: &str) -> Option<f64> {
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let mut next = || fields.next()?.parse::<u64>().ok();
    Some((next()? + next()?) as f64 / CLOCK_TICKS_PER_S)
}

fn resident_bytes(status: &str) -> Option<f64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? as f64 * 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_tells_is_read() {
        let stat = "7 (a ) b) S 1 7 7 0 -1 4194560 1 2 3 4 250 75 0 0 20 0 4 0 100 1 2\n";
        assert_eq!(cpu_seconds(stat), Some(3.25));
        assert_eq!(resident_bytes("VmPeak:\t 9 kB\nVmRSS:\t    1024 kB\n"), Some(1_048_576.0));
        assert_eq!((cpu_seconds(""), resident_bytes("VmRSS: much\n")), (None, None));
    }
}
