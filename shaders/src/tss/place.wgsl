// Gives each triangle its slot. One thread per triangle in order of kinds.
// Twin: `Shelves::corners` in pack.rs.

// Powers of 2 to the minus sixteenths, in 65535ths.
var<private> weights_of_depths: array<u32, 16> = array<u32, 16>(
    65535u, 62757u, 60096u, 57548u, 55108u, 52772u, 50534u, 48392u, 46340u, 44376u, 42494u, 40693u, 38967u, 37315u, 35733u, 34218u,
);

fn weight_of(depth_in: u32) -> u32 {
    let depth = min(depth_in & 0xffu, 64u);
    return weights_of_depths[depth & 15u] >> (depth >> 4u);
}

// The middle of a texel, in eighths.
fn middle(x: u32, y: u32) -> u32 {
    return (8u * x + 4u) + ((8u * y + 4u) << 16u);
}

@compute @workgroup_size(64)
fn place(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let sorted = thread_of(id, groups);
    if (sorted >= state.placing) {
        return;
    }
    let i = order[tss.patch_count + sorted];
    let shape = shapes[triangles[i].patch_id];
    let kind = scaled(deserved(shape), state.steps);
    let found = cells[kind.x * CLASSES + kind.y];
    let rectangle = rectangle_of(kind.x, kind.y);
    let rank = sorted - found.start;
    let index = rank / rectangle.z;
    var x = (found.first & 0xffffu) + index * rectangle.x;
    var y = found.first >> 16u;
    if (index >= found.in_shelf) {
        let per_shelf = tss.width / rectangle.x;
        let rest = index - found.in_shelf;
        x = rest % per_shelf * rectangle.x;
        y = found.next_y + rest / per_shelf * rectangle.y;
    }
    if (y + rectangle.y > tss.height) {
        return;
    }
    let span = spans[kind.y];
    if (kind.x != kind.y) {
        // Its longest edge lies along the lowest row.
        let bottom = y + rectangle.y - 1u;
        let longest = min((shape.y >> 4u) & 3u, 2u);
        triangles[i].corners[longest] = middle(x, bottom);
        triangles[i].corners[(longest + 1u) % 3u] = middle(x + span, bottom);
        triangles[i].corners[(longest + 2u) % 3u] = middle(x, y) + min(shape.y & 15u, 8u) * span;
    } else if (rank % 2u == 0u) {
        triangles[i].corners = array<u32, 3>(middle(x, y), middle(x + span, y), middle(x, y + span));
    } else {
        x += rectangle.x - 1u;
        y += rectangle.y - 1u;
        triangles[i].corners = array<u32, 3>(middle(x, y), middle(x - span, y), middle(x, y - span));
    }
    triangles[i].weights = array<u32, 2>(weight_of(shape.y >> 8u) | (weight_of(shape.y >> 16u) << 16u), weight_of(shape.y >> 24u));
}
