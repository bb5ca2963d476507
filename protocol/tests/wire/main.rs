//! Bytes and messages: round trips, damaged bytes, impossible values, frozen
//! bytes, and how much memory any of it may take.

mod allocation;
mod compact;
mod damage;
mod frozen;
mod round_trip;
mod rules;
mod samples;
