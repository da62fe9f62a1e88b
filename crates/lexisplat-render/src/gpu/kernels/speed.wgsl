// Measures the best rates of the GPU, for comparison with the stages.
@group(0) @binding(0) var<storage, read> from_here: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> to_there: array<vec4<f32>>;

@compute @workgroup_size(GROUP)
fn copy_vectors(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = (group.x + group.y * groups.x) * GROUP + lane;
    if i < arrayLength(&from_here) {
        to_there[i] = from_here[i];
    }
}

// Runs four independent chains of multiplications and additions, of four numbers each.
@compute @workgroup_size(GROUP)
fn multiply_add(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = (group.x + group.y * groups.x) * GROUP + lane;
    let factor = vec4<f32>(0.999);
    let term = vec4<f32>(f32(i)) * 1e-6;
    var a = term;
    var b = term + 1.0;
    var c = term + 2.0;
    var d = term + 3.0;
    for (var k = 0u; k < MULTIPLY_ADDS; k++) {
        a = a * factor + term;
        b = b * factor + term;
        c = c * factor + term;
        d = d * factor + term;
    }
    // This condition is never true. It keeps the compiler from removing the work.
    if a.x + b.y + c.z + d.w == -1.0 {
        to_there[0] = a + b + c + d;
    }
}
