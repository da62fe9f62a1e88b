// Exclusive prefix sums, in place. A sum that would overflow stays at the largest number. The length is the value of a
// counter, or `fixed` if `fixed` is not 0.
struct Scan {
    counter: u32,
    fixed_length: u32,
    padding_a: u32,
    padding_b: u32,
}

@group(0) @binding(0) var<uniform> scan: Scan;
@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> data: array<u32>;
// Sums of the blocks.
@group(0) @binding(3) var<storage, read_write> sums: array<u32>;

var<workgroup> partial: array<u32, GROUP>;

fn scan_length() -> u32 {
    if scan.fixed_length > 0u {
        return scan.fixed_length;
    }
    return counters[scan.counter];
}

fn plus(a: u32, b: u32) -> u32 {
    return a + min(b, 0xffffffffu - a);
}

// Returns the sum of the values of the lanes below this lane. Afterwards `partial[GROUP - 1]` is the sum of all values.
fn before(lane: u32, value: u32) -> u32 {
    workgroupBarrier();
    partial[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < GROUP; step *= 2u) {
        var more = 0u;
        if lane >= step {
            more = partial[lane - step];
        }
        workgroupBarrier();
        partial[lane] = plus(partial[lane], more);
        workgroupBarrier();
    }
    return partial[lane] - value;
}

@compute @workgroup_size(GROUP)
fn scan_reduce(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let length = scan_length();
    let block = group_number(group, groups);
    var sum = 0u;
    for (var k = 0u; k < SCAN_ITEMS; k++) {
        let i = block * SCAN_BLOCK + k * GROUP + lane;
        if i < length {
            sum = plus(sum, data[i]);
        }
    }
    let unused = before(lane, sum);
    if lane == GROUP - 1u && block * SCAN_BLOCK < length {
        sums[block] = partial[lane];
    }
}

@compute @workgroup_size(GROUP)
fn scan_spine(@builtin(local_invocation_index) lane: u32) {
    let blocks = (scan_length() + SCAN_BLOCK - 1u) / SCAN_BLOCK;
    var carry = 0u;
    for (var first = 0u; first < blocks; first += GROUP) {
        let i = first + lane;
        var value = 0u;
        if i < blocks {
            value = sums[i];
        }
        let sum = plus(carry, before(lane, value));
        if i < blocks {
            sums[i] = sum;
        }
        carry = plus(carry, partial[GROUP - 1u]);
    }
}

@compute @workgroup_size(GROUP)
fn scan_spread(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let length = scan_length();
    let block = group_number(group, groups);
    let first = block * SCAN_BLOCK + lane * SCAN_ITEMS;
    var values: array<u32, SCAN_ITEMS>;
    var sum = 0u;
    for (var k = 0u; k < SCAN_ITEMS; k++) {
        if first + k < length {
            values[k] = data[first + k];
            sum = plus(sum, values[k]);
        }
    }
    var total = before(lane, sum);
    if block * SCAN_BLOCK < length {
        total = plus(total, sums[block]);
    }
    for (var k = 0u; k < SCAN_ITEMS; k++) {
        if first + k < length {
            data[first + k] = total;
            total = plus(total, values[k]);
        }
    }
}
