//! Features: the frozen backbone's pooled outputs, computed once for each copy of each view.

use serde::{Deserialize, Serialize};

/// Which view, and which copy of it, one row of a feature matrix belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureRow {
    /// Number of the view in the dataset.
    pub view: u32,
    /// 0: the plain view; others: changed copies (training views only).
    pub copy: u32,
}
