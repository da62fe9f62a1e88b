// Lists the splats that may touch each tile, from front to back, like `cpu::tiles`.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var<storage, read> counters: array<u32>;
// Slots in the order of depth.
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read> rects: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> centres: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> conics: array<vec4<f32>>;
// First the number of tiles that each splat touches; after the scan the index where its entries begin.
@group(0) @binding(7) var<storage, read_write> offsets: array<u32>;

// Returns the rows of the band that `rect` covers: the first row, and the first row after the last.
fn rows_of(rect: vec2<u32>) -> vec2<u32> {
    return clamp(rect >> vec2<u32>(16u), vec2<u32>(band.first), vec2<u32>(band.first + band.rows));
}

// Returns the columns of `rect` in which the splat may touch pixels of the row of tiles `row`: the first column, and the
// first column after the last.
fn columns_of(rect: vec2<u32>, centre: vec4<f32>, conic: vec4<f32>, row: u32) -> vec2<u32> {
    let columns = rect & vec2<u32>(0xffffu);
    if columns.x + 1u >= columns.y && ((rect.x >> 16u) + 1u >= (rect.y >> 16u)) {
        return columns;
    }
    let a = centre.z;
    let b = centre.w;
    let c = conic.x;
    let det = conic.y;
    let level = conic.w;
    let tile = f32(TILE);
    // The boundary of the ellipse is a u^2 + 2 b u v + c v^2 = level, around the centre.
    let highest = sqrt(level * a / det);
    let widest = sqrt(level * c / det);
    let top = max(f32(row) * tile - centre.y - REACH_MARGIN, -highest);
    let bottom = min(f32(row) * tile + (tile - 1.0) - centre.y + REACH_MARGIN, highest);
    if top > bottom {
        return vec2<u32>(0u);
    }
    // Height of the rightmost point of the ellipse. The leftmost point is opposite.
    let turn = -b / c * widest;
    let right_at = clamp(turn, top, bottom);
    let left_at = clamp(-turn, top, bottom);
    let right = (-b * right_at + sqrt(max(a * level - det * right_at * right_at, 0.0))) / a;
    let left = (-b * left_at - sqrt(max(a * level - det * left_at * left_at, 0.0))) / a;
    let slack = REACH_MARGIN + REACH_SLACK * widest;
    let most = f32(frame.columns);
    let first = u32(ceil(clamp((centre.x + left - slack - (tile - 1.0)) / tile, 0.0, most)));
    let end = u32(floor(clamp((centre.x + right + slack) / tile + 1.0, 0.0, most)));
    return vec2<u32>(max(first, columns.x), min(end, columns.y));
}

@compute @workgroup_size(GROUP)
fn count_tiles(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let rank = group_number(group, groups) * GROUP + lane;
    let length = counters[COUNTER_SLOTS];
    if rank > length {
        return;
    }
    var count = 0u;
    if rank < length {
        let slot = order[rank];
        let rect = rects[slot];
        let rows = rows_of(rect);
        if rows.x < rows.y {
            let centre = centres[slot];
            let conic = conics[slot];
            for (var row = rows.x; row < rows.y; row++) {
                let columns = columns_of(rect, centre, conic, row);
                count += max(columns.y, columns.x) - columns.x;
            }
        }
    }
    offsets[rank] = count;
}
