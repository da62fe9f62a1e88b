// Code that drawing and measuring a tile share. Each workgroup has one tile, and each lane one pixel.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read> entry_slots: array<u32>;
@group(0) @binding(4) var<storage, read> centres: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> conics: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> colours: array<f32>;

var<workgroup> range: vec2<u32>;
// Number of pixels that are not finished.
var<workgroup> open: atomic<u32>;
var<workgroup> open_now: u32;

// Returns the entries of the tile: the first entry, and the first entry after the last. All lanes must call this, before
// `any_open`.
fn entries_of(tile: u32, lane: u32) -> vec2<u32> {
    if lane == 0u {
        range = vec2<u32>(0u);
        if tile < band.tiles {
            range = ranges[tile];
        }
        atomicStore(&open, 0u);
    }
    workgroupBarrier();
    return workgroupUniformLoad(&range);
}

// Returns whether any pixel of the tile is not finished. All lanes must call this.
fn any_open(lane: u32, finished: bool) -> bool {
    if !finished {
        atomicAdd(&open, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        open_now = atomicExchange(&open, 0u);
    }
    workgroupBarrier();
    return workgroupUniformLoad(&open_now) > 0u;
}

struct Splat {
    // The centre, and the conic's xx and xy.
    centre: vec4<f32>,
    // The conic's yy and determinant, and the opacity.
    conic: vec3<f32>,
    colour: vec3<f32>,
}

// Returns the splat of an entry. A splat whose colour overflows is not drawn.
fn splat_of(entry: u32) -> Splat {
    let slot = entry_slots[entry];
    let conic = conics[slot];
    let colour = vec3<f32>(colours[3u * slot], colours[3u * slot + 1u], colours[3u * slot + 2u]);
    let opacity = select(conic.z, 0.0, colour.x == NO_COLOUR);
    return Splat(centres[slot], vec3<f32>(conic.xy, opacity), colour);
}

// Returns the opacity of a splat at the pixel `here`, like `cpu::blend::alphas`; 0 where the splat does not count. The
// conic's xx and xy are in `centre.zw`.
fn alpha_at(centre: vec4<f32>, yy: f32, opacity: f32, here: vec2<f32>) -> f32 {
    let d = centre.xy - here;
    let power = -0.5 * (centre.z * d.x * d.x + yy * d.y * d.y) - centre.w * d.x * d.y;
    if power > 0.0 {
        return 0.0;
    }
    let alpha = min(opacity * exp(power), ALPHA_MAX);
    return select(alpha, 0.0, alpha < ALPHA_MIN);
}
