//! Deliveries under way, so that none arrives twice at the same time.

use crate::examine::Claim;
use beamfarm_proto::{LeaseId, WorkerId};
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use tonic::Status;

/// The most deliveries of one worker at a time. It sends one after another.
const DELIVERIES: usize = 2;

/// Each lease has one delivery at a time, and each worker a few.
#[derive(Clone, Default)]
pub(crate) struct Arriving(Arc<Mutex<BTreeSet<(WorkerId, LeaseId)>>>);

impl Arriving {
    /// Start a delivery for a lease; it lasts until the returned value is dropped.
    pub fn begin(&self, claim: &Claim) -> Result<Arrival, Status> {
        let Claim { worker, lease, .. } = *claim;
        let mut leases = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let of_worker = (worker, LeaseId(0))..=(worker, LeaseId(u64::MAX));
        // Earlier ones may be left over from a connection that broke.
        if leases.range(of_worker).count() >= DELIVERIES || !leases.insert((worker, lease)) {
            return Err(Status::resource_exhausted("this block is on its way in already"));
        }
        Ok(Arrival(self.clone(), (worker, lease)))
    }
}

/// A delivery that is under way until this is dropped.
pub(crate) struct Arrival(Arriving, (WorkerId, LeaseId));

impl Drop for Arrival {
    fn drop(&mut self) {
        let Self(Arriving(leases), lease) = self;
        leases.lock().unwrap_or_else(PoisonError::into_inner).remove(lease);
    }
}
