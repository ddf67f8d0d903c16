//! Names and numbers of states and directions in files.

use super::super::{Direction, TrialState};

const STATES: [(TrialState, i64, &str); 5] = [
    (TrialState::Running, 0, "RUNNING"),
    (TrialState::Complete, 1, "COMPLETE"),
    (TrialState::Pruned, 2, "PRUNED"),
    (TrialState::Fail, 3, "FAIL"),
    (TrialState::Waiting, 4, "WAITING"),
];

/// A state's name in databases and on the command line.
pub fn state_name(state: TrialState) -> &'static str {
    STATES.iter().find(|(s, _, _)| *s == state).map_or("", |(_, _, name)| name)
}

/// A state's number in journals.
pub fn state_code(state: TrialState) -> i64 {
    STATES.iter().find(|(s, _, _)| *s == state).map_or(-1, |(_, code, _)| *code)
}

/// The state of that name.
pub fn state_of_name(name: &str) -> Option<TrialState> {
    STATES.iter().find(|(_, _, n)| *n == name).map(|(state, _, _)| *state)
}

/// The state of that number.
pub fn state_of_code(code: i64) -> Option<TrialState> {
    STATES.iter().find(|(_, c, _)| *c == code).map(|(state, _, _)| *state)
}

/// A direction's name in databases and on the command line.
pub fn direction_name(direction: Direction) -> &'static str {
    match direction {
        Direction::Minimize => "MINIMIZE",
        Direction::Maximize => "MAXIMIZE",
    }
}

/// A direction's number in journals.
pub fn direction_code(direction: Direction) -> i64 {
    match direction {
        Direction::Minimize => 1,
        Direction::Maximize => 2,
    }
}

/// The direction of that name; `NOT_SET` is none.
pub fn direction_of_name(name: &str) -> Option<Direction> {
    [Direction::Minimize, Direction::Maximize].into_iter().find(|d| direction_name(*d) == name)
}

/// The direction of that number; 0 is none.
pub fn direction_of_code(code: i64) -> Option<Direction> {
    [Direction::Minimize, Direction::Maximize].into_iter().find(|d| direction_code(*d) == code)
}
