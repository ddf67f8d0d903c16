//! How long work tells how far it is, and learns that the user wants it to stop.

/// Listener of one long piece of work. All methods may be called from several threads.
pub trait Progress: Sync {
    /// `total` units of work, called `label`, begin (e.g. `"views"`, 2400).
    fn begin(&self, label: &str, total: u64);
    /// `by` more units are done.
    fn advance(&self, by: u64);
    /// `by` units were there already: they are done, but tell nothing of the pace.
    fn found(&self, by: u64) {
        self.advance(by);
    }
    /// More units are done of the work that contains the present one (trials, while epochs are counted).
    fn advance_outer(&self, _by: u64) {}
    /// One line about the present state, e.g. the best value so far.
    fn note(&self, text: &str);
    /// The work that began last is done.
    fn end(&self);
    /// Whether the user has asked to stop. Work looks at it at least twice a second and returns its
    /// error of class [`Interrupted`](crate::error::Class::Interrupted).
    fn interrupted(&self) -> bool;
}

/// Tells nobody and is never interrupted.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn note(&self, _: &str) {}
    fn end(&self) {}
    fn interrupted(&self) -> bool {
        false
    }
}
