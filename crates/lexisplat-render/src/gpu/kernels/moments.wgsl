// Sums for each splat of a tile how the tile's pixels change with the splat, like `cpu::moments`. Each workgroup has one
// tile. While drawing, each lane has one pixel. While summing, several lanes share the pixels of one splat.
//
// Index of each entry in the lists, where its moments are stored.
@group(0) @binding(7) var<storage, read> entry_indices: array<u32>;
// The finished picture.
@group(0) @binding(8) var<storage, read> pixels: array<vec4<f32>>;
// Moments of each entry. They begin as zeros, and stay zeros for splats that do not show.
@group(0) @binding(9) var<storage, read_write> moments: array<f32>;

// Number of values of a splat for each pixel.
const PARTS: u32 = 3u;
// Number of lanes that share a splat while summing, and number of pixels that each of these lanes sums.
const SHARERS: u32 = GROUP / MOMENT_SPLATS;
const SHARE: u32 = GROUP / SHARERS;

// A batch of splats. The arrays have: the centre and the conic's xx and xy; the conic's yy, the opacity, red and green;
// blue; the last diagonal element of the conic's root; the index in the lists.
var<workgroup> batch_centre: array<vec4<f32>, MOMENT_BATCH>;
var<workgroup> batch_conic: array<vec4<f32>, MOMENT_BATCH>;
var<workgroup> batch_blue: array<f32, MOMENT_BATCH>;
var<workgroup> batch_root: array<f32, MOMENT_BATCH>;
var<workgroup> batch_index: array<u32, MOMENT_BATCH>;
// First the values of every pixel for some splats, then the moments that every lane has summed.
var<workgroup> scratch: array<f32, PARTS * MOMENT_SPLATS * GROUP>;
// One bit for each of these splats, which is set if the splat shows.
var<workgroup> shown: atomic<u32>;

struct Pixel {
    at: vec2<f32>,
    picture: vec3<f32>,
    // The colour drawn so far.
    colour: vec3<f32>,
    transmittance: f32,
    finished: bool,
}

// Draws splat `k` of the batch like `blend`. Returns the squared derivative by one channel of the splat's colour, g, and
// the largest change of a channel when the splat is removed. All are 0 where the splat does not show.
fn draw(pixel: ptr<function, Pixel>, k: u32) -> vec3<f32> {
    let conic = batch_conic[k];
    let alpha = alpha_at(batch_centre[k], conic.x, conic.y, (*pixel).at);
    if alpha == 0.0 {
        return vec3<f32>(0.0);
    }
    let left = (*pixel).transmittance * (1.0 - alpha);
    if left < TRANSMITTANCE_MIN {
        (*pixel).finished = true;
        return vec3<f32>(0.0);
    }
    let weight = alpha * (*pixel).transmittance;
    let own = weight * vec3<f32>(conic.zw, batch_blue[k]);
    (*pixel).colour += own;
    (*pixel).transmittance = left;
    let behind = (*pixel).picture - (*pixel).colour;
    // alpha / (1 - alpha) is the share of the light from behind that is lost when ln alpha grows by one unit.
    let change = own - behind * (alpha / (1.0 - alpha));
    let sizes = abs(change);
    return vec3<f32>(weight * weight, dot(change, change), max(sizes.x, max(sizes.y, sizes.z)));
}

