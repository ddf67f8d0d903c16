//! `panotune gc`

use super::Failure;
use super::args::Global;
use super::args_runs::GcArgs;
use crate::gc::{self, Places, Scope};

pub(super) fn gc(global: &Global, args: &GcArgs) -> Result<(), Failure> {
    let scope = Scope {
        artefacts: args.artefacts,
        unfinished: args.unfinished,
        runs: args.runs.clone(),
        older_than: args.older_than,
    };
    let cache = global.cache();
    let places = Places { results: &global.results, cache: &cache };
    let items = if args.yes { gc::remove(places, &scope)? } else { gc::plan(places, &scope)? };
    if global.json {
        items.iter().for_each(|item| println!("{}", super::json_line(item)));
    } else {
        print!("{}", gc::describe(&items, args.yes));
    }
    Ok(())
}
