// What the kernels of these tests share. Each reads `inputs` and writes an
// output a thread; consecutive threads belong to one input.

fn thread_of(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.x + id.y * groups.x * 64u;
}

// Points of unrelated seeds are independent, as those of one sequence are not.
fn sampler_of(thread: u32) -> Sampler {
    return Sampler(0u, hash(thread), 0u);
}
