// Shows one or two pictures in a rectangle of the screen or of a file.

struct Arrangement {
    // Size of each picture in pixels.
    size: vec2<u32>,
    // 0: the first picture, 1: side by side, 2: wipe, 3: difference.
    mode: u32,
    // 1 if the target encodes written values as sRGB, otherwise 0. The pictures are sRGB already.
    encodes: u32,
    // Position of the wipe's line, 0 to 1.
    split: f32,
    // Factor on differences.
    gain: f32,
    padding: vec2<f32>,
}

@group(0) @binding(0) var<uniform> arrangement: Arrangement;
@group(0) @binding(1) var<storage, read> first: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> second: array<vec4<f32>>;

struct Corner {
    @builtin(position) position: vec4<f32>,
    // Place in the rectangle, from 0 at the top left to 1.
    @location(0) place: vec2<f32>,
}

@vertex
fn corner(@builtin(vertex_index) index: u32) -> Corner {
    // One triangle that covers the rectangle and more.
    let place = vec2<f32>(f32((index << 1u) & 2u), f32(index & 2u));
    return Corner(vec4<f32>(place.x * 2.0 - 1.0, 1.0 - place.y * 2.0, 0.0, 1.0), place);
}

// Distance from a whole pixel below which a place is moved to that pixel, because interpolated places are slightly
// inexact.
const SNAP: f32 = 0.005;

fn clipped(colour: vec3<f32>) -> vec3<f32> {
    // A comparison with NaN is false.
    return select(vec3<f32>(0.0), min(colour, vec3<f32>(1.0)), colour > vec3<f32>(0.0));
}

fn index(x: i32, y: i32) -> u32 {
    let most = vec2<i32>(arrangement.size) - 1;
    let at = vec2<u32>(clamp(vec2<i32>(x, y), vec2<i32>(0), most));
    return at.y * arrangement.size.x + at.x;
}

struct Footprint {
    // Indices of the pixels: top left, top right, bottom left, bottom right.
    at: vec4<u32>,
    part: vec2<f32>,
}

// Returns the four pixels around a place of the picture, 0 to 1, and the distance of the place from the first of them.
fn footprint(place: vec2<f32>) -> Footprint {
    let pixel = place * vec2<f32>(arrangement.size) - 0.5;
    let near = floor(pixel + SNAP);
    var part = max(pixel - near, vec2<f32>(0.0));
    part = select(part, vec2<f32>(0.0), part < vec2<f32>(SNAP));
    let x = i32(near.x);
    let y = i32(near.y);
    return Footprint(vec4<u32>(index(x, y), index(x + 1, y), index(x, y + 1), index(x + 1, y + 1)), part);
}

fn from_first(f: Footprint) -> vec3<f32> {
    let above = mix(clipped(first[f.at.x].rgb), clipped(first[f.at.y].rgb), f.part.x);
    let below = mix(clipped(first[f.at.z].rgb), clipped(first[f.at.w].rgb), f.part.x);
    return mix(above, below, f.part.y);
}

fn from_second(f: Footprint) -> vec3<f32> {
    let above = mix(clipped(second[f.at.x].rgb), clipped(second[f.at.y].rgb), f.part.x);
    let below = mix(clipped(second[f.at.z].rgb), clipped(second[f.at.w].rgb), f.part.x);
    return mix(above, below, f.part.y);
}

fn decoded(colour: vec3<f32>) -> vec3<f32> {
    let low = colour / 12.92;
    let high = pow((colour + 0.055) / 1.055, vec3<f32>(2.4));
    return select(high, low, colour <= vec3<f32>(0.04045));
}

@fragment
fn colour(corner: Corner) -> @location(0) vec4<f32> {
    let place = corner.place;
    var colour: vec3<f32>;
    switch arrangement.mode {
        case 1u: {
            let double = place.x * 2.0;
            if double < 1.0 {
                colour = from_first(footprint(vec2<f32>(double, place.y)));
            } else {
                colour = from_second(footprint(vec2<f32>(double - 1.0, place.y)));
            }
        }
        case 2u: {
            if place.x < arrangement.split {
                colour = from_first(footprint(place));
            } else {
                colour = from_second(footprint(place));
            }
        }
        case 3u: {
            let f = footprint(place);
            colour = min(abs(from_first(f) - from_second(f)) * arrangement.gain, vec3<f32>(1.0));
        }
        default: {
            colour = from_first(footprint(place));
        }
    }
    if arrangement.encodes == 1u {
        colour = decoded(colour);
    }
    return vec4<f32>(colour, 1.0);
}
