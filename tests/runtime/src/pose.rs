//! Just enough of rigid transforms.

use openxr_sys::{Posef, Quaternionf, Vector3f};

pub(crate) const IDENTITY: Posef = Posef {
    orientation: Quaternionf {
        x: 0.0,
        y: 0.0,
        z: 0.0,
        w: 1.0,
    },
    position: Vector3f {
        x: 0.0,
        y: 0.0,
        z: 0.0,
    },
};

pub(crate) fn add(a: Vector3f, b: Vector3f, scale: f32) -> Vector3f {
    Vector3f {
        x: a.x + b.x * scale,
        y: a.y + b.y * scale,
        z: a.z + b.z * scale,
    }
}

fn cross(a: Vector3f, b: Vector3f) -> Vector3f {
    Vector3f {
        x: a.y * b.z - a.z * b.y,
        y: a.z * b.x - a.x * b.z,
        z: a.x * b.y - a.y * b.x,
    }
}

pub(crate) fn conjugate(q: Quaternionf) -> Quaternionf {
    Quaternionf {
        x: -q.x,
        y: -q.y,
        z: -q.z,
        w: q.w,
    }
}

pub(crate) fn product(a: Quaternionf, b: Quaternionf) -> Quaternionf {
    Quaternionf {
        x: a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        y: a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        z: a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        w: a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    }
}

pub(crate) fn rotate(q: Quaternionf, v: Vector3f) -> Vector3f {
    let axis = Vector3f {
        x: q.x,
        y: q.y,
        z: q.z,
    };
    let once = cross(axis, v);
    let twice = cross(axis, once);
    add(add(v, once, 2.0 * q.w), twice, 2.0)
}

/// `a_from_c` of `a_from_b` and `b_from_c`.
pub(crate) fn then(outer: Posef, inner: Posef) -> Posef {
    Posef {
        orientation: product(outer.orientation, inner.orientation),
        position: add(
            rotate(outer.orientation, inner.position),
            outer.position,
            1.0,
        ),
    }
}

pub(crate) fn inverse(pose: Posef) -> Posef {
    let orientation = conjugate(pose.orientation);
    let back = rotate(orientation, pose.position);
    Posef {
        orientation,
        position: add(IDENTITY.position, back, -1.0),
    }
}

/// Whether the orientation is of unit length, within the 1 % that OpenXR allows.
pub(crate) fn is_valid(pose: &Posef) -> bool {
    let q = pose.orientation;
    let length = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
    let p = pose.position;
    (length - 1.0).abs() < 0.02 && (p.x + p.y + p.z).is_finite()
}
