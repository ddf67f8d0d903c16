//! `panotune watch`

use std::io::Write;
use std::time::Duration;

use console::Term;

use super::Failure;
use super::args::Global;
use super::args_runs::WatchArgs;
use crate::error::Class;
use crate::live::{self, Live, State};
use crate::store;

/// Time between two looks at the run.
const PAUSE: Duration = Duration::from_millis(500);

pub(super) fn watch(global: &Global, args: &WatchArgs) -> Result<(), Failure> {
    let run = store::find_run(&args.run, &global.results)?;
    let mut shown = Shown { terminal: Term::stdout(), json: global.json, height: 0, before: None };
    loop {
        let mut now = live::read(&run)?;
        if now.summary.state == State::Interrupted {
            // It may be about to begin, or to go on.
            std::thread::sleep(PAUSE);
            now = live::read(&run)?;
        }
        let state = now.summary.state;
        shown.show(now);
        match state {
            State::Running if !args.once => std::thread::sleep(PAUSE),
            _ => return end(state),
        }
    }
}

/// How the program ends when the run has.
fn end(state: State) -> Result<(), Failure> {
    let failure = |class| Err(Failure { class, message: format!("the run is {}", state.name()) });
    match state {
        State::Running | State::Finished => Ok(()),
        State::Interrupted => failure(Class::Interrupted),
        State::Failed | State::Damaged => failure(Class::Run),
    }
}

/// What stands on standard output.
struct Shown {
    terminal: Term,
    json: bool,
    /// Lines of the page on the terminal.
    height: usize,
    before: Option<Live>,
}

impl Shown {
    fn show(&mut self, now: Live) {
        let text = if self.json {
            let known = self.before.as_ref().is_some_and(|before| *before == now);
            if known { String::new() } else { format!("{}\n", super::json_line(&now)) }
        } else if self.terminal.is_term() {
            self.page(&now)
        } else {
            live::lines(self.before.as_ref(), &now).iter().map(|line| format!("{line}\n")).collect()
        };
        let mut out = std::io::stdout().lock();
        if out.write_all(text.as_bytes()).and_then(|()| out.flush()).is_err() {
            // Nobody reads any more.
            std::process::exit(0);
        }
        self.before = Some(now);
    }

    /// The page in the place of the last one.
    fn page(&mut self, now: &Live) -> String {
        let (rows, columns) = self.terminal.size();
        let lines = live::screen(now, columns.into(), usize::from(rows).saturating_sub(1));
        let up = if self.height > 0 { format!("\x1b[{}A\r", self.height) } else { String::new() };
        self.height = lines.len();
        let lines: String = lines.iter().map(|line| format!("{line}\x1b[K\n")).collect();
        format!("{up}{lines}\x1b[J")
    }
}
