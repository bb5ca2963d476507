//! Reads a head trace.
//!
//! Text, one pose a line: `time x y z qx qy qz qw`, in seconds, metres and a
//! unit quaternion, of the head in the play space (floor level, facing -Z, +Y
//! up). Times ascend. Empty lines and what follows a `#` are comments. Between
//! lines the head moves straight and turns along the great circle; after the
//! last line it starts over.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use glam::{Quat, Vec3};
use shadecast_protocol::Pose;

/// Longest trace that is read, bytes: an hour at 90 Hz takes 30 MB.
const MAX_BYTES: u64 = 256 << 20;

/// How far from one a quaternion's length may be: five digits were written.
const UNIT_TOLERANCE: f32 = 1e-3;

/// Poses at ascending times, at least one.
#[derive(Clone, Debug)]
pub(crate) struct TraceFile {
    keys: Vec<(f64, Pose)>,
}

impl TraceFile {
    /// Reads the file.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let cannot = || format!("cannot read the head trace {}", path.display());
        let size = std::fs::metadata(path).with_context(cannot)?.len();
        ensure!(size <= MAX_BYTES, "{}: it is larger than 256 MiB", cannot());
        let text = std::fs::read_to_string(path).with_context(cannot)?;
        Self::parse(&text).with_context(|| format!("head trace {}", path.display()))
    }

    fn parse(text: &str) -> Result<Self> {
        let mut keys: Vec<(f64, Pose)> = Vec::new();
        for (index, line) in text.lines().enumerate() {
            let content = line.split('#').next().unwrap_or_default().trim();
            if content.is_empty() {
                continue;
            }
            let at_line = || format!("line {}", index + 1);
            let key = parse_line(content).with_context(at_line)?;
            if let Some((before, _)) = keys.last()
                && key.0 <= *before
            {
                bail!(
                    "line {}: time goes backwards, from {before} to {}",
                    index + 1,
                    key.0
                );
            }
            keys.push(key);
        }
        ensure!(!keys.is_empty(), "it holds no pose");
        Ok(Self { keys })
    }

    /// The head at `seconds` since the first line.
    pub(crate) fn pose(&self, seconds: f64) -> Pose {
        let (first, last) = (&self.keys[0], &self.keys[self.keys.len() - 1]);
        let length = last.0 - first.0;
        if length <= 0.0 {
            return first.1;
        }
        let time = first.0 + seconds.rem_euclid(length);
        let next = self
            .keys
            .partition_point(|key| key.0 <= time)
            .clamp(1, self.keys.len() - 1);
        let (before, after) = (&self.keys[next - 1], &self.keys[next]);
        let t = ((time - before.0) / (after.0 - before.0)).clamp(0.0, 1.0) as f32;
        Pose {
            position: before.1.position.lerp(after.1.position, t),
            orientation: before.1.orientation.slerp(after.1.orientation, t),
        }
    }
}

fn parse_line(content: &str) -> Result<(f64, Pose)> {
    let numbers: Vec<f64> = content
        .split_whitespace()
        .map(|word| {
            let number: f64 = word
                .parse()
                .with_context(|| format!("{word:?} is not a number"))?;
            ensure!(number.is_finite(), "{word:?} is not finite");
            Ok(number)
        })
        .collect::<Result<_>>()?;
    let &[time, x, y, z, qx, qy, qz, qw] = numbers.as_slice() else {
        bail!(
            "a pose is 8 numbers, time x y z qx qy qz qw, and this has {}",
            numbers.len()
        );
    };
    let position = Vec3::new(x as f32, y as f32, z as f32);
    let orientation = Quat::from_xyzw(qx as f32, qy as f32, qz as f32, qw as f32);
    ensure!(
        position.is_finite() && orientation.is_finite(),
        "a number is too large"
    );
    let length = orientation.length();
    ensure!(
        (length - 1.0).abs() <= UNIT_TOLERANCE,
        "the quaternion has length {length:.4} and not 1"
    );
    let pose = Pose {
        position,
        orientation: orientation.normalize(),
    };
    Ok((time, pose))
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "# a step and a turn\n\
        10.0 0 1.6 0  0 0 0 1\n\
        \n\
        11.0 1 1.6 0  0 0 0 1 # aside\n\
        13.0 1 1.6 -2  0 0.70710678 0 0.70710678\n";

    #[test]
    fn poses_are_interpolated_and_start_over() {
        let trace = TraceFile::parse(GOOD).unwrap();
        assert_eq!(trace.pose(0.0).position, Vec3::new(0.0, 1.6, 0.0));
        assert_eq!(trace.pose(0.5).position, Vec3::new(0.5, 1.6, 0.0));
        assert_eq!(trace.pose(2.0).position, Vec3::new(1.0, 1.6, -1.0));
        let turned = trace.pose(2.0).orientation;
        let expected = Quat::from_rotation_y(std::f32::consts::FRAC_PI_4);
        assert!(turned.angle_between(expected) < 1e-3);
        assert_eq!(trace.pose(3.5), trace.pose(0.5));
    }

    #[test]
    fn a_single_pose_stands_still() {
        let trace = TraceFile::parse("5 1 2 3 0 0 0 1").unwrap();
        assert_eq!(trace.pose(0.0), trace.pose(9.0));
    }

    #[test]
    fn each_fault_is_named_with_its_line() {
        let refused = |text: &str| format!("{:#}", TraceFile::parse(text).unwrap_err());
        let after = |line: &str| refused(&format!("0 0 0 0 0 0 0 1\n{line}"));
        assert_eq!(refused("# nothing\n"), "it holds no pose");
        assert_eq!(after("1 NaN 0 0 0 0 0 1"), "line 2: \"NaN\" is not finite");
        assert_eq!(after("1 inf 0 0 0 0 0 1"), "line 2: \"inf\" is not finite");
        assert!(after("1 a 0 0 0 0 0 1").starts_with("line 2: \"a\" is not a number"));
        assert_eq!(
            after("1 0 0 0 0 0 0 2"),
            "line 2: the quaternion has length 2.0000 and not 1"
        );
        assert_eq!(
            after("-1 0 0 0 0 0 0 1"),
            "line 2: time goes backwards, from 0 to -1"
        );
        assert!(after("0 0 0 0 0 0 0 1").contains("backwards"));
        assert!(after("1 2 3").contains("8 numbers"));
        assert_eq!(
            after("1 1e300 0 0 0 0 0 1"),
            "line 2: a number is too large"
        );
    }

    #[test]
    fn a_missing_file_is_named() {
        let refused = TraceFile::read(Path::new("/nowhere/head.txt")).unwrap_err();
        assert!(refused.to_string().contains("/nowhere/head.txt"));
    }
}
