//! What can go wrong, as far as a caller can act on it.

use std::path::PathBuf;

/// An error of this library. Its text is one line that names the file or setting, what is wrong and what is allowed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting has an unknown name or a value that is not allowed.
    #[error("setting `{key}`: {problem}; allowed: {allowed}")]
    Setting {
        /// The dotted key, for example `wave.delta_theta`.
        key: String,
        /// What is wrong with it.
        problem: String,
        /// The values that would have been taken.
        allowed: String,
    },
    /// A file could not be read or holds something that is not allowed.
    #[error("{}: {problem}", path.display())]
    File {
        /// The file, as the caller named it.
        path: PathBuf,
        /// What is wrong, and what is allowed.
        problem: String,
    },
    /// An argument of a call is not allowed (an unknown built-in scene, a camera that is not there, a size).
    #[error("{what}: {problem}; allowed: {allowed}")]
    Argument {
        /// The argument, for example `scene` or `size`.
        what: &'static str,
        /// What is wrong with it.
        problem: String,
        /// The values that would have been taken.
        allowed: String,
    },
    /// No OpenGL context: EGL, a driver or a feature is missing.
    #[error("{0}")]
    NoContext(String),
    /// The GPU was reset. Nothing of the context works any more: it and all that was made from it can only be dropped, and
    /// another one made in their place.
    #[error("the GPU was reset: the OpenGL context is lost")]
    ContextLost,
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// The driver refused something that a sound program asked of it, for example for lack of memory.
    #[error("OpenGL: {0}")]
    Gl(String),
}

impl Error {
    /// True where the input is at fault (exit status 2 of the command line), false where the machine is.
    pub fn is_bad_input(&self) -> bool {
        matches!(self, Error::Setting { .. } | Error::File { .. } | Error::Argument { .. })
    }
}

/// Shorthand for results of this library.
pub type Result<T, E = Error> = std::result::Result<T, E>;
