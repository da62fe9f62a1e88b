// One pass of a stable radix sort of (key, value) pairs, from the lowest digit up.
struct Pass {
    // Lowest bit of the digit.
    shift: u32,
    // Indices of the counters with the number of pairs and the number of blocks.
    length: u32,
    blocks: u32,
    // 1 if the values are the indices of their keys, as in the first pass of a sort of slots; otherwise 0.
    identity: u32,
}

@group(0) @binding(0) var<uniform> digit_pass: Pass;
@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> keys: array<u32>;
// Counts of keys by digit, and for each digit by block.
@group(0) @binding(3) var<storage, read_write> histogram: array<u32>;
@group(0) @binding(4) var<storage, read> values: array<u32>;
@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;

fn digit_of(key: u32) -> u32 {
    return (key >> digit_pass.shift) & (DIGITS - 1u);
}

var<workgroup> bins: array<atomic<u32>, DIGITS>;

@compute @workgroup_size(GROUP)
fn sort_count(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let length = counters[digit_pass.length];
    let blocks = counters[digit_pass.blocks];
    let block = group_number(group, groups);
    if lane < DIGITS {
        atomicStore(&bins[lane], 0u);
    }
    workgroupBarrier();
    for (var k = 0u; k < SORT_ITEMS; k++) {
        let i = block * SORT_BLOCK + k * GROUP + lane;
        if i < length {
            atomicAdd(&bins[digit_of(keys[i])], 1u);
        }
    }
    workgroupBarrier();
    if lane < DIGITS && block < blocks {
        histogram[lane * blocks + block] = atomicLoad(&bins[lane]);
    }
}

// For each pair of digits and each lane: the counts of both digits in one word. The scan replaces the counts by the
// number of keys before those of the lane.
var<workgroup> tallies: array<u32, DIGIT_PAIRS * GROUP>;
var<workgroup> segments: array<u32, GROUP>;
var<workgroup> bases: array<u32, DIGITS>;

@compute @workgroup_size(GROUP)
fn sort_scatter(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let length = counters[digit_pass.length];
    let blocks = counters[digit_pass.blocks];
    let block = group_number(group, groups);
    if lane < DIGITS && block < blocks {
        bases[lane] = histogram[lane * blocks + block];
    }
    for (var p = 0u; p < DIGIT_PAIRS; p++) {
        tallies[p * GROUP + lane] = 0u;
    }
    // Each lane counts consecutive keys, so that the sort is stable.
    let first = block * SORT_BLOCK + lane * SORT_ITEMS;
    var own: array<u32, SORT_ITEMS>;
    for (var k = 0u; k < SORT_ITEMS; k++) {
        if first + k < length {
            own[k] = keys[first + k];
            let digit = digit_of(own[k]);
            tallies[(digit / 2u) * GROUP + lane] += 1u << (16u * (digit % 2u));
        }
    }
    workgroupBarrier();
    // Exclusive sums over lanes. SEGMENTS lanes share a pair of digits, and each lane adds up one segment.
    let at = (lane / SEGMENTS) * GROUP + (lane % SEGMENTS) * SEGMENT;
    var sum = 0u;
    for (var k = 0u; k < SEGMENT; k++) {
        sum += tallies[at + k];
    }
    segments[lane] = sum;
    workgroupBarrier();
    for (var step = 1u; step < SEGMENTS; step *= 2u) {
        var more = 0u;
        if lane % SEGMENTS >= step {
            more = segments[lane - step];
        }
        workgroupBarrier();
        segments[lane] += more;
        workgroupBarrier();
    }
    var total = segments[lane] - sum;
    for (var k = 0u; k < SEGMENT; k++) {
        let count = tallies[at + k];
        tallies[at + k] = total;
        total += count;
    }
    workgroupBarrier();
    for (var k = 0u; k < SORT_ITEMS; k++) {
        let i = first + k;
        if i < length {
            let digit = digit_of(own[k]);
            let tally = (digit / 2u) * GROUP + lane;
            let half = 16u * (digit % 2u);
            let to = bases[digit] + ((tallies[tally] >> half) & 0xffffu);
            tallies[tally] += 1u << half;
            keys_out[to] = own[k];
            var value = i;
            if digit_pass.identity == 0u {
                value = values[i];
            }
            values_out[to] = value;
        }
    }
}
