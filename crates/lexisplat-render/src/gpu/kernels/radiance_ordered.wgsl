// First orders the slots of the group by number of nonzeros. Lanes that run in lockstep then have codes of similar
// length, and none waits for a much longer code. The order of slots with equal numbers does not matter.
var<workgroup> bins: array<atomic<u32>, COUNT_BINS>;
var<workgroup> bin_ends: array<u32, COUNT_BINS>;
var<workgroup> ordered: array<u32, GROUP>;

@compute @workgroup_size(GROUP)
fn radiance(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let number = group_number(group, groups);
    let slot = slot_of(number, lane);
    var count = 0u;
    if slot != NO_SLOT {
        count = column_of(gaussians[slot] - chunk.first).count;
    }
    if lane < COUNT_BINS {
        atomicStore(&bins[lane], 0u);
    }
    workgroupBarrier();
    let rank = atomicAdd(&bins[count], 1u);
    workgroupBarrier();
    if lane < COUNT_BINS {
        bin_ends[lane] = atomicLoad(&bins[lane]);
    }
    workgroupBarrier();
    for (var step = 1u; step < COUNT_BINS; step *= 2u) {
        var more = 0u;
        if lane >= step && lane < COUNT_BINS {
            more = bin_ends[lane - step];
        }
        workgroupBarrier();
        if lane < COUNT_BINS {
            bin_ends[lane] += more;
        }
        workgroupBarrier();
    }
    ordered[bin_ends[count] - atomicLoad(&bins[count]) + rank] = lane;
    workgroupBarrier();
    colour_slot(slot_of(number, ordered[lane]));
}
