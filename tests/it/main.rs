//! Tests of the whole: rules of the architecture, the command line, runs of the real binary.

// The fence is for the program: tests write the broken files that it has to bear.
#![allow(clippy::disallowed_methods)]

mod architecture;
mod bad_input;
mod browser;
mod command_line;
mod compare;
mod http;
mod live_runs;
mod optuna_storage;
mod panoramas;
mod pins;
mod real_data;
mod reports;
mod reruns;
mod run_folders;
mod serve;
mod study_commands;
mod shared_study;
mod support;
mod tables;
mod tuning;
mod verify;
