//! Clocks, memory and the processor's peak.

use std::time::Instant;

use rayon::ThreadPool;
use serde_json::{Map, Value, json};

use super::{Job, PEAK_FLAG};

/// Wall-clock and processor time of a work.
#[derive(Clone, Copy)]
pub struct Time {
    pub seconds: f64,
    pub processor: f64,
}

/// Runs `work` and takes its time.
pub fn timed(work: impl FnOnce()) -> Time {
    let (begun, used) = (Instant::now(), processor_seconds());
    work();
    Time { seconds: begun.elapsed().as_secs_f64(), processor: processor_seconds() - used }
}

/// The mean of `n` times, taken one after the other.
pub fn mean_time(n: usize, mut time: impl FnMut() -> Time) -> Time {
    let mean = |sum: Time, time: Time| Time {
        seconds: sum.seconds + time.seconds / n as f64,
        processor: sum.processor + time.processor / n as f64,
    };
    (0..n).map(|_| time()).fold(Time { seconds: 0.0, processor: 0.0 }, mean)
}

/// Processor time of all threads of this process.
fn processor_seconds() -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `time` is valid for writing
    let failed = unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &mut time) };
    assert!(failed == 0, "this system has no clock of processor time");
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

pub fn pool(threads: usize) -> ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap_or_else(|error| panic!("{error}"))
}

/// Fused multiply-adds in registers on all threads of `pool`, in 10⁹ floating-point operations a second; `None` for
/// processors that it does not know.
pub fn peak_gflops(pool: &ThreadPool) -> Option<f64> {
    const TURNS: u64 = 2_000_000;
    let lanes = peak_loop(1)?;
    let time = timed(|| {
        pool.broadcast(|_| peak_loop(TURNS));
    });
    let operations = TURNS as f64 * (2 * CHAINS * lanes) as f64 * pool.current_num_threads() as f64;
    Some(operations / time.seconds / 1e9)
}

/// Independent sums, enough to fill two units with a latency of four cycles.
const CHAINS: usize = 12;

/// Adds products to each of [`CHAINS`] vectors `turns` times; returns the lanes of a vector.
#[cfg(target_arch = "x86_64")]
fn peak_loop(turns: u64) -> Option<usize> {
    macro_rules! sums {
        ($register:literal) => {
            // SAFETY: the processor has the instructions, as was asked below; only registers change, and those are declared
            unsafe {
                core::arch::asm!(
                    concat!("vbroadcastss ", $register, "14, xmm14"),
                    concat!("vbroadcastss ", $register, "15, xmm15"),
                    "2:",
                    concat!("vfmadd213ps ", $register, "0, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "1, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "2, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "3, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "4, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "5, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "6, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "7, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "8, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "9, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "10, ", $register, "14, ", $register, "15"),
                    concat!("vfmadd213ps ", $register, "11, ", $register, "14, ", $register, "15"),
                    "sub {turns}, 1",
                    "jnz 2b",
                    "vzeroupper",
                    turns = inout(reg) turns => _,
                    out("xmm0") _, out("xmm1") _, out("xmm2") _, out("xmm3") _, out("xmm4") _, out("xmm5") _,
                    out("xmm6") _, out("xmm7") _, out("xmm8") _, out("xmm9") _, out("xmm10") _, out("xmm11") _,
                    inout("xmm14") 0.99f32 => _, inout("xmm15") 0.01f32 => _,
                    options(nomem, nostack),
                );
            }
        };
    }
    if is_x86_feature_detected!("avx512f") {
        sums!("zmm");
        Some(16)
    } else if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        sums!("ymm");
        Some(8)
    } else {
        None
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn peak_loop(_turns: u64) -> Option<usize> {
    None
}

/// Processor, system and date.
pub fn describe() -> Map<String, Value> {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':')).map(|(_, name)| name.trim());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let date = jiff::Timestamp::now().strftime("%Y-%m-%d").to_string();
    let values = [
        ("processor", json!(model)),
        ("cores", json!(cores)),
        ("arch", json!(std::env::consts::ARCH)),
        ("isa", json!(panotune::kernel::isa().name())),
        ("date", json!(date)),
    ];
    values.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Does one round of `job` on one thread and prints the peak of this process's memory, and how much it held before.
pub fn print_peak_memory(job: Option<Job>) {
    let Some(job) = job else { return };
    let mut prepared = (job.make)();
    let before = memory_mib("VmRSS:");
    pool(1).install(&mut prepared.work);
    println!("{}", json!({ "peak_mib": memory_mib("VmHWM:"), "before_mib": before }));
}

/// [`print_peak_memory`] in a process of its own.
pub fn peak_of_child(job: &str) -> Option<Value> {
    let program = std::env::current_exe().ok()?;
    let output = std::process::Command::new(program).args([PEAK_FLAG, job]).output().ok()?;
    serde_json::from_slice(&output.stdout).ok()
}

fn memory_mib(key: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(key))?;
    Some(line.split_whitespace().next()?.parse::<f64>().ok()? / 1024.0)
}
