// Computes the colour towards the camera of the Gaussians that have slots, like `radiance::Radiance::colour`.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> chunk: Chunk;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> gaussians: array<u32>;
@group(0) @binding(4) var<storage, read> bodies: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> colours: array<f32>;

// Returns the slot that this lane colours, or NO_SLOT.
fn slot_of(group: u32, lane: u32) -> u32 {
    let first = min(starts[chunk.first_block], frame.slots);
    let end = min(starts[chunk.first_block + chunk.blocks], frame.slots);
    let slot = first + group * GROUP + lane;
    return select(NO_SLOT, slot, slot < end);
}

// Returns the direction from the camera to the Gaussian. A length of 0 needs no guard, because such a Gaussian is not in
// front of the camera. INRIA's renderer and the CPU renderer have no guard either.
fn direction_to(i: u32) -> vec3<f32> {
    return normalize(bodies[i].xyz - frame.position);
}

// Returns the values of the basis without DC, like `lexisplat::sh::rest_basis`. Values above the frame's degree are 0.
fn rest_basis(d: vec3<f32>) -> array<f32, MAX_BASIS> {
    var b: array<f32, MAX_BASIS>;
    let x = d.x;
    let y = d.y;
    let z = d.z;
    if frame.degree >= 1u {
        b[0] = -SH_C1 * y;
        b[1] = SH_C1 * z;
        b[2] = -SH_C1 * x;
    }
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    let xy = x * y;
    let yz = y * z;
    let xz = x * z;
    if frame.degree >= 2u {
        b[3] = SH_C2_0 * xy;
        b[4] = SH_C2_1 * yz;
        b[5] = SH_C2_2 * (2.0 * zz - xx - yy);
        b[6] = SH_C2_3 * xz;
        b[7] = SH_C2_4 * (xx - yy);
    }
    if frame.degree >= 3u {
        b[8] = SH_C3_0 * y * (3.0 * xx - yy);
        b[9] = SH_C3_1 * xy * z;
        b[10] = SH_C3_2 * y * (4.0 * zz - xx - yy);
        b[11] = SH_C3_3 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
        b[12] = SH_C3_4 * x * (4.0 * zz - xx - yy);
        b[13] = SH_C3_5 * z * (xx - yy);
        b[14] = SH_C3_6 * x * (xx - 3.0 * yy);
    }
    if frame.degree >= 4u {
        b[15] = SH_C4_0 * xy * (xx - yy);
        b[16] = SH_C4_1 * yz * (3.0 * xx - yy);
        b[17] = SH_C4_2 * xy * (7.0 * zz - 1.0);
        b[18] = SH_C4_3 * yz * (7.0 * zz - 3.0);
        b[19] = SH_C4_4 * (zz * (35.0 * zz - 30.0) + 3.0);
        b[20] = SH_C4_5 * xz * (7.0 * zz - 3.0);
        b[21] = SH_C4_6 * (xx - yy) * (7.0 * zz - 1.0);
        b[22] = SH_C4_7 * xz * (xx - 3.0 * yy);
        b[23] = SH_C4_8 * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy));
    }
    return b;
}

// Stores a colour. A colour that overflows becomes NO_COLOUR, and its splat is not drawn.
fn write_colour(slot: u32, dc: vec3<f32>, rest: vec3<f32>) {
    let sum = COLOUR_OFFSET + SH_C0 * dc + rest;
    let finite = all(abs(sum) < vec3<f32>(FAR_LIMIT));
    let colour = select(vec3<f32>(NO_COLOUR), max(sum, vec3<f32>(0.0)), finite);
    colours[3u * slot] = colour.x;
    colours[3u * slot + 1u] = colour.y;
    colours[3u * slot + 2u] = colour.z;
}
