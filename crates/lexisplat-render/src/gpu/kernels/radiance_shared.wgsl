// As `radiance_codes`, with the dictionary in workgroup memory: lanes that want different atoms at once
// meet in banks there, not in cache lines.
var<workgroup> atoms_here: array<f32, DICTIONARY>;

fn seen_here(at: u32, b: array<f32, MAX_BASIS>) -> vec3<f32> {
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
    let slot = slot_of(group_number(group, groups), lane);
    if slot == NO_SLOT {
        return;
    }
    let i = gaussians[slot] - chunk.first;
    let b = rest_basis(direction_to(i));
    let column = column_of(i);
    var rest = vec3<f32>(0.0);
    for (var k = 0u; k < column.count; k++) {
        rest += value_at(column, k) * seen_here(atom_number(column, k) * DIM, b);
    }
    if column.escaped {
        rest = seen((ATOMS + escape_of(i)) * ATOM_VECTORS, b);
    }
    write_colour(slot, base_colour(i), rest);
}
