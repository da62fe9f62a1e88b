// Reads atoms through the cache, a vector at a time.
fn look(d: vec3<f32>) -> array<f32, MAX_BASIS> {
    return rest_basis(d);
}

fn atom_seen(atom: u32, b: array<f32, MAX_BASIS>) -> vec3<f32> {
    return seen(atom * ATOM_VECTORS, b);
}
