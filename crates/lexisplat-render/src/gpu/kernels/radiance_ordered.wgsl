// As `radiance_codes`, with the group's slots ordered by nonzeros first: lanes in step then have codes of
// like length, and none waits for a much longer one. Which of two equal ones goes first makes no difference.
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
    var slot = slot_of(number, lane);
    var count = 0u;
    if slot != NO_SLOT {
        count = column_of(gaussians[slot] - chunk.first).count;
    }
    if lane < COUNT_BINS {
        atomicStore(&bins[lane], 0u);
    }
    workgroupBarrier();
    let place = atomicAdd(&bins[count], 1u);
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
    ordered[bin_ends[count] - atomicLoad(&bins[count]) + place] = lane;
    workgroupBarrier();
    slot = slot_of(number, ordered[lane]);
    if slot == NO_SLOT {
        return;
    }
    let i = gaussians[slot] - chunk.first;
    let b = rest_basis(direction_to(i));
    let column = column_of(i);
    var rest = vec3<f32>(0.0);
    for (var k = 0u; k < column.count; k++) {
        rest += value_at(column, k) * seen(atom_number(column, k) * ATOM_VECTORS, b);
    }
    if column.escaped {
        rest = seen((ATOMS + escape_of(i)) * ATOM_VECTORS, b);
    }
    write_colour(slot, base_colour(i), rest);
}
