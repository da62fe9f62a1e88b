// Draws tiles like `cpu::blend`. Each workgroup draws one tile, and each lane one pixel. Splats are drawn from front to
// back.
@group(0) @binding(7) var<storage, read_write> pixels: array<vec4<f32>>;

// A batch of splats. `batch_centre` has the centre and the conic's xx and xy, `batch_conic` the conic's yy and the
// opacity, the third array the colour.
var<workgroup> batch_centre: array<vec4<f32>, GROUP>;
var<workgroup> batch_conic: array<vec2<f32>, GROUP>;
var<workgroup> batch_colour: array<vec3<f32>, GROUP>;

@compute @workgroup_size(TILE, TILE)
fn blend(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) at: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = group_number(group, groups);
    let x = (tile % frame.columns) * TILE + at.x;
    let y = (band.first + tile / frame.columns) * TILE + at.y;
    let inside = tile < band.tiles && x < frame.width && y < frame.height;
    let entries = entries_of(tile, lane);
    let here = vec2<f32>(f32(x), f32(y));
    var transmittance = 1.0;
    var colour = vec3<f32>(0.0);
    var finished = !inside;
    for (var first = entries.x; first < entries.y; first += GROUP) {
        if !any_open(lane, finished) {
            break;
        }
        if first + lane < entries.y {
            let splat = splat_of(first + lane);
            batch_centre[lane] = splat.centre;
            batch_conic[lane] = splat.conic.xz;
            batch_colour[lane] = splat.colour;
        }
        workgroupBarrier();
        let count = min(GROUP, entries.y - first);
        for (var k = 0u; k < count && !finished; k++) {
            let alpha = alpha_at(batch_centre[k], batch_conic[k].x, batch_conic[k].y, here);
            if alpha == 0.0 {
                continue;
            }
            let left = transmittance * (1.0 - alpha);
            if left < TRANSMITTANCE_MIN {
                finished = true;
                break;
            }
            colour += batch_colour[k] * (alpha * transmittance);
            transmittance = left;
        }
        workgroupBarrier();
    }
    if inside {
        let row = y - band.first * TILE;
        pixels[row * frame.width + x] = vec4<f32>(colour + transmittance * frame.background, 1.0);
    }
}
