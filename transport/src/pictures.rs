//! A stream for each picture.

use std::sync::{
    Arc,
    atomic::{AtomicI32, Ordering::Relaxed},
};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::{
    TransportError, link::Guard, server_end::StreamKind, settings::MAX_PICTURES_IN_FLIGHT,
};

/// Sends pictures side by side, the oldest first where they compete.
pub(crate) struct Pictures {
    slots: Arc<Semaphore>,
    /// Of the next picture. Wraps after nine months at 90 Hz.
    priority: AtomicI32,
}

impl Pictures {
    pub(crate) fn new() -> Self {
        Self {
            slots: Arc::new(Semaphore::new(MAX_PICTURES_IN_FLIGHT)),
            priority: AtomicI32::new(0),
        }
    }

    /// Pictures that were sent and have not wholly arrived.
    pub(crate) fn in_flight(&self) -> usize {
        MAX_PICTURES_IN_FLIGHT - self.slots.available_permits()
    }

    /// Waits for a slot and sends without waiting for the arrival.
    pub(crate) async fn send(&self, guard: &Guard, message: Vec<u8>) -> Result<(), TransportError> {
        let slot = self.slots.clone().acquire_owned().await;
        let slot = slot.expect("the semaphore is never closed");
        guard.alive()?;
        let priority = self.priority.fetch_sub(1, Relaxed);
        let guard = guard.clone();
        tokio::spawn(async move {
            if let Err(error) = write(&guard, message, priority, slot).await {
                guard.fail(error);
            }
        });
        Ok(())
    }
}

/// Holds the slot until the last byte has been acknowledged.
async fn write(
    guard: &Guard,
    message: Vec<u8>,
    priority: i32,
    _slot: OwnedSemaphorePermit,
) -> Result<(), TransportError> {
    let mut stream = guard.connection.open_uni().await?;
    // Fails only on a stream that is closed, and then so does writing.
    let _ = stream.set_priority(priority);
    stream.write_all(&[StreamKind::Picture as u8]).await?;
    stream.write_all(&message).await?;
    let _ = stream.finish();
    // Whether it arrived or the peer is gone, it is no longer in flight.
    let _ = stream.stopped().await;
    Ok(())
}
