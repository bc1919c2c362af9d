//! The coordinator.
pub mod ledger;
