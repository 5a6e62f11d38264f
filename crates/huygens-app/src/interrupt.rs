//! Ctrl-C, and being asked to end: a path tracer comes to an end and its picture is kept, files that are being written
//! are finished, everything else ends at once.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::say;

/// Whether a path tracer is at work.
static TRACING: AtomicBool = AtomicBool::new(false);

/// Whether files are being written.
static WRITING: AtomicBool = AtomicBool::new(false);

/// Whether an interrupt came while either was.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Handles interrupts from now on.
pub fn install() {
    let handler = || {
        let first = !INTERRUPTED.swap(true, Ordering::SeqCst);
        if WRITING.load(Ordering::SeqCst) || (first && TRACING.load(Ordering::SeqCst)) {
            return;
        }
        say("error", "interrupted");
        std::process::exit(130);
    };
    match ctrlc::try_set_handler(handler) {
        // Whoever started the program has it ignore interrupts, as `nohup` does, or a shell in the background.
        Ok(()) | Err(ctrlc::Error::MultipleHandlers) => {}
        Err(error) => say("warning", format_args!("Ctrl-C will lose the picture: {error}")),
    }
}

/// Does `work`, which asks [`is_asked_to_end`] from time to time. A second interrupt ends the program.
pub fn tracing<T>(work: impl FnOnce() -> T) -> T {
    during(&TRACING, work)
}

/// Does `work`, which no interrupt breaks off: a moment in which files get their names, all of them or none.
pub fn writing<T>(work: impl FnOnce() -> T) -> T {
    during(&WRITING, work)
}

/// Whether there was an interrupt.
pub fn is_asked_to_end() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

fn during<T>(flag: &AtomicBool, work: impl FnOnce() -> T) -> T {
    flag.store(true, Ordering::SeqCst);
    let result = work();
    flag.store(false, Ordering::SeqCst);
    result
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// The handler would end the test.
    #[test]
    fn an_interrupt_waits_until_files_are_written() {
        install();
        let interrupted = writing(|| {
            let id = std::process::id().to_string();
            assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
            (0..500).any(|_| {
                std::thread::sleep(std::time::Duration::from_millis(10));
                is_asked_to_end()
            })
        });
        assert!(interrupted);
    }
}
