//! Progress on stderr. It shows itself after a second, whatever happens meanwhile, and on a terminal alone.

use std::fmt::Display;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use huygens::Progress;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};

/// How long nothing is shown.
const DELAY: Duration = Duration::from_secs(1);

/// How often it moves while nothing is reported.
const TICK: Duration = Duration::from_millis(200);

const STEPS: f32 = 1000.0;

/// A bar, or a spinner as long as nobody knows how far it is. It is gone when it is dropped.
pub struct Bar {
    bar: ProgressBar,
    /// Since when shares of the whole have been reported.
    measured: Option<Instant>,
    /// Shows the bar when its time has come; ends when the sender is dropped.
    watcher: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Bar {
    /// `stage` says what is done first.
    pub fn new(quiet: bool, stage: impl Display) -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        bar.set_style(style("{spinner} {msg}"));
        bar.set_message(stage.to_string());
        let watcher = (!quiet).then(|| {
            let (sender, receiver) = mpsc::channel();
            let bar = bar.clone();
            let thread = thread::spawn(move || {
                if receiver.recv_timeout(DELAY) == Err(RecvTimeoutError::Timeout) {
                    bar.set_draw_target(ProgressDrawTarget::stderr());
                    bar.enable_steady_tick(TICK);
                }
            });
            (sender, thread)
        });
        Self { bar, measured: None, watcher }
    }

    /// What is done now, and how much of the whole is done.
    pub fn update(&mut self, progress: Progress) {
        let started = *self.measured.get_or_insert_with(|| {
            self.bar.set_length(STEPS as u64);
            self.bar.set_style(style("{percent:>3}% [{bar:40}] {msg}"));
            Instant::now()
        });
        let fraction = progress.fraction.clamp(0.0, 1.0);
        let left = started.elapsed().as_secs_f32() * (1.0 / fraction - 1.0);
        self.bar.set_position((fraction * STEPS) as u64);
        self.bar.set_message(match Duration::try_from_secs_f32(left) {
            Ok(left) => format!("{}, {} left", progress.pass, HumanDuration(left)),
            Err(_) => progress.pass.to_owned(),
        });
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some((sender, thread)) = self.watcher.take() {
            drop(sender);
            // It cannot panic; if it did, there would be no bar to clear.
            let _ = thread.join();
        }
        self.bar.finish_and_clear();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()).progress_chars("=> ")
}
