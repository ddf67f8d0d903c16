//! Networks on top of features: head, label coding, loss.
