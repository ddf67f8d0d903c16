//! Sentences about the identity of runs, for terminals and pages.

use super::identity::{Identity, State};

/// What is said of a pair.
pub(super) struct Sentences {
    /// Whether it is the same, and where first not.
    pub result: String,
    /// What may be the reason, and how far the comparison can be relied on.
    pub reasons: Vec<String>,
}

/// What is said of the identity of a pair.
pub(super) fn identity(identity: &Identity) -> Sentences {
    let (a, b) = (&identity.first, &identity.second);
    let result = match &identity.first_difference {
        None => format!("{a} and {b} are the same to the byte: {} exact artefacts.", identity.artefacts.len()),
        Some(found) => format!("{a} and {b} differ, first in {found}. {}", not_the_same(identity)),
    };
    let fields = identity.provenance.iter().filter(|_| !identity.same);
    let fields: Vec<String> = fields.map(|(field, [first, second])| format!("{field} ({first}; {second})")).collect();
    let mut reasons = Vec::new();
    if !fields.is_empty() {
        reasons.push(format!("Made with another {}.", fields.join(", ")));
    }
    if identity.by_checksum > 0 {
        reasons.push(format!("Of {} artefacts a folder has only the checksum.", identity.by_checksum));
    }
    if !identity.damaged.is_empty() {
        reasons.push(format!("Not as the run wrote it: {}.", identity.damaged.join(", ")));
    }
    Sentences { result, reasons }
}

/// How many artefacts differ.
pub(super) fn not_the_same(identity: &Identity) -> String {
    let other = identity.artefacts.iter().filter(|artefact| artefact.state != State::Same).count();
    format!("{other} of {} exact artefacts are not the same.", identity.artefacts.len())
}

/// How near to each other metrics must be to be the same.
pub(super) fn how_near(tolerance: f64) -> String {
    if tolerance == 0.0 { "to the bit".to_owned() } else { format!("within {tolerance} of themselves") }
}
