//! Whose fault an error is, and so which code the program ends with.

/// The ways in which a run does not come to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Class {
    /// The command line, the YAML or the data is wrong: exit code 2.
    Input,
    /// The run failed (disk, memory, a bug): exit code 1.
    Run,
    /// What was computed is not what was recorded: exit code 3.
    Different,
    /// The user stopped it; the same command goes on: exit code 130.
    Interrupted,
}

impl Class {
    /// The program's exit code.
    pub fn exit_code(self) -> u8 {
        match self {
            Class::Input => 2,
            Class::Run => 1,
            Class::Different => 3,
            Class::Interrupted => 130,
        }
    }
}

/// An error that knows its [`Class`]; every operation's error type implements it.
pub trait Classify: std::error::Error {
    /// Whose fault it is.
    fn class(&self) -> Class;
}
