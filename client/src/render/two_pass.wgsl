// One eye a pass: its matrix comes first.

@vertex
fn vertex_still(corner: Corner) -> Point {
    return still(0u, corner);
}

@vertex
fn vertex_moving(corner: Corner) -> Point {
    return moving(0u, corner);
}

@vertex
fn vertex_sky(@builtin(vertex_index) vertex: u32) -> Ray {
    return sky_corner(0u, vertex);
}

@vertex
fn vertex_notice(@builtin(vertex_index) vertex: u32) -> OnPanel {
    return notice_corner(0u, vertex);
}
