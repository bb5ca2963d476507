//! When the light of a frame leaves the display, on the client's own clock.

use ::openxr as xr;
use shadecast_protocol::ClientTime;

/// Display intervals from waking to the light, where the runtime does not tell:
/// one to draw and one to be composed and scanned out.
const INTERVALS_AHEAD: i64 = 2;

/// The client's time of the runtime's `predicted` one. `now` was just read;
/// `runtime_now` is the same moment on the runtime's clock, where it tells that.
pub(super) fn display_at(
    now: ClientTime,
    runtime_now: Option<xr::Time>,
    predicted: xr::Time,
    period: xr::Duration,
) -> ClientTime {
    let ahead = match runtime_now {
        Some(runtime) => predicted.as_nanos().saturating_sub(runtime.as_nanos()),
        None => period.as_nanos().saturating_mul(INTERVALS_AHEAD),
    };
    // Light is not earlier than now, nor a second ahead.
    let ahead = ahead.clamp(0, 1_000_000_000) as u64;
    ClientTime(now.0.saturating_add(ahead))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn light_comes_after_now_by_the_runtimes_clock_or_by_two_intervals() {
        let now = ClientTime(5_000 * MS as u64);
        let at = |runtime: Option<i64>, predicted: i64| {
            let runtime = runtime.map(|ms| xr::Time::from_nanos(ms * MS));
            let period = xr::Duration::from_nanos(11 * MS);
            display_at(now, runtime, xr::Time::from_nanos(predicted * MS), period).0 / MS as u64
        };
        assert_eq!(at(Some(100), 125), 5_025);
        assert_eq!(at(None, 125), 5_022);
        assert_eq!(at(Some(200), 125), 5_000, "never in the past");
        assert_eq!(at(Some(-1), i64::MAX / MS), 6_000);
    }
}
