//! The command line as typed.

use std::path::PathBuf;

use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand, ValueEnum};

use super::args_runs::{ArchiveArgs, GcArgs, RunsArgs, ServeArgs, WatchArgs};
use crate::evaluate::Arm;
use crate::figures::study::StudyPlot;
use crate::store::CACHE;

/// Reproducible camera-characterisation studies from one YAML file.
#[derive(Debug, Parser)]
#[command(name = "panotune", version, disable_help_subcommand = true, after_help = EXIT_CODES)]
pub struct Cli {
    /// Options of every command.
    #[command(flatten)]
    pub global: Global,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done; 1 the run failed; 2 the input is wrong; \
3 compared or verified, and different; 130 interrupted, resumable.";

/// Options of every command.
#[derive(Debug, Clone, Args)]
pub struct Global {
    /// Folder of run folders.
    #[arg(long, global = true, value_name = "DIR", default_value = "results")]
    pub results: PathBuf,
    /// Folder of stage artefacts shared by runs [default: <results>/.cache]
    #[arg(long, global = true, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Threads to use; no result depends on it [default: all cores]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Say nothing but errors and the final result.
    #[arg(long, global = true)]
    pub quiet: bool,
    /// Write one JSON object a line to standard output.
    #[arg(long, global = true)]
    pub json: bool,
}

impl Global {
    /// The cache folder.
    pub fn cache(&self) -> PathBuf {
        self.cache.clone().unwrap_or_else(|| self.results.join(CACHE))
    }

    /// The number of threads.
    pub fn threads(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        self.threads.map_or_else(cores, usize::from)
    }
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Execute an experiment or a suite, or go on with an interrupted one.
    Run(RunArgs),
    /// Compute a finished run's trainings again and compare them with what it recorded, step by step.
    Verify(VerifyArgs),
    /// Compare finished runs: the same to the byte or where first not, settings, errors, seeds, searches.
    Compare(CompareArgs),
    /// Make the tables of finished runs from their artefacts, beside the published values; nothing is trained.
    Tables(TablesArgs),
    /// Write the `report.html` of finished runs anew from their artefacts; nothing is trained.
    Report(ReportArgs),
    /// List runs: state, seed, best value, trials, age and size, newest first.
    Runs(RunsArgs),
    /// Follow a run in the terminal.
    ///
    /// Ends when the run ends: with 0 if it has finished, 1 if it failed, 130 if it was interrupted. Nothing is written, and the
    /// run does not notice.
    Watch(WatchArgs),
    /// Follow all runs in a browser.
    ///
    /// Only reading is answered, of the results folder alone. At a loopback address only this machine's own names are answered to.
    Serve(ServeArgs),
    /// Pack a finished run into one file, or take over a packed one.
    ///
    /// The archive has the run's folder, of a suite its runs too: all that verifying, comparing and reading its report takes,
    /// but not the artefacts of the cache, which `panotune verify` then computes anew. They come along with `--with-cache`.
    /// Panoramas and weights files of one's own that the experiment names are not in it.
    Archive(ArchiveArgs),
    /// Remove runs and artefacts that nothing needs; says what would go unless `--yes` is given.
    ///
    /// What remains keeps what it refers to: artefacts of the cache that a run's log names, and the runs of a suite. A run
    /// under way, `results/reference`, weights and whatever is reached through a link are never touched. Runs in other results
    /// folders that share the cache are not looked at; they make anew what they miss.
    Gc(GcArgs),
    /// Check experiment files without computing anything.
    Check(CheckArgs),
    /// Show the stages of an experiment: cached or to run, why, and for how long.
    Plan(ExperimentArgs),
    /// Show resolved values, or the schema of experiment files.
    Config(ConfigArgs),
    /// Install and list trained backbone weights.
    Weights(WeightsArgs),
    /// Look into, convert and add to studies in files of Optuna's formats.
    Study(StudyArgs),
}

/// An experiment file and what changes it.
#[derive(Debug, Clone, Args)]
pub struct ExperimentArgs {
    /// Experiment file.
    pub file: PathBuf,
    /// Scale that overrides the file's values.
    #[arg(long, value_enum)]
    pub profile: Option<ProfileArg>,
    /// Override one value, e.g. `train.epochs=50`; may be given several times.
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub sets: Vec<String>,
}

/// Names of profiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProfileArg {
    /// The paper's scale: 17,000 views, 1,000 epochs.
    Paper,
    /// Within ten minutes on two cores (the default).
    Desk,
    /// Within a minute.
    Smoke,
    /// Within seconds.
    Tiny,
}

