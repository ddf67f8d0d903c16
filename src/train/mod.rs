//! Training of one network: loop, optimisers, dropout, early stopping, checkpoint.
