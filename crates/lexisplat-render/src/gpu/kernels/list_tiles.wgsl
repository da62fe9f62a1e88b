@group(0) @binding(8) var<storage, read_write> entry_tiles: array<u32>;
@group(0) @binding(9) var<storage, read_write> entry_slots: array<u32>;

@compute @workgroup_size(GROUP)
fn list_tiles(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let rank = group_number(group, groups) * GROUP + lane;
    if rank >= counters[COUNTER_SLOTS] {
        return;
    }
    var at = offsets[rank];
    let end = min(offsets[rank + 1u], frame.entries);
    if at >= end {
        return;
    }
    let slot = order[rank];
    let rect = rects[slot];
    let rows = rows_of(rect);
    let centre = centres[slot];
    let conic = conics[slot];
    for (var row = rows.x; row < rows.y; row++) {
        let columns = columns_of(rect, centre, conic, row);
        for (var column = columns.x; column < columns.y && at < end; column++) {
            entry_tiles[at] = (row - band.first) * frame.columns + column;
            entry_slots[at] = slot;
            at++;
        }
    }
    // The same sums in another kernel may round differently, so entries may be left over. They belong to no tile.
    for (; at < end; at++) {
        entry_tiles[at] = band.tiles;
        entry_slots[at] = slot;
    }
}
