//! Both ends of shadecast in one process and in virtual time.
//!
//! A [`Loopback`] joins a server's session and pipeline with a client's session
//! and decoder by two seeded [`Link`]s. Every message is encoded, delayed and
//! decoded; no clock is read, so that a run with the same seed is the same run.

mod link;
mod loopback;

pub use link::{Link, Order};
pub use loopback::{ATLAS_SIZE, DELAY, JITTER, Loopback, MAKING};
