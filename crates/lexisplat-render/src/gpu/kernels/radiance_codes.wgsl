@compute @workgroup_size(GROUP)
fn radiance(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let slot = slot_of(group_number(group, groups), lane);
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
