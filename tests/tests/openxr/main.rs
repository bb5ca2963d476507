//! The headset client against a simulated runtime.

mod faults;
mod hands;
mod live;
mod misuse;
mod multiview;
mod refusals;
mod rig;
mod stall;
