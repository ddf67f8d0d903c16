//! Venues of panoramas, from a CSV file.

use std::collections::BTreeMap;
use std::path::Path;

use super::Error;

/// Reads the columns `file` and `group` of the CSV file `path`.
///
/// # Errors
/// [`Error::Groups`] with the line: a missing column, an empty cell, a file listed twice with
/// different groups.
pub(super) fn read(path: &Path) -> Result<BTreeMap<String, String>, Error> {
    let fail = |line, reason: String| Error::Groups { path: path.to_owned(), line, reason };
    let mut reader = csv::Reader::from_path(path).map_err(|e| fail(None, e.to_string()))?;
    let header = reader.headers().map_err(|e| fail(Some(1), e.to_string()))?.clone();
    let column = |name: &str| {
        let found = header.iter().position(|h| h.trim() == name);
        found.ok_or_else(|| fail(Some(1), format!("it has no column `{name}`; needed are `file` and `group`")))
    };
    let (file, group) = (column("file")?, column("group")?);
    let mut groups = BTreeMap::new();
    for record in reader.records() {
        let record = record.map_err(|e| fail(e.position().map(csv::Position::line), e.to_string()))?;
        let line = record.position().map(csv::Position::line);
        let cell = |i: usize| record.get(i).map(str::trim).filter(|c| !c.is_empty());
        let (Some(file), Some(group)) = (cell(file), cell(group)) else {
            return Err(fail(line, "`file` and `group` must not be empty".to_owned()));
        };
        if let Some(before) = groups.insert(file.to_owned(), group.to_owned())
            && before != group
        {
            return Err(fail(line, format!("`{file}` was in group `{before}` above and is in `{group}` here")));
        }
    }
    Ok(groups)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn groups(text: &str) -> Result<BTreeMap<String, String>, Error> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.csv");
        crate::store::write(&path, text.as_bytes()).unwrap();
        read(&path)
    }

    #[test]
    fn columns_are_found_by_name() {
        let found = groups("licence,file,group\nx,a.jpg,studio\nx,b.jpg,studio\n").unwrap();
        assert_eq!(found["a.jpg"], "studio");
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn mistakes_name_the_line() {
        for (text, line) in [("file,venue\n", 1), ("file,group\na,x\nb,\n", 3), ("file,group\na,x\na,y\n", 3)] {
            let Err(Error::Groups { line: found, .. }) = groups(text) else { panic!("{text}") };
            assert_eq!(found, Some(line), "{text}");
        }
    }
}
