//! `vines completions` and `vines man`, and the list of commands after a wrong one: what shells and readers get from the command line itself.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;

use super::{Cli, failure::Failure};

/// Print completions for a shell
#[derive(Debug, Args)]
pub(super) struct CompletionsArguments {
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// Print a manual page (roff)
#[derive(Debug, Args)]
pub(super) struct ManArguments {
    /// Command of the page; without it, the page of the program
    #[arg(value_name = "COMMAND")]
    command: Option<String>,
}

pub(super) fn completions(arguments: &CompletionsArguments) -> String {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "vines", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

pub(super) fn man(arguments: &ManArguments) -> Result<String, Failure> {
    let mut command = Cli::command();
    // A command then has the name of its page.
    command.build();
    if let Some(name) = &arguments.command {
        let unknown = || Failure::input(format!("`{name}` is not a command; {}", commands()));
        let found = command.find_subcommand(name).ok_or_else(unknown)?;
        command = found.clone();
    }
    let mut page = Vec::new();
    clap_mangen::Man::new(command).render(&mut page)?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}

/// A word as a shell needs it: in single quotes, unless it has only characters that no shell reads otherwise.
pub(super) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./:=,+@%±".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.into(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// The error of the command line, with what to do: of a command that does not exist the list of those that do, of a scene its option.
pub(super) fn with_advice(mut error: clap::Error) -> clap::Error {
    let advice = match (error.kind(), error.get(ContextKind::InvalidArg)) {
        (ErrorKind::InvalidSubcommand, _) => commands(),
        (ErrorKind::UnknownArgument, Some(ContextValue::String(file))) if file.ends_with(".toml") => {
            format!("a scene has an option: --scene {}", quoted(file))
        }
        _ => return error,
    };
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![advice.into()]));
    error
}

fn commands() -> String {
    let command = Cli::command();
    let visible = command.get_subcommands().filter(|command| !command.is_hide_set());
    let names: Vec<&str> = visible.map(Command::get_name).collect();
    format!("commands are {}", names.join(", "))
}