impl ProfileArg {
    /// The profile's name, as in `configs/profile/`.
    pub fn name(self) -> &'static str {
        match self {
            ProfileArg::Paper => "paper",
            ProfileArg::Desk => "desk",
            ProfileArg::Smoke => "smoke",
            ProfileArg::Tiny => "tiny",
        }
    }
}

/// `panotune run`.
#[derive(Debug, Clone, Args)]
pub struct RunArgs {
    /// What to run.
    #[command(flatten)]
    pub experiment: ExperimentArgs,
    /// Begin a new run even if there is one, and make every artefact anew.
    #[arg(long)]
    pub fresh: bool,
    /// Run the experiment N times, with its seed and the N − 1 after it, each in a folder of its own.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub seeds: Option<u32>,
}

/// `panotune compare`.
#[derive(Debug, Clone, Args)]
pub struct CompareArgs {
    /// Runs: folders, or beginnings of names in the results folder, e.g. `optuna_inception/s20250101`. Each is compared
    /// with the first.
    #[arg(value_name = "RUN", num_args = 2.., required_unless_present = "group", conflicts_with = "group")]
    pub runs: Vec<String>,
    /// Runs of one experiment with different seeds; may be given several times, and each group is compared with the first.
    #[arg(long, value_name = "NAME=RUN,RUN…", value_parser = group)]
    pub group: Vec<(String, Vec<String>)>,
    /// Let values of `metrics.json` decide whether runs are the same, instead of all bytes.
    #[arg(long)]
    pub metrics_only: bool,
    /// Relative difference up to which metrics are the same.
    #[arg(long, value_name = "X", requires = "metrics_only", value_parser = tolerance)]
    pub tolerance: Option<f64>,
    /// Whose errors are compared.
    #[arg(long, value_enum, default_value = "tuned")]
    pub arm: ArmArg,
    /// Write the comparison to DIR: `report.html`, `comparison.json`, tables, and the figure of the searches.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Names of arms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ArmArg {
    /// The best trial's hyper-parameters.
    Tuned,
    /// The fixed hyper-parameters.
    Baseline,
}

impl ArmArg {
    /// The arm.
    pub fn arm(self) -> Arm {
        match self {
            ArmArg::Tuned => Arm::Tuned,
            ArmArg::Baseline => Arm::Baseline,
        }
    }
}

/// A group as `name=run,run`.
fn group(text: &str) -> Result<(String, Vec<String>), String> {
    let wanted = || "expected a name and runs such as `a=RUN,RUN`".to_owned();
    let (name, runs) = text.split_once('=').ok_or_else(wanted)?;
    let usable = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    if name.is_empty() || !name.chars().all(usable) {
        return Err(format!("`{name}` cannot name a group: use letters, digits, `.`, `_` and `-`"));
    }
    let runs: Vec<String> = runs.split(',').map(|run| run.trim().to_owned()).collect();
    if runs.iter().any(String::is_empty) { Err(wanted()) } else { Ok((name.to_owned(), runs)) }
}

/// A relative difference, at least 0.
fn tolerance(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok().filter(|x| x.is_finite() && *x >= 0.0);
    number.ok_or_else(|| "expected a number that is at least 0, such as `1e-6`".to_owned())
}

