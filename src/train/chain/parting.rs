//! Where the records of two trainings part.

use std::path::Path;

use super::difference::{self, Difference, Exactness, What};
use super::{Chain, Entry, Line};
use crate::store;

/// The first line in which two recorded trainings are not the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Parting {
    /// Something went otherwise. The first training is the recorded one of [`Difference`], the second the one now.
    Training(Difference),
    /// The line says the same, or nothing that could be read: one of the records was altered.
    Record {
        /// Epoch that the line is about, if either line says so.
        epoch: Option<u32>,
        /// Step that it is about.
        step: Option<u32>,
        /// The first record's line.
        first: String,
        /// The second's.
        second: String,
    },
}

impl Parting {
    /// Compares the chains in two files line by line; `None` if all lines are the same.
    ///
    /// # Errors
    /// Those of the disk. A file that is no chain is no error: it differs where it is none.
    pub fn of_files(first: &Path, second: &Path) -> Result<Option<Self>, store::Error> {
        let text = |path: &Path| store::read(path).map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
        Ok(Self::of_texts(&text(first)?, &text(second)?))
    }

    fn of_texts(first: &str, second: &str) -> Option<Self> {
        let (mut a, mut b) = (first.lines(), second.lines());
        loop {
            match (a.next(), b.next()) {
                (None, None) => return None,
                (a, b) if a == b => {}
                (a, b) => return Some(Self::of_lines(a, b)),
            }
        }
    }

    fn of_lines(first: Option<&str>, second: Option<&str>) -> Self {
        let (a, b) = (first.and_then(line), second.and_then(line));
        let difference = match (&a, &b) {
            (Some(a), Some(b)) => {
                let recorded = Chain { lines: vec![a.clone()] };
                difference::at(&recorded, 0, &b.entry, Exactness::Bitwise)
            }
            (Some(a), None) if second.is_none() => difference::missing(&Chain { lines: vec![a.clone()] }, 0),
            (None, Some(b)) if first.is_none() => {
                difference::at(&Chain { lines: Vec::new() }, 0, &b.entry, Exactness::Bitwise)
            }
            _ => None,
        };
        difference.map(Parting::Training).unwrap_or_else(|| {
            let place = a.or(b).map(|line| line.entry.place());
            let text = |line: Option<&str>| line.unwrap_or("nothing").to_owned();
            Parting::Record {
                epoch: place.map(|(epoch, _)| epoch),
                step: place.and_then(|(_, step)| step),
                first: text(first),
                second: text(second),
            }
        })
    }

    /// Epoch and step, from 0, as far as they are known.
    pub fn place(&self) -> (Option<u32>, Option<u32>) {
        match self {
            Parting::Training(difference) => (Some(difference.epoch), difference.step),
            Parting::Record { epoch, step, .. } => (*epoch, *step),
        }
    }

    /// The tensor that differs, if it is one.
    pub fn tensor(&self) -> Option<&str> {
        match self {
            Parting::Training(Difference { what: What::Tensor(name), .. }) => Some(name),
            _ => None,
        }
    }

    /// What differs, e.g. `loss`; `record` if the training may have been the same.
    pub fn what(&self) -> &'static str {
        match self {
            Parting::Training(difference) => difference.what.name(),
            Parting::Record { .. } => "record",
        }
    }

    /// What the two records have there.
    pub fn values(&self) -> [&str; 2] {
        match self {
            Parting::Training(Difference { recorded, now, .. }) => [recorded, now],
            Parting::Record { first, second, .. } => [first, second],
        }
    }

    /// Representable numbers between two losses.
    pub fn ulps(&self) -> Option<u64> {
        match self {
            Parting::Training(difference) => difference.ulps,
            Parting::Record { .. } => None,
        }
    }
}

fn line(text: &str) -> Option<Line> {
    let (entry, link) = text.rsplit_once(' ')?;
    Some(Line { entry: Entry::parse(entry)?, link: link.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHAIN: &str = "panotune steps 1\nstep 0 0 aaaaaaaaaaaaaaaa 3fa5dc6b0e52c774 0000000000000001\n\
        tensor 0 output.bias ab 0000000000000002\nvalidation 0 3fa5dc6b0e52c774 0000000000000003\n\
        end 0 0 early 0000000000000004\n";

    fn found(from: &str, to: &str) -> Parting {
        Parting::of_texts(CHAIN, &CHAIN.replacen(from, to, 1)).unwrap()
    }

    #[test]
    fn any_changed_byte_is_found_at_its_place() {
        assert_eq!(Parting::of_texts(CHAIN, CHAIN), None);
        let loss = found("c774 0000000000000001", "c775 0000000000000001");
        assert_eq!((loss.what(), loss.place(), loss.ulps()), ("loss", (Some(0), Some(0)), Some(1)));
        let rows = found("aaaa ", "aaab ");
        assert_eq!((rows.what(), rows.place()), ("rows", (Some(0), Some(0))));
        let tensor = found("bias ab", "bias ac");
        assert_eq!((tensor.what(), tensor.tensor(), tensor.place()), ("tensor", Some("output.bias"), (Some(0), None)));
        let link = found("0000000000000001", "0000000000000009");
        assert_eq!((link.what(), link.place()), ("record", (Some(0), Some(0))));
        let unreadable = found("step 0 0", "stop 0 0");
        assert_eq!((unreadable.what(), unreadable.place()), ("record", (Some(0), Some(0))));
        assert_eq!(found("steps 1", "steps 2").place(), (None, None));
    }

    #[test]
    fn a_shorter_training_ends_where_the_other_goes_on() {
        let short = CHAIN.rsplit_once("end").unwrap().0;
        let there = Parting::of_texts(CHAIN, short).unwrap();
        assert_eq!((there.what(), there.values()), ("end", ["end 0 0 early", "before that"]));
        let back = Parting::of_texts(short, CHAIN).unwrap();
        assert_eq!((back.what(), back.values()), ("end", ["before that", "end 0 0 early"]));
    }
}