@compute @workgroup_size(TILE, TILE)
fn tile_moments(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) at: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let tile = group_number(group, groups);
    let left = (tile % frame.columns) * TILE;
    let row = (tile / frame.columns) * TILE;
    let top = band.first * TILE + row;
    let inside = tile < band.tiles && left + at.x < frame.width && top + at.y < frame.height;
    if lane == 0u {
        atomicStore(&shown, 0u);
    }
    let entries = entries_of(tile, lane);
    var pixel: Pixel;
    pixel.at = vec2<f32>(f32(left + at.x), f32(top + at.y));
    pixel.transmittance = 1.0;
    pixel.finished = !inside;
    if inside {
        pixel.picture = pixels[(row + at.y) * frame.width + left + at.x].xyz;
    }
    // These values are used while summing.
    let splat = lane / SHARERS;
    let sharer = lane % SHARERS;
    for (var first = entries.x; first < entries.y; first += MOMENT_BATCH) {
        if !any_open(lane, pixel.finished) {
            break;
        }
        if lane < MOMENT_BATCH && first + lane < entries.y {
            let splat = splat_of(first + lane);
            batch_centre[lane] = splat.centre;
            batch_root[lane] = sqrt(splat.conic.y / splat.centre.z);
            batch_conic[lane] = vec4<f32>(splat.conic.xz, splat.colour.xy);
            batch_blue[lane] = splat.colour.z;
            batch_index[lane] = entry_indices[first + lane];
        }
        workgroupBarrier();
        let count = min(MOMENT_BATCH, entries.y - first);
        for (var k = 0u; k < count; k += MOMENT_SPLATS) {
            var seen = 0u;
            for (var s = 0u; s < MOMENT_SPLATS; s++) {
                var parts = vec3<f32>(0.0);
                if !pixel.finished && k + s < count {
                    parts = draw(&pixel, k + s);
                }
                seen |= select(0u, 1u << s, parts.x > 0.0);
                let to = PARTS * GROUP * s + lane;
                scratch[to] = parts.x;
                scratch[to + GROUP] = parts.y;
                scratch[to + 2u * GROUP] = parts.z;
            }
            if seen != 0u {
                atomicOr(&shown, seen);
            }
            workgroupBarrier();
            let shows = atomicLoad(&shown);
            let own = ((shows >> splat) & 1u) == 1u;
            var second = vec4<f32>(0.0);
            var fourth = vec4<f32>(0.0);
            var rest = vec3<f32>(0.0);
            if own {
                let centre = batch_centre[k + splat];
                // The conic's root, which is upper triangular: `cpu::project::Root`.
                let xx = sqrt(centre.z);
                let xy = centre.w / xx;
                let yy = batch_root[k + splat];
                for (var p = 0u; p < SHARE; p++) {
                    let other = sharer + SHARERS * p;
                    let at_pixel = PARTS * GROUP * splat + other;
                    let g = scratch[at_pixel + GROUP];
                    let d = centre.xy - vec2<f32>(f32(left + other % TILE), f32(top + other / TILE));
                    let u = vec2<f32>(xx * d.x + xy * d.y, yy * d.y);
                    let gxx = g * u.x * u.x;
                    let gxy = g * u.x * u.y;
                    let gyy = g * u.y * u.y;
                    second += vec4<f32>(scratch[at_pixel], g, gxx, gxy);
                    fourth += vec4<f32>(gyy, gxx * u.x * u.x, gxx * u.x * u.y, gxx * u.y * u.y);
                    let largest = max(rest.z, scratch[at_pixel + 2u * GROUP]);
                    rest = vec3<f32>(rest.xy + vec2<f32>(gxy * u.y * u.y, gyy * u.y * u.y), largest);
                }
            }
            workgroupBarrier();
            if lane == 0u {
                atomicStore(&shown, 0u);
            }
            if own {
                scratch[lane] = second.x;
                scratch[GROUP + lane] = second.y;
                scratch[2u * GROUP + lane] = second.z;
                scratch[3u * GROUP + lane] = second.w;
                scratch[4u * GROUP + lane] = fourth.x;
                scratch[5u * GROUP + lane] = fourth.y;
                scratch[6u * GROUP + lane] = fourth.z;
                scratch[7u * GROUP + lane] = fourth.w;
                scratch[8u * GROUP + lane] = rest.x;
                scratch[9u * GROUP + lane] = rest.y;
                scratch[10u * GROUP + lane] = rest.z;
            }
            workgroupBarrier();
            let summed = lane / MOMENTS;
            if summed < MOMENT_SPLATS && ((shows >> summed) & 1u) == 1u {
                let which = lane % MOMENTS;
                var sum = 0.0;
                for (var p = 0u; p < SHARERS; p++) {
                    // Lanes begin at different indices, so that they read from different memory banks.
                    let value = scratch[which * GROUP + summed * SHARERS + (p + lane) % SHARERS];
                    sum = select(sum + value, max(sum, value), which == MOMENT_SUMS);
                }
                moments[batch_index[k + summed] * MOMENTS + which] = sum;
            }
            workgroupBarrier();
        }
    }
}
