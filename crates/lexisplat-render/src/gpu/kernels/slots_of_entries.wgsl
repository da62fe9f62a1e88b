// Gives each sorted entry its slot. While sensitivities are measured, the sort moves the indices of entries in the lists
// instead of their slots.
@group(0) @binding(0) var<storage, read> counters: array<u32>;
@group(0) @binding(1) var<storage, read> entry_indices: array<u32>;
// Slot of each entry, in the order in which the entries were listed.
@group(0) @binding(2) var<storage, read> listed_slots: array<u32>;
@group(0) @binding(3) var<storage, read_write> entry_slots: array<u32>;

@compute @workgroup_size(GROUP)
fn slots_of_entries(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = group_number(group, groups) * GROUP + lane;
    if i < counters[COUNTER_ENTRIES] {
        entry_slots[i] = listed_slots[entry_indices[i]];
    }
}
