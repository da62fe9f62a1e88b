// Draws tiles: each group one tile, each lane one pixel, splats from front to back. Twin: `cpu::blend`.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> entry_slots: array<u32>;
@group(0) @binding(4) var<storage, read> centres: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> conics: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> colours: array<f32>;
@group(0) @binding(7) var<storage, read_write> pixels: array<vec4<f32>>;

// A batch of splats: centre and conic; then conic, opacity and colour.
var<workgroup> batch_centre: array<vec4<f32>, GROUP>;
var<workgroup> batch_conic: array<vec2<f32>, GROUP>;
var<workgroup> batch_colour: array<vec3<f32>, GROUP>;
var<workgroup> range: vec2<u32>;
// Pixels that are not finished.
var<workgroup> open: atomic<u32>;
var<workgroup> open_now: u32;

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
    if lane == 0u {
        range = vec2<u32>(0u);
        if tile < band.tiles {
            range = ranges[tile];
        }
        atomicStore(&open, 0u);
    }
    workgroupBarrier();
    let entries = workgroupUniformLoad(&range);
    let here = vec2<f32>(f32(x), f32(y));
    var transmittance = 1.0;
    var colour = vec3<f32>(0.0);
    var finished = !inside;
    for (var first = entries.x; first < entries.y; first += GROUP) {
        if !finished {
            atomicAdd(&open, 1u);
        }
        workgroupBarrier();
        if lane == 0u {
            open_now = atomicExchange(&open, 0u);
        }
        workgroupBarrier();
        if workgroupUniformLoad(&open_now) == 0u {
            break;
        }
        if first + lane < entries.y {
            let slot = entry_slots[first + lane];
            batch_centre[lane] = centres[slot];
            let conic = conics[slot];
            let colour = vec3<f32>(colours[3u * slot], colours[3u * slot + 1u], colours[3u * slot + 2u]);
            batch_conic[lane] = vec2<f32>(conic.x, select(conic.z, 0.0, colour.x == NO_COLOUR));
            batch_colour[lane] = colour;
        }
        workgroupBarrier();
        let count = min(GROUP, entries.y - first);
        for (var k = 0u; k < count && !finished; k++) {
            let centre = batch_centre[k];
            let conic = batch_conic[k];
            let d = centre.xy - here;
            let power = -0.5 * (centre.z * d.x * d.x + conic.x * d.y * d.y) - centre.w * d.x * d.y;
            if power > 0.0 {
                continue;
            }
            let alpha = min(conic.y * exp(power), ALPHA_MAX);
            if alpha < ALPHA_MIN {
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
