//! The command line: `view` opens a window, `render` makes a picture, `reference` traces one, `compare` and
//! `bench` measure, `info` says what there is. Exit status 0: done; 2: bad arguments or bad input; 130: Ctrl-C; 1: anything else. An error is one line on
//! stderr.

mod bench;
mod cli;
mod compare;
mod info;
mod input;
mod interrupt;
mod metrics;
mod output;
mod progress;
mod reference;
mod render;
mod view;

use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// Why the program stops, and the exit status that says so.
#[derive(Debug)]
struct Failure {
    status: u8,
    cause: anyhow::Error,
}

impl Failure {
    /// Exit status 130, as shells have it for a program that Ctrl-C ended.
    fn interrupted(what: impl Display) -> Self {
        Self { status: 130, cause: anyhow::anyhow!("interrupted: {what}") }
    }

    /// Exit status 2. The message names what was given, what is wrong with it and what is allowed.
    fn bad_input(what: impl Display, problem: impl Display, allowed: impl Display) -> Self {
        Self { status: 2, cause: anyhow::anyhow!("{what}: {problem}; allowed: {allowed}") }
    }
}

impl From<huygens::Error> for Failure {
    fn from(error: huygens::Error) -> Self {
        Self { status: if error.is_bad_input() { 2 } else { 1 }, cause: error.into() }
    }
}

impl From<anyhow::Error> for Failure {
    fn from(cause: anyhow::Error) -> Self {
        Self { status: 1, cause }
    }
}

fn main() -> ExitCode {
    interrupt::install();
    let mut result = cli::parse().and_then(|command| command.as_ref().map_or(Ok(()), run));
    if let Err(failure) = &result
        && failure.cause.is::<view::NoWindow>()
        && let Some(render) = cli::without_window()
    {
        result = run(&render);
    }
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            say("error", format_args!("{:#}", failure.cause));
            ExitCode::from(failure.status)
        }
    }
}

fn run(command: &cli::Command) -> Result<(), Failure> {
    match command {
        cli::Command::View(arguments) => view::run(arguments),
        cli::Command::Render(arguments) => render::run(arguments),
        cli::Command::Reference(arguments) => reference::run(arguments),
        cli::Command::Compare(arguments) => compare::run(arguments),
        cli::Command::Bench(arguments) => bench::run(arguments),
        cli::Command::Info(arguments) => info::run(arguments),
    }
}

/// Writes one line to stderr, whatever the message holds: a file's name may have line breaks in it.
fn say(kind: &str, message: impl Display) {
    let mut line = format!("huygens: {kind}: ");
    for c in message.to_string().chars() {
        if c.is_control() { line.extend(c.escape_default()) } else { line.push(c) }
    }
    line.push('\n');
    // Nobody is left to be told that stderr is closed.
    let _ = std::io::stderr().write_all(line.as_bytes());
}

/// Writes to stdout. Whoever closes it early (`huygens info | head`) has read enough: that is no error.
fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(anyhow::anyhow!("stdout: {error}").into()),
        _ => Ok(()),
    }
}
