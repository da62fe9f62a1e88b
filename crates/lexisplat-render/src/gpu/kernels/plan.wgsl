// Computes sizes that are known only on the GPU: the numbers of slots and entries, and the numbers of workgroups for
// them.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> starts: array<u32>;
// First block of each chunk, and the end of the last chunk.
@group(0) @binding(2) var<storage, read> chunk_blocks: array<u32>;
@group(0) @binding(3) var<storage, read_write> counters: array<u32>;
@group(0) @binding(4) var<storage, read_write> dispatches: array<u32>;
// Index where the entries of each slot begin in the tile lists. Only `plan_entries` reads it.
@group(0) @binding(5) var<storage, read> offsets: array<u32>;

fn dispatch_groups(which: u32, n: u32) {
    let x = min(n, MAX_GROUPS);
    dispatches[3u * which] = x;
    dispatches[3u * which + 1u] = (n + MAX_GROUPS - 1u) / MAX_GROUPS;
    dispatches[3u * which + 2u] = 1u;
}

fn pieces(n: u32, size: u32) -> u32 {
    return (n + size - 1u) / size;
}

@compute @workgroup_size(1)
fn plan_slots() {
    let found = starts[frame.blocks];
    let n = min(found, frame.slots);
    let blocks = pieces(n, SORT_BLOCK);
    counters[COUNTER_FOUND] = max(counters[COUNTER_FOUND], found);
    counters[COUNTER_SLOTS] = n;
    counters[COUNTER_SLOTS_AND_END] = n + 1u;
    counters[COUNTER_SLOT_BLOCKS] = blocks;
    counters[COUNTER_SLOT_DIGITS] = blocks * DIGITS;
    dispatch_groups(DISPATCH_SLOTS_AND_END, pieces(n + 1u, GROUP));
    dispatch_groups(DISPATCH_SLOT_BLOCKS, blocks);
    dispatch_groups(DISPATCH_SLOT_DIGITS, pieces(blocks * DIGITS, SCAN_BLOCK));
    dispatch_groups(DISPATCH_SLOT_SCAN, pieces(n + 1u, SCAN_BLOCK));
    for (var c = 0u; c < frame.chunks; c++) {
        let first = min(starts[chunk_blocks[c]], n);
        let end = min(starts[chunk_blocks[c + 1u]], n);
        dispatch_groups(DISPATCH_CHUNKS + c, pieces(end - first, GROUP));
    }
}

@compute @workgroup_size(1)
fn plan_entries() {
    let found = offsets[counters[COUNTER_SLOTS]];
    let n = min(found, frame.entries);
    let blocks = pieces(n, SORT_BLOCK);
    counters[COUNTER_ENTRIES_MOST] = max(counters[COUNTER_ENTRIES_MOST], found);
    let all = counters[COUNTER_ENTRIES_ALL];
    counters[COUNTER_ENTRIES_ALL] = all + min(found, 0xffffffffu - all);
    counters[COUNTER_ENTRIES] = n;
    counters[COUNTER_ENTRY_BLOCKS] = blocks;
    counters[COUNTER_ENTRY_DIGITS] = blocks * DIGITS;
    dispatch_groups(DISPATCH_ENTRIES, pieces(n, GROUP));
    dispatch_groups(DISPATCH_ENTRY_BLOCKS, blocks);
    dispatch_groups(DISPATCH_ENTRY_DIGITS, pieces(blocks * DIGITS, SCAN_BLOCK));
}
