//! The command line of the crate: runs scene files without a window, and checks them.
//!
//! Its arguments, outputs and exit status are a contract with other programs: see the README.

mod arguments;
mod check;
mod numbering;
mod output;
mod plan;
mod run;
mod simulation;

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;

use arguments::Command;

/// Why the program fails.
#[derive(Debug, thiserror::Error)]
enum Failure {
    /// Bad arguments or a scene that is refused. Nothing was written.
    #[error("{0}")]
    Refused(String),
    /// An output could not be written to the end.
    #[error("cannot write {destination}: {source}")]
    Unwritable { destination: String, source: std::io::Error },
}

impl Failure {
    fn exit_code(&self) -> ExitCode {
        match self {
            Self::Refused(_) => ExitCode::from(2),
            Self::Unwritable { .. } => ExitCode::from(3),
        }
    }
}

fn main() -> ExitCode {
    let result = match Command::parse() {
        Command::Run(arguments) => run::run(&arguments),
        Command::Check(arguments) => check::check(&arguments),
    };
    result.unwrap_or_else(|failure| {
        say(&format!("error: {failure}"));
        failure.exit_code()
    })
}

/// Writes a line to stderr; a closed stderr is not an error.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
