// Adds up the moments of each splat over the tiles that it touches, like `cpu::moments::Moments::add`. The tiles are in
// the order of the lists. The sums of the bands before are continued.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> counters: array<u32>;
// Slots in the order of depth.
@group(0) @binding(2) var<storage, read> order: array<u32>;
// Index where the entries of each splat begin.
@group(0) @binding(3) var<storage, read> offsets: array<u32>;
@group(0) @binding(4) var<storage, read> moments: array<f32>;
// Sums of moments of each slot.
@group(0) @binding(5) var<storage, read_write> sums: array<f32>;

@compute @workgroup_size(GROUP)
fn gather_moments(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let first = group_number(group, groups) * GROUP;
    let length = counters[COUNTER_SLOTS];
    // Each group adds up the moments of GROUP splats. Neighbouring lanes read neighbouring numbers.
    for (var k = lane; k < GROUP * MOMENTS; k += GROUP) {
        let rank = first + k / MOMENTS;
        if rank >= length {
            break;
        }
        let which = k % MOMENTS;
        let end = min(offsets[rank + 1u], frame.entries);
        let to = order[rank] * MOMENTS + which;
        var sum = sums[to];
        for (var e = offsets[rank]; e < end; e++) {
            let value = moments[e * MOMENTS + which];
            sum = select(sum + value, max(sum, value), which == MOMENT_SUMS);
        }
        sums[to] = sum;
    }
}
