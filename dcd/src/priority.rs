//! Lowers the priority of threads that compute no region.

/// By how much such threads are nicer than the others (`nice(2)`): one that competes with one of them for a
/// core gets a quarter of it.
#[cfg(target_os = "linux")]
const NICER: i32 = 5;

/// Makes this thread give way to threads that compute the world, where cores are scarce. It does nothing
/// where threads have no priority of their own: Linux alone gives them one without being asked for rights.
pub(crate) fn give_way() {
    #[cfg(target_os = "linux")]
    {
        use rustix::process::{getpid, getpriority_process, setpriority_process};
        // By a thread's id Linux knows that thread alone: the process's is that of its first thread, and none
        // is the calling one. A thread begins with the priority of the one that starts it.
        let [usual, own] = [Some(getpid()), None].map(|of| getpriority_process(of).unwrap_or(0));
        // A priority may always be lowered.
        let _ = setpriority_process(None, own.max(usual.saturating_add(NICER)));
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_thread_gives_way_and_no_other_does() {
        let priority = || rustix::process::getpriority_process(None).unwrap();
        let before = priority();
        let there = std::thread::spawn(move || {
            give_way();
            let its_own = std::thread::spawn(move || {
                give_way();
                priority()
            });
            [priority(), its_own.join().unwrap()]
        });
        assert_eq!(there.join().unwrap(), [(before + NICER).min(19); 2]);
        assert_eq!(priority(), before);
    }
}
