// Finds where the list of each tile begins and ends among the sorted entries.
@group(0) @binding(0) var<uniform> band: Band;
@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> entry_tiles: array<u32>;
@group(0) @binding(3) var<storage, read_write> ranges: array<vec2<u32>>;

@compute @workgroup_size(GROUP)
fn find_ranges(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_number(group, groups) * GROUP + lane;
    let length = counters[COUNTER_ENTRIES];
    if i >= length {
        return;
    }
    let tile = entry_tiles[i];
    if tile >= band.tiles {
        return;
    }
    var begins = true;
    if i > 0u {
        begins = entry_tiles[i - 1u] != tile;
    }
    var ends = true;
    if i + 1u < length {
        ends = entry_tiles[i + 1u] != tile;
    }
    if begins {
        ranges[tile].x = i;
    }
    if ends {
        ranges[tile].y = i + 1u;
    }
}
