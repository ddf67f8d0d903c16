//! What a run was made with: commit, lock file, toolchain, hardware.
