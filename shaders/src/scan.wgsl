// How threads find their places in lists without racing for them: each goes through a
// run of items and counts what it has, and the sums over what comes before say where it
// goes. So lists keep the order of what they are made of, on every device.
// Kernels are built with `Sums`, what is counted at once, and RUN, the items of a thread.

var<workgroup> sums: array<Sums, 256>;

fn runs_of(count: u32) -> u32 {
    return (count + RUN - 1u) / RUN;
}

// Threads in groups of 64 may be folded into two dimensions.
fn thread_of(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.x + id.y * groups.x * 64u;
}

// Turns what each thread of a group of `lanes` has into what all before it have;
// the last thread's result plus its own is all.
fn sum_before(lane: u32, lanes: u32, own: Sums) -> Sums {
    workgroupBarrier();
    sums[lane] = own;
    for (var step = 1u; step < lanes; step *= 2u) {
        workgroupBarrier();
        var more = Sums();
        if (lane >= step) {
            more = sums[lane - step];
        }
        workgroupBarrier();
        sums[lane] += more;
    }
    workgroupBarrier();
    return sums[lane] - own;
}
