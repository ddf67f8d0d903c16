//! The command line as typed: commands about run folders.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;

/// `panotune runs`.
#[derive(Debug, Clone, Args)]
pub struct RunsArgs {
    /// Only runs of this experiment or suite.
    pub name: Option<String>,
}

/// `panotune gc`.
#[derive(Debug, Clone, Args)]
pub struct GcArgs {
    /// Artefacts of the cache to which no remaining run refers, and what killed processes left.
    #[arg(long)]
    pub artefacts: bool,
    /// Runs that were interrupted or failed.
    #[arg(long)]
    pub unfinished: bool,
    /// Runs whose `<name>/<id>` or id fits one of the patterns; `*` is any text, `?` any character.
    #[arg(long, value_name = "GLOB", num_args = 1..)]
    pub runs: Vec<String>,
    /// Only what has not changed for this long, e.g. `30d`, `12h`, `90min`.
    #[arg(long, value_name = "AGE", value_parser = seconds)]
    pub older_than: Option<f64>,
    /// Remove; without it, only say what would go.
    #[arg(long)]
    pub yes: bool,
}

/// An age as a number with a unit, in seconds.
fn seconds(text: &str) -> Result<f64, String> {
    let number: String = text.chars().take_while(|c| c.is_ascii_digit() || *c == '.').collect();
    let unit = match text[number.len()..].trim() {
        "s" => 1.0,
        "min" | "m" => 60.0,
        "h" => 3600.0,
        "d" => 86_400.0,
        "w" => 7.0 * 86_400.0,
        _ => f64::NAN,
    };
    let seconds = number.parse().unwrap_or(f64::NAN) * unit;
    if seconds.is_finite() { Ok(seconds) } else { Err("expected an age such as `30d`, `12h` or `90min`".to_owned()) }
}

/// `panotune archive`.
#[derive(Debug, Clone, Args)]
pub struct ArchiveArgs {
    /// A finished run: its folder, or the beginning of its name in the results folder.
    #[arg(required_unless_present = "extract")]
    pub run: Option<String>,
    /// The new file [default: <name>-<id>.zip].
    #[arg(long, value_name = "FILE", conflicts_with = "extract")]
    pub out: Option<PathBuf>,
    /// The artefacts of the cache that the run used come along.
    #[arg(long, conflicts_with = "extract")]
    pub with_cache: bool,
    /// Take over a run from this archive instead; nothing is overwritten.
    #[arg(long, value_name = "FILE", conflicts_with = "run")]
    pub extract: Option<PathBuf>,
    /// Results folder for it [default: that of `--results`].
    #[arg(long, value_name = "DIR", requires = "extract")]
    pub into: Option<PathBuf>,
}

/// `panotune watch`.
#[derive(Debug, Clone, Args)]
pub struct WatchArgs {
    /// A run: its folder, or the beginning of its name in the results folder.
    pub run: String,
    /// Show the present state and end.
    #[arg(long)]
    pub once: bool,
}

/// `panotune serve`.
#[derive(Debug, Clone, Args)]
pub struct ServeArgs {
    /// Address and port; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    pub bind: SocketAddr,
    /// Let other machines read: needed for an address that they can reach.
    #[arg(long)]
    pub allow_remote: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ages_have_a_unit() {
        assert_eq!(
            ["30d", "1.5 h", "90min", "2w", "0s"].map(seconds),
            [2_592_000.0, 5400.0, 5400.0, 1_209_600.0, 0.0].map(Ok)
        );
        for text in ["", "30", "d", "-1d", "1y", "1e3d"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }
}
