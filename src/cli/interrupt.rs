//! Ctrl-C and the termination signal: the first asks the work to stop, the second ends the program.

use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Listens from now on. Without a handler (which the system may refuse) the signals end the
/// program at once, which loses nothing that was finished.
pub(super) fn listen() {
    let handler = ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        eprintln!("\nstopping: what is finished stays, and the same command goes on (again to stop at once)");
    });
    if handler.is_err() {
        eprintln!("note: this system refuses a signal handler; Ctrl-C ends the program at once");
    }
}

/// Whether the user has asked to stop.
pub(super) fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}
