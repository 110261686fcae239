//! Clocks and counters.

use std::fs::read_to_string;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Nanoseconds per call, measured over a fifth of a second or more.
pub fn nanoseconds(mut work: impl FnMut()) -> f64 {
    let mut calls = 1;
    loop {
        let begun = Instant::now();
        for _ in 0..calls {
            work();
        }
        let elapsed = begun.elapsed();
        if elapsed >= Duration::from_millis(200) {
            return elapsed.as_nanos() as f64 / calls as f64;
        }
        calls *= 2;
    }
}

/// Processor seconds per second while the work is done ten times a second, for two
/// seconds. A value near 1 means that it cannot keep up.
pub fn processor_at_10_hz(mut work: impl FnMut()) -> f64 {
    let (used, begun) = (processor(), Instant::now());
    for period in 1..=20 {
        work();
        let due = begun + period * Duration::from_millis(100);
        sleep(due.saturating_duration_since(Instant::now()));
    }
    (processor() - used) / begun.elapsed().as_secs_f64()
}

/// Processor seconds that this process has used.
fn processor() -> f64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // Safe: the clock exists in every process; the result is written to a local variable.
    unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) };
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

/// Bytes of this process that are in memory.
pub fn resident() -> f64 {
    let counts = read_to_string("/proc/self/statm").expect("the memory of a process, on Linux");
    let pages = counts.split(' ').nth(1).and_then(|n| n.parse().ok());
    // Safe: it reads a constant of the system.
    let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) } as f64;
    pages.unwrap_or(0.0) * page
}
