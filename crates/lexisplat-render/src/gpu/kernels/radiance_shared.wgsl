// Keeps the dictionary in workgroup memory. Lanes that read different atoms at once then compete for memory banks instead
// of cache lines.
var<workgroup> atoms_here: array<f32, DICTIONARY>;

fn look(d: vec3<f32>) -> array<f32, MAX_BASIS> {
    return rest_basis(d);
}

fn atom_seen(atom: u32, b: array<f32, MAX_BASIS>) -> vec3<f32> {
    let at = atom * DIM;
    var sum = vec3<f32>(0.0);
    // SHARED_TERMS
    return sum;
}

@compute @workgroup_size(GROUP)
fn radiance(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    for (var k = lane; k < ATOMS * DIM; k += GROUP) {
        let c = k % DIM;
        atoms_here[k] = atoms[(k / DIM) * ATOM_VECTORS + c / 4u][c % 4u];
    }
    workgroupBarrier();
    colour_slot(slot_of(group_number(group, groups), lane));
}
