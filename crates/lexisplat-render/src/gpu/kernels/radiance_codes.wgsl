// Colours slots in their order.
@compute @workgroup_size(GROUP)
fn radiance(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    colour_slot(slot_of(group_number(group, groups), lane));
}
