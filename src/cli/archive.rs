//! `panotune archive`

use std::path::{Path, PathBuf};

use super::Failure;
use super::args::Global;
use super::args_runs::ArchiveArgs;
use crate::archive::{self, Extracted};
use crate::store::{self, CACHE, Cache, RunName};

pub(super) fn archive(global: &Global, args: &ArchiveArgs) -> Result<(), Failure> {
    match (&args.extract, &args.run) {
        (Some(file), _) => extract(global, file, args.into.as_deref()),
        (None, Some(run)) => pack(global, &store::find_run(run, &global.results)?, args),
        (None, None) => Err(Failure::input("error: name a run, or an archive with `--extract`")),
    }
}

fn pack(global: &Global, run: &Path, args: &ArchiveArgs) -> Result<(), Failure> {
    let cache = args.with_cache.then(|| Cache::new(super::cache_of(global, run)));
    let named = || RunName::of(run).map(|run| PathBuf::from(format!("{}-{}.zip", run.name, run.id)));
    let out = args.out.clone().or_else(named).ok_or_else(|| {
        let folder = run.display();
        Failure::input(format!("error: `{folder}` is not named as a run is\nhint: name the archive with `--out FILE`"))
    })?;
    archive::pack(run, cache.as_ref(), &out)?;
    println!("{}", out.display());
    Ok(())
}

fn extract(global: &Global, file: &Path, into: Option<&Path>) -> Result<(), Failure> {
    let results = into.unwrap_or(&global.results);
    let cache = global.cache.clone().unwrap_or_else(|| results.join(CACHE));
    let Extracted { folder, known, artefacts } = archive::extract(file, results, &Cache::new(cache))?;
    if !global.quiet {
        known.iter().for_each(|run| eprintln!("{run} was there already, the same to the byte"));
        if artefacts > 0 {
            eprintln!("{artefacts} artefacts of the cache came along");
        }
    }
    println!("{}", folder.display());
    Ok(())
}
