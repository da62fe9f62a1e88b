// Sums the squared differences of two pictures, with channels clipped to 0..1, like `squared_error` on the processor.
// Each lane of a workgroup sums ERROR_PIXELS pixels, always in the same order.
@group(0) @binding(0) var<uniform> extent: Extent;
@group(0) @binding(1) var<storage, read> picture: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> other: array<vec4<f32>>;
// One sum for each workgroup.
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;

// A struct with the layout of `gpu::uniforms::Extent`.
struct Extent {
    // Number of pixels that are compared.
    pixels: u32,
    // Index where the first workgroup stores its sum.
    first_sum: u32,
    padding_a: u32,
    padding_b: u32,
}

var<workgroup> of_lanes: array<f32, GROUP>;

// Returns the channels clipped to 0..1. NaN becomes 0.
fn clipped(pixel: vec4<f32>) -> vec3<f32> {
    return select(vec3<f32>(0.0), min(pixel.xyz, vec3<f32>(1.0)), pixel.xyz > vec3<f32>(0.0));
}

@compute @workgroup_size(GROUP)
fn squared_error(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let number = group_number(group, groups);
    var sum = 0.0;
    for (var k = 0u; k < ERROR_PIXELS; k++) {
        let i = (number * ERROR_PIXELS + k) * GROUP + lane;
        if i < extent.pixels {
            let difference = clipped(picture[i]) - clipped(other[i]);
            sum += dot(difference, difference);
        }
    }
    of_lanes[lane] = sum;
    for (var half = GROUP / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            of_lanes[lane] += of_lanes[lane + half];
        }
    }
    if lane == 0u && number * ERROR_PIXELS * GROUP < extent.pixels {
        sums[extent.first_sum + number] = of_lanes[0];
    }
}
