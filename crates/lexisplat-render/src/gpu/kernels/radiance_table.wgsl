// Reads the radiance of each atom from a table over directions, which `gpu::radiance_table` makes. A layer of the table
// has the six faces of a cube side by side, and belongs to one atom.
@group(0) @binding(10) var table: texture_2d_array<f32>;
@group(0) @binding(11) var linear: sampler;

// Returns the texture coordinates of direction `d` in the table. The centres of the outer texels lie on the edges of a face, so that no
// sample mixes two faces.
fn look(d: vec3<f32>) -> vec2<f32> {
    let size = abs(d);
    var face = 0u;
    var on_face = vec2<f32>(d.y, d.z) / size.x;
    var negative = d.x < 0.0;
    if size.y > size.x && size.y >= size.z {
        face = 1u;
        on_face = vec2<f32>(d.x, d.z) / size.y;
        negative = d.y < 0.0;
    } else if size.z > size.x {
        face = 2u;
        on_face = vec2<f32>(d.x, d.y) / size.z;
        negative = d.z < 0.0;
    }
    face = 2u * face + select(0u, 1u, negative);
    let side = f32(TABLE_SIDE);
    let texel = (on_face * 0.5 + 0.5) * (side - 1.0) + 0.5;
    return vec2<f32>((f32(face) * side + texel.x) / (6.0 * side), texel.y / side);
}

fn atom_seen(atom: u32, uv: vec2<f32>) -> vec3<f32> {
    return textureSampleLevel(table, linear, uv, atom, 0.0).xyz;
}