/// `panotune verify`.
#[derive(Debug, Clone, Args)]
pub struct VerifyArgs {
    /// A finished run: its folder, or the beginning of its name in the results folder.
    pub run: String,
    /// Only this trial.
    #[arg(long, value_name = "N", conflicts_with = "sample")]
    pub trial: Option<u32>,
    /// Only this share of all trainings, e.g. `10%`; the run's seed chooses which, at least one.
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub sample: Option<f64>,
    /// Make every artefact anew, without the cache.
    #[arg(long)]
    pub fresh: bool,
}

/// `panotune tables`.
#[derive(Debug, Clone, Args)]
pub struct TablesArgs {
    /// Folders of finished runs; Tables 2 and 3 then have a row for each [default: the newest of each experiment].
    #[arg(value_name = "RUN", conflicts_with = "audit")]
    pub runs: Vec<String>,
    /// Hold the paper's own figures against each other instead: which follow, and which cannot be.
    #[arg(long)]
    pub audit: bool,
    /// Only this table, e.g. `table_5`, `published`, `controls`, `summary`; may be given several times.
    #[arg(long = "only", value_name = "TABLE")]
    pub only: Vec<String>,
    /// How they are printed.
    #[arg(long, value_enum, default_value_t = TableFormat::Plain)]
    pub format: TableFormat,
    /// Write them to this folder, as Markdown, LaTeX, CSV and Parquet, instead of printing them.
    #[arg(long, value_name = "DIR", conflicts_with = "format")]
    pub out: Option<PathBuf>,
}

/// `panotune report`.
#[derive(Debug, Clone, Args)]
pub struct ReportArgs {
    /// Folders of finished runs.
    #[arg(value_name = "RUN", required = true)]
    pub runs: Vec<String>,
}

/// Formats in which tables are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TableFormat {
    /// Aligned columns.
    Plain,
    /// GitHub-flavoured Markdown.
    Markdown,
    /// LaTeX that needs booktabs.
    Latex,
    /// Comma-separated values with unrounded numbers.
    Csv,
}

/// A share above 0 and up to 1, as `10%` or `0.1`.
fn share(text: &str) -> Result<f64, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let share = match text.strip_suffix('%') {
        Some(percent) => number(percent).map(|x| x / 100.0),
        None => number(text),
    };
    share.filter(|x| *x > 0.0 && *x <= 1.0).ok_or_else(|| "expected a share such as `10%` or `0.1`".to_owned())
}

/// `panotune check`.
#[derive(Debug, Clone, Args)]
pub struct CheckArgs {
    /// Experiment files.
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
    /// Scale that overrides the files' values.
    #[arg(long, value_enum)]
    pub profile: Option<ProfileArg>,
    /// Override one value.
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub sets: Vec<String>,
}

/// `panotune config`.
#[derive(Debug, Clone, Args)]
pub struct ConfigArgs {
    /// What to show.
    #[command(subcommand)]
    pub command: ConfigCommand,
}

/// `panotune config …`.
#[derive(Debug, Clone, Subcommand)]
pub enum ConfigCommand {
    /// Every resolved value of an experiment.
    Show {
        /// Which experiment.
        #[command(flatten)]
        experiment: ExperimentArgs,
        /// With the file and line that each value came from.
        #[arg(long)]
        origin: bool,
    },
    /// The JSON Schema of experiment files, for editors.
    Schema,
}

/// `panotune weights`.
#[derive(Debug, Clone, Args)]
pub struct WeightsArgs {
    /// What to do with weights.
    #[command(subcommand)]
    pub command: WeightsCommand,
}

/// `panotune weights …`.
#[derive(Debug, Clone, Subcommand)]
pub enum WeightsCommand {
    /// Check a weights file against its description and install it in the cache folder.
    Add {
        /// The file.
        file: PathBuf,
        /// Name of the weights, and of their description.
        #[arg(long = "as", value_name = "NAME")]
        name: String,
        /// Describe the file as these known weights are: same architecture, padding, stride, preprocessing.
        #[arg(long, value_name = "KNOWN")]
        like: Option<String>,
    },
    /// List the descriptions, and which of them are installed.
    List,
}

