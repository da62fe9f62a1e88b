// Dense SH. A row has the coefficients of a Gaussian in order, DC first. Red, green and blue of a coefficient are side by
// side.
@group(0) @binding(6) var<storage, read> rows: array<ROW_TYPE>;

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
    let row = i * ROW_VECTORS;
    var rest = vec3<f32>(0.0);
    // DENSE_TERMS
    write_colour(slot, dc, rest);
}
