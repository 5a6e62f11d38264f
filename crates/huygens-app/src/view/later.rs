//! What another thread works out for the window.

use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::thread;

use eframe::egui;

/// A result that will be there later. Nobody waits for it once this is dropped.
pub struct Later<T>(Receiver<T>);

impl<T: Send + 'static> Later<T> {
    pub fn new(ctx: &egui::Context, work: impl FnOnce() -> T + Send + 'static) -> Self {
        let (sender, receiver) = mpsc::channel();
        let ctx = ctx.clone();
        thread::spawn(move || {
            let _ = sender.send(work());
            ctx.request_repaint();
        });
        Self(receiver)
    }

    /// The result, once, when it is there; inside, nothing if the thread has died.
    pub fn take(&self) -> Option<Option<T>> {
        match self.0.try_recv() {
            Ok(result) => Some(Some(result)),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(None),
        }
    }
}