/// `panotune study`.
#[derive(Debug, Clone, Args)]
pub struct StudyArgs {
    /// What to do with a study.
    #[command(subcommand)]
    pub command: StudyCommand,
}

/// Where a study is.
#[derive(Debug, Clone, Args)]
pub struct StudyPlace {
    /// SQLite database, journal, or a run's folder.
    pub db: PathBuf,
    /// Which study; may be left out if there is only one.
    #[arg(long, value_name = "NAME")]
    pub study: Option<String>,
}

/// How trials are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TrialsFormatArg {
    /// Columns for people.
    Table,
    /// One JSON list.
    Json,
    /// Comma-separated values with a column for each parameter.
    Csv,
}

/// `panotune study …`.
#[derive(Debug, Clone, Subcommand)]
pub enum StudyCommand {
    /// List the studies of a file.
    List {
        /// SQLite database, journal, or a run's folder.
        db: PathBuf,
    },
    /// Show a study without its trials.
    Show {
        /// Which study.
        #[command(flatten)]
        place: StudyPlace,
    },
    /// List a study's trials.
    Trials {
        /// Which study.
        #[command(flatten)]
        place: StudyPlace,
        /// How they are shown.
        #[arg(long, value_enum, default_value = "table")]
        format: TrialsFormatArg,
    },
    /// Show the best trial, or with several objectives those that no other one beats.
    Best {
        /// Which study.
        #[command(flatten)]
        place: StudyPlace,
    },
    /// Write a study to a new file, or as text by which studies are compared.
    Export {
        /// Which study.
        #[command(flatten)]
        place: ExportPlace,
        /// Write text without times and names, the same for equal studies, to FILE or standard output.
        #[arg(long)]
        canonical: bool,
    },
    /// Add all studies of a file to another, which is made if it does not exist.
    Import {
        /// SQLite database, journal, or a run's folder.
        file: PathBuf,
        /// Database or journal to add to; the kind of a new one is that of its ending, as in `export`.
        db: PathBuf,
    },
    /// Draw plots of a study.
    Plot(PlotArgs),
    /// Ask for a trial with given values; parameters not named are proposed as usual.
    Enqueue {
        /// Which study.
        #[command(flatten)]
        place: StudyPlace,
        /// A parameter's value, e.g. `n_layers=3`; may be given several times.
        #[arg(long = "set", value_name = "NAME=VALUE", required = true)]
        sets: Vec<String>,
    },
}

/// Which plots of which study.
#[derive(Debug, Clone, Args)]
pub struct PlotArgs {
    /// Which study.
    #[command(flatten)]
    pub place: StudyPlace,
    /// Which plots; all that the study has data for without.
    #[arg(value_parser = PossibleValuesParser::new(StudyPlot::ALL.map(StudyPlot::name)))]
    pub plots: Vec<String>,
    /// Folder for the SVG and PNG files.
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub out: PathBuf,
    /// A parameter to show, in this order; may be given several times. The most important ones without.
    #[arg(long = "param", value_name = "NAME")]
    pub params: Vec<String>,
    /// Which objective, from 0.
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub objective: usize,
}

/// What is exported, and where to.
#[derive(Debug, Clone, Args)]
pub struct ExportPlace {
    /// SQLite database, journal, or a run's folder.
    pub db: PathBuf,
    /// New file: `.db` or `.sqlite3` a database, `.log` or `.journal` a journal.
    #[arg(required_unless_present = "canonical")]
    pub file: Option<PathBuf>,
    /// Which study; may be left out if there is only one.
    #[arg(long, value_name = "NAME")]
    pub study: Option<String>,
}
