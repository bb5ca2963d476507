// Both eyes in one pass: the view is the eye.

@vertex
fn vertex_still(@builtin(view_index) eye: u32, corner: Corner) -> Point {
    return still(eye, corner);
}

@vertex
fn vertex_moving(@builtin(view_index) eye: u32, corner: Corner) -> Point {
    return moving(eye, corner);
}

@vertex
fn vertex_sky(@builtin(view_index) eye: u32, @builtin(vertex_index) vertex: u32) -> Ray {
    return sky_corner(eye, vertex);
}

@vertex
fn vertex_notice(@builtin(view_index) eye: u32, @builtin(vertex_index) vertex: u32) -> OnPanel {
    return notice_corner(eye, vertex);
}
