//! Processes that share a study in a database: the study does not depend on how many there are, nor on kills.
//!
//! A worker is this test program, started again to run `worker_process` alone.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use panotune::search::pruner::{Percentile, Window};
use panotune::search::storage::{self, Storage, StoredTrial};
use panotune::search::{
    Ask, Direction, Distribution, Duplicates, Next, Outcome, Rules, SharedStudy, Study, Ticket, TrialState, sampler,
};

const DATABASE: &str = "PANOTUNE_TEST_DATABASE";
const NAME: &str = "shared";
const STEPS: u64 = 4;

fn space(ask: Ask<'_>) {
    let unit = Distribution::float(0.0, 1.0, false, None).unwrap();
    let layers = ask("layers", &Distribution::int(1, 3, false, 1).unwrap());
    for i in 0..layers as usize {
        ask(&format!("units_{i}"), &Distribution::int(8, 64, true, 1).unwrap());
    }
    if ask("optimizer", &Distribution::categorical(vec!["adam".into(), "sgd".into()]).unwrap()) == 1.0 {
        ask("momentum", &unit);
    }
}

fn rules() -> Rules {
    Rules {
        sampler: sampler::default(),
        pruner: Box::new(Percentile::median(3, Window { warmup: 1, interval: 1 }, 1)),
        directions: vec![Direction::Minimize],
        trials: 40,
        concurrency: 4,
        seed: 5,
        duplicates: Duplicates::Allow,
    }
}

fn value(ticket: &Ticket, step: u64) -> f64 {
    let sum: f64 = ticket.params.iter().map(|p| libm::sin(3.0 * p.internal + p.name.len() as f64)).sum();
    sum + 1.0 / (step + 1) as f64
}

fn outcome(ticket: &Ticket, mut should_prune: impl FnMut(u64, f64) -> bool) -> Outcome {
    for step in 0..STEPS {
        std::thread::sleep(Duration::from_millis(u64::from(ticket.number % 3)));
        if ticket.number % 9 == 7 && step == 1 {
            return Outcome::Failed("diverged".into());
        }
        if should_prune(step, value(ticket, step)) {
            return Outcome::Pruned;
        }
    }
    Outcome::Complete(vec![value(ticket, STEPS)])
}

/// Takes trials until there are none left.
fn work(database: &Path) {
    let mut shared = SharedStudy::open(database, NAME, space, rules()).unwrap();
    loop {
        match shared.next_trial().unwrap() {
            Next::Done => return,
            Next::Wait => std::thread::sleep(Duration::from_millis(2)),
            Next::Trial(ticket) => {
                let ended = outcome(&ticket, |step, x| shared.should_prune(ticket.number, step, x).unwrap());
                shared.tell(ticket.number, ended).unwrap();
            }
        }
    }
}

#[test]
fn worker_process() {
    if let Some(database) = std::env::var_os(DATABASE) {
        work(Path::new(&database));
    }
}

fn worker(database: &Path) -> Child {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "shared_study::worker_process"]).env(DATABASE, database);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

fn canonical(database: &Path) -> String {
    storage::canonical(&storage::load(database, None).unwrap())
}

/// The study as one worker in memory makes it, as it would be stored.
fn in_memory() -> Vec<(TrialState, Vec<f64>, usize)> {
    let mut study = Study::new(space, rules());
    while let Some(ticket) = study.next_trial() {
        let ended = outcome(&ticket, |step, x| study.should_prune(ticket.number, step, x).unwrap());
        study.tell(ticket.number, ended).unwrap();
    }
    study.finished().map(|t| (t.state, t.values.clone(), t.intermediate.len())).collect()
}

#[test]
fn one_process_and_many_give_the_same_study_as_memory() {
    let folder = tempfile::tempdir().unwrap();
    let (one, many) = (folder.path().join("one.db"), folder.path().join("many.db"));
    assert!(worker(&one).wait().unwrap().success());
    let mut workers: Vec<Child> = (0..3).map(|_| worker(&many)).collect();
    assert!(workers.iter_mut().all(|w| w.wait().unwrap().success()));
    assert_eq!(canonical(&one), canonical(&many));
    let stored = storage::load(&one, None).unwrap();
    let records: Vec<_> =
        stored.trials.iter().map(|t| (t.state, t.values.clone().unwrap_or_default(), t.intermediate.len())).collect();
    assert_eq!(records, in_memory());
    for state in [TrialState::Complete, TrialState::Pruned, TrialState::Fail] {
        assert!(stored.trials.iter().any(|t| t.state == state), "{state:?}");
    }
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    // SQLite may leave its log if two processes close a database at once.
    let workers = left.iter().filter(|n| n.to_string_lossy().contains("workers")).count();
    assert_eq!(workers, 0, "{left:?}");
}

#[test]
fn killed_processes_leave_their_trials_to_others() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, cut) = (folder.path().join("whole.db"), folder.path().join("cut.db"));
    let begun = Instant::now();
    assert!(worker(&whole).wait().unwrap().success());
    let full = begun.elapsed();
    let mut steady = worker(&cut);
    let mut kills = 0;
    for part in [1, 2, 3, 4, 5, 6] {
        let mut victim = worker(&cut);
        std::thread::sleep(full * part / 24);
        kills += usize::from(victim.try_wait().unwrap().is_none());
        victim.kill().unwrap();
        victim.wait().unwrap();
    }
    assert!(steady.wait().unwrap().success());
    assert!(kills >= 2, "the workers ended before they could be killed");
    assert_eq!(canonical(&whole), canonical(&cut));
}

#[test]
fn another_space_or_budget_is_refused_and_nothing_altered() {
    let folder = tempfile::tempdir().unwrap();
    let database = folder.path().join("study.db");
    work(&database);
    let before = canonical(&database);
    let wider = |ask: Ask<'_>| {
        ask("layers", &Distribution::int(1, 4, false, 1).unwrap());
    };
    let error = SharedStudy::open(&database, NAME, wider, rules()).err().unwrap().to_string();
    assert!(error.contains("`layers` is int 1 to 3, and int 1 to 4 here"), "{error}");
    let fewer = Rules { trials: 10, ..rules() };
    let error = SharedStudy::open(&database, NAME, space, fewer).err().unwrap().to_string();
    assert!(error.contains("beyond the number of trials"), "{error}");
    let two = Rules { directions: vec![Direction::Minimize, Direction::Maximize], ..rules() };
    assert!(SharedStudy::open(&database, NAME, space, two).is_err());
    assert_eq!(canonical(&database), before);
}

#[test]
fn an_enqueued_trial_comes_under_its_number_whoever_takes_it() {
    let folder = tempfile::tempdir().unwrap();
    let study = |name: &str, workers: usize| {
        let database = folder.path().join(name);
        let mut storage = storage::SqliteStorage::create(&database).unwrap();
        storage.create_study(NAME, &[Direction::Minimize]).unwrap();
        storage.enqueue(NAME, &[("layers".into(), 3.into()), ("units_2".into(), 11.into())]).unwrap();
        let mut workers: Vec<Child> = (0..workers).map(|_| worker(&database)).collect();
        assert!(workers.iter_mut().all(|w| w.wait().unwrap().success()));
        database
    };
    let (one, two) = (study("one.db", 1), study("two.db", 2));
    assert_eq!(canonical(&one), canonical(&two));
    let first: &StoredTrial = &storage::load(&one, None).unwrap().trials[0];
    assert_eq!(first.param("units_2").unwrap().internal, 11.0);
}
