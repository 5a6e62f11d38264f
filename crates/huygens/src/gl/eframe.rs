//! The context of an eframe application.

use std::rc::Rc;

use super::Context;
use crate::{Error, Result};

impl Context {
    /// The context that an eframe application draws with, so that [`Renderer`](crate::Renderer) can draw beside egui.
    ///
    /// eframe keeps it current on its thread while it runs the application. What was made from it has to be dropped in
    /// `App::on_exit` at the latest, and while a frame of another viewport is drawn nothing of it may be used.
    ///
    /// # Errors
    /// [`Error::NoContext`] where eframe does not draw with glow, and as [`Context::new`].
    pub fn of_eframe(creation: &eframe::CreationContext<'_>) -> Result<Rc<Self>> {
        let missing = || Error::NoContext("eframe does not draw with OpenGL here".into());
        let load = creation.get_proc_address.clone().ok_or_else(missing)?;
        // SAFETY: eframe hands this value out while its context is current, which it stays while the application runs.
        unsafe { Self::new(glow::Context::from_loader_function_cstr(|name| load(name))) }
    }
}
